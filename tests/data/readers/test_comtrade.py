"""COMTRADE records, written here by the definition of the standard."""

import struct
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import errorscreen as es
from errorscreen.cases import load_case
from errorscreen.data import read_recording
from errorscreen.data.guess_file import guess_file
from errorscreen.data.readers.comtrade import read_comtrade_table
from errorscreen.exceptions import DataWarning, InputError, MissingExtraError

BASES = {"base_mva": 100.0, "base_kv": 20.0, "f_nominal": 50.0}
WAVEFORMS = {"voltage": ["VA", "VB", "VC"], "current": ["IA", "IB", "IC"]}
DIP = 0.4
#: before and after the dip: V in pu, angle of the voltage in degrees, P and Q in pu
BEFORE, AFTER = (1.0, 30.0, 0.8, 0.1), (0.7, 20.0, 0.5, -0.05)


def waves(time, f=50.0, harmonics=0.0):
    """Three voltages from phase to neutral in kV and three currents in kA."""
    values = {}
    for name, shift in (("A", 0.0), ("B", -2 * np.pi / 3), ("C", 2 * np.pi / 3)):
        for kind in "VI":
            parts = []
            for V, degrees, P, Q in (BEFORE, AFTER):
                angle = np.deg2rad(degrees)
                size, turn = 20.0 / np.sqrt(3) * V, angle
                if kind == "I":
                    size, turn = 100.0 / (np.sqrt(3) * 20.0 * V) * np.hypot(P, Q), angle - np.arctan2(Q, P)
                phase = 2 * np.pi * f * time + turn + shift
                wave = np.sqrt(2) * size * np.cos(phase)
                wave += harmonics * np.sqrt(2) * size * (np.cos(5 * phase) + np.cos(7 * phase + 1.0))
                parts.append(wave)
            values[f"{kind}{name}"] = np.where(time < DIP, *parts)
    return values


