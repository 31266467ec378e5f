"""The paper's agent: a siamese actor-critic trained by n-step advantages with many synchronous workers."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.forward import evaluate_pairs, tabulate
from relm_irl_jax.agents.siamese.imagined_training import train_on_imagined
from relm_irl_jax.agents.siamese.joint_seeds import train_seeds
from relm_irl_jax.agents.siamese.policy import PairPolicy, SeveralViewsPolicy
from relm_irl_jax.agents.siamese.sharding import shard_workers, usable_devices
from relm_irl_jax.agents.siamese.state_target_pairs import state_target_pairs
from relm_irl_jax.agents.siamese.training import (
    prepare_training,
    run_updates,
    scene_heads,
    update_form,
)
from relm_irl_jax.agents.training import LearningCurve, TrainState, train_in_chunks
from relm_irl_jax.types import Parameters, Requirement, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World


@dataclass(frozen=True)
class SiameseAgent:
    """The siamese actor-critic.

    Attributes:
        settings: network and optimiser.
        greedy: whether its policies take the most probable action instead of drawing one.
        devices: devices that share the workers; all devices if None.
    """

    settings: SiameseSettings = field(default_factory=SiameseSettings)
    greedy: bool = False
    devices: Sequence[jax.Device] | None = None
    name: str = "siamese"

    @property
    def requires(self) -> frozenset[Requirement]:
        """Features, and imagined targets if the settings ask for them."""
        if self.settings.imagine == "none":
            return frozenset({"features"})
        return frozenset({"features", "imagined"})

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, LearningCurve]:
        """Train on a problem; see `relm_irl_jax.types.Agent`."""
        if problem.imagined is not None:
            return train_on_imagined(key, problem, self.settings, log)
        n_heads = int(scene_heads(problem.world, self.settings).max()) + 1
        devices = usable_devices(self.settings.workers // n_heads, self.devices)
        state, inputs, form = prepare_training(key, problem, self.settings, len(devices))
        state, inputs = shard_workers(state, inputs, devices)
        frames_per_update = inputs.task.target_range.first.size * self.settings.t_max

        def several(state: TrainState, updates: int):
            return run_updates(state, inputs, form=form, updates=updates)

        state, curve = train_in_chunks(state, several, problem.frames, frames_per_update, log)
        return state.parameters, curve

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> PairPolicy | SeveralViewsPolicy:
        """Make a policy for scenes and targets; see `relm_irl_jax.types.Agent`."""
        n_heads = parameters["params"]["head_kernel"].shape[0]
        network = update_form(self.settings, n_heads).network
        scene_head = scene_heads(world, self.settings)
        if network.history == 1:
            pairs = state_target_pairs(world, targets, scene_head, n_heads)
            evaluated: Outputs = jax.jit(evaluate_pairs, static_argnums=0)(network, parameters, world, targets, pairs)
            return PairPolicy(evaluated, pairs, world, self.greedy)
        tables = tabulate(network, parameters, world, targets)
        return SeveralViewsPolicy(parameters, tables, jnp.asarray(scene_head, jnp.int32), network, self.greedy)

    def prefers_joint_training(self) -> bool:
        """Whether several seeds train faster in one program; see `SiameseSettings.seeds_at_once`."""
        if self.settings.imagine != "none":
            return False
        choice = self.settings.seeds_at_once
        single = len(jax.devices() if self.devices is None else self.devices) == 1
        return single and (choice == "always" or (choice == "auto" and jax.default_backend() != "cpu"))

    def train_jointly(
        self, keys: Sequence[PRNGKeyArray], problems: Sequence[TrainingProblem], log: TrainingLog
    ) -> list[tuple[Parameters, LearningCurve]]:
        """Train one network for each seed in one program; see `relm_irl_jax.types.MultiSeedAgent`."""
        return train_seeds(keys, problems, self.settings, log)
