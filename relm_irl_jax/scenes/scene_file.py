"""Scene files: the THOR v1 format of Zhu et al. (2017), one HDF5 file for each scene.

Datasets: `observation` (state, height, width, 3), `resnet_feature` (state, crop, 2048; crop 0 is read), `location`,
`rotation`, `graph`, `shortest_path_distance`. This package adds optional labels and metadata: the dataset
`visible_object` with the attribute `categories`, and the file attributes `name`, `room_type`, `source`, `encoder` and
`format_version`. Original files without these can also be read.
"""

import math
import mmap
import os
import re
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Int32

from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.files import whole_file
from relm_irl_jax.hardware import require_memory
from relm_irl_jax.scenes.consistency import require_consistent
from relm_irl_jax.scenes.mapped_copy import map_copy
from relm_irl_jax.scenes.scene import ACTIONS, COLLISION, ROWS_AT_ONCE, UNREACHABLE, Scene
from relm_irl_jax.scenes.settings import ROOM_TYPE_PATTERN, ROOM_TYPES

FORMAT_VERSION = 1
NAME_PATTERN = r"\w[\w .+-]*"
"""Pattern of the names of scenes, which become parts of file names."""

LONGEST_NAME = 100
"""Largest number of characters of a name."""

DISTANCE = "shortest_path_distance"
"""Name of the dataset of distances."""

IN_FILE_BYTES = 2**26
"""Size from which a table of distances stays in a file, a private copy, where the file's layout allows it."""

MAX_COMPRESSION = 2000
"""Largest plausible ratio of a dataset's size to its file's size; with a larger ratio, the file is damaged."""

_OTHER_SPELLINGS = {"livingroom": "living_room"}


def save_scene(scene: Scene, path: str | os.PathLike) -> None:
    """Write a scene as a THOR v1 file, atomically.

    Args:
        scene: the scene; fields that are None are left out.
        path: file to write, usually ending in `.h5` or `.hdf5`.
    """
    with whole_file(Path(path)) as temporary, h5py.File(temporary, "w") as file:
        file["location"] = scene.location
        file["rotation"] = scene.rotation
        file["graph"] = scene.graph
        file["shortest_path_distance"] = scene.shortest_path_distance
        if scene.observation is not None:
            chunks = (1, *scene.observation.shape[1:])
            file.create_dataset("observation", data=scene.observation, chunks=chunks, compression="lzf")
        if scene.features is not None:
            file["resnet_feature"] = scene.features[:, None, :]
        if scene.visible_object is not None:
            file["visible_object"] = scene.visible_object
            file["visible_object"].attrs["categories"] = list(scene.categories)
        file.attrs.update(
            name=scene.name,
            room_type=scene.room_type,
            source=scene.source,
            encoder=scene.encoder,
            format_version=FORMAT_VERSION,
        )


def load_scene(path: str | os.PathLike, *, views: bool = True) -> Scene:
    """Read a scene from a THOR v1 file, and check that its datasets agree with each other.

    Args:
        path: file to read.
        views: whether to read the views, by far the largest dataset. Only encoders and figures need them.

    Returns:
        The scene, with features of crop 0 if the file has features.

    Raises:
        InputError: the file is missing or not HDF5, a dataset is missing or has a wrong shape or range, or datasets
            contradict each other (see `consistency`).
    """
    scene = read_scene(path, views=views)
    require_consistent(scene, Path(path))
    table = scene.shortest_path_distance
    if isinstance(table.base, mmap.mmap):  # what the checks have read takes no memory any more
        table.base.madvise(mmap.MADV_DONTNEED)
    return scene


def require_views(path: Path) -> None:
    """Check that a scene file has views, without reading them: they are needed late, for figures.

    Args:
        path: the file.

    Raises:
        InputError: the file has no views.
    """
    with suppress(OSError), h5py.File(path, "r") as file:  # reading the scene says what is wrong with the file
        _require_rgb(_checked(file, path, "observation", (None, None, None, 3)), path)


