"""Private copies of large tables, mapped into memory.

A file that is overwritten in place changes under those who have mapped it, and ends their process where it is shorter
than before. So the table is copied to a file without a name in the cache folder, which no other process can open, and
which the system removes with the last array that uses it, whatever ends the process.
"""

import tempfile
from pathlib import Path
from weakref import WeakValueDictionary

import numpy as np
from jaxtyping import Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import cache_folder

BLOCK = 2**24
"""Bytes that are copied at a time."""

_copies: WeakValueDictionary[tuple, np.memmap] = WeakValueDictionary()
"""The copies in use, by what tells that their file has not changed."""


def map_copy(path: Path, offset: int, shape: tuple[int, int]) -> Int32[np.ndarray, "rows columns"]:
    """Copy a table of 32-bit integers from a file, and map the copy; an unchanged table is copied once.

    Args:
        path: the file.
        offset: position of the table in the file, in bytes.
        shape: the table's shape.

    Returns:
        The table, read-only.

    Raises:
        InputError: the file is too short, or there is no room for a copy.
    """
    status = path.stat()
    key = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, offset, shape)
    table = _copies.get(key)
    if table is None:
        table = _copies[key] = _copy(path, offset, shape)
    return table


def _copy(path: Path, offset: int, shape: tuple[int, int]) -> np.memmap:
    folder, left = cache_folder(), shape[0] * shape[1] * np.dtype(np.int32).itemsize
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("rb") as source, tempfile.TemporaryFile(dir=folder) as copy:
            source.seek(offset)
            while left:
                block = source.read(min(left, BLOCK))
                if not block:
                    raise InputError(f"{path}: became shorter while it was read; start again when it is written.")
                copy.write(block)
                left -= len(block)
            copy.flush()
            return np.memmap(copy, np.int32, "r", shape=shape)
    except OSError as error:
        raise InputError(
            f"{folder}: no room for a copy of the distances of {path}, {left / 1e9:.1f} GB more ({error.strerror}); "
            "free some space, or set XDG_CACHE_HOME to another folder."
        ) from error
