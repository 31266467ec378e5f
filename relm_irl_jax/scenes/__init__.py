"""Scenes: the structure, the file format and the sources.

Names are imported when they are first used, so that processes that only need the structure do not load JAX.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import on_first_use

if TYPE_CHECKING:
    from relm_irl_jax.scenes.dump import load_scene as load_scene
    from relm_irl_jax.scenes.dump import save_scene as save_scene
    from relm_irl_jax.scenes.record import record_scene as record_scene
    from relm_irl_jax.scenes.rooms import generate_room as generate_room
    from relm_irl_jax.scenes.scene import Scene as Scene
    from relm_irl_jax.scenes.source import Pose as Pose
    from relm_irl_jax.scenes.source import Source as Source
    from relm_irl_jax.scenes.source import View as View
    from relm_irl_jax.scenes.source import stepped as stepped

_HOME = {
    "Pose": "source",
    "Scene": "scene",
    "Source": "source",
    "View": "source",
    "generate_room": "rooms",
    "load_scene": "dump",
    "record_scene": "record",
    "save_scene": "dump",
    "stepped": "source",
}

__all__ = sorted(_HOME)

__getattr__ = on_first_use(__name__, _HOME)