def read_scene(path: str | os.PathLike, *, views: bool = True) -> Scene:
    """Read a scene without comparing its datasets with each other.

    Args:
        path: file to read.
        views: whether to read the views.

    Returns:
        The scene.

    Raises:
        InputError: the file is missing or not HDF5, or a dataset is missing or has a wrong shape or range.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such scene file; give an existing HDF5 file.")
    try:
        with h5py.File(path, "r") as file:
            return _read(file, path, views=views)
    except InputError:
        raise
    except Exception as error:  # damaged files cause many kinds of exceptions in the HDF5 library
        cause = first_line(error)
        raise InputError(f"{path}: cannot be read as HDF5 ({cause}); write or copy the file again.") from error


def room_type_from_name(name: str) -> str:
    """Derive the room type from a scene's name, for files without the attribute: `bathroom_02` is a `bathroom`.

    Args:
        name: the scene's name, a room type followed by a number.

    Returns:
        One of `ROOM_TYPES`, or for other rooms the name without its number.
    """
    stem = re.sub(r"\s+", "_", re.sub(r"[\s_-]*\d+$", "", name.lower()).strip())
    stem = _OTHER_SPELLINGS.get(stem, stem)
    return next((room_type for room_type in ROOM_TYPES if stem.startswith(room_type)), stem)


def _read(file: h5py.File, path: Path, *, views: bool) -> Scene:
    _check_version(file, path)
    require_memory(_memory(file, views=views), f"{path}: reading the scene")
    graph = _dataset(file, path, "graph", (None, len(ACTIONS)))
    n_states = len(graph)
    is_state = np.issubdtype(graph.dtype, np.integer) and graph.min() >= COLLISION and graph.max() < n_states
    _require(bool(is_state), path, "graph", f"must contain -1 or a state number below {n_states}")
    location = _numbers(file, path, "location", (n_states, 2))
    stored = file.get("rotation")
    column = isinstance(stored, h5py.Dataset) and len(stored.shape or ()) == 2
    rotation = _numbers(file, path, "rotation", (n_states, 1) if column else (n_states,)).reshape(-1)
    distance = _distances(file, path, n_states)
    features = observation = visible = None
    categories = ()
    if "resnet_feature" in file:
        crops = _numbers(file, path, "resnet_feature", (n_states, None, None))
        features = np.ascontiguousarray(crops[:, 0], np.float32)
    if "visible_object" in file:
        visible = _numbers(file, path, "visible_object", (n_states, None)).astype(np.float32)
        is_share = visible.min() >= 0 and visible.max() <= 1 + 1e-6
        _require(bool(is_share), path, "visible_object", "must contain shares between 0 and 1")
        categories = tuple(str(name) for name in np.ravel(file["visible_object"].attrs.get("categories", ())))
        _require(
            len(categories) == visible.shape[1],
            path,
            "visible_object",
            "needs one name for each column in `categories`",
        )
        _require(
            len(set(categories)) == len(categories) and all(map(_is_label, categories)),
            path,
            "visible_object",
            f"needs distinct names of 1 to {LONGEST_NAME} printable characters in `categories`",
        )
    if views:
        stored = _checked(file, path, "observation", (n_states, None, None, 3))
        _require_rgb(stored, path)
        observation = stored[()]
    name = _text(file, path, "name", path.stem, NAME_PATTERN, "a name of letters, digits, '_', '-', '.' and spaces")
    room_type = room_type_from_name(name)
    kind = "a name of letters, digits, '_', '-' and '.', and not `mean`"
    return Scene(
        name=name,
        room_type=_text(file, path, "room_type", room_type, ROOM_TYPE_PATTERN, kind),
        location=location.astype(np.float64),
        rotation=rotation.astype(np.float64),
        graph=graph.astype(np.int32, copy=False),
        shortest_path_distance=distance,
        observation=observation,
        features=features,
        visible_object=visible,
        categories=categories,
        source=_label(file, path, "source", "thor"),
        encoder=_label(file, path, "encoder", "dump" if features is not None else ""),
    )


def _memory(file: h5py.File, *, views: bool) -> int:
    """Bytes of a scene's large datasets that are read into memory."""
    total = 0
    for name in (DISTANCE, "resnet_feature", *(("observation",) if views else ())):
        stored = file.get(name)
        if isinstance(stored, h5py.Dataset) and stored.shape and not (name == DISTANCE and _stays_in_file(stored)):
            width = np.dtype(np.int32).itemsize if name == DISTANCE else stored.dtype.itemsize
            total += math.prod(stored.shape) * width
    return total


