"""Settings of the image encoder; importing them does not load JAX."""

from pydantic import Field
from pydantic.dataclasses import dataclass

MIN_IMAGE_SIZE = 32
"""Smallest height and width of an image that ResNet-50 can encode."""


@dataclass(frozen=True)
class EncoderSettings:
    """The image encoder: which weights, at which size."""

    weights: str = "random"
    """random (seeded, untrained), imagenet (torchvision's V1), imagenet-v2, or a file of safetensors."""

    seed: int = Field(default=0, ge=0)
    """Seed of random weights."""

    image_size: int = Field(default=224, ge=MIN_IMAGE_SIZE)
    """Height and width at which views are encoded."""
