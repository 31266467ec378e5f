"""The policy of the trained metric agent for given scenes and targets."""

from dataclasses import dataclass, field

import jax
from jaxtyping import Array, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.metric.network import DistanceForm, Embeddings, distance
from relm_irl_jax.agents.rollout import choose_action
from relm_irl_jax.types import NO_MEMORY, Memory, Observation

Batch = Int32[Array, "scenes batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MetricPolicy:
    """Prefers actions whose successor embedding is near the target's embedding; it has no memory.

    Attributes:
        embeddings: embeddings of every state.
        target_embedding: embedding of every target.
        inverse_temperature: factor of the distances in the logits.
        form: form of the distance. Static.
        greedy: whether to take the most probable action instead of drawing one. Static.
    """

    embeddings: Embeddings
    target_embedding: Float32[Array, "targets dimension"]
    inverse_temperature: Float32[Array, ""]
    form: DistanceForm = field(metadata={"static": True})
    greedy: bool = field(default=False, metadata={"static": True})

    def init(self, shape: tuple[int, ...]) -> Memory:
        """No memory."""
        return NO_MEMORY

    def act(self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Batch) -> tuple[Memory, Batch]:
        """Choose actions by their distance to the target."""
        goal = self.target_embedding[target][..., None, :]
        steps = distance(self.embeddings.successor[observation.view], goal, self.form)
        return memory, choose_action(key, -self.inverse_temperature * steps, self.greedy)

    def distance_to(self, target: Int32[Array, ""]) -> Float32[Array, "states"]:
        """Learned distance of every state to a target, in steps.

        Args:
            target: row of the targets.

        Returns:
            D(s, g).
        """
        return distance(self.embeddings.state, self.target_embedding[target], self.form)
