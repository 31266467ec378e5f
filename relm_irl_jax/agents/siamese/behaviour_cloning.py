"""Behaviour cloning: the policy is fitted to demonstrated actions by maximum likelihood, without rewards.

    loss = mean over demonstrated (s, g, a) of −log π(a | s, g)

Network, optimiser and batch size are those of the actor-critic, so that the baseline differs from the other methods
only in its supervision. The value is not trained.
"""

from dataclasses import dataclass, field
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float64, Int, Int32, PRNGKeyArray

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.forward import evaluate, tabulate
from relm_irl_jax.agents.siamese.policy import PairPolicy, SeveralViewsPolicy
from relm_irl_jax.agents.siamese.training import init_parameters, optimizer_numbers, scene_heads, update_form
from relm_irl_jax.agents.siamese.update import OptimizerNumbers, UpdateForm, make_optimizer
from relm_irl_jax.agents.training import apply_gradient, curve_from_rows, run_chunks, split_into_chunks
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Demonstrations, Parameters, Requirement, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World

Carry = tuple[Parameters, optax.OptState]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Decisions:
    """Demonstrated decisions, one row for each head; rows are padded at the end.

    Attributes:
        views: last states in the world, the latest first.
        target: rows of `Targets`.
        action: demonstrated action.
        count: number of valid entries in each row.
    """

    views: Int32[Array, "heads decisions history"]
    target: Int32[Array, "heads decisions"]
    action: Int32[Array, "heads decisions"]
    count: Int32[Array, "heads"]


@dataclass(frozen=True)
class CloningCurve:
    """Progress of the fit, one entry for each chunk of updates.

    Attributes:
        frames: demonstrated decisions in all batches up to the end of the chunk, with repetitions.
        loss: mean −log π of the demonstrated action, in nats.
        accuracy: share of decisions whose demonstrated action is the most probable one.
    """

    frames: Float64[np.ndarray, "chunks"]
    loss: Float64[np.ndarray, "chunks"]
    accuracy: Float64[np.ndarray, "chunks"]


def decisions_by_head(
    demonstrations: Demonstrations, world: World, scene_head: Int[np.ndarray, "scenes"], history: int
) -> Decisions:
    """Group demonstrated decisions by the head of their scene.

    Args:
        demonstrations: the decisions.
        world: the training scenes.
        scene_head: head of each scene.
        history: number of last views that are observed; before a trajectory's start, its first view is repeated.

    Returns:
        The decisions.

    Raises:
        InputError: nothing is demonstrated for a head.
    """
    state, step = np.asarray(demonstrations.state), np.asarray(demonstrations.step)
    views = state[np.arange(len(state))[:, None] - np.minimum(np.arange(history), step[:, None])]
    head = scene_head[np.asarray(world.scene)[state]]
    n_heads = int(scene_head.max()) + 1
    count = np.bincount(head, minlength=n_heads)
    if count.min() == 0:
        raise InputError(
            "tasks.training_targets: some head of the network has no demonstration; give a larger number of targets."
        )

    def rows(values: np.ndarray) -> Array:
        padded = np.zeros((n_heads, count.max(), *values.shape[1:]), np.int32)
        for number in range(n_heads):
            padded[number, : count[number]] = values[head == number]
        return jnp.asarray(padded)

    return Decisions(
        rows(views),
        rows(np.asarray(demonstrations.target)),
        rows(np.asarray(demonstrations.action)),
        jnp.asarray(count, jnp.int32),
    )


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class CloningInputs:
    """The constant inputs of an update.

    Attributes:
        world: the training scenes.
        targets: the training targets.
        decisions: the demonstrated decisions.
        optimizer: the optimiser's numbers.
    """

    world: World
    targets: Targets
    decisions: Decisions
    optimizer: OptimizerNumbers


@partial(jax.jit, static_argnames=("form", "batch", "updates"))
def _run_updates(
    carry: Carry, key: PRNGKeyArray, inputs: CloningInputs, *, form: UpdateForm, batch: int, updates: int
) -> tuple[Carry, tuple[Array, Array]]:
    """Take several gradient steps, each on `batch` decisions of each head, drawn with replacement."""
    network, decisions = form.network, inputs.decisions
    heads = jnp.arange(network.n_heads)

    def update(carry: Carry, key: PRNGKeyArray) -> tuple[Carry, tuple[Array, Array]]:
        parameters, optimizer = carry
        drawn = jax.random.randint(key, (network.n_heads, batch), 0, decisions.count[:, None])
        views, target, action = (
            x[heads[:, None], drawn] for x in (decisions.views, decisions.target, decisions.action)
        )

        def loss(parameters: Parameters) -> tuple[Array, tuple[Array, Array]]:
            tables = tabulate(network, parameters, inputs.world, inputs.targets, drawn.size)
            logits = evaluate(network, parameters, tables, views, target, heads).logits
            likelihood = jnp.take_along_axis(jax.nn.log_softmax(logits), action[..., None], -1)
            agree = jnp.argmax(logits, -1).astype(jnp.int32) == action
            return form.reduce(-likelihood), (-likelihood.mean(), agree.mean())

        (_, measured), gradient = jax.value_and_grad(loss, has_aux=True)(parameters)
        return apply_gradient(make_optimizer(form, inputs.optimizer), gradient, optimizer, parameters), measured

    carry, measured = jax.lax.scan(update, carry, jax.random.split(key, updates))
    return carry, jax.tree.map(jnp.mean, measured)


@dataclass(frozen=True)
class BehaviourCloningAgent:
    """The siamese network fitted to demonstrations.

    Attributes:
        settings: network and optimiser; the weights of the actor-critic loss are not used.
        greedy: whether its policies take the most probable action instead of drawing one.
    """

    settings: SiameseSettings = field(default_factory=SiameseSettings)
    greedy: bool = False
    name: str = "siamese"
    requires: frozenset[Requirement] = frozenset({"features", "demonstrations"})

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, CloningCurve]:
        """Fit the policy to the problem's demonstrations; see `relm_irl_jax.types.Agent`."""
        assert problem.demonstrations is not None
        scene_head = scene_heads(problem.world, self.settings)
        form = update_form(self.settings, int(scene_head.max()) + 1)
        decisions = decisions_by_head(problem.demonstrations, problem.world, scene_head, self.settings.history)
        numbers = optimizer_numbers(self.settings, problem.frames)
        inputs = CloningInputs(problem.world, problem.targets, decisions, numbers)
        key, parameter_key = jax.random.split(key)
        parameters = init_parameters(parameter_key, form.network, problem.world)
        carry = parameters, make_optimizer(form, inputs.optimizer).init(parameters)
        batch = self.settings.workers // form.network.n_heads * self.settings.t_max
        chunks = split_into_chunks(problem.frames, form.network.n_heads * batch)

        def chunk(carry: Carry, number: int):
            chunk_key = jax.random.fold_in(key, number * chunks.updates)
            carry, (loss, accuracy) = _run_updates(
                carry, chunk_key, inputs, form=form, batch=batch, updates=chunks.updates
            )
            frames = float((number + 1) * chunks.frames)
            return carry, {"frames": frames, "loss": float(loss), "accuracy": float(accuracy)}

        carry, rows = run_chunks(carry, chunk, chunks, log)
        return carry[0], curve_from_rows(CloningCurve, rows)

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> PairPolicy | SeveralViewsPolicy:
        """Make a policy for scenes and targets; see `relm_irl_jax.types.Agent`."""
        return SiameseAgent(self.settings, self.greedy).policy(parameters, world, targets)
