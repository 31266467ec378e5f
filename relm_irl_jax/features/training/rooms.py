"""Built-in rooms and scene files as training scenes."""

from collections.abc import Sequence
from functools import partial

from relm_irl_jax.features.convnet import VIEW
from relm_irl_jax.features.training.labels import LabelledScene, label_scene
from relm_irl_jax.scenes.rooms.furniture import CATEGORIES
from relm_irl_jax.scenes.rooms.generate import generate_room


def labelled_room(room_type: str, number: int) -> LabelledScene:
    """Generate a built-in room.

    Args:
        room_type: its type.
        number: its number.

    Returns:
        The room with its labels.
    """
    return label_scene(generate_room(room_type, number, image_size=VIEW, show_progress=False), CATEGORIES)


def room_loaders(rooms: Sequence[tuple[str, int]]) -> list[partial[LabelledScene]]:
    """Functions that generate built-in rooms.

    Args:
        rooms: type and number of each.
    """
    return [partial(labelled_room, room_type, number) for room_type, number in rooms]
