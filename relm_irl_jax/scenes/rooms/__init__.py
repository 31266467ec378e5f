"""The built-in scenes: procedural bathrooms, bedrooms and living rooms, generated without any download.

Names are imported on first use, so that processes that only read cached rooms do not load JAX.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import lazy_getattr

if TYPE_CHECKING:
    from relm_irl_jax.scenes.rooms.cache import built_in_room as built_in_room
    from relm_irl_jax.scenes.rooms.generate import generate_room as generate_room

_MODULES = {"built_in_room": "cache", "generate_room": "generate"}

__all__ = sorted(_MODULES)

__getattr__ = lazy_getattr(__name__, _MODULES)
