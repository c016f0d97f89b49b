"""The first screen: one answer in plain words, how sure it is, and errors in MW and Mvar."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.result import Estimate
from errorscreen.discovery import Verdict
from errorscreen.report.first_screen import acting, certainty, error_rows, statement
from errorscreen.report.result import Correction
from tests.report.samples import UNKNOWN, cause, diagnosis, found, gain, method, recording, result, withdrawn


def verdict(kind, **changes):
    return result(diagnosis=diagnosis(Verdict(kind, "So it is."), **changes))


def corrected(*names):
    changed = tuple(Estimate(n, 4.0, 3.9, 4.1, nominal=3.0, lower=1.0, upper=9.0, unit="s") for n in names)
    return Correction("calibrated.dyr", "unit.dyr", changed, 9.0, 1.0, "")


def test_nothing_to_explain():
    assert statement(verdict("within-noise")) == (
        "The model reproduces the recording within its noise. Nothing has to change."
    )


def test_wrong_values_are_those_of_the_corrected_file_where_there_is_one():
    told = replace(verdict("parameters"), correction=corrected("GENROU.H"))
    assert statement(told) == "Wrong parameter values explain the error: GENROU.H 4 s instead of 3."
    assert "Xd 1.2 pu instead of 0.95" in statement(verdict("parameters"))
    many = replace(told, correction=corrected(*"abcdef"))
    assert statement(many).endswith("d 4 s instead of 3, and 2 more.")


def test_values_that_hold_the_nominal_ones_are_not_called_wrong():
    loose = replace(method("map").parameters[0], low=0.9)
    told = diagnosis(calibration=replace(method("map"), parameters=(loose,)))
    assert "No single one of them stands out" in statement(result(diagnosis=told))


def test_a_named_effect_comes_with_its_values_and_wrong_numbers_of_the_file():
    named = found([cause(title="Stabiliser"), UNKNOWN])
    assert statement(named) == "Stabiliser. Its values: exciter.K 50 pu, exciter.T 0.02 s."
    assert statement(replace(named, correction=corrected("GENROU.H"))).endswith(
        "Wrong in the model file: GENROU.H 4 s instead of 3."
    )


def test_values_that_the_title_tells_are_not_repeated():
    first = cause(title="The stabiliser did not act")
    told = found([replace(first, effects=tuple(replace(e, read=True) for e in first.effects)), UNKNOWN])
    assert statement(told) == "The stabiliser did not act."


def test_a_wrong_measurement_is_no_lack_of_the_model():
    first = cause(title="Scale error of P", kind="measurement")
    told = verdict("measurement", causes=(first, UNKNOWN), extension=first.effects)
    assert statement(told).startswith("The measurement is wrong, not the model: scale error of P.")


def test_an_unknown_cause_is_told_with_its_place():
    assert statement(withdrawn()).startswith(
        "The cause is unknown. It enters at Efd of the synchronous_machine: up to"
    )
    assert statement(verdict("unknown")) == "The cause is unknown."


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (
            found(),
            "Probability 0.97, with 2 effects tried. On one recording that was not fitted, the extension removes "
            "60 % [40, 70] of the squared error of a recalibrated model.",
        ),
        (
            found(gain=gain(*[float("nan")] * 3), confirmed=Verdict("effect", "")),
            "Probability 0.97, with 2 effects tried. One recording that was not fitted agrees with the answer.",
        ),
        (
            replace(found(), recordings=(recording("trip", "fit"),)),
            "Probability 0.97, with 2 effects tried. No recording was held out, so nothing confirms it on another "
            "event.",
        ),
    ],
)
def test_how_sure_the_answer_is(told, words):
    assert certainty(told) == words


def test_a_withdrawn_answer_gains_nothing_on_the_first_screen():
    assert (
        certainty(withdrawn())
        == "What the search told first did not hold on one recording that was not fitted."
    )
    assert certainty(verdict("unknown")) == ""


def test_errors_are_also_told_in_megawatts():
    rows = list(error_rows(found()))
    first = rows[0]
    assert (first.recording, first.channel, first.power, first.base) == ("trip", "P", "MW", 50.0)
    assert (first.before, first.after) == (0.1, 0.03)  # of the extended model
    assert [row.role for row in rows] == ["fit", "held_out"]
    calibrated = list(error_rows(result()))
    assert calibrated[0].after == 0.02
    assert np.isnan(calibrated[1].after)


def test_when_an_effect_acts_is_told_of_named_ones_only():
    assert acting(withdrawn()) == ""
