import numpy as np
import pytest

from errorscreen.data.recordings import Recording
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.plant.playback import playback_observation
from tests.plants import dip, plant


def recording(drop=(), frequency=None, slope=0.05, **changes):
    """A recording made by the machine, with a pre-event frequency that is not nominal."""
    event = dip(dt=0.02)
    simulator = plant("synchronous_machine", event)
    P, Q = simulator.simulate(simulator.parameters.nominal).values[0]
    rng = np.random.default_rng(0)
    values = {
        "V": event.signals["V"] + 1e-4 * rng.standard_normal(P.shape),
        "angle": event.signals["angle"] + 0.4 + slope * event.time,
        "P": P + 1e-3 * rng.standard_normal(P.shape),
        "Q": Q + 1e-3 * rng.standard_normal(P.shape),
    }
    if frequency is not None:
        values["f"] = frequency(event)
    values = {k: v for k, v in values.items() if k not in drop}
    return Recording.from_arrays(
        event.time, values, base_mva=100, f_nominal=60, **{"event_time": 1.0, **changes}
    )


def test_observation_starts_at_the_recorded_steady_state():
    observed = playback_observation(recording(), ("P", "Q"))
    quiet = observed.time < 0.9
    assert observed.channels == ("P", "Q")
    assert abs(observed.event.initial["P"] - 0.7) < 1e-3
    assert np.abs(observed.event.signals["angle"][quiet]).max() < 1e-6  # slope and offset are gone
    assert any("60.0080 Hz" in note for note in observed.assumptions)
    assert np.all(observed.noise > 2e-4)
    assert np.all(observed.noise < 5e-3)


def test_the_frame_of_the_angle_does_not_matter():
    a, b = (playback_observation(recording(slope=s), ("P", "Q")).event.signals["angle"] for s in (0.0, 1.3))
    assert np.allclose(a, b, atol=1e-9)


def test_a_simulation_of_the_truth_is_within_noise():
    simulator = PlantSimulator("synchronous_machine", recording())
    observed = simulator.observe(recording())
    y = simulator.simulate(simulator.parameters.nominal, observed.event).values[0]
    late = observed.time > 1.3  # beside the edges of the dip, where the noise of V moves the solution
    assert np.sqrt(np.mean((y - observed.values)[:, late] ** 2)) < 3e-3


def test_a_fast_recording_is_compared_on_a_coarser_grid_and_its_truth_is_within_noise():
    event = dip(dt=0.001)
    simulator = plant("synchronous_machine", event)
    P, Q = simulator.simulate(simulator.parameters.nominal).values[0]
    rng = np.random.default_rng(0)
    values = {"V": event.signals["V"], "angle": event.signals["angle"], "P": P, "Q": Q}
    values = {name: v + 1e-3 * rng.standard_normal(v.shape) for name, v in values.items()}
    fast = Recording.from_arrays(event.time, values, base_mva=100, f_nominal=60, event_time=1.0)
    simulator = PlantSimulator("synchronous_machine", fast)
    observed = simulator.observe(fast)
    assert observed.event.dt == pytest.approx(0.004)
    z = observed.deviations(simulator.simulate(simulator.parameters.nominal).values[0])
    assert 0.8 < np.mean(z**2) < 1.2
    every = PlantSimulator("synchronous_machine", fast, dt=0.001).observe(fast)
    assert every.event.dt == pytest.approx(0.001)
    assert (observed.noise < 0.8 * every.noise).all()  # four readings are averaged


@pytest.mark.filterwarnings("ignore::errorscreen.exceptions.DataWarning")
def test_a_recording_that_begins_with_the_fault_and_states_the_level_before_starts_like_the_whole():
    whole = recording()
    part = whole.time >= whole.event_time
    cut = Recording.from_arrays(
        whole.time[part],
        {name: channel.values[part] for name, channel in whole.channels.items()},
        base_mva=100,
        f_nominal=60,
        level=whole.initial(["V", "P", "Q"]),
    )
    simulator = PlantSimulator("synchronous_machine", cut)
    observed = simulator.observe(cut)
    assert not observed.mask[:, observed.time < 1.0 - 1e-9].any()  # the stated level is not compared
    assert observed.mask[:, observed.time > 1.0 - 1e-9].all()
    z = observed.deviations(simulator.simulate(simulator.parameters.nominal).values[0])
    assert np.mean(z[observed.mask] ** 2) < 1.5


def test_frequency_stands_in_for_the_angle():
    def frequency(event):
        return 60.008 + np.gradient(event.signals["angle"], event.time) / (2 * np.pi)

    by_angle = playback_observation(recording(), ("P", "Q")).event.signals["angle"]
    observed = playback_observation(recording(drop=("angle",), frequency=frequency), ("P", "Q"))
    assert np.abs(observed.event.signals["angle"] - by_angle).max() < 0.02
    assert any("integral of the recorded frequency" in note for note in observed.assumptions)


def test_a_device_with_inertia_needs_the_angle():
    with pytest.raises(InputError, match="neither the angle nor the frequency.*pv_plant"):
        PlantSimulator("synchronous_machine", recording(drop=("angle",)))
    assert "angle" not in PlantSimulator("pv_plant", recording(drop=("angle",))).event.signals