def write(
    folder,
    values,
    time,
    *,
    revision=1999,
    kind="BINARY",
    cff=False,
    rates=None,
    ratio=None,
    n_status=3,
    names=None,
    units=("kV", "kA"),
    stamps=None,
    missing=(),
    encoding="utf-8",
    phases=None,
    skews=(),
    tail="",
):
    """Write a record: channels in primary kV and kA, or in secondary V and A with a `ratio` of transformers."""
    n, names = len(time), names or list(values)
    lines = ["PLANT,DFR,1999" if revision == 1999 else "PLANT,DFR" if revision == 1991 else "PLANT,DFR,2013"]
    lines.append(f"{len(names) + n_status},{len(names)}A,{n_status}D")
    stored = []
    phases, skews = (
        phases or [name[-1] for name in names],
        {**dict.fromkeys(range(len(names)), 0), **dict(skews)},
    )
    for k, (name, x) in enumerate(zip(names, values.values(), strict=True), start=1):
        own = "I" in (name[0], name.split()[-1][0])
        unit, primary, secondary, ps = units[own], 1, 1, "P"
        if ratio is not None:
            unit, ps = ("V", "A")[own], "S"
            primary, secondary = ratio[own]
            x = 1e3 * x * secondary / primary
        top = {"BINARY": 32767, "BINARY32": 2**31 - 1}.get(kind, 32767)
        a, b = (1.0, 0.0) if kind == "FLOAT32" else (np.abs(x).max() / top, 0.0)
        stored.append(np.asarray(x if kind == "FLOAT32" else np.round((x - b) / a)))
        last = f",{primary},{secondary},{ps}" if revision > 1991 else ""
        middle = f"{unit},{a:.12g},{b},{skews[k - 1]:g},-32767,32767"
        lines.append(f"{k},{name},{phases[k - 1]},UNIT,{middle}{last}{tail}")
    lines += [f"{k},S{k},,,0" if revision > 1991 else f"{k},S{k},0" for k in range(1, n_status + 1)]
    rates = [(1 / (time[1] - time[0]), n)] if rates is None else rates
    lines += ["50", str(len(rates) if rates[0][0] else 0), *(f"{r:.9g},{last}" for r, last in rates)]
    lines += ["03/05/2026,10:00:00.000000", "03/05/2026,10:00:00.400000", kind]
    lines += ["1"] if revision > 1991 else []
    lines += ["+0h00,+0h00", "0,0"] if revision == 2013 else []
    stamps = np.round(1e6 * time).astype(int) if stamps is None else stamps
    mark = {"BINARY": -(2**15), "BINARY32": -(2**31), "FLOAT32": np.finfo(np.float32).min}.get(kind, 99999)
    for channel, rows in missing:
        stored[channel][rows] = mark
    if kind == "ASCII":
        rows = zip(stamps, *stored, strict=True)
        text = "\r\n".join(
            ",".join([str(k), str(s), *(str(int(x)) for x in row), *"0" * n_status])
            for k, (s, *row) in enumerate(rows, start=1)
        )
        data = text.encode()
    else:
        code = {"BINARY": "h", "BINARY32": "i", "FLOAT32": "f"}[kind]
        words = -(-n_status // 16)
        pack = struct.Struct(f"<II{len(names)}{code}{words}H")
        cast = float if kind == "FLOAT32" else int
        data = b"".join(
            pack.pack(k, s, *map(cast, row), *[0] * words)
            for k, (s, *row) in enumerate(zip(stamps, *stored, strict=True), start=1)
        )
    head = ("\r\n".join(lines) + "\r\n").encode(encoding)
    if cff:
        path = folder / "record.cff"
        size = "" if kind == "ASCII" else f": {len(data)}"
        parts = [b"--- file type: CFG ---\r\n", head, b"--- file type: INF ---\r\n\r\n"]
        parts += [
            b"--- file type: HDR ---\r\n\r\n",
            f"--- file type: DAT {kind}{size} ---\r\n".encode(),
            data,
        ]
        path.write_bytes(b"".join(parts))
        return path
    path = folder / "record.cfg"
    path.write_bytes(head)
    (folder / "record.dat").write_bytes(data)
    return path


def check(rec, tolerance=1e-3, f=50.0, around=0.021):
    """V, angle, P and Q as they are, outside of a period around the dip."""
    assert rec.event_time == pytest.approx(DIP, abs=0.011)
    t = rec.time
    parts = ((t < DIP - around, BEFORE), ((t > DIP + around) & (t <= t[-1]), AFTER))
    turned = []
    for part, (V, degrees, P, Q) in parts:
        for name, right in (("V", V), ("P", P), ("Q", Q)):
            assert np.abs(rec.channel(name).values[part] - right).max() < tolerance, name
        turned.append(
            np.degrees(rec.channel("angle").values[part] - 2 * np.pi * (f - 50.0) * t[part]) - degrees
        )
    level = np.round(np.mean(turned[0]) / 360.0) * 360.0
    assert max(np.abs(one - level).max() for one in turned) < np.degrees(tolerance)


TIME = np.arange(1280) / 1600.0


@pytest.mark.parametrize("revision", [1991, 1999, 2013])
@pytest.mark.parametrize("kind", ["ASCII", "BINARY", "BINARY32", "FLOAT32"])
def test_every_kind_of_data_gives_the_same_recording(tmp_path, revision, kind):
    check(read_recording(write(tmp_path, waves(TIME), TIME, revision=revision, kind=kind), None, **BASES))


@pytest.mark.parametrize("kind", ["ASCII", "BINARY", "BINARY32", "FLOAT32"])
def test_one_file_may_hold_all_parts(tmp_path, kind):
    path = write(tmp_path, waves(TIME), TIME, revision=2013, kind=kind, cff=True)
    check(es.read(path, **BASES))


@pytest.mark.parametrize("samples", [8, 16, 33, 80, 256])
@pytest.mark.parametrize("f", [48.0, 50.05, 52.0])
def test_phasors_off_the_nominal_frequency(tmp_path, samples, f):
    time = np.arange(int(0.8 * 50 * samples)) / (50.0 * samples)
    path = write(tmp_path, waves(time, f), time, kind="FLOAT32")
    check(read_recording(path, None, **BASES), 5e-3 if abs(f - 50) > 1 else 1e-3, f)


@pytest.mark.parametrize(("method", "around"), [("cycle", 0.011), ("P", 0.021), ("M", 0.081)])
def test_harmonics_do_not_matter(tmp_path, method, around):
    time = np.arange(3200) / 3200.0
    path = write(tmp_path, waves(time, 50.05, harmonics=0.05), time, kind="FLOAT32")
    waveforms = {"voltage": ["VA", "VB", "VC"], "current": ["IA", "IB", "IC"], "method": method}
    rec = read_recording(path, None, waveforms=waveforms, event_time=DIP - around, **BASES)
    t = rec.time
    for part, right in ((t < DIP - around, BEFORE), (t > DIP + around, AFTER)):
        for name, value in zip("VPQ", (right[0], *right[2:]), strict=True):
            assert np.abs(rec.channel(name).values[part] - value).max() < 5e-3


def test_secondary_values_are_multiplied_by_the_ratios(tmp_path):
    path = write(tmp_path, waves(TIME), TIME, ratio=((20.0, 0.1), (4000.0, 1.0)))
    check(read_recording(path, None, **BASES))


def test_voltages_between_phases(tmp_path):
    values = waves(TIME)
    pairs = {f"V{a}{b}": values[f"V{a}"] - values[f"V{b}"] for a, b in ("AB", "BC", "CA")}
    path = write(tmp_path, {**pairs, **{n: v for n, v in values.items() if n[0] == "I"}}, TIME)
    waveforms = {"voltage": [*pairs], "current": ["IA", "IB", "IC"], "line_to_line": True}
    check(read_recording(path, None, waveforms=waveforms, **BASES))


def test_interchanged_phases_are_refused(tmp_path):
    values = waves(TIME)
    values["VB"], values["VC"] = values["VC"], values["VB"]
    with pytest.raises(
        InputError, match=r"negative sequence.*Interchange two of the voltages: \['VA', 'VC', 'VB'\]"
    ):
        read_recording(write(tmp_path, values, TIME), None, **BASES)


def test_one_reversed_current_transformer_is_warned_of(tmp_path):
    values = waves(TIME)
    values["IB"] = -values["IB"]
    with pytest.warns(DataWarning, match="one current transformer reversed"):
        read_recording(write(tmp_path, values, TIME), None, **BASES)


def test_several_rates(tmp_path):
    time = np.concatenate([np.arange(800) / 1600.0, 0.5 + np.arange(120) / 400.0])
    path = write(tmp_path, waves(time), time, rates=[(1600.0, 801), (400.0, 920)])
    check(read_recording(path, None, **BASES))


@pytest.mark.parametrize("kind", ["ASCII", "BINARY"])
def test_stamps_alone(tmp_path, kind):
    time = np.concatenate([np.arange(800) / 1600.0, 0.5 + np.arange(120) / 400.0])
    check(read_recording(write(tmp_path, waves(time), time, rates=[(0.0, 920)], kind=kind), None, **BASES))


def test_stamps_win_over_a_wrong_rate(tmp_path):
    path = write(tmp_path, waves(TIME), TIME, rates=[(1500.0, len(TIME))])
    rec = read_recording(path, None, **BASES)
    check(rec)
    assert any("the stamps were taken" in note for note in rec.assumptions)


@pytest.mark.parametrize("kind", ["ASCII", "BINARY"])
def test_a_record_that_ends_early_ends_there(tmp_path, kind):
    path = write(tmp_path, waves(TIME), TIME, kind=kind)
    data = path.with_suffix(".dat").read_bytes()
    path.with_suffix(".dat").write_bytes(data[: 3 * len(data) // 4])
    rec = read_recording(path, None, **BASES)
    check(rec)
    assert rec.time[-1] < 0.61
    assert any("of 1280 that the configuration states" in note for note in rec.assumptions)


@pytest.mark.parametrize("kind", ["ASCII", "BINARY", "BINARY32", "FLOAT32"])
def test_missing_samples_are_gaps(tmp_path, kind):
    path = write(tmp_path, waves(TIME), TIME, kind=kind, missing=[(0, slice(900, 910))])
    assert np.isnan(read_comtrade_table(path)[0].columns["VA"]).sum() == 10
    V = read_recording(path, None, **BASES).channel("V").values
    assert 2 <= np.isnan(V).sum() <= 4
    assert np.nanmin(V) > 0.69


def test_a_trend_record_of_rms_values(tmp_path):
    time = np.arange(40) / 50.0
    values = {name: np.where(time < DIP, a, b) for name, a, b in (("U", 20.0, 14.0), ("P", 80.0, 50.0))}
    path = write(tmp_path, values, time, units=("kV", "kA"))
    rec = read_recording(path, {"V": "U", "P": {"column": "P", "unit": "kV"}} | {"P": "P"}, **BASES)
    assert rec.event_time == pytest.approx(DIP)
    assert rec.initial(["V"])["V"] == pytest.approx(1.0, abs=1e-4)


def test_names_with_commas_equal_names_and_old_encodings(tmp_path):
    values = waves(TIME)
    names = ["Spannung, Süd A", "Spannung, Süd B", "Spannung, Süd C", "I", "I", "I"]
    path = write(tmp_path, values, TIME, names=names, encoding="latin-1")
    table, _, found, _ = read_comtrade_table(path)
    assert [*table.columns] == ["time", *names[:3], "I", "I (2)", "I (3)"]
    assert [channel.phase for channel in found.channels] == ["A", "B", "C", "I", "I", "I"]


def test_columns_of_other_formats_are_refused(tmp_path):
    with pytest.raises(InputError, match="delimiter does not apply to the format 'comtrade'"):
        read_recording(write(tmp_path, waves(TIME), TIME), None, delimiter=";", **BASES)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p.with_suffix(".dat").unlink(), "the data record.dat are missing"),
        (lambda p: p.with_suffix(".dat").write_bytes(b""), "the data hold no sample"),
        (lambda p: p.write_text("a,b,1999\n1,x,y\n"), "does not state the numbers of channels"),
        (
            lambda p: p.write_text("\n".join(p.read_text().splitlines()[:5])),
            "the configuration ends too early",
        ),
        (
            lambda p: p.write_text(p.read_text().replace("BINARY", "TEXT")),
            "the data are 'TEXT'.*ASCII, BINARY",
        ),
        (lambda p: p.write_text(p.read_text().replace("1600,", "x,")), "'x, 1280' are no numbers"),
        (lambda p: p.write_text(p.read_text().replace("1600,1280", "1600")), "a rate lacks its last sample"),
        (lambda p: p.write_text(p.read_text().replace("1600,1280", "1600,1e300")), "'1600,1e300' is no rate"),
        (
            lambda p: p.write_text(p.read_text().replace("\n50\n1\n", f"\n50\n{'9' * 400}\n")),
            "'9{400}' are no numbers",
        ),
        (
            lambda p: p.write_text(p.read_text().replace(",kV,", ",bar,")),
            "three voltages of the phases A, B and C",
        ),
    ],
)
def test_unusable_records_are_explained(tmp_path, change, message):
    path = write(tmp_path, waves(TIME), TIME)
    change(path)
    with pytest.raises(InputError, match=message):
        read_recording(path, None, "comtrade", **BASES)


