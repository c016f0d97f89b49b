import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.units import UNITS, Bases, Column, as_column, convert, unwrap

BASES = Bases(mva=50.0, kv=20.0, hz=50.0)
X = np.array([0.1, -0.7, 1.3, np.nan])


def _to_file(role, unit, spec):
    """Size of one unit of the channel in the unit of a file."""
    power = 50.0 / (3.0 if spec.per_phase else 1.0)
    factors = {
        **{"W": power * 1e6, "kW": power * 1e3, "MW": power, "GW": power / 1e3},
        **{"V": 20e3, "kV": 20.0},
        **{"rad": 1.0, "deg": 180 / np.pi},
        **{"Hz": 1.0, "mHz": 1e3, "rad/s": 2 * np.pi},
    }
    if unit == "pu":
        return {"P": 50.0 / (spec.base or 50.0), "V": 20.0 / (spec.base or 20.0), "f": 1 / 50.0}[role]
    return factors[unit] / (np.sqrt(3) if spec.line_neutral else 1.0)


@given(
    case=st.sampled_from(
        [
            *[("P", u) for u in ("W", "kW", "MW", "GW", "pu")],
            *[("V", u) for u in ("V", "kV", "pu")],
            *[("angle", u) for u in ("rad", "deg")],
            *[("f", u) for u in ("Hz", "mHz", "pu", "rad/s")],
        ]
    ),
    base=st.one_of(st.none(), st.floats(0.1, 1e4)),
    scale=st.floats(1e-3, 1e3),
    load=st.booleans(),
    third=st.booleans(),
)
def test_every_unit_base_and_sign_gives_the_same_numbers(case, base, scale, load, third):
    role, unit = case
    physical = unit != "pu"
    spec = Column(
        "c",
        unit=unit,
        base=base if role in ("P", "V") and not physical else None,
        scale=scale,
        sign="load" if load and role == "P" else "generator",
        per_phase=third and role == "P" and physical,
        line_neutral=third and role == "V" and physical,
    )
    as_column(role, spec, "here")
    sign = -1 if spec.sign == "load" else 1
    in_file = sign * X * _to_file(role, unit, spec) / scale
    np.testing.assert_allclose(convert(role, in_file, spec, BASES, "here"), X, rtol=1e-9)


@pytest.mark.parametrize(
    ("unit", "number"), [("var", 5e6), ("kVAr", 5e3), ("Mvar", 5.0), ("MVAr", 5.0), ("VA", 5e6), ("MVA", 5.0)]
)
def test_reactive_power(unit, number):
    assert convert("Q", np.array([number]), Column("q", unit=unit), BASES, "q") == pytest.approx([0.1])


def test_deviations_of_the_frequency_count_from_nominal():
    assert convert("f", np.array([0.2]), Column("f", unit="Hz deviation"), BASES, "f") == pytest.approx(
        [50.2]
    )
    assert convert("f", np.array([-30.0]), Column("f", unit="mHz deviation"), BASES, "f") == pytest.approx(
        [49.97]
    )
    assert convert("f", np.array([-0.01]), Column("f", unit="pu deviation"), BASES, "f") == pytest.approx(
        [49.5]
    )


def test_other_channels_keep_their_numbers():
    np.testing.assert_array_equal(convert("Efd", X, Column("e", unit="pu", scale=2.0), BASES, "e"), 2 * X)


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=50), st.data())
def test_unwrapping_restores_a_continuous_angle(steps, data):
    angle = np.cumsum(steps)
    gaps = data.draw(st.lists(st.booleans(), min_size=len(angle), max_size=len(angle)))
    wrapped = np.angle(np.exp(1j * angle))
    np.testing.assert_allclose(unwrap(wrapped) - wrapped[0], angle - angle[0], atol=1e-9)
    wrapped[gaps] = np.nan
    np.testing.assert_array_equal(np.isnan(unwrap(wrapped)), gaps)


def test_every_unit_is_convertible():
    for role, units in UNITS.items():
        for unit in units:
            assert np.isfinite(convert(role, np.ones(1), Column("c", unit=unit), BASES, "here")).all()
