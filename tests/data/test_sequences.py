"""Symmetrical components, against phases that are made up of known ones."""

import numpy as np
import pytest

from errorscreen.data.sequences import check_voltages, doubt_currents, factor, power, sequences
from errorscreen.exceptions import DataWarning, InputError

A = np.exp(2j * np.pi / 3)
ONE, TWO, ZERO = (np.full(40, z) for z in (11.5 + 2j, 0.7 - 0.2j, -0.1 + 0.4j))
PHASES = [ONE + TWO + ZERO, A**2 * ONE + A * TWO + ZERO, A * ONE + A**2 * TWO + ZERO]
NAMES = ["A", "B", "C"]


def test_components_of_phases():
    for found, right in zip(sequences(PHASES), (ONE, TWO, ZERO), strict=True):
        assert found == pytest.approx(right)


def test_components_of_voltages_between_phases():
    a, b, c = PHASES
    one, two, zero = sequences([a - b, b - c, c - a], line_to_line=True)
    assert one == pytest.approx(ONE)
    assert two == pytest.approx(TWO)
    assert np.abs(zero).max() < 1e-12


def test_power_is_that_of_three_phases():
    currents = [0.3 * np.exp(-0.4j) * phase for phase in PHASES]
    balanced = power(sequences(PHASES)[0], sequences(currents)[0])
    right = 3 * ONE * np.conj(0.3 * np.exp(-0.4j) * ONE)
    assert balanced["P"] + 1j * balanced["Q"] == pytest.approx(right)


@pytest.mark.parametrize("k", range(3))
def test_one_reversed_phase_is_named(k):
    turned = [-phase if i == k else phase for i, phase in enumerate(PHASES)]
    with pytest.raises(InputError, match=f"Correct the sign of '{NAMES[k]}'"):
        check_voltages(turned, NAMES, "here")
    notes = []
    with pytest.warns(DataWarning, match=f"with the other sign of '{NAMES[k]}'"):
        doubt_currents(turned, NAMES, notes, "here")
    assert len(notes) == 1


def test_right_phases_are_not_doubted_and_gaps_do_not_matter():
    with_gaps = [phase.copy() for phase in PHASES]
    with_gaps[1][:10] = np.nan
    for phases in (PHASES, with_gaps, [np.full(40, np.nan + 0j)] * 3):
        check_voltages(phases, NAMES, "here")
        doubt_currents(phases, NAMES, notes := [], "here")
        assert notes == []


@pytest.mark.parametrize(
    ("unit", "quantity", "right"),
    [
        *((unit, "voltage", 1.0) for unit in ("kV", "KV", "kv", "[kV]")),
        *((unit, "voltage", 1e-3) for unit in ("V", "Volt", "volts", "VOLTS")),
        *((unit, "current", 1.0) for unit in ("kA", "KA", "ka")),
        *((unit, "current", 1e-3) for unit in ("A", "Amps", "amp", "Ampere")),
    ],
)
def test_spellings_of_units(unit, quantity, right):
    assert factor({"x": unit, "y": unit}, ["x", "y"], None, quantity, "here") == right


def test_a_record_that_begins_in_a_fault_is_told_so():
    phases = [0.0 * PHASES[0], PHASES[1], 0.2 * PHASES[2]]
    with pytest.raises(InputError, match="begin before the event"):
        check_voltages(phases, NAMES, "here")


@pytest.mark.parametrize(
    ("units", "given", "right"), [({"A": "V", "B": "V"}, None, 1e-3), ({"A": "V", "B": "V"}, "kV", 1.0)]
)
def test_units(units, given, right):
    assert factor(units, ["A", "B"], given, "voltage", "here") == right
    with pytest.raises(InputError, match="Give voltage_unit"):
        factor({"A": "V", "B": "kV"}, ["A", "B"], None, "voltage", "here")
