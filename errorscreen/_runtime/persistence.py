"""Files that are complete or absent, say what they are, and run no code when they are read.

Every file of the package carries a format name and a version. Writers put the content into a temporary file
in the same folder and move it into place, so an interrupted run leaves the old file or the new one, never half
a file. Readers accept the one format and version that they know, and say what they found instead.
"""

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


@contextmanager
def _replacing(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file beside `path` that takes its place when the block ends well."""
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


def write_bytes_atomic(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write `data` to `path`, complete or not at all, and return the path.

    Raises
    ------
    InputError
        If the folder does not exist or cannot be written to, or `path` is a folder.
    """
    path = Path(path)
    with _replacing(path) as handle:
        handle.write(data)
    return path


def write_text_atomic(path: str | os.PathLike[str], text: str) -> Path:
    """Write `text` in UTF-8 to `path`, complete or not at all, and return the path.

    Raises
    ------
    InputError
        As `write_bytes_atomic`.
    """
    return write_bytes_atomic(path, text.encode("utf-8"))


def to_jsonable(value: Any) -> Any:
    """Turn NumPy values, tuples, paths and mappings into what JSON knows.

    Numbers that are not finite become ``None``, because JSON has no word for them.

    Raises
    ------
    InputError
        If a value of another type, or a key that is not a string, is met.

    Examples
    --------
    >>> to_jsonable({"c": np.array([1.0, np.nan]), "n": np.int64(2)})
    {'c': [1.0, None], 'n': 2}
    """
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
    path: str | os.PathLike[str], data: Any, *, format: str | None = None, version: int | None = None
) -> Path:
    """Write `data` as JSON to `path`, complete or not at all, and return the path.

    Parameters
    ----------
    path : path-like
    data : object
        What `to_jsonable` accepts; a mapping where `format` is given.
    format, version : str and int, optional
        Written as the first two keys, for `read_json`.

    Raises
    ------
    InputError
        If the data hold what JSON cannot, or the file cannot be written.
    """
    if format is not None:
        data = {"format": format, "version": version, **data}
    return write_text_atomic(path, json.dumps(to_jsonable(data), indent=2, allow_nan=False) + "\n")


def read_json(path: str | os.PathLike[str], *, format: str, version: int) -> dict[str, Any]:
    """Read a JSON file that `write_json_atomic` wrote, without its ``format`` and ``version``.

    Raises
    ------
    InputError
        If the file is missing, is not JSON, or is of another format or version.
    """
    where = f"file {path}"
    data = _parse_header(_existing(path).read_bytes(), where, format)
    _check_header(data, format, version, where)
    return {key: value for key, value in data.items() if key not in ("format", "version")}


def save_arrays(
    path: str | os.PathLike[str],
    *,
    format: str,
    version: int,
    arrays: Mapping[str, ArrayLike],
    meta: Mapping[str, Any] | None = None,
) -> Path:
    """Write named arrays and a JSON header into one ``.npz`` file, complete or not at all.

    Parameters
    ----------
    path : path-like
        Used as it is; no suffix is added.
    format : str
        Name of the format, for example ``"errorscreen-dataset"``.
    version : int
        Version of the format.
    arrays : mapping of str to array-like
        Numbers, booleans or text; not Python objects.
    meta : mapping, optional
        What `to_jsonable` accepts.

    Returns
    -------
    Path
        The path written.

    Raises
    ------
    InputError
        If an array holds Python objects, `meta` holds what JSON cannot, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = save_arrays(
    ...         Path(folder) / "a.npz", format="demo", version=1, arrays={"x": [1, 2]}, meta={"unit": "pu"}
    ...     )
    ...     load_arrays(path, format="demo", version=1)
    ({'x': array([1, 2])}, {'unit': 'pu'})
    """
    content = {name: _plain(name, array) for name, array in arrays.items()}
    content[_HEADER] = np.frombuffer(_header(format, version, meta), dtype=np.uint8)
    path = Path(path)
    with _replacing(path) as handle:
        np.savez(handle, **content)  # type: ignore[arg-type]
    return path


def load_arrays(
    path: str | os.PathLike[str], *, format: str, version: int
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Read what `save_arrays` wrote; no code in the file is run.

    Returns
    -------
    arrays : dict of str to ndarray
    meta : dict

    Raises
    ------
    InputError
        If the file is missing, damaged, or of another format or version.
    """
    where, existing = f"file {path}", _existing(path)
    try:
        # opened here, because numpy leaves a damaged file open
        with existing.open("rb") as handle, np.load(handle, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
    except (ValueError, EOFError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise _foreign(where, format) from error
    if _HEADER not in arrays:
        raise _foreign(where, format)
    header = _parse_header(arrays.pop(_HEADER).tobytes(), where, format)
    _check_header(header, format, version, where)
    return arrays, header.get("meta", {})


def save_tensors(
    path: str | os.PathLike[str],
    *,
    format: str,
    version: int,
    arrays: Mapping[str, ArrayLike],
    meta: Mapping[str, Any] | None = None,
) -> Path:
    """Write named arrays and a JSON header into one safetensors file; otherwise as `save_arrays`.

    Weights and configuration share one file, so they cannot come apart. Needs the ``cnn`` extra.
    """
    try:
        from safetensors.numpy import save
    except ImportError as error:
        raise MissingExtraError("safetensors", extra="cnn") from error
    content = {name: np.asarray(_plain(name, array), order="C") for name, array in arrays.items()}
    return write_bytes_atomic(path, save(content, {_HEADER: _header(format, version, meta).decode()}))


def load_tensors(
    path: str | os.PathLike[str], *, format: str, version: int
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Read what `save_tensors` wrote; otherwise as `load_arrays`. Needs the ``cnn`` extra."""
    try:
        from safetensors import SafetensorError, safe_open
    except ImportError as error:
        raise MissingExtraError("safetensors", extra="cnn") from error
    where = f"file {path}"
    try:
        with safe_open(_existing(path), framework="np") as content:
            text = (content.metadata() or {}).get(_HEADER)
            arrays = {name: content.get_tensor(name) for name in content.keys()}  # noqa: SIM118 (no iterator)
    except SafetensorError as error:
        raise _foreign(where, format) from error
    if text is None:
        raise _foreign(where, format)
    header = _parse_header(text.encode(), where, format)
    _check_header(header, format, version, where)
    return arrays, header.get("meta", {})


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


def _existing(path: str | os.PathLike[str]) -> Path:
    path = Path(path)
    if not path.is_file():
        raise InputError("is not there" if not path.exists() else "is no file", where=f"file {path}")
    return path


def _parse_header(data: bytes, where: str, format: str) -> dict[str, Any]:
    try:
        header = json.loads(data)
    except ValueError as error:
        raise _foreign(where, format) from error
    if not isinstance(header, dict) or "format" not in header:
        raise _foreign(where, format)
    return header


def _check_header(header: Mapping[str, Any], format: str, version: int, where: str) -> None:
    if header["format"] != format:
        raise InputError(f"is of format {header['format']!r}", where=where, allowed=f"format {format!r}")
    found = header.get("version")
    if found != version:
        newer = isinstance(found, int) and found > version
        raise InputError(
            f"is version {found} of format {format!r}",
            where=where,
            allowed=f"version {version}",
            remedy="Install a newer errorscreen" if newer else "Make the file anew with this errorscreen",
        )


def _foreign(where: str, format: str) -> InputError:
    return InputError(
        f"is damaged or was not written by errorscreen as {format!r}",
        where=where,
        remedy="Check the path, or make the file anew",
    )
