"""Scenes: the structure, the file format and the sources.

Names are imported when they are first used, so that processes that only need the structure do not load JAX.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relm_irl_jax.scenes.dump import load_scene as load_scene
    from relm_irl_jax.scenes.dump import save_scene as save_scene
    from relm_irl_jax.scenes.rooms import generate_room as generate_room
    from relm_irl_jax.scenes.scene import Scene as Scene

_HOME = {"Scene": "scene", "generate_room": "rooms", "load_scene": "dump", "save_scene": "dump"}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