def test_what_was_not_recorded_must_be_given():
    without = recording(drop=("P",))
    with pytest.raises(InputError, match="P before the event is unknown.*operating point"):
        PlantSimulator("synchronous_machine", without)
    simulator = PlantSimulator("synchronous_machine", without, operating_point={"P": 0.7})
    assert simulator.channels == ("Q",)
    assert simulator.simulate(simulator.parameters.nominal).values.shape[1] == 1
    assert any("taken as 0.7 pu" in note for note in simulator.observe(without).assumptions)


def test_the_voltage_must_be_there():
    with pytest.raises(InputError, match="magnitude of the terminal voltage was not recorded"):
        playback_observation(recording(drop=("V",)), ("P", "Q"))


def test_gaps_of_the_voltage_are_filled_and_said():
    source = recording()
    V = source.channels["V"].values.copy()
    V[60:64] = np.nan
    values = {k: c.values for k, c in source.channels.items()} | {"V": V}
    gappy = Recording.from_arrays(source.time, values, base_mva=100, f_nominal=60, event_time=1.0)
    observed = playback_observation(gappy, ("P", "Q"))
    assert np.isfinite(observed.event.signals["V"]).all()


def with_gap(name, first, last, **options):
    source = recording()
    values = {k: c.values.copy() for k, c in source.channels.items()}
    values[name][(source.time > first) & (source.time < last)] = np.nan
    return Recording.from_arrays(
        source.time, values, **{"base_mva": 100, "f_nominal": 60, "event_time": 1.0, **options}
    )


@pytest.mark.parametrize("name", ["V", "angle"])
@pytest.mark.parametrize("gap", [(0.97, 1.3), (2.0, 2.3), (3.8, 9.0)])
def test_a_long_gap_of_what_is_injected_is_refused_from_the_event_on(name, gap):
    with pytest.raises(InputError, match=rf"{name} was not recorded from .* s.*gaps of at most 0.1 s.*t_end"):
        playback_observation(with_gap(name, *gap), ("P", "Q"))


@pytest.mark.parametrize("name", ["V", "angle"])
def test_a_long_gap_before_the_event_is_filled_and_nothing_is_compared_there(name):
    observed = playback_observation(with_gap(name, 0.29, 0.59), ("P", "Q"))
    missing = (observed.time > 0.295) & (observed.time < 0.585)
    assert np.isfinite(observed.event.signals[name]).all()
    assert np.array_equal(observed.mask, np.broadcast_to(~missing, observed.mask.shape))
    assert any(
        f"of {name} was missing" in s and "nothing is compared there" in s for s in observed.assumptions
    )


def test_a_meter_that_ends_a_reading_early_is_held():
    observed = playback_observation(with_gap("V", 3.93, 9.0), ("P", "Q"))
    assert observed.mask.all()
    assert len(set(observed.event.signals["V"][-3:])) == 1


@pytest.mark.parametrize(
    ("P", "Q", "message"),
    [
        (-0.7, 0.1, "P before the event is -0.7 pu, but generation is positive: check its sign"),
        (0.007, 0.001, "P before the event is only 0.007 pu: check its unit and base_mva"),
        (30.0, 0.1, "P before the event is 30 pu: check its unit and base_mva"),
        (0.12, 0.72, r"Q before the event is 0.72 pu and P 0.12 pu: check that they are not interchanged"),
    ],
)
def test_an_operating_point_unlike_a_generators_is_warned_of(P, Q, message):
    moving = 0.01 * np.sin(np.arange(200.0)) * (np.arange(200) > 100)
    values = {"V": 1.0 - moving, "P": P + moving, "Q": Q + moving}
    source = Recording.from_arrays(
        np.arange(200) / 50,
        values,
        base_mva=100,
        f_nominal=60,
        event_time=2.0,
        noise=dict.fromkeys("VPQ", 1e-3),
    )
    with pytest.warns(DataWarning, match=message):
        observed = playback_observation(source, ("P", "Q"), needs_angle=False)
    assert any("check" in s for s in observed.assumptions)


def test_a_usual_operating_point_is_not_warned_of():
    assert not any("check" in s for s in playback_observation(recording(), ("P", "Q")).assumptions)


def test_nothing_to_compare_with():
    with pytest.raises(InputError, match="neither P nor Q was recorded"):
        PlantSimulator("pv_plant", recording(drop=("P", "Q")), operating_point={"P": 0.7, "Q": 0.1})


def test_noise_of_the_injected_voltage_counts_as_noise_of_the_channels():
    """A stiff machine turns angle noise into power noise: the error before the event tells how much."""
    source = recording()
    rng = np.random.default_rng(5)
    values = {k: c.values for k, c in source.channels.items()}
    values["angle"] = values["angle"] + 3e-3 * rng.standard_normal(values["angle"].shape)
    noisy = Recording.from_arrays(source.time, values, base_mva=100, f_nominal=60, event_time=1.0)
    simulator = PlantSimulator("synchronous_machine", noisy)
    observed = simulator.observe(noisy)
    y = simulator.simulate(simulator.parameters.nominal, observed.event).values[0]
    quiet = observed.time < 0.95
    assert observed.noise[0] > 3 * noisy.channels["P"].noise
    assert np.allclose(observed.noise, (y - observed.values)[:, quiet].std(axis=1), rtol=0.2)
    assert any("noise of P is taken as" in note for note in observed.assumptions)
