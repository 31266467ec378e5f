"""The mapping agent with a learned reward: does one change what it finds in scenes that it has never seen?

The agent needs no reward. A method that predicts r(s, g) from the views of a state and of the target can say two things
about the places that it has seen, p_1, p_2, …, whose views' mean costs are c_i = −r(p_i, g) / r_max ∈ [0, 1]:

- *Prices.* To enter a place that was seen costs c_i times what it costs otherwise, any other place as much as before.
- *Prior.* The target is near places of low cost. With weights k that fall with the distance like a Gaussian,

      log P(h, p) += w · (1 − Σ_i k(p − p_i) c_i / Σ_i k(p − p_i))

Where every step costs the same, as under the hand-made reward, c = 1 and both leave the agent as it is.
"""

from dataclasses import dataclass, field
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.map.policy import MapPolicy, Memory, choose_where_running, remember, think
from relm_irl_jax.types import Observation

WIDTH = 3.0
"""Standard deviation of the prior's Gaussian, in places."""

WEIGHT = 10.0
"""w: costs of views lie between 0.6 and 1, so that the prior of places differs by at most e⁴."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RewardedMemory:
    """What the agent remembers of an episode.

    Attributes:
        memory: the mapping agent's memory.
        cost: sum of the costs c of the views met at each place, by z and x.
        views: number of them.
    """

    memory: Memory
    cost: Float32[Array, "*batch z x"]
    views: Float32[Array, "*batch z x"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RewardedPolicy:
    """The mapping agent, told the predicted reward of the views that it meets.

    Attributes:
        policy: the mapping agent's policy.
        cost: c of every state of the world, for every target.
        use: whether costs are prices of steps or a prior of places. Static.
    """

    policy: MapPolicy
    cost: Float32[Array, "targets states"]
    use: Literal["prices", "prior"] = field(metadata={"static": True})

    @property
    def deterministic(self) -> bool:
        """As the mapping agent's policy."""
        return self.policy.deterministic

    def init(self, shape: tuple[int, ...]) -> RewardedMemory:
        """The memory at the start of an episode.

        Args:
            shape: scenes and episodes.

        Returns:
            The memory before the first view.
        """
        memory = self.policy.init(shape)
        nothing = jnp.zeros(memory.odometry.blocked.shape, jnp.float32)
        return RewardedMemory(memory, nothing, nothing)

    def act(
        self, key: PRNGKeyArray, memory: RewardedMemory, observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[RewardedMemory, Int32[Array, "scenes batch"]]:
        """Note the view's cost, draw the view into the map and choose an action.

        Args:
            key: not used; the policy is deterministic.
            memory: what is remembered.
            observation: what is seen.
            target: row of the target.

        Returns:
            The memory after the view, and the action.
        """
        del key
        before, shape = memory.memory, target.shape
        now = remember(self.policy, before, observation)
        new = now.odometry.seen.sum((-3, -2, -1)) > before.odometry.seen.sum((-3, -2, -1))
        weight = new.astype(jnp.float32)
        place = (*jnp.indices(shape), *jnp.moveaxis(now.odometry.pose[..., 1:] + self.policy.extent.radius, -1, 0))
        cost = memory.cost.at[place].add(weight * self.cost[target, observation.view])
        views = memory.views.at[place].add(weight)

        def choose(memory: RewardedMemory, target: Int32[Array, "chunk"]) -> Int32[Array, "chunk"]:
            if self.use == "prices":
                price = jnp.where(memory.views > 0, memory.cost / jnp.maximum(memory.views, 1.0), 1.0)
                return think(self.policy, memory.memory, target, price=price)[0]
            return think(self.policy, memory.memory, target, prior=WEIGHT * nearness(memory.cost, memory.views))[0]

        action = choose_where_running(choose, RewardedMemory(now, cost, views), target, observation.running)
        return RewardedMemory(now.after(action), cost, views), action


def nearness(cost: Float32[Array, "batch z x"], views: Float32[Array, "batch z x"]) -> Float32[Array, "batch z x"]:
    """What the costs of the views met say about the places around them.

    Args:
        cost: sum of the costs of the views met at each place.
        views: number of them.

    Returns:
        1 − Σ_i k(p − p_i) c_i / Σ_i k(p − p_i) for each place p; 0 far from all places seen, where nothing is said.
    """
    place = jnp.arange(cost.shape[-1], dtype=jnp.float32)
    near = jnp.exp(-0.5 * ((place[:, None] - place) / WIDTH) ** 2)
    around = lambda values: near @ values @ near  # noqa: E731
    return around(views - cost) / (around(views) + 1e-3)
