"""Reward functions: the reward of a transition, for every method.

A reward function is a pytree of arrays with a `__call__` on one `Transition`; the rollout vmaps it. The transition into
the target receives the target's reward and ends the episode, so the return after termination is 0.
"""

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.env import Transition
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.equation import LinearRewardForm, linear_reward
from relm_irl_jax.rewards.settings import ManualSettings
from relm_irl_jax.transitions import FeatureReward, TransitionFeatures
from relm_irl_jax.world import Targets, World


@runtime_checkable
class RewardFunction(Protocol):
    """The interface of reward functions; a pytree of arrays."""

    def __call__(self, transition: Transition, world: World, targets: Targets) -> Float32[Array, ""]:
        """Return the reward of one transition."""
        ...


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ManualReward:
    """The hand-made reward of the RL baseline (Zhu et al., 2017).

    Attributes:
        target: reward for reaching the target.
        collision: reward for an action that collides.
        step: reward for any other action.
    """

    target: Float32[Array, ""]
    collision: Float32[Array, ""]
    step: Float32[Array, ""]

    def __call__(self, transition: Transition, world: World, targets: Targets) -> Float32[Array, ""]:
        """Return the reward of one transition."""
        elsewhere = jnp.where(transition.collided, self.collision, self.step)
        return jnp.where(transition.terminated, self.target, elsewhere)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LinearReward:
    """A reward that is linear in reward features; see `relm_irl_jax.rewards.equation`.

    The weights are those of the episode's (start, target) pair. If they are predicted from the current view, they are
    those of the (current state, target) pair: "adjusted in real time according to the current state" (section 4.2).

    Attributes:
        weights: all weight vectors.
        row: row of `weights` for each target and local state of its scene.
        phi: reward features of each state of the world.
        form: bounds and form.
        from_current_view: whether the weights are those of the current state instead of the start. Static.
    """

    weights: Float32[Array, "rows d"]
    row: Int32[Array, "targets locals"]
    phi: Float32[Array, "states d"]
    form: LinearRewardForm
    from_current_view: bool = field(default=False, metadata={"static": True})

    def __call__(self, transition: Transition, world: World, targets: Targets) -> Float32[Array, ""]:
        """Return the reward of one transition."""
        origin = transition.state if self.from_current_view else transition.start
        weights = self.weights[self.row[transition.target, world.local[origin]]]
        target_phi = self.phi[targets.state[transition.target]]
        return linear_reward(weights, self.phi[transition.next_state], target_phi, transition.terminated, self.form)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class OwnReward:
    """A user's reward: a pure function of a transition's features.

    Attributes:
        features: features of each state of the world, as the function sees them.
        function: the function. Static.
    """

    features: Float32[Array, "states feature"]
    function: FeatureReward = field(metadata={"static": True})

    def __call__(self, transition: Transition, world: World, targets: Targets) -> Float32[Array, ""]:
        """Return the reward of one transition."""
        seen = TransitionFeatures(
            view=self.features[transition.state],
            next_view=self.features[transition.next_state],
            target=self.features[targets.state[transition.target]],
            action=transition.action,
            collided=transition.collided,
            arrived=transition.terminated,
        )
        with jax.numpy_dtype_promotion("standard"):  # 10 * seen.arrived, also where JAX is told to be strict
            reward = jnp.asarray(self.function(seen), jnp.float32)
        if reward.shape:
            raise InputError(f"reward: returned an array of shape {reward.shape}; return one number for a transition.")
        return reward


def manual_reward(settings: ManualSettings) -> ManualReward:
    """The reward of the RL baseline.

    Args:
        settings: the three values of the reward.

    Returns:
        The reward function.
    """
    return ManualReward(jnp.float32(settings.target), jnp.float32(settings.collision), jnp.float32(settings.step))
