import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.observations import Observation
from errorscreen.data.plausibility import Doubt
from errorscreen.data.recordings import Channel, Recording
from errorscreen.events import Event
from errorscreen.exceptions import DataWarning, InputError

TIME = np.arange(300) / 60


def swing(time, start=1.0):
    after = np.clip(time - start, 0, None)
    return np.where(time < start, 0.0, np.exp(-0.8 * after) * np.cos(7 * after))


def make(time=TIME, noise=1e-3, **options):
    rng = np.random.default_rng(7)
    values = {
        "V": 1.0 - 0.2 * swing(time) + noise * rng.normal(size=len(time)),
        "P": 0.7 - 0.3 * swing(time) + noise * rng.normal(size=len(time)),
    }
    return Recording.from_arrays(time, values, **{"base_mva": 100.0, "f_nominal": 60.0, **options})


def test_what_is_found_in_a_swing():
    rec = make()
    assert rec.event_time == pytest.approx(1.0)
    assert rec.quiet[0] == 0
    assert 0.9 < rec.quiet[1] < 1.0 - 1 / 60
    assert rec.channel("P").noise == pytest.approx(1e-3, rel=0.3)
    assert rec.initial(["V", "P"]) == pytest.approx({"V": 1.0, "P": 0.7}, abs=1e-3)
    assert (rec.names, rec.channel("V").unit) == (("V", "P"), "pu")
    assert any("begin at 1 s" in sentence for sentence in rec.assumptions)


def test_overrides_are_taken():
    rec = Recording.from_arrays(
        TIME, {"P": swing(TIME)}, base_mva=1, f_nominal=50, event_time=0.8, noise={"P": 0.02}
    )
    assert rec.event_time == 0.8
    assert rec.channel("P").noise == 0.02
    assert not any("begin" in sentence for sentence in rec.assumptions)


def begun(**options):
    """The swing, recorded from its first instant on, with a stated level before it."""
    part = TIME >= 1.0
    values = {"V": 1.0 - 0.2 * swing(TIME), "P": 0.7 - 0.3 * swing(TIME), "angle": 0.3 * swing(TIME)}
    noise = 1e-3 * np.random.default_rng(7).normal(size=(3, 300))
    values = {name: (v + n)[part] for (name, v), n in zip(values.items(), noise, strict=True)}
    options = {"level": {"V": 1.0, "P": 0.7}, "base_mva": 100, "f_nominal": 60} | options
    return Recording.from_arrays(TIME[part], values, **options)


def test_a_recording_that_begins_in_its_event_goes_on_with_a_stated_level_and_a_warning():
    with pytest.warns(DataWarning, match="no quiet part.*stated as V = 1, P = 0.7"):
        rec = begun()
    assert rec.event_time == 1.0
    assert rec.quiet[1] < 1.0
    assert rec.initial(["V", "P"]) == pytest.approx({"V": 1.0, "P": 0.7}, rel=1e-12)
    assert rec.channel("P").noise == pytest.approx(1e-3, rel=0.3)  # not that of the stated level
    before = rec.time < 1.0
    np.testing.assert_array_equal(rec.channel("P").values[before], 0.7)
    np.testing.assert_allclose(rec.channel("angle").values[before], rec.channel("angle").values[~before][0])


@pytest.mark.filterwarnings("ignore::errorscreen.exceptions.DataWarning")
def test_the_angle_before_the_event_turns_with_the_stated_frequency():
    values = {"f": 60.1 + 0.1 * swing(TIME, 0.0), "angle": swing(TIME, 0.0)}
    for level, slope in (({}, 0.0), ({"f": 60.1}, 2 * np.pi * 0.1)):
        level |= {"P": 0.7}
        rec = Recording.from_arrays(
            TIME, {"P": 0.5 + swing(TIME, 0.0), **values}, base_mva=100, f_nominal=60, level=level
        )
        before = rec.time < 0
        angle = rec.channel("angle").values[before]
        np.testing.assert_allclose(np.diff(angle) / np.diff(rec.time[before]), slope, atol=1e-9)
        assert rec.channel("f").values[0] == level.get("f", 60.0)
    with pytest.raises(InputError, match="'f', which is no channel"):
        begun(level={"V": 1.0, "P": 0.7, "f": 60.1})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"level": {"V": 1.0}},
            r"level: the stated level holds no P. Allowed: values before the event of V, P",
        ),
        ({"level": {"V": 1.0, "P": np.nan}}, "level.*P is nan"),
        ({"event_time": 1.5}, "level and event_time are given"),
    ],
)
def test_a_level_that_cannot_be_used_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        begun(**options)


def test_without_a_level_the_message_names_it():
    with pytest.raises(InputError, match="no quiet part.*or state the values before it: level"):
        begun(level=None)


