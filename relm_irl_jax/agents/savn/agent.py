"""The recurrent actor-critic that learns to adapt during an episode."""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.heads import scene_heads
from relm_irl_jax.agents.recurrent.training import make_network
from relm_irl_jax.agents.recurrent.unroll import tabulate
from relm_irl_jax.agents.savn.policy import SavnPolicy
from relm_irl_jax.agents.savn.training import init_train_state, make_adaptation, meta_inputs, run_updates
from relm_irl_jax.agents.settings import SavnSettings
from relm_irl_jax.agents.training import LearningCurve, TrainState, train_in_chunks
from relm_irl_jax.types import Parameters, Requirement, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World


@dataclass(frozen=True)
class SavnAgent:
    """Self-adaptive visual navigation (SAVN).

    Attributes:
        settings: network, adaptation and optimiser.
        greedy: whether its policies take the most probable action instead of drawing one.
        inner_steps: largest number of changes in an episode of its policies; None for as many as in training.
        name: the agent's name.
        requires: features.
    """

    settings: SavnSettings = field(default_factory=SavnSettings)
    greedy: bool = False
    inner_steps: int | None = None
    name: str = "savn"
    requires: frozenset[Requirement] = frozenset({"features"})

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, LearningCurve]:
        """Train on a problem; see `relm_irl_jax.types.Agent`."""
        inputs, n_heads = meta_inputs(problem, self.settings)
        network, t_max = make_network(self.settings, n_heads), self.settings.t_max
        frames_per_update = inputs.task.target_range.first.size * t_max
        windows = t_max // self.settings.interval

        def several(state: TrainState, updates: int):
            return run_updates(state, inputs, network=network, windows=windows, updates=updates)

        state = init_train_state(key, inputs, network)
        state, curve = train_in_chunks(state, several, problem.frames, frames_per_update, log)
        return state.parameters, curve

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> SavnPolicy:
        """Make a policy for scenes and targets; see `relm_irl_jax.types.Agent`."""
        network = make_network(self.settings, parameters["params"]["head_kernel"].shape[0])
        head = jnp.asarray(scene_heads(world, self.settings.heads, self.name), jnp.int32)
        tables = jax.jit(tabulate, static_argnums=0)(network, parameters, world, targets)
        adaptation = make_adaptation(self.settings, self.inner_steps)
        return SavnPolicy(parameters, tables, head, adaptation, network, self.greedy)
