"""Fuzz the readers of files: ``python benchmarks/fuzz_readers.py [READER] [SECONDS]``; all readers where none is named.

Small valid files of every kind are damaged under the guidance of their coverage (``pip install atheris``). Each of them
is read with the right options, or looked into as `errorscreen init` does. Only `InputError` and `MissingExtraError` may
escape, within 20 s and 4 GiB. What else escapes is printed once for each place; its input is kept in a folder, which is
named. MATLAB and Parquet files are read by the program of their own process, in a fork of this one.
"""

# ruff: noqa: E402  (only what is imported under the instrumentation guides the damage)
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace

import atheris

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}

with atheris.instrument_imports(
    include=["errorscreen.data", "errorscreen.models.dyr", "errorscreen.models.raw", "errorscreen.workflow"]
):
    from errorscreen.data import read_recording
    from errorscreen.data.readers import apart, child
    from errorscreen.models.dyr import read_dyr
    from errorscreen.models.raw import read_raw
    from errorscreen.workflow.init_case import init_case

import numpy as np
import pandas as pd

from errorscreen.data import Recording
from errorscreen.exceptions import InputError, MissingExtraError
from tests.data.readers import test_comtrade as comtrade
from tests.data.readers import test_excel as excel
from tests.data.readers import test_matlab as matlab
from tests.data.readers import test_pscad as pscad
from tests.models.raw_texts import raw_text

#: s for one file, and bytes of address space
LONGEST, MEMORY = 20, 2**32
#: between the files of one recording
CUT = b"\n=8<=8<=\n"
BASES = {"base_mva": 100.0, "base_kv": 20.0, "f_nominal": 50.0}
COLUMNS = {"V": {"column": "V", "unit": "kV"}, "P": {"column": "P", "unit": "MW"}}
TIME = np.arange(40) * 0.02
V = np.where(TIME < 0.4, 20.0, 14.0) + 1e-3 * np.sin(9e4 * TIME)
P = np.where(TIME < 0.4, 80.0, 50.0) + 1e-2 * np.sin(7e4 * TIME)
#: files of a recording in the order of the parts of an input, and the options it is read with
Seed = tuple[dict[str, bytes], dict]


def rows(*columns, sep=",") -> str:
    return "\n".join(sep.join(map(str, row)) for row in zip(*columns, strict=True)) + "\n"


def numbers(values) -> list[str]:
    return [f"{x:.4f}" for x in values]


def text_seeds() -> Iterator[tuple[str | bytes, dict]]:
    t, v, p = map(numbers, (TIME, V, P))
    plain = "time,V,P\n" + rows(t, v, p)
    yield plain, {}
    yield plain.replace(",", ";").replace(".", ","), {"decimal": ","}
    yield "# logger\n! two\n" + plain.replace(",", "  "), {}
    yield "sep=;\n" + plain.replace(",", ";"), {}
    yield plain.replace("\n", "\ns,kV,MW\n", 1), {"missing": ["off"], "held": "keep"}
    yield (
        "a,Plant B,Plant B\n" + plain,
        {"header_rows": 2, "time": "a|time", "columns": _prefixed("Plant B|")},
    )
    yield "title\n\n" + rows(t, v, p, sep="   "), {
        "header": ["time", "V", "P"], "skip_rows": 2, "delimiter": "whitespace"
    }  # fmt: skip
    yield plain.encode("utf-16"), {}
    yield plain.replace("time", "zëit").encode("latin-1"), {"encoding": "latin-1", "time": "zëit"}
    stamps = pd.Timestamp("2026-10-25T02:59:59.600+02:00") + pd.to_timedelta(TIME, unit="s")
    yield "time,V,P\n" + rows([s.isoformat() for s in stamps], v, p), {"time_unit": "iso"}
    yield (
        "time,V,P\n" + rows([f"{s:%d-%b-%Y %H:%M:%S.%f}" for s in stamps], v, p),
        {"time_format": "%d-%b-%Y %H:%M:%S.%f"},
    )
    yield (
        "Date,Time,V,P\n"
        + rows([f"{s:%Y-%m-%d}" for s in stamps], [f"{s:%H:%M:%S.%f}" for s in stamps], v, p),
        {"time": ["Date", "Time"]},
    )
    yield "SOC,FRACSEC,V,P\n" + rows([1777802400] * 40, [round(1e6 * t) for t in TIME], v, p), {
        "time": ["SOC", "FRACSEC"], "time_base": 1e6
    }  # fmt: skip
    status = ["8000" if k == 30 else "0000" for k in range(40)]
    yield "time,V,P,STAT\n" + rows(t, v, p, status), {"quality": {"column": "STAT", "good": ["0000"]}}
    again = [*t[:20], t[20], *t[20:39]]
    for on_duplicate in ("last", "keep-step", "mean"):
        yield "time,V,P\n" + rows(again, v, p), {"on_duplicate": on_duplicate, "on_backward": "drop"}
    yield "time,V,P\n" + rows(t[::-1], v, p), {"on_backward": "sort"}
    phases = {
        f"{kind}{phase}": size * np.exp(1j * (0.3 + TIME**2 - 2 * np.pi * k / 3))
        for kind, size in (("V", V / np.sqrt(3)), ("I", P / 30))
        for k, phase in enumerate("ABC")
    }
    names = {"voltage": ["VA", "VB", "VC"], "current": ["IA", "IB", "IC"]}
    units = {"voltage_unit": "kV", "current_unit": "kA"}
    texts = ([f"{z.real:.4f}{z.imag:+.4f}j" for z in one] for one in phases.values())
    yield ",".join(["time", *phases]) + "\n" + rows(t, *texts), {"phasors": names | units, "columns": None}
    polar = [numbers(part) for z in phases.values() for part in (np.abs(z), np.angle(z, deg=True))]
    heads = [f"{name}_{part}" for name in phases for part in ("mag", "ang")]
    pairs = {key: [[f"{name}_mag", f"{name}_ang"] for name in some] for key, some in names.items()}
    yield ",".join(["time", *heads]) + "\n" + rows(t, *polar), {
        "phasors": pairs | units | {"angle_unit": "deg"}, "columns": None
    }  # fmt: skip
    time_ = np.arange(120) / 400.0
    values = comtrade.waves(time_ + 0.2)
    yield ",".join(["time", *values]) + "\n" + rows(numbers(time_), *map(numbers, values.values())), {
        "waveforms": names | units, "columns": None
    }  # fmt: skip


