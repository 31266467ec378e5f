import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.rooms.training_rooms import FIRST_ROOM, LAST_ROOM, check_training_rooms, training_numbers


def test_training_rooms_are_apart_from_every_room_of_a_task():
    numbers = [number for _, number in training_numbers(3 * (LAST_ROOM - FIRST_ROOM + 1))]
    assert min(numbers) >= 100
    assert max(numbers) < 10000
    for forbidden in (0, 4, 99, 999, 10000, 123456):
        with pytest.raises(InputError, match="kept for evaluation"):
            check_training_rooms([FIRST_ROOM, forbidden])
    with pytest.raises(InputError, match="kept for evaluation"):
        training_numbers(3 * (LAST_ROOM - FIRST_ROOM + 2))
