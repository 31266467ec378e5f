"""Trainings that are cut off and taken up again, in a run folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from relm_irl_jax.agent.learning import TrainingRecord
from relm_irl_jax.agent.settings import RecordSettings
from relm_irl_jax.stages.recording import FolderRecord

from relm_irl_jax.config import Config
from relm_irl_jax.run_folder import RunFolder

EVERY_CHUNK = Config(record=RecordSettings(checkpoint_minutes=0))


class CutOff(Exception):
    pass


class ShortLived(FolderRecord):
    """Ends the training after two chunks: the third is computed and lost."""

    def add(self, state, rows):
        if len(rows) == 3:
            raise CutOff
        super().add(state, rows)


def cut_off(path: Path, train: Callable[[TrainingRecord], Any], config: Config = EVERY_CHUNK) -> None:
    with pytest.raises(CutOff), ShortLived(RunFolder(path), config, "rl", 0, lambda frames: None) as record:
        train(record)


def take_up(path: Path, train: Callable[[TrainingRecord], Any], config: Config = EVERY_CHUNK) -> tuple[Any, list[int]]:
    """What the training gives, and the movements of the progress bar."""
    moved = []
    with FolderRecord(RunFolder(path), config, "rl", 0, moved.append) as record:
        return train(record), moved


def assert_same(one: Any, other: Any) -> None:
    """Parameters and curve, to the bit."""
    for a, b in zip(jax.tree.leaves(one[0]), jax.tree.leaves(other[0]), strict=True):
        np.testing.assert_array_equal(a, b)
    for name, values in vars(one[1]).items():
        np.testing.assert_array_equal(getattr(other[1], name), values)
