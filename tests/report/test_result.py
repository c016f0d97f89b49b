import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest

from errorscreen.exceptions import InputError
from errorscreen.report import read_result, write_result
from errorscreen.report.html_report import render_report
from errorscreen.report.result import result_schema, write_json_schema
from tests.report.samples import found, gain, result, withdrawn

OLD = Path(__file__).parent
DOCUMENTED = Path(__file__).resolve().parents[2] / "docs" / "result_schema.json"


def test_the_documented_schema_is_the_one_in_use(tmp_path):
    """After a change of the classes: errorscreen.report.result.write_json_schema(...)."""
    written = write_json_schema(tmp_path / "schema.json").read_text()
    assert DOCUMENTED.read_text(encoding="utf-8") == written


def test_keys_of_the_schema_are_described_by_the_docstrings():
    schema = result_schema()
    gains = schema["$defs"]["Gain"]["properties"]
    assert gains["baseline"]["description"] == gains["extended"]["description"] != ""
    assert "most probable first" in schema["$defs"]["Diagnosis"]["properties"]["causes"]["description"]
    assert "observations" not in schema["$defs"]["Diagnosis"]["properties"]


@pytest.mark.parametrize("one", [result(), found(), withdrawn()])
def test_a_result_fits_the_schema(tmp_path, one):
    data = json.loads(write_result(one, tmp_path / "result.json").read_text())
    jsonschema.Draft202012Validator(result_schema()).validate(data)
    assert data["schema_version"] == 2
    del data["diagnosis"]
    with pytest.raises(jsonschema.ValidationError, match="'diagnosis' is a required property"):
        jsonschema.validate(data, result_schema())


@pytest.mark.parametrize("before", [result(), found(), withdrawn(), found(gain=gain(placebo=None))])
def test_reading_gives_what_was_written(before, tmp_path):
    path = write_result(before, tmp_path / "result.json")
    again = write_result(read_result(path), tmp_path / "again.json")
    assert path.read_bytes() == again.read_bytes()


def test_numbers_that_do_not_exist_are_null(tmp_path):
    path = write_result(result(), tmp_path / "result.json")
    assert "NaN" not in path.read_text()
    held_out = json.loads(path.read_text())["models"][1]["channels"][1]
    assert (held_out["rms"], held_out["E"], held_out["chi2_per_sample"]) == (None, None, None)


def test_results_describe_themselves_briefly():
    one = withdrawn()
    for shown in (one, one.diagnosis):
        assert len(repr(shown)) < 200
        assert "unknown" in repr(shown)
        assert "withdrawn" in shown.summary()
        assert shown.summary() in shown._repr_html_().replace("&#x27;", "'")
    assert one.to_frame().loc[("nominal", "trip", "P"), "rms"] == 0.1
    assert one.diagnosis.to_frame().loc["exciter", "withdrawn"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema_version": 3}, "schema_version is 3. Allowed: 1 or 2. Run the case again"),
        ({"hints": 5}, "key hints"),
        ({"diagnosis": {}}, "key diagnosis.verdict"),
        ({"schema_version": 1}, "no result of schema version 1"),
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


def test_a_verdict_is_one_of_five(tmp_path):
    odd = found()
    odd = replace(
        odd, diagnosis=replace(odd.diagnosis, verdict=replace(odd.diagnosis.verdict, kind="perhaps"))
    )
    with pytest.raises(InputError, match="within-noise"):
        read_result(write_result(odd, tmp_path / "result.json"))


@pytest.mark.parametrize(
    ("name", "kind", "label"),
    [
        ("parameters", "parameters", None),
        ("named", "effect", "extended"),
        ("withdrawn", "unknown", "parameters only"),
    ],
)
def test_results_of_version_1_are_read_and_reported(name, kind, label):
    """Files that version 0.1.0.dev of the package wrote."""
    old = json.loads((OLD / f"version1_{name}.json").read_text(encoding="utf-8"))
    new = read_result(OLD / f"version1_{name}.json")
    assert new.schema_version == 2
    assert new.diagnosis.final.kind == kind
    assert [r.name for r in new.recordings] == [r["name"] for r in old["data"]]
    assert new.models[0].channel("trip", "P").rms == 0.1
    assert [m.label for m in new.models[1:]] == [m["label"] for m in old["calibration"]["methods"]]
    assert new.calibration[0].parameters[0].value == 1.2
    assert label is None or new.diagnosis.model(label).channel("second trip", "P").unit == "pu"
    causes = old["verdict"]["causes"]
    assert len(new.diagnosis.causes) == max(1, len(causes))
    for cause, before in zip(new.diagnosis.causes, causes, strict=False):
        assert (cause.name, cause.probability, cause.withdrawn) == tuple(
            before[key] for key in ("name", "probability", "withdrawn")
        )
        assert [p.value for p in cause.parameters] == [p["value"] for p in before["parameters"]]
    assert old["verdict"]["text"] in render_report(new)
