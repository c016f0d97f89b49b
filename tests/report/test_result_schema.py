import json
from pathlib import Path

import jsonschema
import pytest
from errorscreen.report.result_schema import Verdict, json_schema, write_json_schema
from pydantic import ValidationError

from errorscreen.exceptions import InputError
from errorscreen.report import diagnose_recording, read_result, write_result
from tests.report.samples import fit, found, gain, result, stage, withdrawn

DOCUMENTED = Path(__file__).resolve().parents[2] / "docs" / "result_schema.json"


def test_the_documented_schema_is_the_one_in_use(tmp_path):
    """After a change of the models: errorscreen.report.result_schema.write_json_schema(...)."""
    written = write_json_schema(tmp_path / "schema.json").read_text()
    assert DOCUMENTED.read_text(encoding="utf-8") == written


def test_a_result_fits_the_schema(tmp_path):
    data = json.loads(write_result(result(), tmp_path / "result.json").read_text())
    jsonschema.Draft202012Validator(json_schema()).validate(data)
    assert data["schema_version"] == 1
    assert {"verdict", "diagnosis", "screening", "calibration", "data", "run"} <= set(data)
    del data["verdict"]
    with pytest.raises(jsonschema.ValidationError, match="'verdict' is a required property"):
        jsonschema.validate(data, json_schema())


@pytest.mark.parametrize("before", [result(), found(), withdrawn(), found(gain=gain(placebo=None))])
def test_reading_gives_what_was_written(before, tmp_path):
    after = read_result(write_result(before, tmp_path / "result.json"))
    assert after == before


def test_a_result_without_what_was_added_later_is_read(tmp_path):
    path = write_result(withdrawn(), tmp_path / "result.json")
    data = json.loads(path.read_text())
    for cause in data["verdict"]["causes"]:
        del cause["withdrawn"], cause["event"]
    del data["verdict"]["hints"], data["gain"]["placebo_parameters"], data["gain"]["extension_parameters"]
    del data["discovery"]["fits"], data["discovery"]["tried"]
    for name in ("extension", "parameters", "step", "first_look_compared"):
        del data["discovery"][name]
    for place in data["discovery"]["places"]:
        del place["unit"], place["time"], place["waveform"], place["explained"]
    path.write_text(json.dumps(data))
    after = read_result(path)
    assert not any(cause.withdrawn or cause.event for cause in after.verdict.causes)
    assert after.discovery.places[0].waveform == []


def test_what_is_no_number_is_null(tmp_path):
    path = write_result(result(), tmp_path / "result.json")
    assert "NaN" not in path.read_text()
    held_out = json.loads(path.read_text())["diagnosis"]["recordings"][1]
    assert held_out["channels"][0]["after"] == {"rms": None, "E": None, "chi2_per_sample": None}


def test_stages_and_channels_are_paired_by_name():
    paired = diagnose_recording(
        "trip",
        "fit",
        [fit(0.1, channel="P"), fit(0.2, channel="Q")],
        [fit(0.02, channel="Q")],
        [stage(0.9, "fault"), stage(0.1, "end")],
        [stage(0.3, "end")],
    )
    assert [c.after.rms if c.after else None for c in paired.channels] == [None, 0.02]
    assert [s.after.share if s.after else None for s in paired.stages] == [None, 0.3]


def test_a_verdict_is_one_of_five():
    with pytest.raises(ValidationError, match="within-noise"):
        Verdict(kind="perhaps", text="")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema_version": 2}, "schema_version is 2. Allowed: 1. Run the case again"),
        ({"verdict": {"kind": "perhaps", "text": ""}}, r"key verdict.kind"),
        ({"extra": 1}, r"key extra"),
    ],
)
def test_other_files_are_refused(tmp_path, change, message):
    path = write_result(result(), tmp_path / "result.json")
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=message):
        read_result(path)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="cannot be read as JSON"):
        read_result(tmp_path / "none.json")
    (tmp_path / "list.json").write_text("[]")
    with pytest.raises(InputError, match="schema_version is None"):
        read_result(tmp_path / "list.json")
    with pytest.raises(InputError, match="cannot be written"):
        write_result(result(), tmp_path / "no" / "result.json")
