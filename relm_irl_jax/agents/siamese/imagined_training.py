"""Training of the siamese actor-critic on imagined targets."""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.imagined_targets import drawn_pairs
from relm_irl_jax.agents.siamese.imagined_update import ImaginedInputs, ImaginedState, run_imagined_updates
from relm_irl_jax.agents.siamese.network import DISTANCE
from relm_irl_jax.agents.siamese.size_classes import size_classes
from relm_irl_jax.agents.siamese.training import (
    init_parameters,
    loss_weights,
    optimizer_numbers,
    scene_heads,
    update_form,
)
from relm_irl_jax.agents.siamese.update import UpdateForm, make_optimizer
from relm_irl_jax.agents.training import LearningCurve, train_in_chunks
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Parameters, TrainingLog, TrainingProblem


def train_on_imagined(
    key: PRNGKeyArray, problem: TrainingProblem, settings: SiameseSettings, log: TrainingLog
) -> tuple[Parameters, LearningCurve]:
    """Train on the given and on imagined targets.

    Args:
        key: source of all randomness of the training.
        problem: the learning problem, with imagined targets.
        settings: the agent's settings.
        log: receives the progress, and restores an interrupted training.

    Returns:
        The network's parameters and the learning curve.

    Raises:
        InputError: the settings do not suit the problem.
    """
    state, inputs, form = prepare_imagined(key, problem, settings)
    frames_per_update = inputs.pairs.worker_first.size * settings.t_max

    def several(state: ImaginedState, updates: int):
        return run_imagined_updates(state, inputs, form=form, updates=updates)

    state, curve = train_in_chunks(state, several, problem.frames, frames_per_update, log)
    return state.parameters, curve


def prepare_imagined(
    key: PRNGKeyArray, problem: TrainingProblem, settings: SiameseSettings
) -> tuple[ImaginedState, ImaginedInputs, UpdateForm]:
    """Prepare a training.

    Args:
        key: source of all randomness of the training.
        problem: the learning problem, with imagined targets.
        settings: the agent's settings.

    Returns:
        The state before the first update, the inputs of updates, and their static part.

    Raises:
        InputError: the settings do not suit the problem.
    """
    assert problem.imagined is not None
    if settings.history > 1 or settings.observe_reward:
        name = "history" if settings.history > 1 else "observe_reward"
        raise InputError(
            f"siamese.{name}: imagined targets are for agents that observe one view and no reward; leave it out, or "
            "give siamese.imagine = none."
        )
    scene_head = scene_heads(problem.world, settings)
    form = update_form(settings, int(scene_head.max()) + 1)
    classes = size_classes(problem.world, problem.imagined, scene_head, settings.scenes_at_once)
    inputs = ImaginedInputs(
        world=problem.world,
        pairs=drawn_pairs(classes, settings.targets_at_once, settings.workers),
        collision=problem.imagined.collision,
        told=problem.imagined.told,
        given_share=jnp.float32(settings.given_share),
        near_starts=jnp.float32(settings.near_starts),
        loss=loss_weights(settings, problem.return_scale),
        optimizer=optimizer_numbers(settings, problem.frames),
    )
    return _initial_state(key, inputs, form), inputs, form


@partial(jax.jit, static_argnames="form")
def _initial_state(key: PRNGKeyArray, inputs: ImaginedInputs, form: UpdateForm) -> ImaginedState:
    key, parameter_key = jax.random.split(key)
    parameters = init_parameters(parameter_key, form.network, inputs.world)
    if form.network.distance:
        # Values begin at 0 at a target that ends the episode, and at 0 far from one that goes on paying.
        layers = dict(parameters["params"])
        layers["value_bias"] += jnp.where(inputs.told, 0.0, DISTANCE / 2)
        parameters = {"params": layers}
    return ImaginedState(parameters, make_optimizer(form, inputs.optimizer).init(parameters), key)
