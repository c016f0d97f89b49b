"""What a diagnosis hands to result and report."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen._runtime.typed import to_json
from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.cases.case_models import DiscoverySection
from errorscreen.data.observations import Observation
from errorscreen.discovery import Contribution, InputLocation, NamedEffect
from errorscreen.effects import EXCITER
from errorscreen.effects.forced_oscillation import forced_oscillation
from errorscreen.report import read_result
from errorscreen.workflow import Study, run_study, write_outputs
from tests.plants import dip, plant
from tests.report import samples
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
    found = outcome.result.diagnosis
    assert (found.verdict.kind, found.final.kind) == ("effect", "effect")
    first = found.causes[0]
    assert first.name == hidden.effects[0] == first.effects[0].name
    assert first.effects[0].equation
    assert first.effects[0].explanation
    assert {p.name.split(".")[0] for p in first.parameters} == {hidden.effects[0]}
    assert found.gain.extended < 0.5 * found.gain.recalibrated
    assert len(found.gain.events) == len(hidden.held_out)
    assert found.hypotheses[0].evidence > 10
    report = write_outputs(outcome, out)[1].read_text(encoding="utf-8")
    assert "Why this cause" in report
    assert "Gain on events that were not fitted" in report
    assert "after calibration and with the extension" in report
    assert first.effects[0].equation.split(",")[0].replace("'", "&#39;") in report


def test_the_diagnosis_is_taken_over_from_an_earlier_run(hidden_effect):
    _, study, out, outcome = hidden_effect
    again = run_study(study, out)
    assert "diagnosis" in again.result.run.reused
    assert to_json(again.result.diagnosis) == to_json(outcome.result.diagnosis)
    one, two = (o.result.diagnosis.responses["extended"] for o in (again, outcome))
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_all_numbers_of_the_extension_are_in_the_result(hidden_effect):
    hidden, study, _, outcome = hidden_effect
    found = outcome.result.diagnosis
    alone, extended = found.model("parameters only"), found.model("extended")
    assert [(c.recording, c.channel) for c in extended.channels] == [
        (o.event.name, channel) for o in study.observations for channel in "PQ"
    ]
    for one in extended.channels:
        assert one.chi2_per_sample < 0.5 * alone.channel(one.recording, one.channel).chi2_per_sample
    assert set(found.tried) == {*hidden.effects, "lag_P"}
    assert found.gain.extension_parameters == len(found.causes[0].parameters)
    assert found.gain.placebo_parameters > 0


def rebuilt(simulator, found):
    """The extended model, from that of the case file and ``result.json``."""
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


@pytest.mark.usefixtures("undrawn_figures")
@pytest.mark.parametrize("name", ["hidden_effect", "refuted", "swinging"])
def test_the_extended_model_is_rebuilt_from_the_result_alone(name, request, tmp_path):
    outcome = request.getfixturevalue(name)[-1]
    found = read_result(write_outputs(outcome, tmp_path)[0]).diagnosis
    model = rebuilt(outcome.study.simulator, found)
    label = "extended" if found.extension else "parameters only"
    responses = outcome.result.diagnosis.responses[label]
    for observation, response in zip(outcome.study.observations, responses, strict=True):
        assert np.array_equal(model.baseline(observation.event), response)


def test_the_first_look_is_compared_with_the_named_effects():
    kinds = {"Xd": "parameter", "exciter": "effect", "D": "parameter", "oscillation": "effect"}
    looked = tuple(Contribution(name, kind, 1.0) for name, kind in kinds.items())
    one, two = NamedEffect.of(forced_oscillation("Pm").during("calm")), NamedEffect.of(EXCITER)

    def told(*effects, looked=looked):
        found = samples.diagnosis(extension=effects)
        return samples.result(diagnosis=found, first_look=looked).first_look_compared

    assert told(one) == "The search names oscillation, which has rank 4 of 4 here."
    assert told(two, one) == (
        "The search names exciter, which has rank 2 of 4 here, and oscillation, which has rank 4 of 4 here."
    )
    assert told() == "The search names no effect; the first one here, exciter, has rank 2 of 4."
    assert told(two, looked=()) == ""


def test_all_values_of_the_extended_model_have_intervals_or_a_bound(hidden_effect):
    _, study, _, outcome = hidden_effect
    diagnosis = outcome.result.diagnosis
    space, found = study.simulator.parameters, diagnosis.parameters
    own = diagnosis.causes[0].parameters
    assert [p.name for p in found] == [*space.names, *(p.name for p in own)]
    for p in found:
        assert np.isnan(p.low) == np.isnan(p.high)
        assert p.at_bound or p.lower <= p.low < p.value < p.high <= p.upper
    assert found[len(space) :] == own
    for p in found[: len(space)]:
        assert p.nominal == space[p.name].nominal
    # a calibration without the effect has found others
    alone = {p.name: p.value for p in outcome.result.calibration[0].parameters}
    assert any(abs(p.value / alone[p.name] - 1.0) > 0.02 for p in found[: len(space)])


@pytest.fixture(scope="module")
def refuted(hidden_effect):
    """The same search, judged on recordings of the machine without the stabiliser."""
    hidden, study, out, outcome = hidden_effect
    alone = outcome.result.diagnosis.responses["parameters only"]
    held_out = tuple(replace(o, values=y) for o, y in zip(study.held_out, alone[1:], strict=True))
    return hidden, out, run_study(replace(study, held_out=held_out), out)


@pytest.mark.usefixtures("undrawn_figures")
def test_a_refuted_extension_is_withdrawn_and_the_first_verdict_stays(refuted, tmp_path):
    hidden, _, outcome = refuted
    found = outcome.result.diagnosis
    unknown, gone = found.causes[:2]
    assert (found.verdict.kind, found.final.kind) == ("effect", "unknown")
    assert (unknown.name, gone.name) == ("unknown", hidden.effects[0])
    assert gone.withdrawn
    assert gone.parameters
    assert found.extension == ()
    assert found.model("extended") is None
    advice = " ".join(outcome.result.advice)
    assert "Something unknown enters at Efd" in advice
    assert f"{gone.title} was withdrawn" in advice
    assert "[[together]]" in advice
    report = write_outputs(outcome, tmp_path)[1].read_text(encoding="utf-8")
    assert f"Withdrawn: {gone.title}" in report
    assert "The extension:" not in report
    assert "Input that would have to enter at Efd" in report


def test_locations_are_in_the_result_with_their_signal(refuted):
    first = refuted[2].result.diagnosis.input_locations[0]
    time = refuted[2].study.observation.time
    assert first.unit == "pu"
    assert 100 < len(first.time) <= 200 < len(time)
    assert (first.time[0], first.time[-1]) == (time[0], time[-1])


def test_a_thinned_signal_keeps_its_ends_and_its_peaks():
    time = np.linspace(0.0, 5.0, 1001)
    signal = np.sin(7.0 * time) * np.exp(-time)
    signal[497] = 3.0
    whole = InputLocation("unit", "Efd", 1.0, 1.0, time, signal, ())
    thin = whole.thinned()
    assert len(thin.time) <= 200
    assert (thin.waveform.max(), thin.waveform.min()) == (signal.max(), signal.min())
    assert np.allclose(np.interp(thin.time, time, signal), thin.waveform)
    assert thin.thinned() is thin


def test_other_held_out_recordings_need_no_new_search(refuted):
    _, out, outcome = refuted
    assert {"screening-sensitivity", "screening-random"} <= set(outcome.result.run.reused)
    assert "diagnosis" not in outcome.result.run.reused  # held-out recordings are part of it
    assert len(list(out.glob("stages/*/search"))) == 1


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
    first = outcome.result.diagnosis.causes[0]
    assert (first.name, first.event) == ("oscillation@swinging", True)
    assert first.effects[0].recording == "swinging"
    assert next(p.value for p in first.parameters if p.name.endswith(".f")) == pytest.approx(1.3, rel=0.02)
    # screening knows the first recording alone
    assert replace(study, together=()).fingerprint("screening") == study.fingerprint("screening")


def test_the_role_of_each_recording_is_reported(swinging):
    result = swinging[2].result
    roles = [("calm", "fit"), ("swinging", "together"), ("other", "held_out")]
    assert [(r.name, r.role) for r in result.recordings] == roles
    for model in (*result.models, *result.diagnosis.models):
        assert list(dict.fromkeys(c.recording for c in model.channels)) == [name for name, _ in roles]


@pytest.mark.usefixtures("undrawn_figures")
def test_an_event_of_one_recording_is_no_lack_of_the_model(swinging, tmp_path):
    outcome = swinging[2]
    report = write_outputs(outcome, tmp_path)[1].read_text(encoding="utf-8")
    assert "parameters fitted beside oscillation, which is off here" in report
    assert "Something happened during this recording" in report
    assert "The extension:" not in report
    assert "this is about one recording alone" in " ".join(outcome.result.advice)
    assert "swinging, fitted together" in report


def test_another_recording_to_fit_leaves_screening_and_the_swarm(swinging):
    study, out, _ = swinging
    again = run_study(replace(study, together=(), discovery=DiscoverySection(enabled=False)), out).result
    assert set(again.run.reused) == {
        *("screening-sensitivity", "screening-random"),
        *(f"calibration-pso-{method}" for method in ("sensitivity", "random")),
    }
    assert again.diagnosis.tried == ()
    keys = {
        replace(study, together=together).fingerprint("diagnosis", together)
        for together in ((), study.together, study.held_out)
    }
    assert len(keys) == 3
