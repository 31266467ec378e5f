"""Minari datasets (https://minari.farama.org), written without the Minari package.

A dataset is a folder `NAME-vN/data` with an HDF5 file that has a group for each episode, and a file of metadata. The
format is that of Minari 0.5: https://minari.farama.org/content/dataset_standards.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.exports.episodes import ObservedEpisode
from relm_irl_jax.files import whole_file, write_json
from relm_irl_jax.scenes.scene import ACTIONS

VERSION = "0.5.4"
"""Version of Minari whose format this is."""

NAME = re.compile(r"[\w.-]+-v\d+")
"""Names of datasets."""


def check_name(folder: Path) -> None:
    """Refuse a folder that Minari does not recognise as a dataset.

    Args:
        folder: the dataset's folder.

    Raises:
        InputError: its name has no version.
    """
    if not NAME.fullmatch(folder.name):
        raise InputError(f"out: {folder} is refused; a Minari dataset is a folder with a version, such as expert-v0.")


def write_minari(
    episodes: Sequence[ObservedEpisode], folder: Path, algorithm: str, environment: str | None = None
) -> None:
    """Write episodes as a Minari dataset with the observations of `RelmIrl/Task-v0`.

    Args:
        episodes: at least one episode; all have features of equal dimension.
        folder: the dataset's folder, whose parent is what `MINARI_DATASETS_PATH` names.
        algorithm: what the episodes come from.
        environment: Gymnasium's specification of the environment as JSON; None where no registered one is equal.

    Raises:
        InputError: the folder's name has no version.
    """
    check_name(folder)
    data = folder / "data"
    with whole_file(data / "main_data.hdf5") as path:
        # Minari counts groups to find the next number, and keeps the order in which they are created.
        with h5py.File(path, "w", track_order=True) as file:
            for number, episode in enumerate(episodes):
                _write_episode(file.create_group(f"episode_{number}"), number, episode)
        megabytes = round(path.stat().st_size / 1e6, 1)
    steps = [len(episode.action) for episode in episodes]
    metadata: dict[str, Any] = {
        "dataset_id": folder.name,
        "minari_version": VERSION,
        "data_format": "hdf5",
        "jpeg_encoding": False,
        "total_episodes": len(episodes),
        "total_steps": sum(steps),
        "dataset_size": megabytes,
        "algorithm_name": algorithm,
        "observation_space": json.dumps(_observation_space(episodes[0].view.shape[1])),
        "action_space": json.dumps({"type": "Discrete", "dtype": "int64", "start": 0, "n": len(ACTIONS)}),
    }
    # Written last: a folder without metadata is no dataset.
    write_json(data / "metadata.json", metadata | ({} if environment is None else {"env_spec": environment}))


def _write_episode(group: h5py.Group, number: int, episode: ObservedEpisode) -> None:
    steps = len(episode.action)
    group.attrs.update({"id": number, "total_steps": steps, "scene": episode.scene})
    terminated = np.arange(steps) == steps - 1
    for name, values in (
        ("observations/view", episode.view),
        ("observations/target", np.broadcast_to(episode.target, episode.view.shape)),
        ("actions", episode.action.astype(np.int64)),
        ("rewards", episode.reward),
        ("terminations", terminated),
        ("truncations", np.zeros(steps, bool)),
        ("infos/state", episode.state.astype(np.int64)),
    ):
        group.create_dataset(name, data=values, chunks=True, maxshape=(None, *values.shape[1:]), compression="gzip")


def _observation_space(dimension: int) -> dict[str, Any]:
    """Minari's description of the space of features, which has no bounds."""
    box = {
        "type": "Box",
        "dtype": "float32",
        "shape": [dimension],
        "low": [-float("inf")] * dimension,
        "high": [float("inf")] * dimension,
    }
    return {"type": "Dict", "subspaces": {"target": box, "view": box}}
