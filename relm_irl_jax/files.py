"""Files of arrays, tables and plain values, written atomically: a reader finds the complete file or none."""

import csv
import io
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from relm_irl_jax.errors import InputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Write a temporary file, and rename it to the final path when the block ends without an error.

    Args:
        path: the file; its folder is created if missing.

    Yields:
        The temporary file to write, in the same folder.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=".partial")
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
    """Write named arrays as safetensors.

    Args:
        path: the file.
        arrays: arrays by name.
        metadata: strings to store in the same file.
    """
    contiguous = {name: np.asarray(value, order="C") for name, value in arrays.items()}
    write_bytes(path, save(contiguous, None if metadata is None else dict(metadata)))


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


def load_arrays_and_metadata(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Read arrays and the strings stored with them.

    Args:
        path: the file.

    Returns:
        Arrays by name, and strings by name.

    Raises:
        InputError: the file is missing or damaged.
    """
    try:
        with safe_open(str(path), framework="numpy") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, dict(file.metadata() or {})  # noqa: SIM118
    except FileNotFoundError as error:
        raise InputError(f"{path} is missing; restore it, or repeat the command that writes it.") from error
    except (SafetensorError, OSError) as error:
        raise InputError(
            f"{path}: cannot be read ({error}); remove it, and repeat the command that writes it."
        ) from error
