"""Walks by keyboard as demonstrations."""

from pathlib import Path

from relm_irl_jax.demonstrations import append_demonstrations
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.episodes import EpisodePath
from relm_irl_jax.stages.recordings import trajectory_of


def record_walk(scene: Scene, path: EpisodePath, file: Path) -> str:
    """Add a walk to a file of demonstrations, if it reached its target.

    Args:
        scene: the scene.
        path: the walk.
        file: the file; created if it is missing.

    Returns:
        What was done, for the user.

    Raises:
        InputError: the file is not one of demonstrations.
    """
    if not path.success or len(path.states) < 2:
        return f"{file}: nothing was recorded, since the walk did not reach its target"
    count = append_demonstrations({scene.name: [trajectory_of(scene, path.states)]}, file)
    return f"{file}: {count} demonstration{'s' if count > 1 else ''}"
