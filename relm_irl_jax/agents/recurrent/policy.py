"""Policy of the trained recurrent actor-critic for given scenes and targets."""

from dataclasses import dataclass, field

import jax
from jaxtyping import Array, Int32, PRNGKeyArray

from relm_irl_jax.agents.recurrent.network import RecurrentActorCritic, Tables
from relm_irl_jax.agents.recurrent.unroll import (
    EpisodeMemory,
    cell_inputs,
    heads_outputs,
    initial_memory,
    observe,
    remember,
)
from relm_irl_jax.agents.rollout import choose_action
from relm_irl_jax.types import Memory, Observation, Parameters


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RecurrentPolicy:
    """Policy of a network with memory.

    Attributes:
        parameters: the network's parameters.
        tables: the network's tables over all states and targets.
        head: head of each scene.
        network: the network. Static.
        greedy: whether to take the most probable action instead of drawing one. Static.
    """

    parameters: Parameters
    tables: Tables
    head: Int32[Array, "scenes"]
    network: RecurrentActorCritic = field(metadata={"static": True})
    greedy: bool = field(default=False, metadata={"static": True})

    def init(self, shape: tuple[int, ...]) -> Memory:
        """Nothing is remembered."""
        return initial_memory(self.network, shape)

    def act(
        self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[Memory, Int32[Array, "scenes batch"]]:
        """Choose actions by the network's policy."""
        network, seen = self.network, observe(memory, observation, target)
        inputs = cell_inputs(network, self.parameters, self.tables, seen)
        recurrent = remember(network, self.parameters, memory.recurrent, inputs)
        logits = heads_outputs(network, self.parameters, network.recall(recurrent, inputs), self.head).logits
        action = choose_action(key, logits, self.greedy)
        return EpisodeMemory(recurrent, action), action
