"""Views, and one encoder of 32x32 images: ResNet-50 is compiled once for encoding and once for calibrating."""

import numpy as np
import pytest

from relm_irl_jax.features import EncoderSettings, make_encoder

IMAGE_SIZE = 32


def draw_views(n, seed=0):
    """Rooms in miniature: a floor, a wall and coloured rectangles."""
    rng = np.random.default_rng(seed)
    views = np.empty((n, IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8)
    for view in views:
        horizon = rng.integers(IMAGE_SIZE // 3, 2 * IMAGE_SIZE // 3)
        view[:horizon], view[horizon:] = rng.integers(0, 256, (2, 3))
        for _ in range(4):
            top, left = rng.integers(0, IMAGE_SIZE * 3 // 4, 2)
            view[top : top + IMAGE_SIZE // 4, left : left + IMAGE_SIZE // 3] = rng.integers(0, 256, 3)
    return views


@pytest.fixture(scope="session")
def views():
    """More than one batch of views, and no multiple of it."""
    return draw_views(24)


@pytest.fixture(scope="session")
def settings():
    return EncoderSettings(weights="random", image_size=IMAGE_SIZE)


@pytest.fixture(scope="session")
def encoder(settings, views):
    return make_encoder(settings, views)
