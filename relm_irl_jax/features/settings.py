"""Settings of the image encoder; importing them does not load JAX."""

from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import ImageSize, Seed

MIN_IMAGE_SIZE = 32
"""Smallest height and width of an image that ResNet-50 can encode."""

RESNET_IMAGE_SIZE = 224
"""Height and width of the images that ResNet-50 encodes, by default."""

SMALL_IMAGE_SIZE = 64
"""Height and width of the images that the small network encodes."""

Observed = Literal["features", "frames"]
"""What an agent observes of a view."""

SHIPPED = ("rooms", "rooms-paths")
"""Weights of the small network that come with the package."""


@dataclass(frozen=True)
class EncoderSettings:
    """Weights and image size of the encoder."""

    weights: str = "auto"
    """rooms (small network trained on generated rooms, by perception alone), rooms-paths (the same, which also learned
    shortest paths there), random (untrained ResNet-50), imagenet (ResNet-50 with torchvision's V1), imagenet-v2, or a
    safetensors file of either network. auto: rooms for the built-in scenes; for others, the features in
    their files, or random where there are none."""

    seed: Seed = 0
    """Seed of the random weights."""

    image_size: Annotated[ImageSize, Field(ge=MIN_IMAGE_SIZE)] | None = None
    """Height and width at which views are encoded; by default 224 for ResNet-50. The small network's is always 64."""


def settings_for(settings: EncoderSettings, *, built_in: bool) -> EncoderSettings:
    """Settle what `auto` means for the built-in scenes.

    Args:
        settings: the settings.
        built_in: whether the scenes are the built-in rooms.

    Returns:
        Settings with `rooms` in the place of `auto` for built-in scenes, and the same settings otherwise.
    """
    return replace(settings, weights="rooms") if built_in and settings.weights == "auto" else settings
