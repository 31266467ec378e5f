"""Scenes, targets and features of environments, from the arguments of `gymnasium.make`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.gym.problem import NavigationProblem, Options
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.rooms.cache import built_in_room
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.scene_file import load_scene
from relm_irl_jax.scenes.selection import check_scenes_setting, loader, training_scenes, unseen_scenes
from relm_irl_jax.scenes.settings import ROOM_TYPES, SceneSettings
from relm_irl_jax.tasks import Target, draw_split

if TYPE_CHECKING:
    from relm_irl_jax.stages.encoding import EncodedScenes

SPLITS = ("train", "test")


def find_scene(scene: Scene | Path | str) -> Scene:
    """Load the scene that an argument refers to.

    Args:
        scene: a scene, a scene file, or the name of a built-in room such as `bathroom-0`.

    Returns:
        The scene.

    Raises:
        InputError: there is no such scene.
    """
    if isinstance(scene, Scene):
        return scene
    room_type, _, number = str(scene).rpartition("-")
    if room_type in ROOM_TYPES and number.isdecimal():
        return built_in_room(room_type, int(number))
    if Path(scene).is_file():
        return load_scene(Path(scene))
    raise InputError(
        f"scene: {scene} is neither a scene file nor a built-in room; give a path, or a name such as {ROOM_TYPES[0]}-0."
    )


def target_states(scene: Scene, target: int | str | Sequence[int] | None) -> list[int]:
    """States that may be targets of episodes.

    Args:
        scene: the scene.
        target: a state, several states, a category of objects, or None.

    Returns:
        At least one state.

    Raises:
        InputError: the scene has no such state or category.
    """
    views = best_views(scene) if scene.visible_object is not None else {}
    if target is None:
        return sorted(set(views.values())) or list(range(scene.n_states))
    if isinstance(target, str):
        if target not in views:
            shown = ", ".join(sorted(views)) or "no labelled object"
            raise InputError(f"target: {scene.name} shows no {target}; it shows {shown}.")
        return [views[target]]
    states = [int(state) for state in np.atleast_1d(target)]
    outside = [state for state in states if not 0 <= state < scene.n_states]
    if outside or not states:
        raise InputError(f"target: {outside} is not in {scene.name}; give states from 0 to {scene.n_states - 1}.")
    return states


def navigation_problem(
    scene: Scene | Path | str, target: int | str | Sequence[int] | None, options: Options, *, rendered: bool
) -> NavigationProblem:
    """The problem of one scene, with targets of the user's choice.

    Args:
        scene: see `find_scene`.
        target: see `target_states`.
        options: how it is presented.
        rendered: whether views are rendered.

    Returns:
        The problem. Views are encoded only if features are observed and the scene has none.

    Raises:
        InputError: there is no such scene or target.
    """
    found = _found(scene) if isinstance(scene, str) else find_scene(scene)
    if options.obs == "features" and found.features is None:
        found = _found_and_encoded(scene) if isinstance(scene, str) else encoded(found)
    targets = [Target(0, state) for state in target_states(found, target)]
    return NavigationProblem([found], targets, options, [found.views] if rendered else None)


# Scenes are kept, so that the workers of a vector environment, forked from a process that has made one environment,
# neither read nor encode them again: JAX may not be used in a forked process.
@lru_cache(maxsize=4)
def _found(scene: str) -> Scene:
    return find_scene(scene)


@lru_cache(maxsize=4)
def _found_and_encoded(scene: str) -> Scene:
    return encoded(_found(scene))


def encoded(scene: Scene) -> Scene:
    """A scene with features of the default encoder, whose batch-norm statistics are measured on the scene's views.

    Args:
        scene: the scene with views.

    Returns:
        The scene with features.
    """
    from relm_irl_jax.features.cache import encode_scene  # loads JAX
    from relm_irl_jax.features.encoder import N_CALIBRATION_VIEWS, make_encoder
    from relm_irl_jax.features.settings import EncoderSettings, settings_for
    from relm_irl_jax.scenes.rooms.room_specifications import SOURCE

    calibration_views = scene.views[:: max(1, scene.n_states // N_CALIBRATION_VIEWS)]
    settings = settings_for(EncoderSettings(), built_in=scene.source == SOURCE)
    return encode_scene(scene, make_encoder(settings, calibration_views))


@dataclass(frozen=True, eq=False)
class TaskScenes:
    """The scenes of a task.

    Attributes:
        config: scenes, task, numbers of targets, encoder.
        training: the training scenes with views, instead of the configuration's.
        unseen: the scenes of Task III with views, instead of the configuration's.
    """

    config: Config
    training: Sequence[Scene] | None = None
    unseen: Sequence[Scene] | None = None

    def observed(self, *, unseen: bool, obs: str) -> list[Scene]:
        """Training or unseen scenes, with what is observed."""
        if obs == "frames":
            return self.pictured(unseen=unseen)
        if self.training is None:
            config = replace(self.config, task="I")
            return _encoded_unseen(config) if unseen else _encoded_training(config).scenes
        from relm_irl_jax.stages.encoding import encode_more, encode_scenes  # loads JAX

        training = encode_scenes(self.config, [loader(scene) for scene in self.training])
        return encode_more(training, [loader(scene) for scene in self.unseen or ()]) if unseen else training.scenes

    def pictured(self, *, unseen: bool) -> list[Scene]:
        """Training or unseen scenes, with views."""
        given = self.unseen if unseen else self.training
        if self.training is not None:
            return list(given or ())
        check_scenes_setting(self.config.scenes)
        from relm_irl_jax.stages.encoding import scene_settings  # loads JAX

        return _loaded(self.config.scenes, scene_settings(self.config), unseen)


def task_problem(
    scenes: TaskScenes, seed: int, split: str, options: Options, *, rendered: bool = False
) -> NavigationProblem:
    """The problem of a task, with the scenes and targets that the tables are made with.

    Args:
        scenes: the scenes.
        seed: the seed that draws the targets.
        split: `train` for the training scenes and targets, `test` for those on which the task is evaluated.
        options: how it is presented.
        rendered: whether views are rendered.

    Returns:
        The problem.

    Raises:
        InputError: the scenes cannot be used, or an argument is none of its values.
    """
    if split not in SPLITS:
        raise InputError(f"split = {split!r} is refused; give train or test.")
    config = scenes.config
    elsewhere = split == "test" and config.task == "III"
    training = scenes.observed(unseen=False, obs=options.obs)
    others = scenes.observed(unseen=True, obs=options.obs) if elsewhere else []
    if elsewhere and not others:
        raise InputError("unseen: Task III needs scenes that the agent was not trained in; give a list of them.")
    drawn = draw_split(training, others, config.tasks, seed)
    chosen = drawn.training if split == "train" else drawn.of_task(config.task, config.evaluation)
    number = {old: new for new, old in enumerate(sorted({target.scene for target in chosen}))}
    pictures = [scene.views for scene in scenes.pictured(unseen=elsewhere)] if rendered else None
    return NavigationProblem(
        [(others if elsewhere else training)[old] for old in number],
        [replace(target, scene=number[target.scene]) for target in chosen],
        options,
        [pictures[old] for old in number] if pictures else None,
    )


@lru_cache(maxsize=2)
def _encoded_training(config: Config) -> "EncodedScenes":
    from relm_irl_jax.stages.encoding import encode_training  # loads JAX

    check_scenes_setting(config.scenes)
    return encode_training(config)


@lru_cache(maxsize=2)
def _encoded_unseen(config: Config) -> list[Scene]:
    from relm_irl_jax.stages.encoding import encode_unseen

    return encode_unseen(config, _encoded_training(config))


@lru_cache(maxsize=2)
def _loaded(scenes: str, settings: SceneSettings, unseen: bool) -> list[Scene]:
    return [load() for load in (unseen_scenes if unseen else training_scenes)(scenes, settings)]
