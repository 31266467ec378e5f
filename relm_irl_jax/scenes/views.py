"""Views of scenes at the size that an agent asks for."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import scene_to_show
from relm_irl_jax.scenes.settings import SceneSettings


@lru_cache(maxsize=32)
def scene_views(scenes: str, settings: SceneSettings, size: int, name: str) -> UInt8[np.ndarray, "states size size 3"]:
    """Views of one scene; those of the scenes asked for last are kept.

    Args:
        scenes: `rooms`, or a folder of scene files.
        settings: which scenes.
        size: rows and columns of a view. Built-in rooms are rendered at this size; the views of files are resized.
        name: the scene's name.

    Returns:
        RGB view of each state.

    Raises:
        InputError: there is no such scene, or it has no views.
    """
    return resized(scene_to_show(scenes, replace(settings, image_size=size), name), size)


def resized(scene: Scene, size: int) -> UInt8[np.ndarray, "states size size 3"]:
    """Resize a scene's views by averaging over the area of each new pixel.

    Args:
        scene: the scene with views.
        size: rows and columns of a view.

    Returns:
        The views.

    Raises:
        InputError: the scene has no views.
    """
    views = scene.views
    if views.shape[1:3] == (size, size):
        return views
    return np.stack([np.asarray(Image.fromarray(view).resize((size, size), Image.Resampling.BOX)) for view in views])
