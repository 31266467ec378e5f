"""The configuration behind the arguments of `RelmIrl/Task-v0`."""

from pathlib import Path

from relm_irl_jax.config import Config, overlay


def task_config(task: str, scenes: str | Path | None, cap: int | None, config: Config | None) -> Config:
    """The configuration of a task.

    Args:
        task: `I`, `II` or `III`.
        scenes: `rooms` or a folder; None for the configuration's.
        cap: number of steps after which an episode is truncated; None for the configuration's.
        config: all other settings; None for the default ones.

    Returns:
        The configuration.

    Raises:
        InputError: a value is refused.
    """
    changes: dict = {"task": task}
    if scenes is not None:
        changes["scenes"] = str(scenes)
    if cap is not None:
        changes["tasks"] = {"cap": cap}
    return overlay(config or Config(), changes, "RelmIrl/Task-v0")
