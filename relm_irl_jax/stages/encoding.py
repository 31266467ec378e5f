"""First stage: scenes and the features of their views."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import UInt8

from relm_irl_jax.config import Config, read_fields
from relm_irl_jax.errors import InputError
from relm_irl_jax.features.cache import encode_scene
from relm_irl_jax.features.encoder import N_CALIBRATION_VIEWS, Encoder, Views, image_size_of, make_encoder
from relm_irl_jax.files import write_json
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import SceneLoader, training_scenes, unseen_scenes
from relm_irl_jax.scenes.settings import ROOMS, SceneSettings
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
    loaders = training_scenes(config.scenes, scene_settings(config))
    return encode_scenes(config, loaders) if needs_features(config) else scenes_without_features(loaders)


def scenes_without_features(loaders: Sequence[SceneLoader]) -> EncodedScenes:
    """Scenes for agents that look at pixels, where no reward needs features.

    Args:
        loaders: the scenes.

    Returns:
        The scenes, their features without columns.
    """
    return EncodedScenes([_without_features(load(views=False)) for load in loaders], None, NO_ENCODER)


def encode_scenes(config: Config, loaders: Sequence[SceneLoader]) -> EncodedScenes:
    """Prepare scenes to train in.

    Args:
        config: the configuration, which says how built-in rooms are encoded.
        loaders: the scenes.

    Returns:
        The scenes with features.

    Raises:
        InputError: the encoder was trained on one of the scenes.
    """
    settings = config.resolved().encoder
    if settings.weights == "auto":
        scenes = [load(views=False) for load in loaders]
        if all(scene.features is not None for scene in scenes):
            return EncodedScenes(scenes, None, scenes[0].encoder)
    # The statistics of random weights are measured on training views only, so that unseen scenes stay unseen.
    share = -(-N_CALIBRATION_VIEWS // len(loaders))
    random = settings.weights in ("random", "auto")
    calibration = [_evenly_spaced(load().views, share) for load in loaders] if random else []
    encoder = make_encoder(settings, np.concatenate(calibration) if calibration else None)
    scenes = [_encoded(load, encoder) for load in loaders]
    if config.scenes == ROOMS or all(scene.source == SOURCE for scene in scenes):
        _check_apart(encoder, scenes)
    return EncodedScenes(scenes, encoder, encoder.name)


def encode_unseen(config: Config, training: EncodedScenes) -> list[Scene]:
    """Prepare the scenes of Task III with the encoder of the training scenes.

    Args:
        config: the configuration.
        training: the training scenes.

    Returns:
        The unseen scenes with features.
    """
    return _encode_unseen(config.scenes, scene_settings(config), training)


def scene_settings(config: Config) -> SceneSettings:
    """The settings of scenes, with the size at which built-in rooms are rendered where nobody looks at them.

    Args:
        config: the configuration.
    """
    return replace(config.scene, image_size=config.scene.image_size or image_size_of(config.resolved().encoder))


def check_encoder(folder: RunFolder, encoded: EncodedScenes) -> None:
    """Note the encoder of a run's first training, and refuse another one afterwards.

    Args:
        folder: the run folder.
        encoded: the training scenes.

    Raises:
        InputError: agents of the run were trained with another encoder.
    """
    fingerprint = encoded.encoder.fingerprint if encoded.encoder else ""
    found = {"name": encoded.encoder_name, "fingerprint": fingerprint}
    if not folder.encoder.exists():
        write_json(folder.encoder, found)
        return
    noted = read_fields(folder.encoder)
    if noted != found:
        raise InputError(
            f"run: the agents in {folder.path} were trained with encoder {noted.get('name')}, not {found['name']} as "
            "the weights are now; restore those weights, or give another run folder."
        )


def _check_apart(encoder: Encoder, scenes: Sequence[Scene]) -> None:
    """Refuse scenes that the encoder was trained on, where they must be new to it."""
    known = sorted({scene.name for scene in scenes} & encoder.trained_scenes)
    if known:
        raise InputError(
            f"encoder: {encoder.name} was trained on {known[0]}, which must be new to it here; choose other scenes, or "
            "another encoder with --encoder.weights."
        )


@lru_cache(maxsize=1)
def _encode_unseen(source: str, settings: SceneSettings, training: EncodedScenes) -> list[Scene]:
    return encode_more(training, unseen_scenes(source, settings))


def encode_more(training: EncodedScenes, loaders: Sequence[SceneLoader]) -> list[Scene]:
    """Prepare other scenes with the encoder of the training scenes.

    Args:
        training: the training scenes.
        loaders: the other scenes.

    Returns:
        The other scenes with features.
    """
    if training.scenes[0].encoded.shape[1] == 0:
        return scenes_without_features(loaders).scenes
    if training.encoder is None:
        return [load(views=False) for load in loaders]
    scenes = [_encoded(load, training.encoder) for load in loaders]
    _check_apart(training.encoder, scenes)
    return scenes


def _evenly_spaced(views: Views, count: int) -> UInt8[np.ndarray, "chosen height width 3"]:
    """A few views, without keeping the others in memory."""
    return views[:: max(1, len(views) // count)][:count].copy()


def _encoded(load: SceneLoader, encoder: Encoder) -> Scene:
    """The scene with features, without the views that they are computed from."""
    return encode_scene(load(), encoder).without_views()


def _without_features(scene: Scene) -> Scene:
    """The scene without views, its features without columns."""
    return replace(scene.without_views(), features=np.zeros((scene.n_states, 0), np.float32))