def test_noise_set_to_the_resolution_is_said():
    rec = make(noise=0.0)
    assert rec.channel("P").noise > 0
    assert any(s.startswith("P scatters less before the event") for s in rec.assumptions)


def test_held_readings_are_dropped_or_kept_and_said():
    rng = np.random.default_rng(1)
    fresh = 0.5 + 0.3 * swing(TIME[::3]) + 1e-3 * rng.normal(size=100)
    values = {"P": np.repeat(fresh, 3)}
    dropped = Recording.from_arrays(TIME, values, base_mva=1, f_nominal=50)
    kept = Recording.from_arrays(TIME, values, base_mva=1, f_nominal=50, held="keep")
    assert np.isfinite(dropped.channel("P").values).sum() == 100
    assert np.isfinite(kept.channel("P").values).all()
    assert dropped.channel("P").age == kept.channel("P").age == pytest.approx(3 * np.diff(TIME).mean())
    assert make().channel("P").age == 0.0
    assert any("stale repeats were dropped" in s for s in dropped.assumptions)
    assert any("staircase was kept" in s for s in kept.assumptions)
    np.testing.assert_allclose(dropped.resample(0.05).channel("P").values[:90], fresh[:90], atol=1e-12)


def test_given_values_stand_in_for_channels():
    rec = Recording.from_arrays(TIME, {"Q": swing(TIME)}, base_mva=1, f_nominal=50, given={"P": 0.54})
    assert rec.initial(["P"]) == {"P": 0.54}
    assert rec.names == ("Q",)


@given(st.floats(-0.3, 0.3), st.floats(0.005, 0.03))
def test_shifting_comes_before_resampling(shift, step):
    """A shifted channel is the signal at ``t - shift``, whether or not the shift fits the grid."""
    time = np.arange(2001) / 400
    rec = Recording.from_arrays(
        time, {"V": 1 + swing(time), "P": swing(time)}, base_mva=1, f_nominal=50, event_time=1.0
    ).resample(step, shift={"V": shift})
    # the low-pass of a coarse grid blurs the step, so the steps themselves are left out
    for name, moved in (("V", rec.time - shift), ("P", rec.time)):
        away = np.abs(moved - 1.0) > 2 * step + 0.0025
        offset = 1.0 if name == "V" else 0.0
        np.testing.assert_allclose(rec.channel(name).values[away], offset + swing(moved[away]), atol=0.02)
    assert np.isfinite(rec.channel("V").values).all()


@given(st.floats(0.02, 0.2))
def test_shift_then_resample_equals_resample_of_shifted_stamps(shift):
    rec = make()
    moved = Recording.from_arrays(
        TIME + shift, {"V": rec.channel("V").values}, base_mva=1, f_nominal=60, event_time=1.0 + shift
    )
    grid = np.arange(0.5, 4.0, 0.01)
    one = rec.resample(time=grid, shift={"V": shift}).channel("V").values
    np.testing.assert_allclose(one, moved.resample(time=grid).channel("V").values, atol=1e-12)


def test_resampling_coarsely_filters_noise_and_says_so():
    rec = make()
    coarse = rec.resample(0.05)
    assert coarse.channel("P").noise < 0.9 * rec.channel("P").noise
    assert any("low-pass filtered" in s for s in coarse.assumptions)
    assert rec.resample(0.01).channel("P").noise == rec.channel("P").noise


def test_a_stated_noise_holds_on_a_coarser_grid():
    values = {name: channel.values for name, channel in make().channels.items()}
    rec = Recording.from_arrays(TIME, values, base_mva=1, f_nominal=60, noise={"P": 0.02})
    coarse = rec.resample(0.05)
    assert coarse.channel("P").noise == 0.02
    assert coarse.channel("V").noise < 0.9 * rec.channel("V").noise


def test_a_window_keeps_event_and_noise():
    rec = make()
    cut = rec.window(0.2, 4.1)
    assert cut.time[0] >= 0.2
    assert cut.time[-1] <= 4.1
    assert cut.quiet == (0.2, rec.quiet[1])
    assert cut.channel("P").noise == rec.channel("P").noise
    assert len(rec.window().time) == len(rec.time)


@pytest.mark.parametrize(
    ("window", "message"),
    [
        ((1.2, 4.0), "the window leaves 0 quiet samples before the event at 1 s"),
        ((0.0, 1.05), "4 samples lie after the event at 1 s. Allowed: at least 5"),
    ],
)
def test_a_window_needs_something_before_and_after_the_event(window, message):
    with pytest.raises(InputError, match=message):
        make().window(*window)


def test_a_recording_that_ends_with_its_event_is_refused():
    with pytest.raises(InputError, match=r"2 samples lie after the event at 4\.96"):
        make(time=TIME, event_time=4.96)


