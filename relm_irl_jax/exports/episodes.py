"""Episodes with what was observed and rewarded, as datasets of other libraries hold them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import Trajectory
from relm_irl_jax.scenes.scene import Scene


@dataclass(frozen=True)
class ObservedEpisode:
    """One episode that ends at its target.

    Attributes:
        scene: the scene's name.
        state: states, which no agent observes.
        view: features of the views.
        target: features of the target's view.
        action: numbers of the actions.
        reward: reward of each action.
    """

    scene: str
    state: Int32[np.ndarray, "visited"]
    view: Float32[np.ndarray, "visited d"]
    target: Float32[np.ndarray, "d"]
    action: Int32[np.ndarray, "steps"]
    reward: Float64[np.ndarray, "steps"]


@dataclass(frozen=True)
class StepRewards:
    """Rewards of arriving, of an action that leaves the state unchanged, and of any other action."""

    target: float
    collision: float
    step: float


def observe(scene: Scene, trajectories: Sequence[Trajectory], rewards: StepRewards) -> list[ObservedEpisode]:
    """What an agent of `RelmIrl/Task-v0` would have observed and been paid along trajectories.

    Args:
        scene: the scene, with features.
        trajectories: the trajectories.
        rewards: the rewards.

    Returns:
        The episodes.

    Raises:
        InputError: the scene has no features.
    """
    if scene.encoded.shape[1] == 0:
        raise InputError(
            f"format: {scene.name} has no features, since the run's agents use none; give jsonl, or a run of another "
            "agent."
        )
    episodes = []
    for trajectory in trajectories:
        before, after = trajectory.states[:-1], trajectory.states[1:]
        paid = np.where(before == after, rewards.collision, rewards.step)
        paid = np.where(after == trajectory.target, rewards.target, paid)
        view = scene.encoded[trajectory.states].astype(np.float32)
        target = scene.encoded[trajectory.target].astype(np.float32)
        episodes.append(ObservedEpisode(scene.name, trajectory.states, view, target, trajectory.actions, paid))
    return episodes
