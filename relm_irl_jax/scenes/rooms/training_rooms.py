"""Numbers of the built-in rooms on which networks of this package are trained, apart from all that tasks evaluate on.

Rooms 0 to 99 and those from 10000 on are for evaluation.
"""

from collections.abc import Sequence

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.settings import ROOM_TYPES

FIRST_ROOM = 1000
"""Number of the first built-in training room of each type."""

LAST_ROOM = 9999
"""Number of the last one."""


def check_training_rooms(numbers: Sequence[int]) -> None:
    """Refuse rooms that are kept for evaluation.

    Args:
        numbers: numbers of built-in rooms.

    Raises:
        InputError: one lies outside `FIRST_ROOM` to `LAST_ROOM`.
    """
    for number in numbers:
        if not FIRST_ROOM <= number <= LAST_ROOM:
            raise InputError(
                f"Room {number} is kept for evaluation; networks are trained on rooms {FIRST_ROOM} to {LAST_ROOM}."
            )


def training_numbers(rooms: int) -> list[tuple[str, int]]:
    """Type and number of the built-in training rooms.

    Args:
        rooms: how many, spread over the room types.

    Returns:
        The rooms, the types in turn.

    Raises:
        InputError: there are not as many rooms.
    """
    numbers = [(ROOM_TYPES[i % len(ROOM_TYPES)], FIRST_ROOM + i // len(ROOM_TYPES)) for i in range(rooms)]
    check_training_rooms([number for _, number in numbers[-len(ROOM_TYPES) :]])
    return numbers
