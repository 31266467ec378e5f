"""The log of a training in a run folder: progress bar, TensorBoard files, checkpoints."""

import math
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from shutil import rmtree
from typing import Any

import jax

from relm_irl_jax.checkpoints import Checkpoints
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.progress import console
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.types import Row, State, TrainingLog

FLUSH_SECONDS = 10
"""Seconds after which TensorBoard's scalars are written to disk."""


class RunFolderLog(TrainingLog):
    """Saves the progress of one training in a run folder; a context manager.

    Processes that train together save no checkpoints, since their folders need not be shared. Only the first of them
    writes TensorBoard files.

    Args:
        folder: the run folder.
        config: the configuration as run.
        method: the method.
        seed: the seed.
        advance: called with the number of frames since its last call.
    """

    def __init__(self, folder: RunFolder, config: Config, method: str, seed: int, advance: Callable[[int], None]):
        self._settings, self._advance = config.log, advance
        self._frames = 0.0
        self._saved_at = time.monotonic()
        self._closing = ExitStack()
        self._board: Path | None = None
        self._writer: Any = None
        self._checkpoints: Checkpoints | None = None
        if config.log.tensorboard and jax.process_index() == 0:
            self._board = folder.scalars(method, seed)
        if jax.process_count() == 1:
            self._checkpoints = self._closing.enter_context(Checkpoints(folder.checkpoints(method, seed), config))

    def __enter__(self) -> "RunFolderLog":
        return self

    def __exit__(self, *_: object) -> None:
        """Wait until everything is on disk."""
        self._closing.close()

    def resume(self, state: State) -> tuple[State, list[Row]]:
        """Continue from the last checkpoint; if it cannot be used, print the reason and start again."""
        rows: list[Row] = []
        if self._checkpoints is not None:
            try:
                state, rows = self._checkpoints.restore(state) or (state, rows)
            except InputError as error:
                console.print(f"{error} The training starts again.", highlight=False, soft_wrap=True)
                self._checkpoints.remove()
        if self._board is not None:
            # All rows are written again, since rows after the last checkpoint are no longer valid.
            rmtree(self._board, ignore_errors=True)
            self._writer = _summary_writer()(str(self._board), flush_secs=FLUSH_SECONDS)
            self._closing.callback(self._writer.close)
            for row in rows:
                self._write(row)
        if rows:
            self._move_bar(rows)
        return state, rows

    def add(self, state: State, rows: list[Row]) -> None:
        """Move the progress bar, write the last row, and save a checkpoint if the last one is old enough."""
        self._move_bar(rows)
        if self._writer is not None:
            self._write(rows[-1])
        now = time.monotonic()
        if self._checkpoints is not None and now - self._saved_at >= 60 * self._settings.checkpoint_minutes:
            self._checkpoints.save(state, rows)
            self._saved_at = now

    def stop(self, state: State, rows: list[Row]) -> None:
        """Save a checkpoint of the last valid state, unless the last checkpoint is of that state."""
        if self._checkpoints is not None and rows and self._checkpoints.last_step() != len(rows):
            self._checkpoints.save(state, rows)
            console.print(f"Checkpoint: {self._checkpoints.path}", highlight=False, soft_wrap=True)

    def remove_checkpoints(self) -> None:
        """Remove the checkpoints; to be called when the result of the training is saved."""
        if self._checkpoints is not None:
            self._checkpoints.remove()

    def _move_bar(self, rows: list[Row]) -> None:
        self._advance(int(rows[-1]["frames"] - self._frames))
        self._frames = rows[-1]["frames"]

    def _write(self, row: Row) -> None:
        for name, value in row.items():
            if name != "frames" and math.isfinite(value):
                self._writer.add_scalar(name, value, int(row["frames"]))


def _summary_writer() -> Any:
    """Import tensorboardX's writer, which only trainings need.

    tensorboardX imports torch if it is installed, which takes seconds and is not needed for scalars. Torch is therefore
    hidden during the import.
    """
    hidden = "torch" not in sys.modules
    if hidden:
        sys.modules["torch"] = None  # pyrefly: ignore  None is how Python marks a module that must not be found
    try:
        return import_module("tensorboardX").SummaryWriter
    finally:
        if hidden:
            del sys.modules["torch"]
