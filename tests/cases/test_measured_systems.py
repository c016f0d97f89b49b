from pathlib import Path

import numpy as np
import pytest

from errorscreen.cases import falling_ball, read_falling_ball, read_silverbox, silverbox
from errorscreen.discovery import CauseFinder
from errorscreen.exceptions import InputError

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"

SILVERBOX, BALLS = DATA / "silverbox" / "multisine.csv", DATA / "falling_balls" / "balls.csv"
needs_silverbox = pytest.mark.skipif(not SILVERBOX.exists(), reason=f"{SILVERBOX} is missing")
needs_balls = pytest.mark.skipif(not BALLS.exists(), reason=f"{BALLS} is missing")


def found_in_a_fall(ball):
    first, second = (read_falling_ball(BALLS, ball, drop) for drop in (1, 2))
    # with fewer than sixty readings one effect is all that can be sought
    finder = CauseFinder(falling_ball(first), max_effects=1, random_state=0).fit(first)
    return finder, finder.confirm(second)


@pytest.mark.slow
@needs_balls
@pytest.mark.parametrize("ball", ["Whiffle Ball 1", "Tennis Ball", "Volleyball"])
def test_drag_is_named_and_predicts_the_other_drop(ball):
    finder, confirmed = found_in_a_fall(ball)
    assert finder.verdict_.kind == "effect"
    assert finder.causes_[0].name in ("velocity.viscous(velocity)", "velocity.drag(velocity)")
    assert confirmed.gain.holds
    assert confirmed.gain.extended < 0.3 * confirmed.gain.recalibrated


@pytest.mark.slow
@needs_balls
def test_nothing_is_named_for_the_bowling_ball():
    finder, _ = found_in_a_fall("Bowling Ball")
    assert finder.verdict_.kind in ("within-noise", "parameters", "unknown")


@pytest.mark.slow
@needs_silverbox
def test_the_cubic_spring_is_named_first():
    # the full record by benchmarks/measured_systems.py
    fitted = read_silverbox(SILVERBOX, 0, 1500, name="beginning")
    unseen = read_silverbox(SILVERBOX, 10000, 14000, name="second half")
    model = silverbox(fitted, templates=["cubic", "quadratic", "drag", "coulomb", "offset", "saturation"])
    finder = CauseFinder(model, random_state=0).fit(fitted)
    assert finder.best_.effects[0].name == "v.cubic(y)"
    gain = finder.measure_gain(unseen)
    assert gain.recalibrated > 6 * gain.extended


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def test_files_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_silverbox(tmp_path / "none.csv")
    with pytest.raises(InputError, match="column u_V, y_V is missing"):
        read_silverbox(write(tmp_path / "a.csv", "time_s\n0\n1\n"))
    rows = "\n".join(f"{0.01 * k},{np.sin(k)},{np.cos(k)}" for k in range(50))
    with pytest.raises(InputError, match="50 samples"):
        read_silverbox(write(tmp_path / "b.csv", "time_s,u_V,y_V\n" + rows))
    with pytest.raises(InputError, match="there is no 'Marble', drop 1.*Cube, drop 1"):
        read_falling_ball(write(tmp_path / "c.csv", "ball,drop,time,height_m\nCube,1,0,1\n"), "Marble", 1)


def test_a_ball_in_vacuum_lacks_nothing(tmp_path):
    t = np.arange(0, 2.8, 1 / 15)
    height = 47 - 0.5 * 9.80665 * t**2 + np.random.default_rng(0).normal(0, 0.1, len(t))
    rows = "\n".join(f"Lead,1,{a},{b}" for a, b in zip(t, height, strict=True))
    path = write(tmp_path / "balls.csv", "ball,drop,time,height_m\n" + rows)
    recording = read_falling_ball(path, "Lead", 1)
    finder = CauseFinder(falling_ball(recording), max_effects=1, random_state=0).fit(recording)
    assert finder.verdict_.kind in ("within-noise", "parameters")
