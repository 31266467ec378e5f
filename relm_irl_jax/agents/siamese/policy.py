"""The trained actor-critic as a policy for the scenes and targets at hand."""

from dataclasses import dataclass, field

import jax
from jaxtyping import Array, Int32, PRNGKeyArray

from relm_irl_jax.agents.rollout import choose_action
from relm_irl_jax.agents.siamese.forward import evaluate
from relm_irl_jax.agents.siamese.network import Outputs, SiameseActorCritic, Tables
from relm_irl_jax.agents.siamese.state_target_pairs import StateTargetPairs
from relm_irl_jax.agents.siamese.update import initial_memory, observe_views
from relm_irl_jax.types import NO_MEMORY, Memory, Observation, Parameters
from relm_irl_jax.world import World

Shape = tuple[int, ...]
Batch = Int32[Array, "scenes batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SeveralViewsPolicy:
    """A network that observes several views, with its tables of all states and targets; remembers the last views.

    Attributes:
        parameters: the network's parameters.
        tables: what is computed once for every state and every target.
        head: head of each scene.
        network: the network. Static.
        greedy: take the most probable action instead of drawing from the policy. Static.
    """

    parameters: Parameters
    tables: Tables
    head: Int32[Array, "scenes"]
    network: SiameseActorCritic = field(metadata={"static": True})
    greedy: bool = field(default=False, metadata={"static": True})

    def init(self, shape: Shape) -> Memory:
        """No earlier views."""
        return initial_memory(shape, self.network.history)

    def act(self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Batch) -> tuple[Memory, Batch]:
        """Act by the network's policy."""
        memory, views = observe_views(memory, observation)
        outputs = evaluate(self.network, self.parameters, self.tables, views, target, self.head)
        return memory, choose_action(key, outputs.logits, self.greedy)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class PairPolicy:
    """A network that observes one view, evaluated on every pair of a state and a target; remembers nothing.

    Attributes:
        outputs: policy and value of every pair.
        pairs: the pairs.
        world: the scenes.
        greedy: take the most probable action instead of drawing from the policy. Static.
    """

    outputs: Outputs
    pairs: StateTargetPairs
    world: World
    greedy: bool = field(default=False, metadata={"static": True})

    def init(self, shape: Shape) -> Memory:
        """No memory."""
        return NO_MEMORY

    def act(self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Batch) -> tuple[Memory, Batch]:
        """Act by the network's policy."""
        logits = self.outputs.logits[self.pairs.index(self.world, observation.view, target)]
        return memory, choose_action(key, logits, self.greedy)
