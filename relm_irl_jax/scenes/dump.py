"""Scenes as files: the THOR v1 dump, one HDF5 file a scene.

Datasets are those of the field's own dumps: `observation`, `resnet_feature` (state, crop, 2048; crop 0 is the one
used), `location`, `rotation`, `graph`, `shortest_path_distance`. Two optional additions carry labels and origin:
the dataset `visible_object` with the attribute `categories`, and the file attributes `name`, `room_type`, `source`,
`encoder` and `format_version`. A file without them is read as an original dump.
"""

import os
import re
from pathlib import Path

import h5py
import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import whole_file
from relm_irl_jax.scenes.scene import ROOM_TYPES, Scene

FORMAT_VERSION = 1
_OTHER_SPELLINGS = {"livingroom": "living_room"}


def save_scene(scene: Scene, path: str | os.PathLike) -> None:
    """Write a scene as one THOR v1 file; the file appears only once it is complete.

    Args:
        scene: the scene; fields that are None are left out.
        path: file to write, customarily ending in `.h5` or `.hdf5`.
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


def load_scene(path: str | os.PathLike, *, frames: bool = True) -> Scene:
    """Read a scene from a THOR v1 file.

    Args:
        path: file to read.
        frames: whether to read `observation`, by far the largest dataset.

    Returns:
        The scene, with features of crop 0 where the file holds any.

    Raises:
        InputError: the file is missing, not HDF5, or a dataset is absent or of an unusable shape or range; the
            message names the file and the dataset.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such scene file; give an existing HDF5 file.")
    try:
        with h5py.File(path, "r") as file:
            return _read(file, path, frames)
    except OSError as error:
        raise InputError(f"{path}: cannot be read as HDF5 ({error}); write or copy the file again.") from error


def room_type_of(name: str) -> str:
    """Room type from a scene's name, for dumps without the attribute: `bathroom_02` is a `bathroom`.

    Args:
        name: the scene's name, a room type followed by a number.

    Returns:
        One of `ROOM_TYPES`, or the name without its number for other rooms.
    """
    stem = re.sub(r"[\s_-]*\d+$", "", name.lower())
    stem = _OTHER_SPELLINGS.get(stem, stem)
    return next((room_type for room_type in ROOM_TYPES if stem.startswith(room_type)), stem)


def _read(file: h5py.File, path: Path, frames: bool) -> Scene:
    graph = _dataset(file, path, "graph", 2)
    n_states = len(graph)
    location = _dataset(file, path, "location", 2, n_states)
    rotation = _dataset(file, path, "rotation", None, n_states).reshape(-1)
    distance = _dataset(file, path, "shortest_path_distance", 2, n_states)
    _require(graph.shape[1] == 4, path, "graph", f"has {graph.shape[1]} columns where 4 actions are expected")
    _require(
        np.issubdtype(graph.dtype, np.integer) and graph.min() >= -1 and graph.max() < n_states,
        path,
        "graph",
        f"must hold -1 or a state number below {n_states}",
    )
    _require(
        distance.shape == (n_states, n_states),
        path,
        "shortest_path_distance",
        f"must be {n_states} x {n_states}",
    )
    _require(location.shape == (n_states, 2), path, "location", f"must be {n_states} x 2")
    _require(rotation.shape == (n_states,), path, "rotation", f"must hold {n_states} headings")
    features = categories = visible = None
    if "resnet_feature" in file:
        stored = _dataset(file, path, "resnet_feature", 3, n_states)
        features = np.ascontiguousarray(stored[:, 0], np.float32)
        _require(bool(np.isfinite(features).all()), path, "resnet_feature", "holds values that are not finite")
    if "visible_object" in file:
        visible = _dataset(file, path, "visible_object", 2, n_states).astype(np.float32)
        categories = tuple(str(name) for name in file["visible_object"].attrs.get("categories", ()))
        _require(
            len(categories) == visible.shape[1],
            path,
            "visible_object",
            "needs one name a column in `categories`",
        )
    observation = None
    if frames:
        observation = _dataset(file, path, "observation", 4, n_states)
        _require(
            observation.dtype == np.uint8 and observation.shape[3] == 3,
            path,
            "observation",
            "must be uint8 RGB",
        )
    name = str(file.attrs.get("name", path.stem))
    return Scene(
        name=name,
        room_type=str(file.attrs.get("room_type", room_type_of(name))),
        location=location.astype(np.float64),
        rotation=rotation.astype(np.float64),
        graph=graph.astype(np.int32),
        shortest_path_distance=distance.astype(np.int32),
        observation=observation,
        features=features,
        visible_object=visible,
        categories=categories or (),
        source=str(file.attrs.get("source", "thor")),
        encoder=str(file.attrs.get("encoder", "dump" if features is not None else "")),
    )


def _dataset(file: h5py.File, path: Path, name: str, dimensions: int | None, length: int | None = None) -> np.ndarray:
    """Read one dataset whole, checking presence, number of dimensions and length."""
    if not isinstance(file.get(name), h5py.Dataset):
        raise InputError(f"{path}: dataset `{name}` is missing; write the scene again in the THOR v1 format.")
    values = file[name][()]
    _require(isinstance(values, np.ndarray) and values.size > 0, path, name, "is empty")
    _require(dimensions in (None, values.ndim), path, name, f"has {values.ndim} dimensions, expected {dimensions}")
    _require(length in (None, len(values)), path, name, f"has {len(values)} rows where `graph` has {length}")
    return values


def _require(holds: bool, path: Path, dataset: str, fault: str) -> None:
    if not holds:
        raise InputError(f"{path}: dataset `{dataset}` {fault}; write the scene again.")
