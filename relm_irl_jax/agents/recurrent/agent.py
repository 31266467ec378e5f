"""The siamese actor-critic with recurrent memory, trained by n-step advantages over sequences of steps."""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.heads import scene_heads
from relm_irl_jax.agents.recurrent.policy import RecurrentPolicy
from relm_irl_jax.agents.recurrent.training import init_train_state, make_network, run_updates, update_inputs
from relm_irl_jax.agents.recurrent.unroll import tabulate
from relm_irl_jax.agents.settings import RecurrentSettings
from relm_irl_jax.agents.training import LearningCurve, TrainState, train_in_chunks
from relm_irl_jax.types import Parameters, Requirement, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World


@dataclass(frozen=True)
class RecurrentAgent:
    """The siamese actor-critic with recurrent memory.

    Attributes:
        settings: network and optimiser.
        greedy: whether its policies take the most probable action instead of drawing one.
        name: the agent's name.
        requires: features.
    """

    settings: RecurrentSettings = field(default_factory=RecurrentSettings)
    greedy: bool = False
    name: str = "recurrent"
    requires: frozenset[Requirement] = frozenset({"features"})

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, LearningCurve]:
        """Train on a problem; see `relm_irl_jax.types.Agent`."""
        inputs, n_heads = update_inputs(problem, self.settings, self.name)
        network, t_max = make_network(self.settings, n_heads), self.settings.t_max
        frames_per_update = inputs.task.target_range.first.size * t_max

        def several(state: TrainState, updates: int):
            return run_updates(state, inputs, network=network, t_max=t_max, updates=updates)

        state = init_train_state(key, inputs, network)
        state, curve = train_in_chunks(state, several, problem.frames, frames_per_update, log)
        return state.parameters, curve

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> RecurrentPolicy:
        """Make a policy for scenes and targets; see `relm_irl_jax.types.Agent`."""
        network = make_network(self.settings, parameters["params"]["head_kernel"].shape[0])
        head = jnp.asarray(scene_heads(world, self.settings.heads, self.name), jnp.int32)
        tables = jax.jit(tabulate, static_argnums=0)(network, parameters, world, targets)
        return RecurrentPolicy(parameters, tables, head, network, self.greedy)
