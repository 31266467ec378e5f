"""Settings of the image encoder; importing them does not load JAX."""

from pydantic import Field
from pydantic.dataclasses import dataclass

MIN_IMAGE_SIZE = 32
"""Smallest height and width of an image that ResNet-50 can encode."""


@dataclass(frozen=True)
class EncoderSettings:
    """Weights and image size of the encoder."""

    weights: str = "random"
    """random (untrained), imagenet (torchvision's V1), imagenet-v2, or a safetensors file."""

    seed: int = Field(default=0, ge=0)
    """Seed of the random weights."""

    image_size: int = Field(default=224, ge=MIN_IMAGE_SIZE)
    """Height and width at which views are encoded."""