@pytest.mark.parametrize("changes", [(",1999", ",²"), ("\n50\n", "\n-50\n")])
def test_a_revision_or_a_frequency_that_is_none_does_not_matter(tmp_path, changes):
    path = write(tmp_path, waves(TIME), TIME)
    path.write_text(path.read_text().replace(*changes))
    check(read_recording(path, None, **BASES))
    assert guess_file(path).keys["f_nominal"].value == 50.0


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "comtrade", None)
    with pytest.raises(MissingExtraError, match=r"errorscreen\[comtrade\]"):
        read_recording(write(tmp_path, waves(TIME), TIME), None, **BASES)


@pytest.mark.parametrize("kind", ["ASCII", "BINARY"])
def test_a_record_of_1991_has_marks_of_its_own(tmp_path, kind):
    mark = {"ASCII": 99999, "BINARY": -1}[kind]
    values = {"U": np.array([20.0, 19.0, 18.0, 17.0]), "P": np.array([80.0, 79.0, 78.0, 77.0])}
    path = write(tmp_path, values, np.arange(4) / 50.0, kind=kind, revision=1991, missing=[(0, [2])])
    if kind == "BINARY":  # written with the mark of later revisions
        data = bytearray(path.with_suffix(".dat").read_bytes())
        row = len(data) // 4
        assert data[2 * row + 8 : 2 * row + 10] == struct.pack("<h", -(2**15))
        data[2 * row + 8 : 2 * row + 10] = struct.pack("<h", mark)
        path.with_suffix(".dat").write_bytes(data)
    table = read_comtrade_table(path)[0]
    np.testing.assert_array_equal(np.isnan(table.columns["U"]), [False, False, True, False])
    assert np.isfinite(table.columns["P"]).all()