def test_a_stated_event_behind_the_real_one_is_refused():
    with pytest.raises(
        InputError,
        match=r"V moves from 1 s on, before the stated event at 4.5 s.*set t_start",
    ):
        make(event_time=4.5)


def test_a_small_move_before_the_stated_event_is_warned_of():
    """A tenth of the excursion, but far above the noise."""
    power = 0.7 - 0.3 * swing(TIME, 3.0) - 0.03 * (TIME > 1)
    with pytest.warns(DataWarning, match=r"P moves from 1.\d* s on by 9% of its largest excursion"):
        rec = Recording.from_arrays(TIME, {"P": power}, base_mva=1, f_nominal=50, event_time=3.0)
    assert any("before the event" in s for s in rec.assumptions)


@given(st.floats(1e-4, 1e-2), st.integers(0, 1000))
def test_noise_before_the_stated_event_is_no_event(noise, seed):
    rng = np.random.default_rng(seed)
    power = 0.7 - 0.3 * swing(TIME, 3.0) + noise * rng.normal(size=len(TIME))
    rec = Recording.from_arrays(TIME, {"P": power}, base_mva=1, f_nominal=50, event_time=3.0)
    assert not any("before the event, " in s or "largest excursion" in s for s in rec.assumptions)


def test_the_table_has_one_column_for_each_channel():
    frame = make().to_frame()
    assert list(frame.columns) == ["V", "P"]
    assert frame.index.name == "time"


def test_implausible_values_are_warned_of():
    with pytest.warns(DataWarning, match="V before the event is 10 pu"):
        rec = Recording.from_arrays(TIME, {"V": 10 - swing(TIME)}, base_mva=1, f_nominal=50)
    assert any("base_kv" in s for s in rec.assumptions)


def test_no_power_is_implausible_before_it_is_known_whose_it_is():
    """A line of a grid carries many times the base; `pytest` makes errors of warnings."""
    rec = Recording.from_arrays(TIME, {"P": 30 - swing(TIME)}, base_mva=1, f_nominal=50)
    assert not any("check its unit" in s for s in rec.assumptions)


def test_recordings_travel_to_workers():
    rec = make()
    copy = pickle.loads(pickle.dumps(rec))
    np.testing.assert_array_equal(copy.channel("P").values, rec.channel("P").values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": TIME[::-1]}, "not finite and strictly increasing"),
        ({"time": TIME[:1]}, "the time axis has shape"),
        ({"values": {}}, "there is no channel"),
        ({"values": {"P": np.ones(5)}}, r"channel 'P' has shape \(5,\). Allowed: \(300,\)"),
        ({"base_mva": 0.0}, "base_mva is 0.0. Allowed: a positive number"),
        ({"f_nominal": -50.0}, "f_nominal is -50.0"),
        ({"base_kv": np.nan}, "base_kv is nan"),
        ({"noise": {"P": 0.0}}, "the noise of P is 0.0"),
        ({"event_time": 99.0}, "event_time is 99 s. Allowed: 0 to"),
        ({"event_time": 0.05}, r"3 samples lie before the event .* correct event_time"),
        ({"noise": {"p": 0.1}}, "recording 'recording', noise: unknown channel 'p'"),
        ({"given": {"P": 0.1}}, "'P' is measured and given. Allowed: one of them"),
        ({"held": "hold"}, "unknown value of held 'hold'"),
        ({"values": {"P": np.ones(300)}}, "no event was found"),
    ],
)
def test_unusable_arrays_are_refused(change, message):
    options = {"time": TIME, "values": {"P": swing(TIME)}, "base_mva": 1.0, "f_nominal": 50.0, **change}
    with pytest.raises(InputError, match=message):
        Recording.from_arrays(options.pop("time"), options.pop("values"), **options)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: r.channel("p"), "unknown channel 'p'.*did you mean 'P'|unknown channel 'p'"),
        (lambda r: r.window(8, 9), "the window from 8 to 9 s holds 0 samples"),
        (lambda r: r.resample(0.01, time=[0, 1]), "both dt and time are given"),
        (lambda r: r.resample(0.01, shift={"U": 1}), "unknown channel 'U'"),
        (lambda r: r.initial(["Q"]), "unknown channel 'Q'"),
    ],
)
def test_wrong_calls_are_explained(call, message):
    with pytest.raises(InputError, match=message):
        call(make())


def test_a_channel_needs_positive_noise():
    with pytest.raises(InputError, match="the noise of P is 0"):
        Recording("r", TIME, {"P": Channel("P", TIME, "pu", 0.0)}, 1.0, 50.0, 1.0, (0.0, 0.9))


