"""What the host does between two chunks of a training."""

from collections.abc import Callable

from relm_irl_jax.agent.learning import Row, State, TrainingRecord


class ProgressRecord(TrainingRecord):
    """Moves a progress bar.

    Args:
        advance: takes the number of frames done since its last call.
    """

    def __init__(self, advance: Callable[[int], None]):
        self._advance = advance
        self._frames = 0.0

    def add(self, state: State, rows: list[Row]) -> None:
        """Move the bar to the last row's frames."""
        self._advance(int(rows[-1]["frames"] - self._frames))
        self._frames = rows[-1]["frames"]