@pytest.mark.parametrize("kind", ["ASCII", "BINARY"])
def test_rates_count_where_a_stamp_is_missing(tmp_path, kind):
    stamps = np.round(1e6 * TIME).astype(np.int64)
    stamps[100] = 2**32 - 1
    path = write(tmp_path, waves(TIME), TIME, kind=kind, stamps=stamps)
    np.testing.assert_allclose(read_comtrade_table(path)[1], TIME, atol=1e-9)
    check(read_recording(path, None, **BASES))


def test_the_data_alone_are_refused_with_the_way_through(tmp_path):
    path = write(tmp_path, waves(TIME), TIME)
    with pytest.raises(InputError, match=r"holds the data of a COMTRADE record.*Give the \.cfg file"):
        read_recording(path.with_suffix(".dat"), None, **BASES)


def test_too_few_samples_in_a_period_are_refused(tmp_path):
    time = np.arange(160) / 200.0
    with pytest.raises(InputError, match="4 samples in a period of 50 Hz.*give columns instead of waveforms"):
        read_recording(write(tmp_path, waves(time), time), None, **BASES)


def test_waveforms_in_a_text_file(tmp_path):
    values = waves(TIME)
    rows = zip(TIME, *values.values(), strict=True)
    path = tmp_path / "waves.csv"
    path.write_text(
        ",".join(["time", *values]) + "\n" + "\n".join(",".join(map(repr, map(float, r))) for r in rows)
    )
    waveforms = {
        "voltage": ["VA", "VB", "VC"],
        "current": ["IA", "IB", "IC"],
        "voltage_unit": "kV",
        "current_unit": "kA",
    }
    check(read_recording(path, None, waveforms=waveforms, **BASES))
    with pytest.raises(InputError, match="the unit of VA, VB, VC is 'not stated'.*Give voltage_unit"):
        read_recording(path, None, waveforms={"voltage": ["VA", "VB", "VC"]}, **BASES)


def test_a_case_file_reads_a_record(tmp_path):
    write(tmp_path, waves(TIME), TIME)
    (tmp_path / "case.toml").write_text(
        '[recording]\npath = "record.cfg"\nbase_mva = 100\nbase_kv = 20\nf_nominal = 50\n'
        '[recording.waveforms]\nvoltage = ["VA", "VB", "VC"]\ncurrent = ["IA", "IB", "IC"]\nrate = 200\n'
        '[device]\ntype = "synchronous_machine"\n'
    )
    rec = load_case(tmp_path / "case.toml").load_recording()
    check(rec)
    assert np.median(np.diff(rec.time)) == pytest.approx(0.005)


@given(st.data())
def test_any_damage_is_told_or_harmless(tmp_path_factory, data):
    """A configuration with some characters changed ends in a recording or in an explanation."""
    folder = tmp_path_factory.mktemp("damaged")
    path = write(folder, waves(TIME[:400]), TIME[:400])
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 5))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(content))
    try:
        table, time, _, _ = read_comtrade_table(path)
        assert all(len(column) == len(time) for column in table.columns.values())
    except InputError:
        pass
