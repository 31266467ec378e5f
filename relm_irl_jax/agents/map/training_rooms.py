"""The rooms that the mapping agent trains on: generated ones that no task evaluates on, or given scenes.

Only a window of the generated rooms is held in memory: it moves on through all of them as training advances, so that
memory does not grow with their number.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

from relm_irl_jax.agents.map.network import VIEW
from relm_irl_jax.agents.map.rooms import Room, to_room
from relm_irl_jax.scenes.rooms.training_rooms import training_numbers

WINDOW = 96
"""Generated rooms that are held in memory, about 0.5 GB."""


@runtime_checkable
class TrainingRooms(Protocol):
    """Rooms to walk in."""

    def at(self, progress: float) -> Sequence[Room]:
        """Rooms of the moment, one of which is drawn uniformly for each update.

        Args:
            progress: share of the training that is done, in [0, 1).

        Returns:
            The rooms; a function of `progress` alone.
        """
        ...


@dataclass(frozen=True, eq=False)
class GivenRooms:
    """The same rooms all the time.

    Attributes:
        rooms: the rooms.
    """

    rooms: Sequence[Room]

    def at(self, progress: float) -> Sequence[Room]:
        """All rooms."""
        return self.rooms


@dataclass(frozen=True)
class GeneratedRooms:
    """Generated rooms of all types, in turn. Living rooms, the hardest, are drawn twice as often as the others.

    Attributes:
        count: number of rooms, spread over the room types.
        size: `full` or `tiny`, as in `relm_irl_jax.scenes.rooms.generate_room`.
    """

    count: int
    size: str = "full"

    def at(self, progress: float) -> Sequence[Room]:
        """A window of the rooms, which moves through all of them once; see `TrainingRooms`."""
        rooms = []
        for room_type, number in self.numbers_at(progress):
            room = _generated(room_type, number, self.size)
            rooms += [room] * (2 if room_type == "living_room" else 1)
        return rooms

    def numbers_at(self, progress: float) -> list[tuple[str, int]]:
        """Types and numbers of the rooms of the moment.

        Args:
            progress: share of the training that is done, in [0, 1).

        Returns:
            At most `WINDOW` of them.
        """
        numbers = training_numbers(self.count)
        first = round(progress * (len(numbers) - WINDOW)) if len(numbers) > WINDOW else 0
        return numbers[first : first + WINDOW]


@lru_cache(maxsize=WINDOW)
def _generated(room_type: str, number: int, size: str) -> Room:
    from relm_irl_jax.scenes.rooms.generate import generate_room

    return to_room(generate_room(room_type, number, size=size, image_size=VIEW, show_progress=False))
