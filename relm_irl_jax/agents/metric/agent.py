"""The metric agent: it explores, learns distances from its experience graph, and moves to shorten them.

Each update acts with every worker and takes one gradient step; costs to go are computed again whenever a chunk of
updates has found new transitions.
"""

from dataclasses import dataclass, field, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float64, PRNGKeyArray

from relm_irl_jax.agents.metric.costs_to_go import (
    CostsToGo,
    SceneStates,
    compute_costs_to_go,
    scenes_by_size,
    unknown_costs,
)
from relm_irl_jax.agents.metric.experience_graph import coverage, empty_graph, one_way_transitions
from relm_irl_jax.agents.metric.loss import Losses, LossForm, LossInputs, LossWeights
from relm_irl_jax.agents.metric.network import DistanceForm, Embeddings, MetricNetwork, embed
from relm_irl_jax.agents.metric.policy import MetricPolicy
from relm_irl_jax.agents.metric.update import (
    OptimizerNumbers,
    TrainState,
    UpdateForm,
    UpdateInputs,
    make_optimizer,
    update,
)
from relm_irl_jax.agents.rollout import EpisodeSums, NavigationTask, init_workers
from relm_irl_jax.agents.settings import MetricSettings
from relm_irl_jax.agents.training import LearningCurve, curve_from_rows, learning_row, run_chunks, split_into_chunks
from relm_irl_jax.env import scene_target_ranges
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import NO_MEMORY, Parameters, Requirement, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World

TARGET_SHARE = 0.25
"""Share of the drawn goals that are training targets; the others are drawn from all goals. Without any, paths to
trained targets are longer, and those to new targets no shorter."""

GRADIENT_CLIP = 10.0
"""Largest global norm of a gradient."""


@dataclass(frozen=True)
class MetricCurve(LearningCurve):
    """Progress of the training, one entry for each chunk of updates.

    Attributes:
        states_visited: share of the states that have been visited.
        actions_tried: share of all states' actions that have been tried.
        distance_loss: weighted squared error of distances, in squared mean steps.
        policy_loss: divergence of the policy from the best actions, in nats.
        successor_loss: squared distance of successor embeddings from those of the states reached.
    """

    states_visited: Float64[np.ndarray, "chunks"]
    actions_tried: Float64[np.ndarray, "chunks"]
    distance_loss: Float64[np.ndarray, "chunks"]
    policy_loss: Float64[np.ndarray, "chunks"]
    successor_loss: Float64[np.ndarray, "chunks"]


def update_form(settings: MetricSettings) -> UpdateForm:
    """The static part of an update.

    Args:
        settings: the agent's settings.

    Returns:
        Network, loss and rollout length.

    Raises:
        InputError: the embedding cannot be divided into its groups.
    """
    if settings.dimension % settings.groups:
        raise InputError(
            f"metric.groups: {settings.dimension} dimensions cannot be divided into {settings.groups} equal parts; "
            "give a divisor of metric.dimension."
        )
    distance = DistanceForm(settings.groups, settings.symmetric)
    network = MetricNetwork(settings.width, settings.dimension)
    loss = LossForm(settings.states, settings.goals, distance)
    return UpdateForm(network, loss, settings.t_max, settings.scenes_at_once)


def scene_states(world: World) -> SceneStates:
    """States of each scene.

    Args:
        world: the scenes.

    Returns:
        Padded rows of states.
    """
    count = np.bincount(np.asarray(world.scene))
    local = np.arange(count.max())
    first = np.cumsum(count) - count
    state = first[:, None] + np.where(local < count[:, None], local, 0)
    return SceneStates(jnp.asarray(state, jnp.int32), jnp.asarray(count, jnp.int32))


def reachable_states(world: World, targets: Targets) -> Bool[np.ndarray, "states"]:
    """States in which an episode can start or end; coverage is a share of these.

    Args:
        world: the scenes.
        targets: the training targets.

    Returns:
        Whether each state is one of them.
    """
    reachable = np.zeros(len(world.scene), bool)
    for row, count in zip(np.asarray(targets.start), np.asarray(targets.n_starts), strict=True):
        reachable[row[:count]] = True
    reachable[np.asarray(targets.state)] = True
    return reachable


@partial(jax.jit, static_argnames="form")
def init_train_state(key: PRNGKeyArray, inputs: UpdateInputs, form: UpdateForm) -> TrainState:
    """Draw parameters and start episodes.

    Args:
        key: source of all randomness of the training.
        inputs: scenes, targets and numbers.
        form: the static part. Static.

    Returns:
        The state before the first update.
    """
    key, parameter_key, episode_key = jax.random.split(key, 3)
    world = inputs.task.world
    parameters = form.network.init(parameter_key, world.features[:1])
    workers = init_workers(episode_key, inputs.task, NO_MEMORY)
    optimizer = make_optimizer(inputs.optimizer).init(parameters)
    return TrainState(parameters, optimizer, workers, empty_graph(len(world.scene)), key)


