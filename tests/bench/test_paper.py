"""The case study in a small version; the figures of the full one are in the documentation, not asserted here."""

import json
import logging
import shutil

import numpy as np
import pytest

from errorscreen.bench import Effort, effort_of, paper, paper_study
from errorscreen.bench.paper import study_screener, summarise
from errorscreen.bench.paper_draw import CALIBRATED, FIT_EVENTS, RANKINGS, Setting, hidden, step_error
from errorscreen.bench.paper_output import typical_draw
from errorscreen.cli import main
from errorscreen.exceptions import InputError

SMALL = Effort(
    samples=24, enlarged=16, epochs=1, particles=4, iterations=1, starts=1, library=32, posterior=4
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    return out, paper_study(out, draws=2, seed=4, noise_db=40.0, effort=SMALL)


def test_the_result_has_the_documented_form(finished):
    out, result = finished
    stored = json.loads((out / "result.json").read_text())
    assert stored["methods"] == result["methods"]
    assert set(result["methods"]) == {*RANKINGS, "map_all"}
    for name, entry in result["methods"].items():
        assert {"overlap_at_10", "fit", "held_out", "simulations", "seconds"} <= set(entry)
        assert (entry["overlap_at_10"] is None) == (name == "map_all")
        for part in ("fit", "fit_measured", "held_out"):
            for channel in "UP":
                assert entry[part][channel]["p10"] <= entry[part][channel]["median"] <= 1.0
        assert entry["simulations"] > 0 or name == "oracle"
    for entry in (result["methods"]["map_all"], result["methods"]["map_all"]["three_events"]):
        floor = entry["noise_floor_share"]
        assert floor >= entry["noise_floor_share_of_truth"]  # a fit is below the truth
        counts = entry["coverage_by_parameter"].values()
        assert sum(c["identifiable"] for c in counts) == pytest.approx(2 * entry["identifiable"])
        assert 0 < entry["p90_seconds"] <= entry["largest_seconds"]
    assert {*FIT_EVENTS}.isdisjoint(result["events"]["held_out"])
    assert len(result["events"]["held_out"]) >= 3


def test_all_parameters_together_explain_what_was_measured(finished):
    methods = finished[1]["methods"]
    assert methods["map_all"]["search_share"] == 1.0
    assert methods["map_all"]["fit"]["P"]["p10"] > 0.99
    assert methods["map_all"]["three_events"]["held_out"]["P"]["median"] > 0.95


def test_tables_and_figures_are_written(finished):
    out, result = finished
    text = (out / "tables.md").read_text()
    for words in ("Table 2", "Table 3", "Table 4", "coverage", "held out"):
        assert words in text
    assert text.count("\n| 10 | ") == 2
    for number in range(1, 5):
        assert (out / f"figure{number}.png").stat().st_size > 10_000
    assert result["shown_draw"] in (0, 1)


def stored_draw(out, i):
    return out / "stages" / "draws" / f"batch-{i:06d}.npz"


def arrays_of(path):
    """Arrays of a stored draw but the times, which differ from run to run."""
    with np.load(path) as content:
        return {
            name: content[name] for name in content.files if name not in ("seconds", "errorscreen_header")
        }


def test_a_study_goes_on_where_it_stopped_on_any_number_of_processes(finished, tmp_path, caplog):
    out = tmp_path / "paper"
    shutil.copytree(finished[0], out)
    first, second = (stored_draw(out, i) for i in range(2))
    kept, lost = first.read_bytes(), arrays_of(second)
    second.unlink()
    with caplog.at_level(logging.INFO):
        again = paper_study(out, draws=2, seed=4, noise_db=40.0, effort=SMALL, n_jobs=2)
    assert "2 draws, 1 of them finished before" in caplog.text
    assert kept == first.read_bytes()
    found = arrays_of(second)
    assert len(found) > 10
    for name, values in lost.items():
        np.testing.assert_array_equal(found[name], values)
    for method, entry in finished[1]["methods"].items():
        for part in ("fit", "held_out"):
            assert again["methods"][method][part] == entry[part]


def test_more_draws_can_follow_but_not_those_of_another_study(finished, monkeypatch):
    """What a draw finds is the test's: the next one asks for the third only."""
    out, _ = finished
    asked = []

    def run_draw(setting, draw, step_errors, cnn):
        asked.append((draw, len(cnn)))
        return {**arrays_of(stored_draw(out, 0)), "seconds": np.ones((len(CALIBRATED), 2))}

    monkeypatch.setattr(paper, "run_draw", run_draw)
    again = paper_study(out, draws=3, seed=4, noise_db=40.0, effort=SMALL)
    assert again["draws"] == 3
    assert asked == [(2, 40)]
    with pytest.raises(InputError, match="whitend"):
        paper_study(out, draws=2, seed=4, network="whitend", effort=SMALL)
    with pytest.raises(InputError, match="belongs to another run"):
        paper_study(out, draws=2, seed=5, noise_db=40.0, effort=SMALL)


def test_a_draw_depends_neither_on_the_others_nor_on_which_events_are_asked_for():
    setting = Setting(7, 40.0, SMALL)
    errors = {name: np.zeros((2, 501)) for name in setting.events}
    alone = hidden(setting, 3, errors, FIT_EVENTS[:1])
    both = hidden(setting, 3, errors, FIT_EVENTS)
    name = FIT_EVENTS[0]
    assert np.array_equal(alone.theta, both.theta)
    assert np.array_equal(alone.observations[name].values, both.observations[name].values)
    assert not np.array_equal(hidden(setting, 4, errors, ()).theta, alone.theta)


def test_the_noise_has_the_level_that_was_asked_for():
    setting = Setting(7, 30.0, SMALL)
    errors = {name: np.zeros((2, 501)) for name in setting.events}
    found = hidden(setting, 0, errors, FIT_EVENTS)
    for name in FIT_EVENTS:
        truth, seen = found.truths[name], found.observations[name]
        moved = np.sqrt(np.mean((truth - truth[:, :1]) ** 2, axis=1))
        noise = np.std(seen.values - truth, axis=1)
        np.testing.assert_allclose(20 * np.log10(moved / noise), 30.0, atol=0.8)
        np.testing.assert_allclose(noise, seen.noise, rtol=0.1)
    quiet = hidden(Setting(7, None, SMALL), 0, errors, FIT_EVENTS[:1])
    assert np.array_equal(quiet.observations[FIT_EVENTS[0]].values, quiet.truths[FIT_EVENTS[0]])
    assert np.array_equal(quiet.theta, found.theta)


def test_the_truth_is_not_made_with_the_step_that_is_fitted():
    setting = Setting(0, 40.0, SMALL)
    errors = step_error(setting)[FIT_EVENTS[0]]
    assert errors.shape == (2, 501)
    assert np.all(errors[:, :50] < 1e-9)  # before the fault nothing moves
    assert 1e-5 < errors.max() < 0.05


def test_the_summary_counts_what_it_says():
    n, events = 4, 5
    reductions = np.array([0.9, 0.8, 0.7, -0.5])
    errors = np.ones((n, len(CALIBRATED), events, 2)) * (1 - reductions)[:, None, None, None]
    table = {
        "before": np.ones((n, events, 2)),
        "errors": errors,
        "measured_before": np.ones((n, 2)),
        "measured": errors[:, :, 0],
        "overlap": np.tile([[0.5], [0.7], [0.9], [0.3]], (1, len(RANKINGS))),
        "overlap_three": np.full(n, 0.9),
        "expected_overlap": np.tile([0.8, 0.95], (n, 1)),
        "chi2": np.array([[[1.0, 1.0]] * 2, [[1.06, 1.02]] * 2, [[1.2, 1.0]] * 2, [[0.9, 1.1]] * 2]),
        "objective": np.array(
            [[[9.0, 10.0]] * 2, [[10.0, 10.0]] * 2, [[11.0, 10.0]] * 2, [[12.0, 10.0]] * 2]
        ),
        "covered": np.array(
            [[[True, True]] * 2, [[True, False]] * 2, [[False, True]] * 2, [[True, True]] * 2]
        ),
        "identifiable": np.array([[[True, False]] * 2] * n),
        "converged": np.array([[True, True], [True, False], [True, True], [True, True]]),
        "starts": np.full((n, 2), 2),
        "simulations": np.tile([10, 100], (n, len(CALIBRATED), 1)),
        "seconds": np.tile([0.5, 2.0], (n, len(CALIBRATED), 1)),
    }
    methods = summarise(table, ("Xd", "H"), seed=0)
    sensitivity = methods["sensitivity"]
    assert sensitivity["overlap_at_10"] == pytest.approx(0.6)
    low, high = sensitivity["overlap_at_10_interval"]
    assert 0.3 <= low < 0.6 < high <= 0.9
    assert sensitivity["fit"]["U"]["median"] == pytest.approx(0.75)
    assert sensitivity["held_out"]["P"]["p10"] == pytest.approx(-0.5)
    assert sensitivity["reaches_paper"] == 0.0
    assert sensitivity["simulations"] == 110
    assert sensitivity["seconds"] == pytest.approx(2.5)
    everything = methods["map_all"]
    assert everything["noise_floor_share"] == pytest.approx(0.5)
    assert everything["noise_floor_share_of_truth"] == pytest.approx(0.75)
    assert everything["search_share"] == pytest.approx(0.5)
    assert everything["failed"] == 0
    assert everything["coverage"] == pytest.approx(0.75)  # the second parameter is not identifiable
    assert everything["coverage_by_parameter"] == {
        "Xd": {"identifiable": 4, "covered": 3},
        "H": {"identifiable": 0, "covered": 0},
    }
    assert everything["converged_share"] == 1.0
    assert everything["three_events"]["converged_share"] == pytest.approx(0.75)
    assert everything["three_events"]["chi2_largest"] == pytest.approx(1.2)
    assert methods["map"]["expected_overlap_at_10"] == pytest.approx(0.8)
    assert methods["map"]["three_events"]["overlap_at_10"] == pytest.approx(0.9)
    assert methods["map"]["three_events"]["expected_overlap_at_10"] == pytest.approx(0.95)
    assert typical_draw(table) == 1


def test_the_network_in_the_paper_s_form_sees_energies_of_64_by_256():
    assert effort_of("published").samples == 2500
    assert effort_of("published").enlarged == 0
    screener = study_screener("published", 0.01, None, 0, 1)
    assert not screener.whiten
    errors = np.random.default_rng(0).standard_normal((3, 2, 501))
    images = screener.estimator.named_steps["cwttransformer"].fit(errors)
    assert images.transform(errors).shape == (3, 2, 64, 256)
    np.testing.assert_array_equal(
        images.transform(errors), images.transform(-errors)
    )  # energies have no sign


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--draws", "0"], "draws"),
        (["--seed", "-1"], "seed"),
        (["--noise-db", "-3"], "noise_db"),
        (["--noise-db", "nan"], "noise_db"),
        (["--samples", "1"], "samples"),
        (["--enlarged", "-1"], "enlarged"),
        (["--seed", str(10**23)], "seed"),
        (["--jobs", "0"], "jobs"),
        (["--network", "resnet"], "network"),
    ],
)
def test_wrong_options_are_named(options, message, tmp_path, capsys):
    assert main(["bench", "paper", "--out", str(tmp_path), *options]) == 2
    assert message in capsys.readouterr().err
