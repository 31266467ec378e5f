"""Rooms that are rendered once for all tests of this folder."""

import pytest

from relm_irl_jax.scenes.rooms.generate import generate_room
from relm_irl_jax.scenes.settings import ROOM_TYPES

from .sizes import IMAGE_SIZE


@pytest.fixture(scope="session", params=ROOM_TYPES)
def room(request):
    """A full room of each type."""
    return generate_room(request.param, 0, image_size=IMAGE_SIZE)
