"""Policies of the trained actor-critic for given scenes and targets."""

from dataclasses import dataclass, field

import jax
from jaxtyping import Array, Int32, PRNGKeyArray

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.agents.rollout import choose_action
from relm_irl_jax.agents.siamese.forward import evaluate
from relm_irl_jax.agents.siamese.network import SiameseActorCritic, Tables
from relm_irl_jax.agents.siamese.state_target_pairs import StateTargetPairs
from relm_irl_jax.agents.siamese.update import initial_memory, observe_views
from relm_irl_jax.types import NO_MEMORY, Memory, Observation, Parameters
from relm_irl_jax.world import World

Shape = tuple[int, ...]
Batch = Int32[Array, "scenes batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SeveralViewsPolicy:
    """Policy of a network that observes several views; its memory is the last views.

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
    network: SiameseActorCritic = field(metadata={"static": True})
    greedy: bool = field(default=False, metadata={"static": True})

    def init(self, shape: Shape) -> Memory:
        """Memory without earlier views."""
        return initial_memory(shape, self.network.history)

    def act(self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Batch) -> tuple[Memory, Batch]:
        """Choose actions by the network's policy."""
        memory, views = observe_views(memory, observation)
        outputs = evaluate(self.network, self.parameters, self.tables, views, target, self.head)
        return memory, choose_action(key, outputs.logits, self.greedy)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class PairPolicy:
    """Policy of a network that observes one view, evaluated on all pairs of a state and a target; it has no memory.

    Attributes:
        outputs: policy and value of every pair.
        pairs: the pairs.
        world: the scenes.
        greedy: whether to take the most probable action instead of drawing one. Static.
    """

    outputs: Outputs
    pairs: StateTargetPairs
    world: World
    greedy: bool = field(default=False, metadata={"static": True})

    def init(self, shape: Shape) -> Memory:
        """No memory."""
        return NO_MEMORY

    def act(self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Batch) -> tuple[Memory, Batch]:
        """Choose actions by the network's policy."""
        logits = self.outputs.logits[self.pairs.index(self.world, observation.view, target)]
        return memory, choose_action(key, logits, self.greedy)
