"""Variants that the mapping agent is measured against.

- *Explorer*: the same memory of places and the same planner, but no network: every pose not yet stood on is as likely
  as any other, so it walks to the nearest ones. What systematic search is worth by itself.
- *Memoryless*: the same network and planner, on a map of the current view alone. Where its action collides it takes a
  random one, since nothing else would free it. What the memory is worth.
- *True walls*: the mapping agent that knows from the start which places are blocked, in its own frame. This is
  privileged information; it bounds what better occupancy could bring.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int32, PRNGKeyArray

from relm_irl_jax.agents.map.policy import MapPolicy, Memory
from relm_irl_jax.agents.map.prior import Prior
from relm_irl_jax.types import Observation


def explorer(policy: MapPolicy) -> MapPolicy:
    """Search systematically, without a network.

    Args:
        policy: a mapping agent's policy.

    Returns:
        The same with empty tables: nothing is seen but where the agent stands and what it collides with.
    """
    nothing = Prior(jnp.zeros_like(policy.prior.free), jnp.zeros_like(policy.prior.pose), policy.prior.scale)
    return replace(policy, record=jnp.zeros_like(policy.record), kernel=jnp.zeros_like(policy.kernel), prior=nothing)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MemorylessPolicy:
    """The mapping agent with a map of the current view alone.

    Attributes:
        policy: the mapping agent's policy.
    """

    policy: MapPolicy

    def init(self, shape: tuple[int, ...]) -> tuple[()]:
        """No memory."""
        return ()

    def act(
        self, key: PRNGKeyArray, memory: tuple[()], observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[tuple[()], Int32[Array, "scenes batch"]]:
        """Choose an action by the current view.

        Args:
            key: source of the random actions after collisions.
            memory: none.
            observation: what is seen.
            target: row of the target.

        Returns:
            No memory, and the action.
        """
        empty = self.policy.init(target.shape)
        empty = replace(empty, steps=empty.steps + self.policy.search.turns)  # it cannot know that it looked around
        _, action = self.policy.act(key, empty, observation, target)
        random = jax.random.randint(key, target.shape, 0, 4)
        return memory, jnp.where(observation.collided, random, action)


def with_true_walls(memory: Memory, blocked: Bool[Array, "*batch z x"]) -> Memory:
    """Tell an empty memory which places are blocked.

    Args:
        memory: the memory before the first view.
        blocked: the places that cannot be stood on, in the agent's frame.

    Returns:
        The memory that knows them.
    """
    return replace(memory, odometry=replace(memory.odometry, blocked=blocked))
