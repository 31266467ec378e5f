"""Scenes: the structure, the file format and the sources.

Names are imported when they are first used, so that processes that only need the structure do not load JAX.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import on_first_use

if TYPE_CHECKING:
    from relm_irl_jax.scenes.dump import load_scene as load_scene
    from relm_irl_jax.scenes.dump import save_scene as save_scene
    from relm_irl_jax.scenes.rooms import generate_room as generate_room
    from relm_irl_jax.scenes.scene import Scene as Scene

_HOME = {"Scene": "scene", "generate_room": "rooms", "load_scene": "dump", "save_scene": "dump"}

__all__ = sorted(_HOME)

__getattr__ = on_first_use(__name__, _HOME)
