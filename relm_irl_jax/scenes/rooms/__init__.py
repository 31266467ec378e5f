"""The built-in scenes: procedural bathrooms, bedrooms and living rooms, generated without any download.

Names are imported when they are first used, so that processes that only read cached rooms do not load JAX.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import on_first_use

if TYPE_CHECKING:
    from relm_irl_jax.scenes.rooms.cache import built_in_room as built_in_room
    from relm_irl_jax.scenes.rooms.generate import generate_room as generate_room

_HOME = {"built_in_room": "cache", "generate_room": "generate"}

__all__ = sorted(_HOME)

__getattr__ = on_first_use(__name__, _HOME)