def _prefixed(prefix: str) -> dict:
    return {role: {**one, "column": prefix + one["column"]} for role, one in COLUMNS.items()}


def csv_seeds(folder: Path) -> Iterator[Seed]:
    for text, options in text_seeds():
        yield {"a.csv": text if isinstance(text, bytes) else text.encode()}, options


def long_seeds(folder: Path) -> Iterator[Seed]:
    tags, good = ["V"] * 40 + ["P"] * 40, ["Good"] * 79 + ["Bad"]
    long = {"tag": "TagName", "value": "Value"}
    t, x = numbers([*TIME, *TIME]), numbers([*V, *P])
    head = "TagName,time,Value,Quality\n"
    yield {"a.csv": (head + rows(tags, t, x, good)).encode()}, {"long": long}
    mixed = sorted(zip(tags, t, x, good, strict=True), key=lambda row: row[1])
    quality = {"column": "Quality", "good": ["Good"]}
    yield {"a.csv": (head + rows(*zip(*mixed, strict=True))).encode()}, {
        "long": long, "quality": quality, "on_backward": "sort", "on_duplicate": "last"
    }  # fmt: skip


def comtrade_seeds(folder: Path) -> Iterator[Seed]:
    time_ = np.arange(240) / 400.0
    for kind in ("ASCII", "BINARY", "BINARY32", "FLOAT32"):
        for options in (
            {"revision": 1991},
            {"ratio": ((20.0, 0.1), (4000.0, 1.0))},
            {"cff": True, "revision": 2013},
        ):
            path = comtrade.write(folder, comtrade.waves(time_), time_, kind=kind, **options)
            parts = {path.name: path.read_bytes()}
            if path.suffix == ".cfg":
                parts["record.dat"] = path.with_suffix(".dat").read_bytes()
            yield parts, {"columns": None}
    values = {"V": V, "P": P}
    path = comtrade.write(folder, values, TIME, units=("kV", "kA"), kind="ASCII", rates=[(0.0, 40)])
    columns = {"V": "V", "P": {"column": "P", "unit": "MW"}}
    yield {p.name: p.read_bytes() for p in (path, path.with_suffix(".dat"))}, {"columns": columns}


def pscad_seeds(folder: Path) -> Iterator[Seed]:
    parts = {"run.inf": pscad.INF.encode()}
    for number, values in enumerate((V, P), start=1):
        parts[f"run_{number:02}.out"] = ("!\n" + rows(numbers(TIME), numbers(values), sep="  ")).encode()
    yield parts, {}


def excel_seeds(folder: Path) -> Iterator[Seed]:
    """Members of the archive, without the shell of zip, whose check sums would catch all damage."""
    stamps = (pd.Timestamp("2026-05-03") + pd.to_timedelta(TIME, unit="s")).to_pydatetime()
    for instants, options in ((TIME.tolist(), {}), (list(stamps), {"time_unit": "iso"})):
        cells = [("time", "V", "P"), *zip(instants, V.tolist(), P.tolist(), strict=True)]
        path = excel.write(folder / "a.xlsx", cells[:31])
        with zipfile.ZipFile(path) as archive:
            yield {one: archive.read(one) for one in archive.namelist()}, options | {"sheet": "data"}


