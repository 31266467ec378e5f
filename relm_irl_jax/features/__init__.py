"""Features of views: the image encoder, its weights and the cache."""

from relm_irl_jax.features.cache import encode_cached
from relm_irl_jax.features.encoder import Encoder, EncoderSettings, encode, encode_maps, make_encoder

__all__ = ["Encoder", "EncoderSettings", "encode", "encode_cached", "encode_maps", "make_encoder"]
