"""First stage: scenes and the features of their views."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from relm_irl_jax.config import Config
from relm_irl_jax.features.cache import encode_scene
from relm_irl_jax.features.encoder import N_CALIBRATION_VIEWS, Encoder, make_encoder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import ROOMS, SceneSettings, training_scenes, unseen_scenes
from relm_irl_jax.stages.make_agent import needs_features

NO_ENCODER = "none"
"""Name of the encoder in results of agents that look at pixels."""


@dataclass(frozen=True, eq=False)
class EncodedScenes:
    """Scenes with features, and their encoder; compared by identity.

    Attributes:
        scenes: the scenes, without their views.
        encoder: the encoder; None if the scene files contain features, or nothing needs features.
        encoder_name: name of the encoder in results.
    """

    scenes: list[Scene]
    encoder: Encoder | None
    encoder_name: str


def encode_training(config: Config) -> EncodedScenes:
    """Prepare the training scenes.

    Args:
        config: the configuration.

    Returns:
        The training scenes with features; without columns if neither the agents nor the rewards need features.
    """
    if not needs_features(config):
        scenes = training_scenes(config.scenes, config.scene, views=False)
        return EncodedScenes([_without_features(scene) for scene in scenes], None, NO_ENCODER)
    return encode_scenes(config, training_scenes(config.scenes, config.scene))


def encode_scenes(config: Config, scenes: list[Scene]) -> EncodedScenes:
    """Prepare scenes to train in.

    Args:
        config: the configuration, which says how built-in rooms are encoded.
        scenes: the scenes with views.

    Returns:
        The scenes with features.
    """
    if config.scenes != ROOMS and all(scene.features is not None for scene in scenes):
        return EncodedScenes([scene.without_views() for scene in scenes], None, scenes[0].encoder)
    # The statistics of random weights are measured on training views only, so that unseen scenes stay unseen.
    share = -(-N_CALIBRATION_VIEWS // len(scenes))
    views = [scene.views[:: max(1, scene.n_states // share)][:share] for scene in scenes]
    encoder = make_encoder(config.encoder, np.concatenate(views))
    return EncodedScenes([encode_scene(scene, encoder).without_views() for scene in scenes], encoder, encoder.name)


def encode_unseen(config: Config, training: EncodedScenes) -> list[Scene]:
    """Prepare the scenes of Task III with the encoder of the training scenes.

    Args:
        config: the configuration.
        training: the training scenes.

    Returns:
        The unseen scenes with features.
    """
    return _encode_unseen(config.scenes, config.scene, training)


@lru_cache(maxsize=1)
def _encode_unseen(source: str, settings: SceneSettings, training: EncodedScenes) -> list[Scene]:
    if training.scenes[0].encoded.shape[1] == 0:
        return [_without_features(scene) for scene in unseen_scenes(source, settings, views=False)]
    return encode_more(training, unseen_scenes(source, settings))


def encode_more(training: EncodedScenes, scenes: list[Scene]) -> list[Scene]:
    """Prepare other scenes with the encoder of the training scenes.

    Args:
        training: the training scenes.
        scenes: the other scenes with views.

    Returns:
        The other scenes with features.
    """
    if training.encoder is None:
        return [scene.without_views() for scene in scenes]
    return [encode_scene(scene, training.encoder).without_views() for scene in scenes]


def _without_features(scene: Scene) -> Scene:
    """The scene without views, its features without columns."""
    return replace(scene.without_views(), features=np.zeros((scene.n_states, 0), np.float32))
