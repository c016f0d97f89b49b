"""Files that are complete or absent, carry a format name and a version, and run no code when they are read."""

from __future__ import annotations

import json
import math
import os
import secrets
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.exceptions import InputError, MissingExtraError

_HEADER = "errorscreen_header"
_Path = str | os.PathLike[str]
_Content = tuple[dict[str, NDArray[Any]], dict[str, Any]]


@contextmanager
def _replacing(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file beside `path` that takes its place when the block ends without an error."""
    # not tempfile: its files are private to the user, and a result should follow the user's umask
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as handle:
            yield handle
            handle.flush()
            os.fsync(handle.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(
            f"cannot be written: {error.strerror or error}",
            where=f"file {path}",
            allowed="a file in an existing folder that may be written to",
        ) from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def write_bytes_atomic(path: _Path, data: bytes) -> Path:
    """Write `data` to `path` completely or not at all; `InputError` if that is impossible."""
    path = Path(path)
    with _replacing(path) as handle:
        handle.write(data)
    return path


def write_text_atomic(path: _Path, text: str) -> Path:
    """Write `text` in UTF-8, otherwise as `write_bytes_atomic`."""
    return write_bytes_atomic(path, text.encode("utf-8"))


def to_jsonable(value: Any) -> Any:
    """Turn NumPy values, tuples, paths and mappings into JSON values; numbers that are not finite become None."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise InputError(f"key {key!r} cannot be written as JSON", allowed="keys that are text")
        return {str(key): to_jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_jsonable(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    raise InputError(
        f"a value of type {type(value).__name__} cannot be written as JSON",
        allowed="text, numbers, arrays of them, lists, mappings, None",
    )


def write_json_atomic(
    path: _Path, data: Any, *, format: str | None = None, version: int | None = None
) -> Path:
    """Write `data`, which `to_jsonable` must accept, as JSON; `format` and `version` are for `read_json`."""
    if format is not None:
        data = {"format": format, "version": version, **data}
    return write_text_atomic(path, json.dumps(to_jsonable(data), indent=2, allow_nan=False) + "\n")


def read_json(path: _Path, *, format: str, version: int) -> dict[str, Any]:
    """Read a file of `write_json_atomic`; `InputError` if it is missing, no JSON, or of another format or version."""
    data = _header_in(_existing(path).read_bytes(), path, format, version)
    return {key: value for key, value in data.items() if key not in ("format", "version")}


def save_arrays(
    path: _Path,
    *,
    format: str,
    version: int,
    arrays: Mapping[str, ArrayLike],
    meta: Mapping[str, Any] | None = None,
) -> Path:
    """Write named arrays (no Python objects) and a JSON header into one ``.npz`` file, completely or not at all."""
    content = {name: _plain(name, array) for name, array in arrays.items()}
    content[_HEADER] = np.frombuffer(_header(format, version, meta), dtype=np.uint8)
    path = Path(path)
    with _replacing(path) as handle:
        np.savez(handle, **content)  # type: ignore[arg-type]
    return path


def load_arrays(path: _Path, *, format: str, version: int) -> _Content:
    """Read arrays and meta of `save_arrays`; `InputError` if the file is missing, damaged, or of another kind."""
    existing = _existing(path)
    try:
        # opened here, because numpy leaves a damaged file open
        with existing.open("rb") as handle, np.load(handle, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
        header = arrays.pop(_HEADER).tobytes()
    except (ValueError, EOFError, TypeError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise _foreign(path, format) from error
    return arrays, _header_in(header, path, format, version).get("meta", {})


def save_tensors(
    path: _Path,
    *,
    format: str,
    version: int,
    arrays: Mapping[str, ArrayLike],
    meta: Mapping[str, Any] | None = None,
) -> Path:
    """Write arrays and a JSON header into one safetensors file; as `save_arrays`, with the ``cnn`` extra."""
    try:
        from safetensors.numpy import save
    except ImportError as error:
        raise MissingExtraError("safetensors", extra="cnn") from error
    content = {name: np.asarray(_plain(name, array), order="C") for name, array in arrays.items()}
    return write_bytes_atomic(path, save(content, {_HEADER: _header(format, version, meta).decode()}))


def load_tensors(path: _Path, *, format: str, version: int) -> _Content:
    """Read arrays and meta that `save_tensors` wrote; otherwise as `load_arrays`."""
    try:
        from safetensors import SafetensorError, safe_open
    except ImportError as error:
        raise MissingExtraError("safetensors", extra="cnn") from error
    try:
        with safe_open(_existing(path), framework="np") as content:
            header = (content.metadata() or {})[_HEADER].encode()
            arrays = {name: content.get_tensor(name) for name in content.keys()}  # noqa: SIM118 (no iterator)
    except (SafetensorError, KeyError) as error:
        raise _foreign(path, format) from error
    return arrays, _header_in(header, path, format, version).get("meta", {})


def _header(format: str, version: int, meta: Mapping[str, Any] | None) -> bytes:
    data = {"format": format, "version": version, "meta": to_jsonable(meta or {})}
    return json.dumps(data, allow_nan=False).encode("utf-8")


def _plain(name: str, array: ArrayLike) -> NDArray[Any]:
    values = np.asarray(array)
    if values.dtype.hasobject:
        raise InputError(
            "holds Python objects", where=f"array {name!r}", allowed="numbers, booleans or text of one type"
        )
    return values


def _existing(path: _Path) -> Path:
    path = Path(path)
    if not path.is_file():
        raise InputError("is not there" if not path.exists() else "is no file", where=f"file {path}")
    return path


def _header_in(data: bytes, path: _Path, format: str, version: int) -> dict[str, Any]:
    """Parse a JSON header and compare its format and version."""
    try:
        header: dict[str, Any] = json.loads(data)
        found = header["format"]
    except (ValueError, TypeError, KeyError) as error:
        raise _foreign(path, format) from error
    where = f"file {path}"
    if found != format:
        raise InputError(f"is of format {found!r}", where=where, allowed=f"format {format!r}")
    found = header.get("version")
    if found != version:
        newer = isinstance(found, int) and found > version
        raise InputError(
            f"is version {found} of format {format!r}",
            where=where,
            allowed=f"version {version}",
            remedy="Install a newer errorscreen" if newer else "Make the file anew with this errorscreen",
        )
    return header


def _foreign(path: _Path, format: str) -> InputError:
    return InputError(
        f"is damaged or was not written by errorscreen as {format!r}",
        where=f"file {path}",
        remedy="Check the path, or make the file anew",
    )
