"""Trainings that are interrupted and continued, in a run folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from relm_irl_jax.agents.settings import LogSettings
from relm_irl_jax.config import Config
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.stages.training_log import RunFolderLog
from relm_irl_jax.types import TrainingLog

EVERY_CHUNK = Config(log=LogSettings(checkpoint_minutes=0))


class Interrupted(Exception):
    pass


class InterruptedLog(RunFolderLog):
    """Ends the training after two chunks: the third is computed and lost."""

    def add(self, state, rows):
        if len(rows) == 3:
            raise Interrupted
        super().add(state, rows)

    def stop(self, state, rows):
        """Nothing, as in a process that is killed."""


def interrupt(path: Path, train: Callable[[TrainingLog], Any], config: Config = EVERY_CHUNK) -> None:
    with pytest.raises(Interrupted), InterruptedLog(RunFolder(path), config, "rl", 0, lambda frames: None) as log:
        train(log)


def resume(path: Path, train: Callable[[TrainingLog], Any], config: Config = EVERY_CHUNK) -> tuple[Any, list[int]]:
    """The result of the training, and the movements of the progress bar."""
    moved = []
    with RunFolderLog(RunFolder(path), config, "rl", 0, moved.append) as log:
        return train(log), moved


def assert_same(one: Any, other: Any) -> None:
    """Parameters and curve, to the bit."""
    for a, b in zip(jax.tree.leaves(one[0]), jax.tree.leaves(other[0]), strict=True):
        np.testing.assert_array_equal(a, b)
    for name, values in vars(one[1]).items():
        np.testing.assert_array_equal(getattr(other[1], name), values)
