"""Limits of a case file: a profile, limits of one's own, and both together."""

import pytest

from errorscreen.cases import load_case
from errorscreen.cases.limits_section import LimitsSection
from errorscreen.exceptions import InputError
from errorscreen.validation import PROFILES

HEAD = """
[recording]
path = "r.csv"
base_mva = 100.0
f_nominal = 50.0
[device]
type = "synchronous_machine"
"""


def loaded(tmp_path, text):
    (tmp_path / "case.toml").write_text(HEAD + text)
    return load_case(tmp_path / "case.toml").limits


def test_without_a_section_there_are_no_limits(tmp_path):
    assert loaded(tmp_path, "").limits() is None


def test_a_profile_by_name(tmp_path):
    section = loaded(tmp_path, '[limits]\nprofile = "rte-simulation"\nset_by = "the operator"\n')
    limits = section.limits()
    assert limits.windows == PROFILES["rte-simulation"].limits.windows
    assert (limits.begin, limits.end, limits.set_by) == (0.02, 0.06, "the operator")
    assert section.title == "RTE, against a simulation"


def test_limits_of_ones_own_replace_those_of_a_profile(tmp_path):
    text = '[limits]\nprofile = "rte-simulation"\nsource = "contract 7"\nleave_out_end = 0.2\n'
    limits = loaded(tmp_path, text + "[limits.after]\nMXE = 0.1\n").limits()
    assert limits.windows["after"].MXE == 0.1
    assert limits.windows["after"].ME == 0.02
    assert limits.windows["during"].MXE == 0.08
    assert (limits.begin, limits.end) == (0.02, 0.2)
    assert limits.source.endswith("; changed by: contract 7")


def test_limits_of_ones_own_alone_leave_out_what_the_standard_allows():
    limits = LimitsSection(source="contract 7", during={"MAE": 0.05}).limits()
    assert limits.windows["during"].MAE == 0.05
    assert limits.windows["after"].MAE is None
    assert (limits.begin, limits.end) == (0.14, 0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[limits]\nprofile = "rte"\n', "unknown profile of limits 'rte'.*rte-simulation"),
        ("[limits.after]\nMXE = 0.1\n", "limits of your own .after. have no source"),
        ('[limits]\nsource = "x"\n[limits.after]\nMXE = 0.0\n', "limits.after.MXE"),
        ('[limits]\nsource = "x"\ntime = 0.1\n', "unknown key 'time' .did you mean 'times'"),
    ],
)
def test_wrong_limits_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        loaded(tmp_path, text)