def matlab_seeds(folder: Path) -> Iterator[Seed]:
    from scipy.io import savemat

    names = np.array(["time", "V", "P"], dtype=object)
    stamps = np.array([f"2026-05-03T10:00:{t:06.3f}" for t in TIME], dtype=object)
    odd = {
        "n": 3,
        "z": V + 1j,
        "b": V > 15,
        "text": "abc",
        "e": np.zeros((0, 3)),
        "cube": np.zeros((2, 3, 4)),
    }
    signals = np.empty((1, 2), dtype=[("values", object), ("dimensions", object), ("label", object)])
    signals[0, 0], signals[0, 1] = (V[:, None], 1.0, "V"), (P[:, None], 1.0, "P")
    of_out = {"time": "out.time", "columns": _prefixed("out.")}
    of_5 = (
        ({"time": TIME, "V": V, "P": P} | odd, {}),
        ({"data": np.stack([TIME, V, P], axis=1), "names": names}, {}),
        ({"time": stamps, "V": V, "P": P}, {"time_unit": "iso"}),
        ({"out": {"time": TIME[:, None], "signals": signals}, "int": np.arange(40, dtype=np.int16)}, of_out),
    )
    for k, (variables, options) in enumerate(of_5):
        path = folder / "a.mat"
        savemat(path, variables, do_compression=k == 3)
        yield {"a.mat": path.read_bytes() + (matlab.opaque("x", "timeseries") if k == 0 else b"")}, options
    of_73 = (
        ({"time": TIME, "V": V, "P": P, "text": "abc"}, {}),
        ({"s": {"t": TIME, "V": V, "P": P}}, {"time": "s.t", "columns": _prefixed("s.")}),
        ({"data": np.stack([TIME, V, P], axis=1), "names": ["time", "V", "P"]}, {}),
    )
    for variables, options in of_73:
        yield {"a.mat": matlab.write_73(folder / "b.mat", **variables).read_bytes()}, options


def parquet_seeds(folder: Path) -> Iterator[Seed]:
    path = folder / "a.parquet"
    stamps = pd.Timestamp("2026-05-03", tz="UTC") + pd.to_timedelta(TIME, unit="s")
    frame = pd.DataFrame({"time": TIME, "V": V, "P": P})
    typed = frame.assign(time=stamps, V=V.astype("float32"), P=pd.Categorical(P), text="a", whole=range(40))
    for one in (frame, typed, frame.convert_dtypes(), frame.drop(columns="time").set_index(stamps)):
        for compression in ("none", "snappy"):
            one.to_parquet(path, compression=compression)
            yield {"a.parquet": path.read_bytes()}, {}


def dyr_seeds(folder: Path) -> Iterator[Seed]:
    yield {"a.dyr": (ROOT / "examples" / "dyr" / "unit.dyr").read_bytes()}, {}


def raw_seeds(folder: Path) -> Iterator[Seed]:
    for revision in (33, 34, 35):
        yield {"a.raw": raw_text(revision).encode()}, {}


SEEDS: dict[str, Callable[[Path], Iterator[Seed]]] = {
    "csv": csv_seeds, "long": long_seeds, "comtrade": comtrade_seeds, "pscad": pscad_seeds, "excel": excel_seeds,
    "matlab": matlab_seeds, "parquet": parquet_seeds, "dyr": dyr_seeds, "raw": raw_seeds,
}  # fmt: skip


def forked(command: list[str], *, timeout: float, **_) -> SimpleNamespace:
    """In place of `subprocess.run`: the program of a reader's own process in a fork, which has all modules."""
    if not (pid := os.fork()):
        for one in (
            signal.SIGSEGV,
            signal.SIGABRT,
            signal.SIGBUS,
            signal.SIGFPE,
            signal.SIGILL,
            signal.SIGALRM,
        ):
            signal.signal(one, signal.SIG_DFL)
        code = 1
        try:
            child.main(*command[3:])
            code = 0
        finally:
            os._exit(code)
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            return SimpleNamespace(returncode=os.waitstatus_to_exitcode(status))
        time.sleep(5e-4)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    raise subprocess.TimeoutExpired(command, timeout)


