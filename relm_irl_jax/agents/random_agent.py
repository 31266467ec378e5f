"""The Random baseline: every action with the same probability (section 5.3)."""

from dataclasses import dataclass

import jax
from jaxtyping import Array, Int32, PRNGKeyArray

from relm_irl_jax.scenes.scene import ACTIONS
from relm_irl_jax.types import NO_MEMORY, Memory, Observation


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RandomPolicy:
    """Draws actions uniformly at random."""

    def init(self, shape: tuple[int, ...]) -> Memory:
        """No memory."""
        return NO_MEMORY

    def act(
        self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[Memory, Int32[Array, "scenes batch"]]:
        """Draw actions."""
        return memory, jax.random.randint(key, target.shape, 0, len(ACTIONS))
