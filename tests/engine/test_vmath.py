import numba
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.engine.vmath import (
    back_calculate,
    clip,
    hold_at_limits,
    select,
    sincos,
    smooth_step,
)

finite = st.floats(-1e5, 1e5)


@given(finite)
def test_sincos_agrees_with_numpy(x):
    s, c = sincos(x)
    assert abs(s - np.sin(x)) < 4e-16
    assert abs(c - np.cos(x)) < 4e-16


def test_compiled_functions_agree_with_numpy_bit_for_bit():
    @numba.njit(error_model="numpy")
    def compiled(x, out):
        for i in range(x.size):
            s, c = sincos(x[i])
            out[0, i], out[1, i] = s, c
            out[2, i] = clip(x[i], -1.0, 1.0)
            out[3, i] = hold_at_limits(x[i], s, -1.0, 1.0)
            out[4, i] = smooth_step(x[i])
            out[5, i] = select(x[i] > 0.0, s, c)
            out[6, i] = back_calculate(x[i], s, -1.0, 1.0, 0.1)

    x = np.random.default_rng(1).uniform(-20, 20, 1000)
    out = np.empty((7, x.size))
    compiled(x, out)
    s, c = sincos(x)
    expected = [
        s, c, clip(x, -1.0, 1.0), hold_at_limits(x, s, -1.0, 1.0), smooth_step(x),
        select(x > 0, s, c), back_calculate(x, s, -1.0, 1.0, 0.1),
    ]  # fmt: skip
    assert np.array_equal(out, np.array(expected))


def test_smooth_step_has_no_slope_at_its_ends():
    assert abs(smooth_step(1e-6)) < 1e-11
    assert abs(1 - smooth_step(1 - 1e-6)) < 1e-11


def test_integrator_is_held_only_where_it_leads_outwards():
    assert hold_at_limits(2.0, 1.0, 0.0, 1.0) == 0
    assert hold_at_limits(2.0, -1.0, 0.0, 1.0) == -1
    assert hold_at_limits(-1.0, -1.0, 0.0, 1.0) == 0
    assert hold_at_limits(0.5, 1.0, 0.0, 1.0) == 1
