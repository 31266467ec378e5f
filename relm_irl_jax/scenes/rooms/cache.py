"""Cache of built-in rooms: each room is generated once, and then read from the user's cache folder."""

from contextlib import suppress

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import cache_folder, has_checksum, write_checksum
from relm_irl_jax.scenes.rooms.room_specifications import VERSION
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.scene_file import read_scene, save_scene


def built_in_room(
    room_type: str, number: int, *, size: str = "full", image_size: int = 224, views: bool = True
) -> Scene:
    """Read a built-in room from the cache; generate and save it if it is missing or its checksum differs.

    Args:
        room_type: one of `ROOM_TYPES`.
        number: the room's number, which is its seed.
        size: `full` or `tiny`.
        image_size: rows and columns of a view.
        views: whether to read the views.

    Returns:
        The room.
    """
    path = cache_folder() / f"rooms-{VERSION}-{size}-{image_size}" / f"{room_type}-{number}.h5"
    if has_checksum(path):
        # Another process may replace the file meanwhile, by the same room.
        with suppress(InputError):
            return read_scene(path, views=views)
    from relm_irl_jax.scenes.rooms.generate import generate_room  # loads JAX

    scene = generate_room(room_type, number, size=size, image_size=image_size)
    with suppress(OSError):  # without a cache folder, the room is generated again
        save_scene(scene, path)
        write_checksum(path)
    return scene if views else scene.without_views()