class Target:
    """Reads what an input says, and counts."""

    def __init__(self, kind: str, seconds: float) -> None:
        self.kind, self.home = kind, Path(mkdtemp(prefix=f"fuzz-{kind}-"))
        self.work, self.corpus = self.home / "work", self.home / "corpus"
        self.work.mkdir()
        self.corpus.mkdir()
        self.seeds = [*SEEDS[kind](self.work)]
        for k, (parts, _) in enumerate(self.seeds):
            for number in range(2):
                (self.corpus / f"{k}-{number}").write_bytes(
                    bytes([2 * k + number]) + CUT.join(parts.values())
                )
        self.counts: Counter[str] = Counter()
        self.defects: Counter[str] = Counter()
        self.slowest, self.end = 0.0, time.monotonic() + seconds

    def __call__(self, data: bytes) -> None:
        chosen = data[0] if data else 0
        parts, options = self.seeds[chosen // 2 % len(self.seeds)]
        contents = [*data[1:].split(CUT, len(parts) - 1)]
        contents += [*parts.values()][len(contents) :]
        shutil.rmtree(self.work)
        self.work.mkdir()
        path = self._write(dict(zip(parts, contents, strict=True)))
        begin = time.monotonic()
        self._try(self._actions(path, options)[chosen % 2], data)
        self.counts["files"] += 1
        self.slowest = max(self.slowest, time.monotonic() - begin)
        if time.monotonic() > self.end:
            self._finish()

    def _write(self, parts: dict[str, bytes]) -> Path:
        if self.kind == "excel":
            path = self.work / "a.xlsx"
            with zipfile.ZipFile(path, "w") as archive:
                for name, content in parts.items():
                    archive.writestr(name, content)
            return path
        for name, content in parts.items():
            (self.work / name).write_bytes(content)
        return self.work / next(iter(parts))

    def _actions(self, path: Path, options: dict) -> tuple[Callable[[], object], Callable[[], object]]:
        if self.kind == "dyr":
            return lambda: read_dyr(path).unit(), lambda: _told(read_dyr(path)).check()
        if self.kind == "raw":
            return lambda: read_raw(path), lambda: _told(read_raw(path))
        given = {"columns": COLUMNS, "format": "csv" if self.kind == "long" else self.kind} | options | BASES
        return lambda: read_recording(path, **given), lambda: init_case(path, out=self.work / "case.toml")

    def _try(self, action: Callable[[], object], data: bytes) -> None:
        try:
            action()
            self.counts["read"] += 1
        except (InputError, MissingExtraError) as error:
            self.counts["refused"] += 1
            if "process that reads it ended" in error.what:
                self.counts["ended processes"] += 1
            elif "reading it took more" in error.what:
                self.counts["endless processes"] += 1
        except Exception as error:
            steps = [s for s in traceback.extract_tb(error.__traceback__) if "errorscreen" in s.filename]
            place = f"{type(error).__name__} at {Path(steps[-1].filename).name}:{steps[-1].lineno}"
            self.defects[place] += 1
            if self.defects[place] == 1:
                (self.home / f"defect-{len(self.defects)}").write_bytes(data)
                print(f"DEFECT {len(self.defects)} in {self.home}: {place}", flush=True)
                traceback.print_exc()

    def _finish(self) -> None:
        found = {**self.counts, "slowest_s": round(self.slowest, 2), "defects": dict(self.defects)}
        print(self.kind, json.dumps(found), flush=True)
        shutil.rmtree(self.home if not self.defects else self.corpus)
        os._exit(bool(self.defects))


def _told(file):
    file.table()
    file.summary()
    return file


def fuzz(kind: str, seconds: float) -> None:
    """Fuzz one reader; ends the process."""
    import resource

    if kind in ("matlab", "parquet"):
        import h5py  # noqa: F401
        import pyarrow.parquet  # noqa: F401
        import scipy.io  # noqa: F401

        apart.subprocess.run = forked
    warnings.simplefilter("ignore")
    # the picture of `init_case` takes longer than all else
    Recording.plot = lambda self, **_: SimpleNamespace(savefig=lambda *_, **__: None)
    target = Target(kind, seconds)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    largest = max(one.stat().st_size for one in target.corpus.iterdir())
    limits = (
        f"-timeout={LONGEST}",
        f"-max_len={2 * largest}",
        "-rss_limit_mb=0",
        "-verbosity=0",
        "-close_fd_mask=1",
    )
    atheris.Setup([sys.argv[0], *limits[:-1], f"-artifact_prefix={target.home}/", str(target.corpus)], target)
    atheris.Fuzz()


if __name__ == "__main__":
    SECONDS = float(sys.argv[2]) if len(sys.argv) > 2 else 240.0
    if len(sys.argv) > 1:
        fuzz(sys.argv[1], SECONDS)
    sys.exit(sum(subprocess.run([sys.executable, __file__, kind, str(SECONDS)]).returncode for kind in SEEDS))
