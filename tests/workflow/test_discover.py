"""What the search for causes hands to result and report."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.cases.case_models import DiscoverySection
from errorscreen.data.observations import Observation
from errorscreen.discovery import Cause
from errorscreen.effects import EXCITER
from errorscreen.effects.forced_oscillation import forced_oscillation
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.report import read_result
from errorscreen.report.html_report import EVENT_HEADLINE
from errorscreen.workflow import Study, build_result, run_study, write_outputs
from errorscreen.workflow.discover import compared, fitted_parameters
from errorscreen.workflow.output import thinned
from tests.plants import dip, plant
from tests.workflow.test_study import QUICK

NOISE = np.array([2e-3, 2e-3])


@pytest.fixture(scope="module")
def hidden_effect(tmp_path_factory):
    """A machine with a hidden stabiliser, searched as `errorscreen run` does."""
    hidden = draw_plant_scenario(2, 40.0, kind="effect", device="synchronous_machine")
    sections = SimpleNamespace(**vars(QUICK))
    sections.discovery = DiscoverySection(effects=[*hidden.effects, "lag_P"], max_effects=1)
    study = Study(
        "hidden", hidden.simulator, hidden.recordings[0], hidden.held_out, 100.0, 60.0,
        sections.screening, sections.calibration, sections.discovery, sections.run,
    )  # fmt: skip
    out = tmp_path_factory.mktemp("hidden")
    return hidden, study, out, run_study(study, out)


def test_a_hidden_effect_is_named_extended_and_gains(hidden_effect):
    hidden, _, out, outcome = hidden_effect
    result = build_result(outcome)
    assert result.verdict.kind == "effect"
    first = result.verdict.causes[0]
    assert first.name == hidden.effects[0]
    assert first.equation
    assert first.explanation
    assert {p.name.split(".")[0] for p in first.parameters} == {hidden.effects[0]}
    assert result.gain.extended < 0.5 * result.gain.recalibrated
    assert len(result.gain.events) == len(hidden.held_out)
    assert result.discovery.hypotheses[0].evidence > 10
    report = write_outputs(outcome, out)[1].read_text(encoding="utf-8")
    assert "What parameters cannot explain" in report
    assert "Gain on events that were not fitted" in report
    assert first.equation.split(",")[0].replace("'", "&#39;") in report


def test_the_search_is_taken_over_from_an_earlier_run(hidden_effect):
    _, study, out, outcome = hidden_effect
    again = run_study(study, out)
    assert "discovery" in again.reused
    assert again.verdict == outcome.verdict
    assert np.array_equal(again.discovered.responses[1], outcome.discovered.responses[1])


def test_all_numbers_of_the_extension_are_in_the_result(hidden_effect):
    hidden, study, _, outcome = hidden_effect
    result = build_result(outcome)
    fits = result.discovery.fits
    assert [(f.recording, f.role, f.channel) for f in fits] == [
        (o.event.name, role, channel)
        for o, role in zip(study.observations, study.roles, strict=True)
        for channel in "PQ"
    ]
    assert all(f.extended.chi2_per_sample < 0.5 * f.parameters.chi2_per_sample for f in fits)
    assert set(result.discovery.tried) == {*hidden.effects, "lag_P"}
    assert result.gain.extension_parameters == len(result.verdict.causes[0].parameters)
    assert result.gain.placebo_parameters > 0
    assert outcome.discovered.labels == (f"extended ({hidden.effects[0]})",) * 3


def rebuilt(simulator, found):
    """The extended model, from that of the case file and what ``result.json`` tells of the search."""
    for one in found.extension:
        name = one.name.partition("@")[0]
        effect = next(e for e in simulator.effects if e.name == name)
        simulator = simulator.extend(
            effect.during(one.recording, rename=name != one.name) if one.recording else effect
        )
    assert [p.name for p in found.parameters] == list(simulator.parameters.names)
    model = simulator.with_nominal([p.value for p in found.parameters])
    model.step = found.step
    return model


@pytest.mark.parametrize("name", ["hidden_effect", "refuted", "swinging"])
def test_the_extended_model_is_rebuilt_from_the_result_alone(name, request, tmp_path):
    outcome = request.getfixturevalue(name)[-1]
    found = read_result(write_outputs(outcome, tmp_path)[0]).discovery
    assert [e.name for e in found.extension] == outcome.discovered.label.split()
    model = rebuilt(outcome.study.simulator, found)
    responses = outcome.discovered.responses  # of CauseFinder.extended_simulator_
    for observation, response in zip(outcome.observations, responses, strict=True):
        assert np.array_equal(model.baseline(observation.event), response)


def test_the_first_look_is_compared_with_what_the_search_names():
    kinds = {"Xd": "parameter", "exciter": "effect", "D": "parameter", "oscillation": "effect"}
    looked = [{"name": name, "kind": kind, "value": 1.0} for name, kind in kinds.items()]
    one, two = forced_oscillation("Pm").during("calm"), EXCITER
    assert compared(looked, [one]) == "The search names oscillation, which has rank 4 of 4 here."
    assert compared(looked, [two, one]) == (
        "The search names exciter, which has rank 2 of 4 here, and oscillation, which has rank 4 of 4 here."
    )
    assert compared(looked, []) == "The search names no effect; the first one here, exciter, has rank 2 of 4."
    assert compared([], [two]) == ""


def test_a_value_at_its_bound_has_no_interval():
    space = ParameterSpace([Parameter("a", 1.0, 0.5, 2.0), Parameter("e.s", 0.0, 0.0, 1.0, scale=1.0)])
    hypothesis = SimpleNamespace(
        names=space.names,
        theta=np.array([1.4, 1.0]),
        free=np.array([True, False]),
        covariance=np.diag([0.01, 0.0]),
        inflation=4.0,
        simulator=SimpleNamespace(parameters=space),
    )
    cause = Cause("e", "E", "effect", 0.9, "port", {"e.s": (1.0, 1.0, 1.0)}, 0.99, True)
    free, bound = fitted_parameters(hypothesis, cause)
    assert (free["value"], free["at_bound"]) == (1.4, False)
    assert (free["low"], free["high"]) == pytest.approx((1.4 - 0.1645, 1.4 + 0.1645))
    assert (bound["value"], bound["low"], bound["high"], bound["at_bound"]) == (1.0, None, None, True)
    # what leaves more than was named: errors of form count as noise of their size
    assert fitted_parameters(hypothesis, None)[0]["high"] == pytest.approx(1.4 + 2 * 0.1645)


def test_all_values_of_the_extended_model_have_intervals_or_a_bound(hidden_effect):
    _, study, _, outcome = hidden_effect
    result = build_result(outcome)
    space, found = study.simulator.parameters, result.discovery.parameters
    own = result.verdict.causes[0].parameters
    assert [p.name for p in found] == [*space.names, *(p.name for p in own)]
    for p in found:
        assert (p.low is None) == p.at_bound == (p.value in (p.lower, p.upper))
        assert p.at_bound or p.lower <= p.low < p.value < p.high <= p.upper
    for p, q in zip(found[len(space) :], own, strict=True):
        assert (p.value, p.low, p.high, p.at_bound) == (q.value, q.low, q.high, q.at_bound)
    for p in found[: len(space)]:
        assert p.nominal == space[p.name].nominal
    # which is not what a calibration without the effect has found
    alone = {p.name: p.value for p in result.calibration.methods[0].parameters}
    assert any(abs(p.value / alone[p.name] - 1.0) > 0.02 for p in found[: len(space)])


@pytest.fixture(scope="module")
def refuted(hidden_effect):
    """The same search, judged on recordings of the machine without the stabiliser."""
    hidden, study, out, outcome = hidden_effect
    held_out = tuple(
        replace(o, values=y) for o, y in zip(study.held_out, outcome.discovered.alone[1:], strict=True)
    )
    return hidden, out, run_study(replace(study, held_out=held_out), out)


def test_a_refuted_extension_is_reported_as_withdrawn(refuted, tmp_path):
    hidden, _, outcome = refuted
    result = build_result(outcome)
    unknown, gone = result.verdict.causes[:2]
    assert (result.verdict.kind, unknown.name, gone.name) == ("unknown", "unknown", hidden.effects[0])
    assert gone.withdrawn
    assert gone.parameters
    assert outcome.discovered.label == ""
    assert set(outcome.discovered.labels) == {""}
    assert all(f.extended is None for f in result.discovery.fits)
    advice = " ".join(result.discovery.advice)
    assert "Something unknown enters at Efd" in advice
    assert f"{gone.title} was withdrawn" in advice
    assert "[[together]]" in advice
    report = write_outputs(outcome, tmp_path)[1].read_text(encoding="utf-8")
    assert f"Withdrawn: {gone.title}" in report
    assert "The extension:" not in report
    assert "Signal that would have to enter at Efd" in report


def test_places_are_in_the_result_with_their_signal(refuted):
    outcome = refuted[2]
    places = build_result(outcome).discovery.places
    time, signal = outcome.discovered.waveforms[0]
    assert places[0].unit == "pu"
    assert 100 < len(places[0].time) <= 200 < len(time)
    assert places[0].time[0] == time[0]
    assert places[0].time[-1] == time[-1]
    assert np.allclose(np.interp(places[0].time, time, signal), places[0].waveform)
    assert max(places[0].waveform) == signal.max()
    assert min(places[0].waveform) == signal.min()


def test_other_recordings_to_judge_on_need_no_new_search(refuted):
    _, out, outcome = refuted
    assert {"screening-sensitivity", "screening-random"} <= set(outcome.reused)
    assert "discovery" not in outcome.reused  # which is also what held-out recordings say about it
    assert len(list(out.glob("stages/*/discovery.npz"))) == 2
    assert len(list(out.glob("stages/*/search"))) == 1


def test_a_short_series_is_kept():
    short = np.arange(20.0).reshape(2, 10)
    assert thinned(short) is short


def recorded(simulator, theta, event, seed):
    y = simulator.simulate(theta, event).require_ok().values[0]
    noisy = y + NOISE[:, None] * np.random.default_rng(seed).standard_normal(y.shape)
    return Observation(event, noisy, NOISE, simulator.channels, simulator.units)


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    """Two recordings of a machine searched together: in the second one something else swings."""
    kinds = {"calm": (0.5, 0.12), "swinging": (0.2, 0.2), "other": (0.4, 0.15)}
    events = [
        replace(dip(depth=depth, duration=duration, stop=5.0, dt=1 / 30), name=name)
        for name, (depth, duration) in kinds.items()
    ]
    machine = plant("synchronous_machine", events[0])
    theta = machine.parameters.nominal * np.random.default_rng(5).uniform(0.9, 1.1, len(machine.parameters))
    true = machine.extend("oscillation@swinging")
    calm, second, other = (recorded(true, [*theta, 0.05, 1.3, 0.4], e, i) for i, e in enumerate(events))
    discovery = DiscoverySection(effects=["oscillation", "governor"], max_effects=1, fits=2)
    study = Study(
        "two", machine, calm, (other,), 1.0, 60.0, QUICK.screening, QUICK.calibration, discovery, QUICK.run,
        together=(second,),
    )  # fmt: skip
    out = tmp_path_factory.mktemp("swinging")
    return study, out, run_study(study, out)


def test_recordings_are_searched_together(swinging):
    study, _, outcome = swinging
    first = build_result(outcome).verdict.causes[0]
    assert (first.name, first.event) == ("oscillation@swinging", True)
    assert next(p.value for p in first.parameters if p.name.endswith(".f")) == pytest.approx(1.3, rel=0.02)
    # screening and calibration know the first alone
    without = replace(study, together=())
    assert without.fingerprint("screening") == study.fingerprint("screening")
    assert outcome.calibrated[0].meta["chi2_per_sample"] < 2


def test_the_role_of_each_recording_is_reported(swinging):
    result = build_result(swinging[2])
    roles = [("calm", "fit"), ("swinging", "together"), ("other", "held_out")]
    assert [(r.name, r.role) for r in result.data] == roles
    assert [(r.recording, r.role) for r in result.diagnosis.recordings] == roles
    assert list(dict.fromkeys((f.recording, f.role) for f in result.discovery.fits)) == roles
    assert list(dict.fromkeys((f.recording, f.role) for f in result.calibration.methods[0].fits)) == roles


def test_what_happened_once_is_no_lack_of_the_model(swinging, tmp_path):
    outcome = swinging[2]
    off = "parameters fitted beside oscillation, which is off here"
    assert outcome.discovered.labels == (off, "extended (oscillation)", off)
    report = write_outputs(outcome, tmp_path)[1].read_text(encoding="utf-8")
    assert EVENT_HEADLINE in report
    assert "The extension:" not in report
    assert "this is about one recording alone" in " ".join(outcome.advice)
    assert "swinging, fitted together" in report


def test_a_recording_more_to_search_leaves_screening_and_calibration(swinging):
    study, out, _ = swinging
    again = run_study(replace(study, together=(), discovery=DiscoverySection(enabled=False)), out)
    assert again.reused == ["screening-sensitivity", "screening-random", "calibration-map"] + [
        f"calibration-pso-{method}" for method in ("sensitivity", "random")
    ]
    assert again.discovered is None
    keys = {
        replace(study, together=together).fingerprint("discovery", together)
        for together in ((), study.together, study.held_out)
    }
    assert len(keys) == 3
