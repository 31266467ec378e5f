"""Generation of built-in scenes: bathrooms, bedrooms and living rooms."""

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.rooms.floor_plan import draw_floor_plan
from relm_irl_jax.scenes.rooms.furniture import CATEGORIES
from relm_irl_jax.scenes.rooms.ray_casting import pack_boxes
from relm_irl_jax.scenes.rooms.rendering import render_views
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE
from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances
from relm_irl_jax.scenes.settings import ROOM_TYPES


def generate_room(
    room_type: str, seed: int, *, size: str = "full", image_size: int = 224, show_progress: bool = True
) -> Scene:
    """Generate a scene with its views, deterministically.

    Args:
        room_type: one of `ROOM_TYPES`.
        seed: number of the room, 0 or more.
        size: `full` for the state counts of the original scenes, `tiny` for 12 to 20 places.
        image_size: rows and columns of a view.
        show_progress: whether to show a progress bar.

    Returns:
        The scene, with views and visible objects, without features.

    Raises:
        InputError: an argument is out of range.
    """
    if seed < 0:
        raise InputError(f"A room's seed must be 0 or more, not {seed}.")
    if image_size < 1:
        raise InputError(f"A room's image size must be 1 or more, not {image_size}.")
    kind = ROOM_TYPES.index(room_type) if room_type in ROOM_TYPES else 0  # draw_floor_plan refuses unknown names
    rng = np.random.default_rng([kind, seed, int(size == "tiny")])
    plan = draw_floor_plan(room_type, rng, size)
    location, rotation, graph = pose_graph(plan.places)
    name = f"{room_type}-{seed}"
    observation, visible_object = render_views(
        pack_boxes(plan.boxes, plan.light),
        location,
        rotation,
        size=image_size,
        description=f"rendering {name}" if show_progress else None,
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
