"""Several seeds of one training in one compiled program.

Each seed has its own parameters, random keys, targets and reward, stacked on a first axis over which the update is
mapped; the scenes are shared. The numbers of a seed are those that it would have alone, up to the order of sums. An
accelerator that one seed leaves half idle trains several in little more time; a CPU gains nothing.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.rollout import EpisodeSums, NavigationTask
from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.training import (
    init_train_state,
    pairs_if_cheaper,
    run_updates,
    scene_heads,
    update_form,
    update_inputs,
    worker_target_ranges,
)
from relm_irl_jax.agents.siamese.update import TrainState, UpdateForm, UpdateInputs
from relm_irl_jax.agents.training import LearningCurve, curve_from_rows, learning_row, run_chunks, split_into_chunks
from relm_irl_jax.types import Parameters, Row, TrainingLog, TrainingProblem

Tree = TypeVar("Tree")


def stack_padded(trees: Sequence[Tree]) -> Tree:
    """Stack structures of one form on a new first axis.

    Args:
        trees: structures whose arrays differ in length at most; shorter ones are padded with zeros at the end, so that
            every valid index keeps its meaning.

    Returns:
        One structure.
    """

    def stack(*arrays: jax.Array) -> jax.Array:
        if len({array.shape for array in arrays}) == 1:
            return jnp.stack(arrays)
        longest = [max(sizes) for sizes in zip(*(array.shape for array in arrays), strict=True)]
        pad = lambda array: [(0, most - size) for most, size in zip(longest, array.shape, strict=True)]  # noqa: E731
        return jnp.stack([jnp.pad(array, pad(array)) for array in arrays])

    return jax.tree.map(stack, *trees)


@partial(jax.jit, static_argnames=("form", "updates"))
def run_updates_of_seeds(
    states: TrainState, inputs: UpdateInputs, *, form: UpdateForm, updates: int
) -> tuple[TrainState, EpisodeSums]:
    """Run several updates of all seeds as one program.

    Args:
        states: the states of training; the first axis of every array is the seed.
        inputs: as for one seed, with the seed as first axis of targets, target ranges, reward and pairs.
        form: the static part. Static.
        updates: number of updates. Static.

    Returns:
        The next states of training, and sums over the episodes that ended, by seed.
    """
    task = NavigationTask(world=None, targets=0, target_range=0, reward=0, cap=None)  # pyrefly: ignore
    own = UpdateInputs(task=task, loss=None, optimizer=None, pairs=0)  # pyrefly: ignore
    return jax.vmap(partial(run_updates, form=form, updates=updates), in_axes=(0, own))(states, inputs)


def train_seeds(
    keys: Sequence[PRNGKeyArray], problems: Sequence[TrainingProblem], settings: SiameseSettings, log: TrainingLog
) -> list[tuple[Parameters, LearningCurve]]:
    """Train one network for each seed, all at once.

    Args:
        keys: source of all randomness of each seed.
        problems: what each seed is to learn: the same scenes, cap, frames and return scale, as many targets, rewards of
            one kind.
        settings: the agent's settings.
        log: receives the progress, and restores an interrupted training. Its rows have the columns of every seed, with
            the place of the seed before their names.

    Returns:
        The network's parameters and the learning curve of each seed.

    Raises:
        InputError: the settings do not suit the problems.
    """
    shared = problems[0]
    scene_head = scene_heads(shared.world, settings)
    form = update_form(settings, int(scene_head.max()) + 1)
    n_heads = form.network.n_heads
    ranges = [worker_target_ranges(own.targets, scene_head, n_heads, settings.workers) for own in problems]
    frames_per_update = ranges[0].first.size * settings.t_max
    pairs = [pairs_if_cheaper(own, scene_head, form.network, frames_per_update) for own in problems]
    pairs = [None] * len(pairs) if None in pairs else pairs
    inputs = [
        update_inputs(own, settings, target_range, own_pairs)
        for own, target_range, own_pairs in zip(problems, ranges, pairs, strict=True)
    ]
    states = stack_padded([init_train_state(key, own, form) for key, own in zip(keys, inputs, strict=True)])
    stacked = replace(
        inputs[0],
        task=replace(
            inputs[0].task,
            targets=stack_padded([own.task.targets for own in inputs]),
            target_range=stack_padded(ranges),
            reward=stack_padded([own.task.reward for own in inputs]),
        ),
        pairs=None if pairs[0] is None else stack_padded(pairs),
    )
    chunks = split_into_chunks(shared.frames, frames_per_update)

    def chunk(states: TrainState, number: int) -> tuple[TrainState, Row]:
        states, sums = run_updates_of_seeds(states, stacked, form=form, updates=chunks.updates)
        row = {"frames": float((number + 1) * chunks.frames)}
        for place in range(len(keys)):
            own = learning_row(jax.tree.map(lambda x, place=place: x[place], sums), number, chunks)
            row |= {f"{place}/{name}": value for name, value in own.items()}
        return states, row

    states, rows = run_chunks(states, chunk, chunks, log)
    trained = []
    for place in range(len(keys)):
        prefix = f"{place}/"
        own: list[Row] = [
            {name.removeprefix(prefix): row[name] for name in row if name.startswith(prefix)} for row in rows
        ]
        parameters = jax.tree.map(lambda x, place=place: x[place], states.parameters)
        trained.append((parameters, curve_from_rows(LearningCurve, own)))
    return trained
