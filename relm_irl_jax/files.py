"""Files of arrays, tables and plain values, written atomically: a reader finds the complete file or none.

Files of arrays contain a checksum of their contents. Any other file can have one in a second file next to it.
"""

import csv
import hashlib
import io
import json
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from platformdirs import user_cache_path
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.inputs import refuse_device


def cache_folder() -> Path:
    """The user's cache folder for everything that can be computed again."""
    return user_cache_path("relm-irl-jax")


PARTIAL = ".partial"
"""Suffix of temporary files; a process that is killed leaves them."""

_CONTENTS = "contents"
"""Metadata key of all strings of a file of arrays and of its checksum, as JSON: safetensors writes several keys in any
order, and equal contents shall be equal files."""


def remove_partial_files(folder: Path) -> None:
    """Remove temporary files of processes that were killed; to be called when no other process writes to the folder.

    Args:
        folder: the folder, with its sub-folders.
    """
    for path in folder.rglob(f".*{PARTIAL}"):
        path.unlink(missing_ok=True)


def ensure_writable(folder: Path) -> None:
    """Create a folder, and write a file to it and remove it: before hours of work, not after.

    Args:
        folder: the folder.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".", suffix=PARTIAL):
        pass


def write_checksum(path: Path) -> None:
    """Write the checksum of a file to a file next to it.

    Args:
        path: the file.
    """
    write_bytes(_checksum_path(path), checksum_of(path).encode())


def has_checksum(path: Path) -> bool:
    """Whether a file exists and is as it was when `write_checksum` was called.

    Args:
        path: the file.

    Returns:
        Whether the file can be used.
    """
    try:
        return _checksum_path(path).read_bytes().decode(errors="replace") == checksum_of(path)
    except OSError:
        return False


def _checksum_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def checksum_of(path: Path) -> str:
    """The SHA-256 checksum of a file's contents.

    Args:
        path: the file.

    Returns:
        64 hexadecimal digits.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Write a temporary file, and rename it to the final path when the block ends without an error.

    Args:
        path: the file; its folder is created if missing.

    Yields:
        The temporary file to write, in the same folder.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=PARTIAL)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # Temporary files are private; the finished one gets the permissions of any other new file.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically.

    Args:
        path: the file.
        content: the file's content.
    """
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: Path, value: Any) -> None:
    """Write plain values as JSON.

    Args:
        path: the file.
        value: the file's content.
    """
    write_bytes(path, (json.dumps(value, indent=1) + "\n").encode())


def write_table(path: Path, columns: Mapping[str, Any]) -> None:
    """Write named columns of equal length as CSV.

    Args:
        path: the file.
        columns: sequences or arrays by name.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([str(value) for value in row] for row in zip(*columns.values(), strict=True))
    write_bytes(path, text.getvalue().encode())