@partial(jax.jit, static_argnames=("form", "updates"))
def run_updates(
    state: TrainState, inputs: UpdateInputs, *, form: UpdateForm, updates: int
) -> tuple[TrainState, EpisodeSums, Losses]:
    """Run several updates as one program.

    Args:
        state: the state of training.
        inputs: scenes, goals, costs to go and numbers.
        form: the static part. Static.
        updates: updates to run. Static.

    Returns:
        The next state of training, sums over the episodes that ended, and the mean losses.
    """

    def step(carry: TrainState, _: None) -> tuple[TrainState, tuple[EpisodeSums, Losses]]:
        return update(carry, inputs, form)

    state, (sums, losses) = jax.lax.scan(step, state, length=updates)
    return state, jax.tree.map(jnp.sum, sums), jax.tree.map(jnp.mean, losses)


@dataclass(frozen=True)
class MetricAgent:
    """The agent that learns an embedding of views whose distances are numbers of steps.

    Attributes:
        settings: network and optimiser.
        greedy: whether its policies take the most probable action instead of drawing one.
    """

    settings: MetricSettings = field(default_factory=MetricSettings)
    greedy: bool = False
    name: str = "metric"
    requires: frozenset[Requirement] = frozenset({"features", "goals"})

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, MetricCurve]:
        """Train on a problem; see `relm_irl_jax.types.Agent`."""
        assert problem.goals is not None
        settings, world, goals = self.settings, problem.world, problem.goals
        form = update_form(settings)
        self._check(problem)
        target_range = scene_target_ranges(problem.targets, world.n_scenes, settings.workers // world.n_scenes)
        chunks = split_into_chunks(problem.frames, target_range.first.size * settings.t_max)
        inputs = self._inputs(
            problem,
            NavigationTask(world, problem.targets, target_range, problem.reward, jnp.int32(problem.cap)),
            chunks.count * chunks.updates,
        )
        scenes = inputs.loss.scenes
        by_size = scenes_by_size(scenes, goals)
        reachable = jnp.asarray(reachable_states(world, problem.targets))

        def chunk(carry: tuple[TrainState, CostsToGo, Array], number: int):
            state, costs, tried_before = carry
            current = replace(inputs, loss=replace(inputs.loss, costs=costs))
            state, sums, losses = run_updates(state, current, form=form, updates=chunks.updates)
            visited, tried = coverage(state.graph, reachable)
            if tried > tried_before:
                if settings.symmetric and bool(one_way_transitions(state.graph).any()):
                    raise InputError(
                        "metric.symmetric: some step cannot be undone by one action in these scenes; set it to false."
                    )
                costs = compute_costs_to_go(state.graph, world, goals, scenes, settings.counts, by_size)
            row = learning_row(sums, number, chunks) | {
                "states_visited": float(visited),
                "actions_tried": float(tried),
                **{f"{name}_loss": float(value) for name, value in jax.device_get(vars(losses)).items()},
            }
            return (state, costs, tried), row

        carry = init_train_state(key, inputs, form), inputs.loss.costs, jnp.float32(0.0)
        (state, *_), rows = run_chunks(carry, chunk, chunks, log)
        return state.parameters, curve_from_rows(MetricCurve, rows)

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> MetricPolicy:
        """Make a policy for scenes and targets; see `relm_irl_jax.types.Agent`."""
        form = update_form(self.settings)
        embeddings: Embeddings = jax.jit(embed, static_argnums=0)(form.network, parameters, world.features)
        inverse_temperature = jnp.float32(self.settings.evaluation_inverse_temperature)
        target_embedding = embeddings.state[targets.state]
        return MetricPolicy(embeddings, target_embedding, inverse_temperature, form.loss.distance, self.greedy)

    def _inputs(self, problem: TrainingProblem, task: NavigationTask, updates: int) -> UpdateInputs:
        settings = self.settings
        assert problem.goals is not None
        weights = LossWeights(
            target_share=jnp.float32(TARGET_SHARE),
            policy=jnp.float32(settings.policy_weight),
            successor=jnp.float32(settings.successor_weight),
            tolerance=jnp.float32(settings.tolerance),
            inverse_temperature=jnp.float32(settings.inverse_temperature),
        )
        optimizer = OptimizerNumbers(
            learning_rate=jnp.float32(settings.learning_rate),
            updates=jnp.float32(updates),
            gradient_clip=jnp.float32(GRADIENT_CLIP),
        )
        scenes = scene_states(problem.world)
        loss = LossInputs(scenes, problem.goals, unknown_costs(scenes, problem.goals), weights)
        return UpdateInputs(task, loss, optimizer)

    def _check(self, problem: TrainingProblem) -> None:
        n_scenes, workers = problem.world.n_scenes, self.settings.workers
        if workers < n_scenes:
            raise InputError(
                f"metric.workers: {workers} workers are too few for {n_scenes} scenes; give at least {n_scenes}."
            )
        if np.bincount(np.asarray(problem.targets.scene), minlength=n_scenes).min() == 0:
            raise InputError("tasks.training_targets: some scene has no training target; give a larger number.")
