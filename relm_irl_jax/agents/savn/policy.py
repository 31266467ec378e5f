"""Policy of the meta-trained network: it adapts during an episode, without rewards."""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int32, PRNGKeyArray

from relm_irl_jax.agents.recurrent.network import RecurrentActorCritic, Tables
from relm_irl_jax.agents.recurrent.unroll import EpisodeMemory, cell_inputs, observe, remember
from relm_irl_jax.agents.rollout import choose_action
from relm_irl_jax.agents.savn.adaptation import Adaptation, Window, adapt_where, policy_logits
from relm_irl_jax.agents.savn.update import AdaptiveMemory, hidden_layer, worker_memory
from relm_irl_jax.types import Memory, Observation, Parameters


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SearchMemory:
    """What the policy remembers of an episode.

    Attributes:
        worker: the memory of the recurrent network, and how its weights changed.
        last: what the heads were given in the last K steps, the latest last.
        steps: number of actions taken.
    """

    worker: AdaptiveMemory
    last: Float[Array, "groups batch interval memory"]
    steps: Int32[Array, "groups batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SavnPolicy:
    """Policy of a network that adapts.

    Attributes:
        parameters: the network's parameters, with those of the interaction loss.
        tables: the network's tables over all states and targets.
        head: head of each scene.
        adaptation: how weights change.
        network: the network. Static.
        greedy: whether to take the most probable action instead of drawing one. Static.
    """

    parameters: Parameters
    tables: Tables
    head: Int32[Array, "scenes"]
    adaptation: Adaptation
    network: RecurrentActorCritic = field(metadata={"static": True})
    greedy: bool = field(default=False, metadata={"static": True})

    def init(self, shape: tuple[int, ...]) -> Memory:
        """Nothing is remembered, and no weight is changed."""
        last = jnp.zeros((*shape, self.adaptation.interval, self.network.memory), jnp.float32)
        return SearchMemory(worker_memory(self.network, self.adaptation, shape), last, jnp.zeros(shape, jnp.int32))

    def act(
        self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[Memory, Int32[Array, "scenes batch"]]:
        """Choose actions by the network's policy, and adapt after every K-th."""
        network, theta, worker = self.network, self.parameters, memory.worker
        inputs = cell_inputs(network, theta, self.tables, observe(worker.episode, observation, target))
        recurrent = remember(network, theta, worker.episode.recurrent, inputs)
        recalled = network.recall(recurrent, inputs)
        step = Window(recalled, hidden_layer(theta, recalled, self.head))
        action = choose_action(key, policy_logits(theta, step, worker.change, self.head), self.greedy)
        last = jnp.concatenate([memory.last[..., 1:, :], recalled[..., None, :]], -2)
        steps = memory.steps + 1
        due = (steps % self.adaptation.interval == 0) & (worker.changes < self.adaptation.inner_steps)
        hidden = jnp.moveaxis(last, -2, 0)
        window = Window(hidden, hidden_layer(theta, hidden, self.head))
        change = adapt_where(due, theta, window, worker.change, self.head, self.adaptation)
        worker = AdaptiveMemory(EpisodeMemory(recurrent, action), change, worker.changes + due.astype(jnp.int32))
        return SearchMemory(worker, last, steps), action