def columns_of_rows(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> dict[str, list]:
    """A table as columns, for `write_table`.

    Args:
        names: the names of the columns.
        rows: the rows, each with a value for each column; there may be none.

    Returns:
        The columns by name.
    """
    table = list(rows)
    return {name: [row[number] for row in table] for number, name in enumerate(names)}


def read_table(path: Path) -> dict[str, list[str]]:
    """Read the columns of a CSV file.

    Args:
        path: the file.

    Returns:
        Strings by column name; empty if the file has no rows.

    Raises:
        InputError: the file is missing or damaged.
    """
    try:
        with path.open(newline="") as file:
            lines = list(csv.reader(file))
    except FileNotFoundError as error:
        raise InputError(f"{path} is missing; restore it, or repeat the command that writes it.") from error
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({error}); restore it, or remove it.") from error
    names, rows = (lines[0], lines[1:]) if lines else ([], [])
    for number, row in enumerate(rows, start=2):
        if len(row) != len(names):
            raise InputError(
                f"{path}: line {number} has {len(row)} fields, not {len(names)}; restore the file, or remove it."
            )
    return {name: list(values) for name, values in zip(names, zip(*rows, strict=True), strict=True)} if rows else {}


def read_numbers(path: Path, names: Sequence[str]) -> dict[str, Float64[np.ndarray, "rows"]]:
    """Read numeric columns of a CSV file.

    Args:
        path: the file.
        names: the columns to read; the file may have others.

    Returns:
        Numbers by column name, all of the same length.

    Raises:
        InputError: the file is missing or damaged, or a column is missing or not numeric.
    """
    table = read_table(path)
    numbers = {}
    for name in names:
        if name not in table:
            raise InputError(f"{path}: column `{name}` is missing; restore the file, or remove it.")
        try:
            numbers[name] = np.asarray(table[name], np.float64)
        except ValueError as error:
            raise InputError(f"{path}: column `{name}`: {error}; restore the file, or remove it.") from error
    return numbers


def save_arrays(path: Path, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, str] | None = None) -> None:
    """Write named arrays as safetensors, with a checksum of all arrays and strings.

    Args:
        path: the file.
        arrays: arrays by name.
        metadata: strings to store in the same file.
    """
    contiguous = {name: np.asarray(value, order="C") for name, value in arrays.items()}
    strings = dict(metadata or {})
    contents = {"strings": strings, "sha256": _checksum_of_arrays(contiguous, strings)}
    write_bytes(path, save(contiguous, {_CONTENTS: json.dumps(contents, sort_keys=True)}))


def _checksum_of_arrays(arrays: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> str:
    digest = hashlib.sha256(json.dumps(sorted(metadata.items())).encode())
    for name in sorted(arrays):
        array = np.asarray(arrays[name], order="C")
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def load_arrays(path: Path) -> dict[str, np.ndarray]:
    """Read arrays.

    Args:
        path: the file.

    Returns:
        Arrays by name.

    Raises:
        InputError: the file is missing or damaged.
    """
    return load_arrays_and_metadata(path)[0]


def load_metadata(path: Path) -> dict[str, str]:
    """Read the strings of a file of arrays, without its arrays and without checking it.

    Args:
        path: a safetensors file.

    Returns:
        Strings by name; none if there are none, or the file is missing or damaged.
    """
    try:
        with safe_open(str(path), framework="numpy") as file:
            metadata = dict(file.metadata() or {})
        return metadata if _CONTENTS not in metadata else dict(json.loads(metadata[_CONTENTS])["strings"])
    except (SafetensorError, OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return {}


def load_arrays_and_metadata(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Read arrays and the strings stored with them.

    Args:
        path: the file.

    Returns:
        Arrays by name, and strings by name.

    Raises:
        InputError: the file is missing or damaged.
    """
    refuse_device(path)
    try:
        with safe_open(str(path), framework="numpy") as file:
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            metadata = dict(file.metadata() or {})
    except FileNotFoundError as error:
        raise InputError(f"{path} is missing; restore it, or repeat the command that writes it.") from error
    except (SafetensorError, OSError, ValueError, TypeError, AttributeError) as error:  # the last three: unknown types
        raise InputError(
            f"{path}: cannot be read ({first_line(error)}); remove it, and repeat the command that writes it."
        ) from error
    if _CONTENTS not in metadata:
        # Files of other programs have no checksum, but then they have nothing that looks like one.
        if any(re.search('"sha256": "[0-9a-f]{64}"', value) for value in metadata.values()):
            raise InputError(f"{path}: is damaged; remove it, and repeat the command that writes it.")
        return arrays, metadata
    try:
        contents = json.loads(metadata[_CONTENTS])
        metadata, checksum = {str(name): str(text) for name, text in contents["strings"].items()}, contents["sha256"]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"{path}: is damaged; remove it, and repeat the command that writes it.") from error
    if checksum != _checksum_of_arrays(arrays, metadata):
        raise InputError(f"{path}: does not match its checksum; remove it, and repeat the command that writes it.")
    return arrays, metadata
