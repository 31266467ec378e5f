"""Rewards as data: what the environment pays for a transition, for every method.

A reward model is a small pytree with a `__call__` on one `Transition`; the rollout vmaps it. Whatever the method,
the reward of the absorbing target is paid on entering it and nothing after, so that termination with value 0 is
right: the hand-made reward by construction, the learned one because r(g) = w·(φ(g) − φ(g)) = 0 in the cost form.
"""

from dataclasses import dataclass, field
from typing import Protocol

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.env import Transition
from relm_irl_jax.world import Targets, World


class RewardModel(Protocol):
    """What the rollout needs of a reward."""

    def __call__(self, transition: Transition, world: World, targets: Targets) -> Float32[Array, ""]:
        """Return the reward of one transition."""
        ...


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ManualReward:
    """The hand-made reward of the RL baseline (Zhu et al.).

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
    """A reward that is linear in features of the view (paper, Equation 1), in cost or free form.

        r(s, a, s') = w · (φ(s') − φ(g))   in the cost form, clipped to [−r_max, −least_cost], and 0 at the target g
        r(s, a, s') = w · φ(s')            in the free form, clipped to [−r_max, r_max]

    with the weights w of the episode's (start, target) pair, or, where the reward follows the agent, of the
    (current state, target) pair: "adjusted in real time according to the current state" (paper, section 4.2).

    Attributes:
        weights: every weight vector in use.
        row: row of `weights` for each target and local state of its scene.
        features: φ of each state of the world.
        r_max: bound on the size of the reward; predicted weights may break the bound that solved ones obey.
        least_cost: least cost of a step that does not reach the target, so that standing still never pays.
        cost_form: whether φ(g) is subtracted and the reward clipped at 0. Static.
        follow: whether the weights are those of the current state instead of the start. Static.
    """

    weights: Float32[Array, "rows dimension"]
    row: Int32[Array, "targets locals"]
    features: Float32[Array, "states dimension"]
    r_max: Float32[Array, ""]
    least_cost: Float32[Array, ""]
    cost_form: bool = field(default=True, metadata={"static": True})
    follow: bool = field(default=False, metadata={"static": True})

    def __call__(self, transition: Transition, world: World, targets: Targets) -> Float32[Array, ""]:
        """Return the reward of one transition."""
        origin = transition.state if self.follow else transition.start
        weights = self.weights[self.row[transition.target, world.local[origin]]]
        view = self.features[transition.next_state]
        if not self.cost_form:
            return jnp.clip(weights @ view, -self.r_max, self.r_max)
        cost = weights @ (view - self.features[targets.state[transition.target]])
        return jnp.where(transition.terminated, 0.0, jnp.clip(cost, -self.r_max, -self.least_cost))
