"""The built-in scenes: procedural bathrooms, bedrooms and living rooms, without any download."""

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.furniture import CATEGORIES
from relm_irl_jax.scenes.layout import layout
from relm_irl_jax.scenes.render import box_table, render
from relm_irl_jax.scenes.scene import ROOM_TYPES, Scene, pose_graph, shortest_path_distances

VERSION = 3
"""Version of the generator. Raise it whenever rooms or pictures change: caches depend on it."""

SOURCE = f"rooms/{VERSION}"
"""`Scene.source` of these scenes."""


def generate_room(room_type: str, seed: int, *, size: str = "full", image_size: int = 224) -> Scene:
    """Generate a scene with its views; the same arguments give the same scene.

    Args:
        room_type: one of `ROOM_TYPES`.
        seed: number of the room, 0 or more.
        size: `full` for the original scenes' state counts, `tiny` for 12 to 20 places.
        image_size: rows and columns of a view.

    Returns:
        The scene, with views and the visible objects, without features.
    """
    if seed < 0:
        raise InputError(f"A room's seed must be 0 or more, not {seed}.")
    if image_size < 1:
        raise InputError(f"A room's image size must be 1 or more, not {image_size}.")
    kind = ROOM_TYPES.index(room_type) if room_type in ROOM_TYPES else 0  # layout refuses unknown names
    room = layout(room_type, np.random.default_rng([kind, seed, int(size == "tiny")]), size)
    location, rotation, graph = pose_graph(room.places)
    name = f"{room_type}-{seed}"
    observation, visible_object = render(
        box_table(room.boxes, room.light),
        location,
        rotation,
        size=image_size,
        n_categories=len(CATEGORIES),
        description=f"rendering {name}",
    )
    return Scene(
        name=name,
        room_type=room_type,
        location=location,
        rotation=rotation,
        graph=graph,
        shortest_path_distance=shortest_path_distances(graph),
        observation=observation,
        visible_object=visible_object,
        categories=CATEGORIES,
        source=SOURCE,
    )
