import logging
import os
import re
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.cases import ieee39_events, load_case, load_ieee39
from errorscreen.cases.case_models import (
    CalibrationSection,
    DiscoverySection,
    RunSection,
    ScreeningSection,
)
from errorscreen.cases.demo import demo_recordings
from errorscreen.data.plausibility import Doubt
from errorscreen.exceptions import InputError
from errorscreen.screening import RelativeThresholdSelector, TopKSelector
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow import Study, run, run_study, write_outputs
from errorscreen.workflow.screen import selector
from tests.plants import dip

QUICK = SimpleNamespace(
    screening=ScreeningSection(methods=["sensitivity", "random"], top_k=3),
    calibration=CalibrationSection(library=256),
    discovery=DiscoverySection(enabled=False),
    run=RunSection(),
)


def quick_study(seed=0, sections=QUICK, **options):
    recording, held_out, truth = demo_recordings(seed)
    simulator = PlantSimulator("synchronous_machine", recording, **options)
    return Study.of("quick", simulator, recording, held_out, sections, truth)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    return run_study(quick_study(), tmp_path_factory.mktemp("out"))


#: what is screened and calibrated beside the search
WITH_NETWORK = SimpleNamespace(
    screening=ScreeningSection(methods=["cnn"]),
    calibration=QUICK.calibration,
    discovery=DiscoverySection(),
    run=RunSection(),
)


def failing(study, store, progress):
    raise InputError(f"meant by process {os.getpid()}")


def test_what_fails_beside_the_search_ends_it(tmp_path, monkeypatch):
    """It is told at the next line of the search, and comes from another process."""

    def searched(study, store):
        for _ in range(6000):
            logging.getLogger("errorscreen.discovery").info("another line")
            time.sleep(0.1)

    monkeypatch.setattr(run, "_selected", failing)
    monkeypatch.setattr(run, "_diagnosed", searched)
    with pytest.raises(InputError, match="meant by process") as caught:
        run_study(quick_study(sections=WITH_NETWORK), tmp_path)
    assert f"process {os.getpid()}" not in str(caught.value)
    # without a network it runs in this process
    with pytest.raises(InputError, match=f"meant by process {os.getpid()}"):
        run_study(quick_study(), tmp_path)


def test_a_process_that_is_killed_beside_the_search_is_made_up_for_after_it(tmp_path, monkeypatch):
    here, lines = os.getpid(), []

    def killed(study, store, progress):
        if os.getpid() != here:
            os._exit(1)
        lines.append("made up for")
        raise InputError("enough")

    monkeypatch.setattr(run, "_selected", killed)
    monkeypatch.setattr(run, "_diagnosed", lambda study, store: lines.append("searched"))
    with pytest.raises(InputError, match="enough"):
        run_study(quick_study(sections=WITH_NETWORK), tmp_path)
    assert lines == ["searched", "made up for"]


def test_the_fingerprint_of_a_stage_knows_everything_that_it_depends_on():
    base, again = quick_study(), quick_study()
    others = [
        quick_study(seed=1),
        quick_study(step=0.004),
        quick_study(constants={"Ra": 0.01}),
        quick_study(grid_impedance=0.01j),
        replace(base, run=RunSection(random_state=1)),
        replace(base, simulator=base.simulator.extend("exciter")),
        replace(base, simulator=base.simulator.with_nominal(base.simulator.parameters.nominal * 1.01)),
    ]
    for stage in ("screening", "calibration", "diagnosis"):
        prints = [s.fingerprint(stage) for s in (base, *others)]
        prints += [base.fingerprint(stage, base.held_out), base.fingerprint(stage, ("Xd",))]
        assert len(set(prints)) == len(prints)
        assert again.fingerprint(stage) == prints[0]
        assert replace(base, run=RunSection(n_jobs=2)).fingerprint(stage) == prints[0]
    assert len({base.fingerprint(stage) for stage in ("screening", "calibration", "diagnosis")}) == 3


