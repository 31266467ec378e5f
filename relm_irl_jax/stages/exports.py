"""Demonstrations of a run in the files of other libraries."""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import gymnasium

from relm_irl_jax.config import Config, Method, Task
from relm_irl_jax.errors import InputError
from relm_irl_jax.exports import imitation, minari
from relm_irl_jax.exports.episodes import StepRewards, observe
from relm_irl_jax.stages.encoding import EncodedScenes, encode_unseen
from relm_irl_jax.stages.recordings import Recordings

Format = Literal["minari", "imitation"]
"""A library."""

DEFAULT = Config()


@dataclass(frozen=True)
class Export:
    """What is written where.

    Attributes:
        path: the file, or the dataset's folder.
        format: the library that reads it.
        method: the method whose agent acted; None for the expert.
        task: the task of the agent's episodes.
        seed: the run's seed.
    """

    path: Path
    format: Format
    method: Method | None
    task: Task
    seed: int


def check_output(path: Path, form: str) -> None:
    """Refuse folders in place of files, and names that a library does not read.

    Args:
        path: the file, or the dataset's folder.
        form: the format.

    Raises:
        InputError: the name is refused.
    """
    if form == "minari":
        minari.check_name(path)
        return
    if path.is_dir():
        raise InputError(f"out: {path} is a folder; give the name of a file.")
    if form == "imitation":
        imitation.check_file(path)


def export_recordings(config: Config, training: EncodedScenes, recordings: Recordings, export: Export) -> None:
    """Write demonstrations with the observations and rewards of `RelmIrl/Task-v0`.

    Args:
        config: the configuration as run.
        training: the training scenes.
        recordings: the demonstrations.
        export: format and place.

    Raises:
        InputError: there is no demonstration, or the run has no features.
    """
    unseen = encode_unseen(config, training) if export.method is not None and export.task == "III" else []
    manual = config.manual
    rewards = StepRewards(manual.target, manual.collision, manual.step)
    episodes = [
        episode
        for scene in (*training.scenes, *unseen)
        for episode in observe(scene, recordings.get(scene.name, []), rewards)
    ]
    if not episodes:
        raise InputError("demonstrations: no episode reached its target, so there is nothing to write.")
    if export.format == "imitation":
        imitation.write_imitation(episodes, export.path)
    else:
        algorithm = "shortest paths" if export.method is None else export.method
        minari.write_minari(episodes, export.path, algorithm, _environment(config, export))


def _environment(config: Config, export: Export) -> str | None:
    """Gymnasium's specification of the environment, where `RelmIrl/Task-v0` has the run's scenes and targets."""
    resolved, default = config.resolved(), DEFAULT.resolved()
    parts = ("scenes", "scene", "tasks", "encoder", "manual")
    if any(getattr(resolved, part) != getattr(default, part) for part in parts):
        return None
    spec = copy.deepcopy(gymnasium.spec("RelmIrl/Task-v0"))
    split = "train" if export.method is None else "test"
    spec.kwargs = {"task": export.task, "seed": export.seed, "split": split}
    return spec.to_json()
