"""The scenes and settings behind the arguments of `RelmIrl/Task-v0`."""

from collections.abc import Sequence
from pathlib import Path

from relm_irl_jax.api.scenes import Scenes, config_of
from relm_irl_jax.config import Config, overlay
from relm_irl_jax.gym.scenes import TaskScenes
from relm_irl_jax.scenes.scene import Scene


def task_scenes(
    task: str, scenes: Scenes | None, unseen: Sequence[Scene] | None, cap: int | None, config: Config | None
) -> TaskScenes:
    """The scenes of a task.

    Args:
        task: `I`, `II` or `III`.
        scenes: the training scenes: a list, `rooms` or a folder; None for the configuration's.
        unseen: scenes of Task III, where the training scenes are a list.
        cap: number of steps after which an episode is truncated; None for the configuration's.
        config: all other settings; None for the default ones.

    Returns:
        The scenes and settings, as `relm_irl_jax.evaluate` has them for the same arguments.

    Raises:
        InputError: a value is refused.
    """
    settings = config or Config() if scenes is None else config_of(scenes, config)
    changes: dict = {"task": task} | ({} if cap is None else {"tasks": {"cap": cap}})
    settings = overlay(settings, changes, "RelmIrl/Task-v0")
    listed = None if scenes is None or isinstance(scenes, str | Path) else scenes
    return TaskScenes(settings, listed, unseen)