@pytest.mark.parametrize(
    ("stage", "section", "changed", "same"),
    [
        (
            "screening",
            "screening",
            ScreeningSection(methods=["sensitivity", "random"], top_k=2),
            ScreeningSection(methods=["random"], top_k=3),
        ),
        (
            "calibration",
            "calibration",
            CalibrationSection(library=256, particles=5),
            CalibrationSection(library=256, methods=["map"], prior_scale=0.2),
        ),
        (
            "diagnosis",
            "calibration",
            CalibrationSection(library=256, level=0.5),
            CalibrationSection(library=256),
        ),
        ("diagnosis", "discovery", DiscoverySection(fits=3, enabled=False), DiscoverySection(enabled=False)),
    ],
)
def test_a_stage_depends_on_its_own_keys_only(stage, section, changed, same):
    base = quick_study()
    for other in ("screening", "calibration", "diagnosis"):
        differs = replace(base, **{section: changed}).fingerprint(other) != base.fingerprint(other)
        assert differs == (other == stage)
        assert replace(base, **{section: same}).fingerprint(other) == base.fingerprint(other)


def plant_case(folder, more=""):
    """Case file of a machine with three recordings of it: dips of another depth."""
    for name, depth in (("first", 0.5), ("second", 0.3), ("third", 0.4)):
        event = dip(depth=depth, dt=0.02)
        machine = PlantSimulator("synchronous_machine", event)
        values = {**event.signals, **dict(zip("PQ", machine.baseline(), strict=True))}
        rows = [",".join(f"{v:.8f}" for v in row) for row in zip(event.time, *values.values(), strict=True)]
        (folder / f"{name}.csv").write_text("\n".join(["time," + ",".join(values), *rows]))
    columns = "".join(f"[recording.columns.{name}]\ncolumn = '{name}'\n" for name in values)
    (folder / "case.toml").write_text(
        "[recording]\npath = 'first.csv'\nbase_mva = 1.0\nf_nominal = 60.0\n" + columns
        + "[device]\ntype = 'synchronous_machine'\n" + more
    )  # fmt: skip
    return folder / "case.toml"


def test_a_case_says_what_is_searched_together(tmp_path):
    more = "[[held_out]]\npath = 'third.csv'\n[[together]]\npath = 'second.csv'\n"
    study = Study.from_case(load_case(plant_case(tmp_path, more)))
    assert [o.event.name for o in study.searched] == ["first", "second"]
    assert [o.event.name for o in study.observations] == ["first", "second", "third"]
    assert study.roles == ("fit", "together", "held_out")
    assert study.paths == ("first.csv", "second.csv", "third.csv")
    assert study.simulator.event.name == "first"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            "[[held_out]]\npath = 'copy.csv'\n[[together]]\npath = 'second.csv'\n",
            "recording 'copy' in [[held_out]]: it holds the same readings as recording 'second' in [[together]].",
        ),
        (
            "[[together]]\npath = 'copy.csv'\nname = 'first'\n",
            "recording 'first' in [[together]]: another recording has the same name. Allowed: a name of its own for "
            "each recording. Give one of them another name (key name).",
        ),
        (
            "[discovery]\neffects = ['exciter', 'governer']\n",
            "case.toml, discovery.effects: unknown effect 'governer' (did you mean 'governor'",
        ),
    ],
)
def test_what_a_search_cannot_use_is_refused_at_the_start(more, message, tmp_path):
    case = plant_case(tmp_path, more)
    (tmp_path / "copy.csv").write_bytes((tmp_path / "second.csv").read_bytes())
    with pytest.raises(InputError, match=re.escape(message)):
        Study.from_case(load_case(case))


def test_a_case_states_the_impedance_of_the_grid(tmp_path):
    case = plant_case(tmp_path, "grid_resistance = 0.02\ngrid_reactance = 0.1\n")
    simulator = Study.from_case(load_case(case)).simulator
    assert simulator.grid_impedance == 0.02 + 0.1j
    assert {"V", "angle", "P", "Q"} == set(simulator.event.signals)


@pytest.fixture(scope="module")
def grid_case(tmp_path_factory):
    """Case file of the example, with recordings of a grid whose machine has a larger X'd."""
    folder = tmp_path_factory.mktemp("grid")
    system, events = load_ieee39(), ieee39_events()
    theta = system.parameters.nominal.copy()
    theta[system.parameters.index("Xd1")] *= 1.2
    for name, file in {"fault at bus 3": "bus3", "fault at bus 16": "bus16", "line 2-3 out": "line"}.items():
        y = system.simulate(theta, events[name]).require_ok().values[0]
        y += np.random.default_rng(0).normal(0, 1e-3, y.shape)
        rows = [f"{t:.2f},{u:.6f},{p:.6f}" for t, u, p in zip(events[name].time, *y, strict=True)]
        (folder / f"{file}.csv").write_text("\n".join(["time,V,P", *rows]))
    text = (Path(__file__).parents[2] / "examples" / "ieee39.toml").read_text()
    (folder / "case.toml").write_text(text.replace("[grid]", '[grid]\ncandidates = ["Xd", "Xd1", "Tj"]'))
    return folder / "case.toml"


