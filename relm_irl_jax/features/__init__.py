"""Features of views: the image encoder, its weights and the cache.

Names are imported when they are first used, so that processes that only need the settings do not load JAX.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import on_first_use

if TYPE_CHECKING:
    from relm_irl_jax.features.cache import encode_cached as encode_cached
    from relm_irl_jax.features.encoder import Encoder as Encoder
    from relm_irl_jax.features.encoder import encode as encode
    from relm_irl_jax.features.encoder import make_encoder as make_encoder
    from relm_irl_jax.features.settings import EncoderSettings as EncoderSettings

_HOME = {
    "Encoder": "encoder",
    "EncoderSettings": "settings",
    "encode": "encoder",
    "encode_cached": "cache",
    "make_encoder": "encoder",
}

__all__ = sorted(_HOME)

__getattr__ = on_first_use(__name__, _HOME)
