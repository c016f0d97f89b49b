"""Output of PSCAD/EMTDC."""

import pytest
from hypothesis import given

import errorscreen as es
from errorscreen.data import read_recording
from errorscreen.exceptions import InputError
from tests.data.readers.shared_rows import BASES, COLUMNS, TIME, P, V, bounded, check, damages, survives

INF = (
    'PGB(1) Output Desc="V" Group="Main" Max=2.0 Min=-2.0 Units="kV"\n'
    'PGB(2) Output Desc="P" Group="Main" Max=2.0 Min=-2.0 Units="MW"\n'
)


def write(folder, inf=INF, head="!\n", rows=100):
    (folder / "run.inf").write_text(inf)
    for number, values in enumerate((V, P), start=1):
        lines = [f"  {t:.6E}  {x:.9E}" for t, x in zip(TIME, values, strict=True)][
            : rows if number > 1 else None
        ]
        (folder / f"run_{number:02}.out").write_text(head + "\n".join(lines) + "\n")
    return folder / "run.inf"


@pytest.mark.parametrize("head", ["! \n", "\n", "", " time channels\n"])
def test_files_of_a_run_are_joined(tmp_path, head):
    path = write(tmp_path, head=head)
    check(read_recording(path, COLUMNS, **BASES))
    check(es.read(path, **BASES))  # names and units are those of the file


def test_equal_names_get_their_group_or_a_number(tmp_path):
    path = write(tmp_path, INF.replace('"P" Group="Main"', '"V" Group="Grid"'))
    columns = {"V": "Main.V", "P": {"column": "Grid.V", "unit": "MW"}}
    with pytest.raises(InputError, match="all readings|the unit of 'P'|unknown") as told:
        read_recording(path, {"V": "V"}, **BASES)
    assert "Main.V, Grid.V" in str(told.value)
    check(read_recording(path, columns, **BASES))
    path = write(tmp_path, INF.replace('"P"', '"V"'))
    check(read_recording(path, {"V": "Main.V", "P": "Main.V (2)"}, **BASES))


def test_a_file_that_ends_early_ends_the_recording(tmp_path):
    rec = read_recording(write(tmp_path, rows=80), COLUMNS, **BASES)
    check(rec)
    assert len(rec.time) == 80
    assert any("80 rows that all of them have" in note for note in rec.assumptions)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p.with_name("run_02.out").unlink(), "hold 1 channels, but 2 are named"),
        (
            lambda p: p.with_name("run_02.out").write_text("!\n0 1\n1 2 3\n2 2"),
            "line 3: the line has 3 numbers",
        ),
        (lambda p: p.with_name("run_02.out").write_text("!\n0 1\n1 x\n"), "holds texts among the numbers"),
        (lambda p: p.with_name("run_02.out").write_text("!\n0 1\n7 1\n"), "its time differs"),
        (lambda p: p.write_text(INF.replace("(2)", f"({'2' * 5000})")), "hold 2 channels, but 1 are named"),
        (lambda p: [q.unlink() for q in p.parent.glob("*.out")], "the numbers run_01.out are missing"),
    ],
)
def test_files_that_do_not_fit_are_refused(tmp_path, change, message):
    path = write(tmp_path)
    change(path)
    with pytest.raises(InputError, match=message):
        read_recording(path, COLUMNS, **BASES)


def test_keys_of_text_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="header does not apply to the format 'pscad'"):
        read_recording(write(tmp_path), COLUMNS, header=["time"], **BASES)


@bounded
@given(damages)
def test_damage(tmp_path_factory, damage):
    path = write(tmp_path_factory.mktemp("run"))
    survives(path, INF.encode(), damage)
    path = write(path.parent)
    out = path.with_name("run_01.out")
    content = out.read_bytes()[: damage[0]]
    for at, byte in damage[1]:
        content = content[: at % 4000] + bytes([byte]) + content[at % 4000 + 1 :]
    out.write_bytes(content)
    survives(path, INF.encode(), (len(INF), []))
