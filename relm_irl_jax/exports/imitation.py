"""Trajectories of the `imitation` library (https://imitation.readthedocs.io), written without it.

The library requires an older Gymnasium than this package, so the two are not installed together. Its function
`imitation.data.serialize.load` reads this file of NumPy arrays, and `save` turns it into the library's newer format.
"""

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.exports.episodes import ObservedEpisode
from relm_irl_jax.files import whole_file

SUFFIX = ".npz"


def check_file(path: Path) -> None:
    """Refuse a file that `imitation` does not read.

    Args:
        path: the file.

    Raises:
        InputError: its name does not end in `.npz`.
    """
    if path.suffix != SUFFIX:
        raise InputError(f"out: {path} is refused; give a name that ends in {SUFFIX}.")


def write_imitation(episodes: Sequence[ObservedEpisode], path: Path) -> None:
    """Write episodes as trajectories with rewards.

    An observation is one vector, the features of the view followed by those of the target. `infos` has one JSON object
    for each step, with the scene's name, the state and the next state.

    Args:
        episodes: at least one episode; all have features of equal dimension.
        path: the file.

    Raises:
        InputError: its name does not end in `.npz`.
    """
    check_file(path)
    arrays = {
        "obs": np.concatenate([_observations(episode) for episode in episodes]),
        "acts": np.concatenate([episode.action for episode in episodes]).astype(np.int64),
        "rews": np.concatenate([episode.reward for episode in episodes]).astype(np.float32),
        "infos": np.asarray([info for episode in episodes for info in _infos(episode)]),
        "indices": np.cumsum([len(episode.action) for episode in episodes[:-1]]).astype(np.int64),
        "terminal": np.ones(len(episodes), bool),
    }
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _observations(episode: ObservedEpisode) -> np.ndarray:
    return np.concatenate([episode.view, np.broadcast_to(episode.target, episode.view.shape)], axis=1)


def _infos(episode: ObservedEpisode) -> list[str]:
    states = episode.state.tolist()
    return [
        json.dumps({"scene": episode.scene, "state": state, "next_state": following})
        for state, following in pairwise(states)
    ]