def test_deviations_of_a_right_simulation_are_white_and_of_unit_size():
    """Noise, uncertain samples, an offset of the level and slow errors: the covariance is divided out."""
    rng = np.random.default_rng(0)
    time = np.arange(200.0)
    after = time >= 50
    noise, level = np.array([0.1, 2.0]), np.array([0.05, 0.5])
    extra = np.zeros((2, 200))
    extra[:, 60:70] = 0.3
    # two slow errors that both channels share
    modes = np.stack([np.outer([0.3, 4.0], np.sin(time / 20)), np.outer([0.1, -5.0], np.cos(time / 35))])
    seen = Observation(
        Event(time, start=50.0), np.zeros((2, 200)), noise, ("P", "Q"), ("", ""), (), extra, level, modes
    )
    draws = rng.standard_normal((4000, 2, 200)) * seen.sigma
    draws += rng.standard_normal((4000, 2, 1)) * level[:, None] * after
    draws += np.einsum("nk,krl->nrl", rng.standard_normal((4000, 2)), modes)
    z = seen.deviations(draws)
    covariance = np.cov(z.reshape(len(z), -1).T)
    assert np.abs(np.diag(covariance) - 1).max() < 0.1
    assert np.abs(covariance - np.diag(np.diag(covariance))).max() < 0.1
    assert abs(np.mean(z**2) - 1) < 0.01


def test_a_gap_does_not_spread_and_a_failed_row_stays_nan():
    values = np.zeros((1, 10))
    values[0, 7] = np.nan
    seen = Observation(
        Event(np.arange(10.0), start=3.0), values, np.ones(1), ("P",), ("",), level_std=np.ones(1)
    )
    z = seen.deviations(np.stack([np.ones((1, 10)), np.full((1, 10), np.nan)]))
    assert np.array_equal(np.isnan(z[0, 0]), np.arange(10) == 7)
    assert np.isnan(z[1]).all()


def test_parts_are_cut_once_and_later_ones_are_others():
    seen = Observation(
        Event(np.arange(10.0), start=3.0),
        np.arange(10.0)[None],
        np.ones(1),
        ("P",),
        ("",),
        level_std=np.ones(1),
    )
    part = seen.first(6)
    assert seen.first(6) is part
    assert seen.first(7) is not part
    assert part.values.shape == (1, 6)
    # what is changed later has parts of its own
    noisy = replace(seen, noise=np.full(1, 2.0)).first(6)
    assert np.array_equal(noisy.noise, [2.0])
    assert not np.allclose(noisy.deviations(np.zeros((1, 6))), part.deviations(np.zeros((1, 6))))


def test_recordings_and_observations_are_shown_in_short():
    rec = replace(make(name="trip", base_kv=20.0), given={"Q": 0.1})
    seen = Observation(
        Event(TIME, "trip", 1.0), np.full((1, 300), np.nan), np.ones(1), ("P",), ("pu",), ("It was assumed.",)
    )
    for shown in (rec, rec.channel("P"), seen):
        assert len(repr(shown)) < 200
        assert shown._repr_html_().startswith("<table>")
    assert repr(rec).startswith("Recording(name: trip, channels: V, P, time: 300 samples from 0 to 4.98")
    assert repr(seen) == (
        "Observation(event: trip (Event), channels: P, time: 300 samples from 0 to 4.98333 s, start: 1 s, "
        "readings: 0 of 300)"
    )
    assert "base   100 MVA, 20 kV, 60 Hz\ngiven  Q\n" in rec.summary()
    assert f"- {rec.assumptions[0]}" in rec.summary()
    assert seen.summary().startswith("Observation of trip\nevent     trip (Event)\ntime")
    assert seen.summary().endswith("\n\n- It was assumed.")


def test_recordings_and_observations_are_drawn_and_tabulated():
    rec = make()
    figure = rec.plot(window=(0.5, 2.0))
    assert [axes.get_ylabel() for axes in figure.axes] == ["V in pu", "P in pu"]
    assert figure.axes[0].get_xlim() == (0.5, 2.0)
    seen = Observation(
        Event(TIME, start=1.0), rec.to_frame().to_numpy().T, np.ones(2), ("V", "P"), ("pu", "pu")
    )
    assert seen.to_frame().equals(rec.to_frame())
    assert len(seen.plot({"twice": 2 * seen.values}).axes[0].lines) == 3  # measured, simulated, start


def test_a_doubt_is_told_from_other_assumptions():
    with pytest.warns(DataWarning, match="check its unit"):
        rec = Recording.from_arrays(TIME, {"V": 10 - swing(TIME)}, base_mva=1, f_nominal=50)
    doubts = [sentence for sentence in rec.assumptions if isinstance(sentence, Doubt)]
    assert [str(sentence) for sentence in doubts] == [rec.assumptions[-1]]
