"""Scenes of an experiment: encoded for agents that use features, with views for those that look at frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from relm_irl_jax.api.scenes import Scenes
from relm_irl_jax.config import Config
from relm_irl_jax.features.settings import Observed
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import check_scenes_setting, loader, training_scenes, unseen_scenes
from relm_irl_jax.scenes.views import resized
from relm_irl_jax.stages.encoding import (
    EncodedScenes,
    encode_more,
    encode_scenes,
    encode_training,
    scene_settings,
    scenes_without_features,
)
from relm_irl_jax.stages.make_agent import needs_features
from relm_irl_jax.stages.worlds import EvaluationTask, evaluation_task


@dataclass(frozen=True, eq=False)
class Setting:
    """The scenes of an experiment and its settings.

    Attributes:
        config: the settings.
        training: the encoded training scenes.
        scenes: the training scenes as given, if they were given as a list.
        unseen: the scenes of Task III as given, if they were given as a list.
    """

    config: Config
    training: EncodedScenes
    scenes: Sequence[Scene] | None = None
    unseen: Sequence[Scene] | None = None

    def task(self, name: str, seed: int) -> EvaluationTask:
        """Scenes and targets of a task for one seed."""
        unseen = None
        if self.unseen is not None and name == "III":
            unseen = encode_more(self.training, [loader(scene) for scene in self.unseen])
        return evaluation_task(self.config, self.training, name, seed, unseen)

    def observed(self, task: EvaluationTask, obs: Observed) -> list[np.ndarray]:
        """What is observed of the views of a task's scenes, [states, ...] for each."""
        if obs == "features":
            return [scene.encoded for scene in task.scenes]
        given = self.unseen if task.name == "III" else self.scenes
        if given is None:
            load = unseen_scenes if task.name == "III" else training_scenes
            given = [each() for each in load(self.config.scenes, scene_settings(self.config))]
        views = {scene.name: scene.views for scene in given}
        return [views[scene.name] for scene in task.scenes]


@dataclass(frozen=True, eq=False)
class ListedViews:
    """Views of listed scenes by the scene's name, for an agent that looks at pixels.

    Attributes:
        scenes: the scenes.
        size: rows and columns of a view.
    """

    scenes: Sequence[Scene]
    size: int

    def __call__(self, name: str) -> UInt8[np.ndarray, "states size size 3"]:
        """Views of a scene at the agent's size.

        Raises:
            InputError: the scene has no views.
        """
        return resized(next(scene for scene in self.scenes if scene.name == name), self.size)


def prepare(scenes: Scenes, config: Config, unseen: Sequence[Scene] | None = None) -> Setting:
    """Encode the training scenes.

    Args:
        scenes: the scenes.
        config: their settings, see `config_of`.
        unseen: scenes of Task III; None for those of the configuration.

    Returns:
        The setting.
    """
    if isinstance(scenes, str | Path):
        check_scenes_setting(config.scenes)
        return Setting(config, _encoded(config), None, unseen)
    loaders = [loader(scene) for scene in scenes]
    encoded = encode_scenes(config, loaders) if needs_features(config) else scenes_without_features(loaders)
    return Setting(config, encoded, scenes, unseen if unseen is not None else [])


@lru_cache(maxsize=1)
def _encoded(config: Config) -> EncodedScenes:
    return encode_training(config)
