import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.exceptions import InputError
from errorscreen.models import DEVICES
from errorscreen.parameters import Parameter, ParameterSpace, distinct_rows

SPACE = ParameterSpace(
    [Parameter("a", 1, 0.5, 2), Parameter("b", -10, -20, -5), Parameter("c", 0, 0, 1, scale=0.5)]
)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            (1, 2, 3),
            r"parameter 'x': the range \[2, 3\] excludes the nominal value 1. Allowed: lower <= nominal",
        ),
        ((1, 3, 2), r"the range \[3, 2\] is empty. Allowed: lower < upper"),
        ((float("nan"), 0, 1), "nominal is nan. Allowed: a finite number"),
        ((1, 0, float("inf")), "upper is inf. Allowed: a finite number"),
        (
            (0, -1, 1),
            "the nominal value is 0 and the scale is 0.*Allowed: a nominal value other than 0.*Give scale=",
        ),
        ((0, -1, 1, "", "", "", "", -2), "a positive scale"),
    ],
)
def test_bad_parameters(arguments, message):
    with pytest.raises(InputError, match=message):
        Parameter("x", *arguments)


def test_names_are_unique_and_unknown_ones_are_answered():
    with pytest.raises(InputError, match="declared 2 times"):
        ParameterSpace([SPACE[0], SPACE[0]])
    with pytest.raises(InputError, match="unknown parameter 'd'"):
        SPACE.subset(["d"])


@given(st.permutations(["a", "b", "c"]))
def test_subset_permutes_everything(names):
    order = [SPACE.index(n) for n in names]
    part = SPACE.subset(names)
    assert np.array_equal(part.nominal, SPACE.nominal[order])
    assert np.array_equal(part.bounds, SPACE.bounds[order])
    assert np.array_equal(part.scales, SPACE.scales[order])
    theta = np.array([[1.5, -7.0, 0.2]])
    assert np.array_equal(part.deviation(theta[:, order]), SPACE.deviation(theta)[:, order])


@given(st.floats(1e-3, 1e3))
def test_deviation_does_not_depend_on_the_unit(factor):
    one = ParameterSpace([Parameter("a", 2, 1, 3)])
    other = ParameterSpace([Parameter("a", 2 * factor, factor, 3 * factor)])
    assert np.allclose(one.deviation([2.5]), other.deviation([2.5 * factor]))


def test_replace_measures_against_the_new_nominal():
    changed = SPACE.replace({"a": {"nominal": 1.5}})
    assert changed["a"].scale == 1.5
    assert SPACE["a"].scale == 1
    assert changed["b"] == SPACE["b"]


def test_a_scale_of_its_own_stays_with_another_nominal_value():
    space = ParameterSpace([Parameter("offset", 0.0, -1.0, 1.0, scale=0.2), Parameter("gain", 2.0, 0.0, 5.0)])
    assert space.replace({"offset": {"nominal": 0.5}})["offset"].scale == 0.2
    assert space.replace({"offset": {"nominal": 0.5, "scale": 0.1}})["offset"].scale == 0.1
    with pytest.raises(InputError, match="Give scale="):
        space.replace({"gain": {"nominal": 0.0}})


def test_space_is_hashable_and_tabulated():
    assert len({SPACE, ParameterSpace(list(SPACE))}) == 1
    frame = SPACE.to_frame()
    assert list(frame.index) == ["a", "b", "c"]
    assert frame.loc["b", "lower"] == -20


def test_embed_keeps_the_rest_nominal():
    assert np.array_equal(SPACE.embed([[0.7], [0.8]], ["c"]), [[1, -10, 0.7], [1, -10, 0.8]])


@pytest.mark.parametrize("field", ["nominal", "lower"])
@pytest.mark.parametrize(("domain", "bad"), [("> 0", 0.0), ("> 0", -1.0), (">= 0", -1.0)])
def test_a_value_outside_the_domain_is_refused(field, domain, bad):
    values = {"nominal": bad if field == "nominal" else 2.0, "lower": bad, "upper": 3.0}
    with pytest.raises(InputError, match=f"parameter 'T': {field} is {bad:g}. Allowed: a number {domain}"):
        Parameter("T", **values, domain=domain)


def test_domains_hold_their_edge_and_survive_changes():
    space = ParameterSpace([Parameter("K", 1.0, 0.0, 2.0, domain=">= 0"), Parameter("x", 1.0, -1.0, 2.0)])
    assert space.replace({"K": {"nominal": 0.5}})["K"].domain == ">= 0"
    with pytest.raises(InputError, match="parameter 'K': lower is -0.1"):
        space.replace({"K": {"lower": -0.1}})
    with pytest.raises(InputError, match="parameter 'UC': upper is 1. Allowed: a number <= 0"):
        Parameter("UC", -1.0, -2.0, 1.0, domain="<= 0")
    assert Parameter("UC", -1.0, -2.0, 0.0, domain="<= 0").upper == 0.0
    with pytest.raises(InputError, match="unknown domain 'positive'"):
        Parameter("T", 1.0, 0.5, 2.0, domain="positive")


@pytest.mark.parametrize("device", DEVICES.values(), ids=DEVICES)
def test_every_parameter_of_a_device_has_a_domain(device):
    domains = {p.name: p.domain for p in device.candidates}
    assert set(domains.values()) == {"> 0", ">= 0"}
    for p in device.candidates:
        if p.unit == "s" or p.name.startswith("X"):
            assert p.domain == "> 0"


@given(st.integers(0, 12), st.integers(1, 3), st.integers(0, 2**32 - 1))
def test_distinct_rows_give_all_rows_back(n, m, seed):
    theta = np.random.default_rng(seed).integers(0, 2, (n, m)).astype(float)
    rows, which = distinct_rows(theta)
    assert np.array_equal(rows[which], theta)
    assert len(rows) == len(np.unique(theta, axis=0))


def test_many_parameters_are_shown_in_short():
    space = ParameterSpace(Parameter(f"parameter_{k}", 1, 0, 2) for k in range(100))
    assert len(repr(space)) < 200
    assert repr(space).startswith("ParameterSpace(parameter_0, parameter_1")
    assert "parameter_99" in space._repr_html_()
