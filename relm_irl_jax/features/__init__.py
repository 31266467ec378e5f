"""Features of views: the image encoder, its weights and the cache.

Names are imported on first use, so that processes that only need the settings do not load JAX.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import lazy_getattr

if TYPE_CHECKING:
    from relm_irl_jax.features.cache import encode_cached as encode_cached
    from relm_irl_jax.features.encoder import Encoder as Encoder
    from relm_irl_jax.features.encoder import encode as encode
    from relm_irl_jax.features.encoder import make_encoder as make_encoder
    from relm_irl_jax.features.settings import EncoderSettings as EncoderSettings

_MODULES = {
    "Encoder": "encoder",
    "EncoderSettings": "settings",
    "encode": "encoder",
    "encode_cached": "cache",
    "make_encoder": "encoder",
}

__all__ = sorted(_MODULES)

__getattr__ = lazy_getattr(__name__, _MODULES)