def _distances(file: h5py.File, path: Path, n_states: int) -> Int32[np.ndarray, "states states"]:
    """Read the distances: a large table as a mapped copy, and otherwise a few rows at a time."""
    stored = _checked(file, path, DISTANCE, (n_states, n_states))
    _require(stored.dtype.kind in "iuf", path, DISTANCE, f"must contain real numbers, not {stored.dtype}")
    if in_file := _stays_in_file(stored):
        distances = map_copy(path, stored.id.get_offset(), (n_states, n_states))
    else:
        distances = np.empty(stored.shape, np.int32)
    for first in range(0, n_states, ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        given = distances[rows] if in_file else stored[rows]
        whole = given.min() >= UNREACHABLE and given.max() < 2**31  # false for NaN
        if given.dtype.kind == "f":
            whole = whole and (given == np.round(given)).all()
        _require(bool(whole), path, DISTANCE, "must contain whole numbers, -1 or more")
        if not in_file:
            distances[rows] = given
    return distances


def _stays_in_file(stored: h5py.Dataset) -> bool:
    """Whether a table is large, and contiguous in its file as it would be in memory."""
    contiguous = stored.id.get_offset() is not None and stored.file.userblock_size == 0
    return contiguous and stored.dtype == np.int32 and stored.nbytes >= IN_FILE_BYTES


def _checked(file: h5py.File, path: Path, name: str, shape: tuple[int | None, ...]) -> h5py.Dataset:
    """Find a dataset and check its shape; None in `shape` stands for any positive length."""
    stored = file.get(name)
    if not isinstance(stored, h5py.Dataset):
        raise InputError(f"{path}: dataset `{name}` is missing; write the scene again in the THOR v1 format.")
    elsewhere = stored.file.filename != file.filename or bool(stored.external) or stored.is_virtual
    _require(not elsewhere, path, name, "is stored in another file")
    actual = stored.shape or ()
    fits = len(actual) == len(shape) and all(n > 0 and m in (None, n) for n, m in zip(actual, shape, strict=True))
    expected = " x ".join("any" if length is None else str(length) for length in shape)
    _require(fits, path, name, f"has shape {' x '.join(map(str, actual)) or 'none'}, expected {expected}")
    # With a damaged length, reading could exhaust the memory.
    limit = MAX_COMPRESSION * path.stat().st_size
    _require(stored.size * stored.dtype.itemsize <= limit, path, name, "is declared larger than its file can store")
    return stored


def _dataset(file: h5py.File, path: Path, name: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """Read a dataset of a given shape, see `_checked`."""
    return _checked(file, path, name, shape)[()]


def _numbers(file: h5py.File, path: Path, name: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """Read a dataset of finite real numbers."""
    values = _dataset(file, path, name, shape)
    _require(values.dtype.kind in "iuf", path, name, f"must contain real numbers, not {values.dtype}")
    if values.dtype.kind == "f":
        limit = float(np.finfo(np.float32).max)
        # The extremes are NaN or infinite if any value is; this takes no memory, unlike a mask.
        fits = -limit <= float(values.min()) and float(values.max()) <= limit
        _require(fits, path, name, "has values that are not finite")
    return values


def _require_rgb(observation: h5py.Dataset, path: Path) -> None:
    _require(observation.dtype == np.uint8, path, "observation", "must be uint8 RGB")


def _text(file: h5py.File, path: Path, attribute: str, default: str, pattern: str, kind: str) -> str:
    """Read a string attribute that becomes part of file names."""
    value = file.attrs.get(attribute, default)
    if not isinstance(value, str) or len(value) > LONGEST_NAME or not re.fullmatch(pattern, value):
        raise InputError(f"{path}: attribute `{attribute}` must be {kind}, of at most {LONGEST_NAME} characters.")
    return value


def _label(file: h5py.File, path: Path, attribute: str, default: str) -> str:
    """Read a string attribute that is shown as it is; it may be empty."""
    value = str(file.attrs.get(attribute, default))
    if value and not _is_label(value):
        raise InputError(
            f"{path}: attribute `{attribute}` must be at most {LONGEST_NAME} printable characters; write the scene "
            "again."
        )
    return value


def _is_label(text: str) -> bool:
    return 0 < len(text) <= LONGEST_NAME and text.isprintable()


def _check_version(file: h5py.File, path: Path) -> None:
    """Refuse a file of a later format; original files have no version."""
    version = file.attrs.get("format_version", FORMAT_VERSION)
    if not isinstance(version, int | np.integer) or version != FORMAT_VERSION:
        raise InputError(
            f"{path}: attribute `format_version` is {version!r}, and this program reads version {FORMAT_VERSION}; "
            "install a newer relm-irl-jax, or write the scene again."
        )


def _require(condition: bool, path: Path, dataset: str, fault: str) -> None:
    if not condition:
        raise InputError(f"{path}: dataset `{dataset}` {fault}; write the scene again.")