def test_a_case_compares_recordings_with_a_grid(grid_case, tmp_path):
    study = Study.from_case(load_case(grid_case))
    fault, other, trip = (o.event for o in (study.observation, *study.held_out))
    assert (fault.bus, other.bus, trip.ends) == (3, 16, (2, 3))
    assert fault.duration == pytest.approx(0.1)
    assert [e.name for e in (fault, other, trip)] == ["bus3", "bus16", "line"]
    assert study.simulator.channels == ("V", "P")
    sections = {"screening": QUICK.screening, "discovery": QUICK.discovery}
    quick = replace(study, calibration=CalibrationSection(library=16, starts=2, methods=["map"]), **sections)
    outcome = run_study(quick, tmp_path)
    found = {p.name: p.value for p in outcome.result.calibration[0].parameters}
    assert found["Xd1"] == pytest.approx(1.2 * study.simulator.parameters["Xd1"].nominal, rel=0.05)
    before, after = outcome.result.models
    for one in (c for c in before.channels if c.recording != "bus3"):
        assert after.channel(one.recording, one.channel).E < one.E
    assert outcome.result.diagnosis.final.kind == "parameters"
    result, report, _ = write_outputs(outcome, tmp_path)
    assert "Event as stated: line trip, ends [2, 3]" in result.read_text()
    assert report.stat().st_size > 10_000


def test_recordings_of_a_grid_are_searched_together(grid_case):
    case = grid_case.with_name("together.toml")
    text = grid_case.read_text()
    case.write_text(text.replace('[[held_out]]\npath = "bus16.csv"', '[[together]]\npath = "bus16.csv"'))
    study = Study.from_case(load_case(case))
    assert [(o.event.name, role) for o, role in zip(study.observations, study.roles, strict=True)] == [
        ("bus3", "fit"), ("bus16", "together"), ("line", "held_out"),
    ]  # fmt: skip
    assert (study.together[0].event.bus, study.held_out[0].event.ends) == (16, (2, 3))
    assert any("bus 16" in note for note in study.together[0].assumptions)


def test_where_an_event_is_moved_to_a_step_is_told(grid_case):
    late = grid_case.with_name("late.toml")
    late.write_text(
        grid_case.read_text().replace("event_time = 1.0\n\n# the", "event_time = 1.0032\n\n# the")
    )
    observation = Study.from_case(load_case(late)).observation
    assert observation.event.start == pytest.approx(1.0025)
    assert "In the model it starts at 1.0025 s instead of 1.0032 s" in " ".join(observation.assumptions)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bus = 3", "bus = 99", r"recording 'bus3': what happened cannot be simulated: unknown bus '99'"),
        ("ends = [2, 3]", "ends = [2, 39]", "recording 'line': what happened cannot be simulated: .*branch"),
        ("base_mva = 100.0", "base_mva = 50.0", "recording 'bus3': base_mva is 50. Allowed: 100, that of the grid"),
        ("f_nominal = 60.0", "f_nominal = 50.0", "recording 'bus3': f_nominal is 50. Allowed: 60, that of the grid"),
        ('case = "ieee39"', 'case = "ieee39"\nchannels = { V = 2, P3 = [4, 3] }', "channel 'P3' of .grid. is not"),
        ('case = "ieee39"', 'case = "ieee39"\nchannels = { V = 77 }', "grid.channels: unknown bus '77'"),
        ("duration = 0.1\n\n", "duration = 0.0001\n\n", "recording 'bus3', fault: a duration of 0.0001 s"),
        ("event_time = 1.0\n\n# the", "event_time = 1.0\nload_level = 50.0\n\n# the", "'bus3': what happened"),
    ],
)  # fmt: skip
def test_what_a_grid_cannot_have_is_refused_with_its_recording(grid_case, old, new, message):
    assert old in grid_case.read_text()
    wrong = grid_case.with_name("wrong.toml")
    wrong.write_text(grid_case.read_text().replace(old, new))
    with pytest.raises(InputError, match=message):
        Study.from_case(load_case(wrong))


