"""Settings of the image encoder; importing them does not load JAX."""

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import ImageSize, Seed

MIN_IMAGE_SIZE = 32
"""Smallest height and width of an image that ResNet-50 can encode."""


@dataclass(frozen=True)
class EncoderSettings:
    """Weights and image size of the encoder."""

    weights: str = "random"
    """random (untrained), imagenet (torchvision's V1), imagenet-v2, or a safetensors file."""

    seed: Seed = 0
    """Seed of the random weights."""

    image_size: Annotated[ImageSize, Field(ge=MIN_IMAGE_SIZE)] = 224
    """Height and width at which views are encoded."""
