"""The log of a training in a run folder: progress bar, TensorBoard's scalars, checkpoints."""

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
"""TensorBoard's scalars are on disk after this many seconds."""


class RunFolderLog(TrainingLog):
    """Keeps the progress of one training in a run folder; to be used in a `with` statement.

    Several processes that train together keep no checkpoints, since their folders need not be shared; the first of
    them alone writes TensorBoard's scalars.

    Args:
        folder: the run folder.
        config: the configuration as run.
        method: the method trained.
        seed: the seed trained.
        advance: takes the number of frames done since its last call.
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
        """Go on from the last checkpoint; from the start, after a sentence on why, where it cannot be used."""
        rows: list[Row] = []
        if self._checkpoints is not None:
            try:
                state, rows = self._checkpoints.restore(state) or (state, rows)
            except InputError as error:
                console.print(f"{error} This training starts again.", highlight=False, soft_wrap=True)
                self._checkpoints.remove()
        if self._board is not None:
            # Written from the first row on again: what was lost with an earlier attempt is made up for.
            rmtree(self._board, ignore_errors=True)
            self._writer = _summary_writer()(str(self._board), flush_secs=FLUSH_SECONDS)
            self._closing.callback(self._writer.close)
            for row in rows:
                self._write(row)
        if rows:
            self._move_bar(rows)
        return state, rows

    def add(self, state: State, rows: list[Row]) -> None:
        """Move the bar, write the last row, and keep the state where the last checkpoint is old enough."""
        self._move_bar(rows)
        if self._writer is not None:
            self._write(rows[-1])
        now = time.monotonic()
        if self._checkpoints is not None and now - self._saved_at >= 60 * self._settings.checkpoint_minutes:
            self._checkpoints.save(state, rows)
            self._saved_at = now

    def forget(self) -> None:
        """Remove the checkpoints; to be called once the result of the training is kept."""
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
    """The class of tensorboardX, which only trainings need.

    Where torch is installed, tensorboardX imports it for seconds, and not for scalars: it is hidden meanwhile.
    """
    hidden = "torch" not in sys.modules
    if hidden:
        sys.modules["torch"] = None  # pyrefly: ignore  None is how Python marks a module that must not be found
    try:
        return import_module("tensorboardX").SummaryWriter
    finally:
        if hidden:
            del sys.modules["torch"]