def test_held_out_recordings_are_judged_on_and_not_fitted(outcome, tmp_path):
    alone = run_study(replace(outcome.study, held_out=()), tmp_path).result
    whole = outcome.result
    assert [p.value for p in alone.calibration[0].parameters] == [
        p.value for p in whole.calibration[0].parameters
    ]
    assert len({c.recording for c in whole.models[1].channels}) == 3
    assert len({c.recording for c in alone.models[1].channels}) == 1
    assert alone.diagnosis.confirmed is None
    assert whole.diagnosis.confirmed.kind == whole.diagnosis.verdict.kind == "parameters"
    # the truth has the model's structure, so the values hold for other events
    first = outcome.study.observation.event.name
    for before in (c for c in whole.models[0].channels if c.recording != first):
        assert whole.models[1].channel(before.recording, before.channel).E < 0.1 * before.E


def test_one_fit_of_all_parameters_is_the_calibration_and_the_base_of_the_diagnosis(outcome):
    result = outcome.result
    fitted = {p.name: p.value for p in result.calibration[0].parameters}
    assert {p.name: p.value for p in result.diagnosis.calibration.parameters} == fitted
    assert result.diagnosis.calibration.chi2_per_sample == result.calibration[0].chi2_per_sample


def test_another_prior_leads_on_from_that_fit(outcome, tmp_path):
    wide = replace(
        outcome.study, calibration=CalibrationSection(library=256, methods=["map"], prior_scale=3.0)
    )
    found = run_study(wide, tmp_path).result.calibration[0]
    before = outcome.result.calibration[0]
    assert found.chi2_per_sample < before.chi2_per_sample + 1e-6
    assert found.n_simulations < 0.5 * before.n_simulations


def test_the_result_tells_the_simulated_errors(outcome):
    result, study = outcome.result, outcome.study
    theta = result.calibration[0].theta(study.simulator.parameters)
    y = study.simulator.simulate(theta, study.observation.event).values[0]
    error = (y - study.observation.values)[0, study.observation.time >= study.observation.event.start - 1e-9]
    first = result.models[1].channels[0]
    assert (first.recording, first.channel) == ("fault near the terminal", "P")
    assert np.isclose(first.rms, np.sqrt(np.mean(error**2)))
    assert [r.role for r in result.recordings] == ["fit", "held_out", "held_out"]
    assert result.study.f_nominal == 60
    assert result.diagnosis.final.kind == "parameters"


def test_truth_and_overlap_are_reported_where_the_truth_is_known(outcome, tmp_path):
    result, true = outcome.result, outcome.result.contributions
    largest = sorted(true, key=true.get, reverse=True)[:3]
    for method in result.screening:
        assert np.isclose(method.overlap, len(set(method.selected) & set(largest)) / 3)
    for parameter in result.calibration[0].parameters:
        assert parameter.truth == outcome.study.truth[parameter.name]
    unknown = run_study(replace(outcome.study, truth=None), tmp_path).result
    assert unknown.contributions is None
    assert np.isnan(unknown.screening[0].overlap)


def test_a_doubtful_unit_is_told_beside_a_favourable_verdict(outcome, tmp_path):
    doubt = Doubt("P before the event is 721 pu: check its unit and base_mva.")
    doubtful = replace(outcome.study.observation, assumptions=(doubt,))
    result = run_study(replace(outcome.study, observation=doubtful), tmp_path).result
    assert result.diagnosis.final.kind == "parameters"
    assert result.hints == result.advice == (f"fault near the terminal: {doubt}",)
    assert outcome.result.hints == ()


def test_selection_rules():
    assert isinstance(selector(ScreeningSection(top_k=2)), TopKSelector)
    assert isinstance(selector(ScreeningSection(threshold=0.3)), RelativeThresholdSelector)
    assert selector(ScreeningSection()).threshold == 0.1


def test_a_verdict_does_not_need_map_among_the_calibrators(tmp_path):
    sections = SimpleNamespace(
        **{**vars(QUICK), "calibration": CalibrationSection(methods=["pso"], particles=5, iterations=3)}
    )
    outcome = run_study(quick_study(sections=sections), tmp_path)
    assert [c.label for c in outcome.result.calibration] == ["pso on sensitivity", "pso on random"]
    assert outcome.result.diagnosis.final.kind == "parameters"
