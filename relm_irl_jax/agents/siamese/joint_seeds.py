"""Several seeds of one training in one compiled program.

Each seed has its own parameters, random keys, targets and reward, stacked on a first axis over which the update is
mapped; the scenes are shared. The numbers of a seed are those that it would have alone, up to the order of sums. An
accelerator that one seed leaves half idle trains several in little more time; a CPU gains nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.rollout import EpisodeSums
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


def stack_padded(trees: Sequence[Any]) -> list[jax.Array]:
    """Stack the arrays of structures of one form on a new first axis.

    Args:
        trees: structures whose arrays differ in length at most; shorter ones are padded with zeros at the end, so that
            every valid index keeps its meaning.

    Returns:
        The stacked arrays, in the order of `jax.tree.leaves`.
    """

    def stack(arrays: Sequence[jax.Array]) -> jax.Array:
        if len({array.shape for array in arrays}) == 1:
            return jnp.stack(arrays)
        longest = [max(sizes) for sizes in zip(*(array.shape for array in arrays), strict=True)]
        pad = lambda array: [(0, most - size) for most, size in zip(longest, array.shape, strict=True)]  # noqa: E731
        return jnp.stack([jnp.pad(array, pad(array)) for array in arrays])

    return [stack(arrays) for arrays in zip(*map(jax.tree.leaves, trees), strict=True)]


@dataclass(frozen=True)
class _Structures:
    """Structures of one seed, whose arrays all have the seed as first axis while several seeds are trained."""

    state: jax.tree_util.PyTreeDef
    own: jax.tree_util.PyTreeDef


@partial(jax.jit, static_argnames=("structures", "form", "updates"))
def _run_updates_of_seeds(
    states: list[jax.Array],
    own: list[jax.Array],
    inputs: UpdateInputs,
    *,
    structures: _Structures,
    form: UpdateForm,
    updates: int,
) -> tuple[list[jax.Array], EpisodeSums]:
    """Run several updates of all seeds as one program; `own` holds targets, target ranges, rewards and pairs."""

    def run_seed(state: list[jax.Array], own: list[jax.Array]) -> tuple[list[jax.Array], EpisodeSums]:
        targets, target_range, reward, pairs = jax.tree.unflatten(structures.own, own)
        task = replace(inputs.task, targets=targets, target_range=target_range, reward=reward)
        whole: TrainState = jax.tree.unflatten(structures.state, state)
        whole, sums = run_updates(whole, replace(inputs, task=task, pairs=pairs), form=form, updates=updates)
        return jax.tree.leaves(whole), sums

    return jax.vmap(run_seed)(states, own)


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
    states = [init_train_state(key, seed_inputs, form) for key, seed_inputs in zip(keys, inputs, strict=True)]
    own = [(i.task.targets, i.task.target_range, i.task.reward, i.pairs) for i in inputs]
    structures = _Structures(jax.tree.structure(states[0]), jax.tree.structure(own[0]))
    stacked_states, stacked_own = stack_padded(states), stack_padded(own)
    chunks = split_into_chunks(shared.frames, frames_per_update)

    def chunk(states: list[jax.Array], number: int) -> tuple[list[jax.Array], Row]:
        states, sums = _run_updates_of_seeds(
            states, stacked_own, inputs[0], structures=structures, form=form, updates=chunks.updates
        )
        row = {"frames": float((number + 1) * chunks.frames)}
        for place in range(len(keys)):
            means = learning_row(jax.tree.map(lambda x, place=place: x[place], sums), number, chunks)
            row |= {f"{place}/{name}": value for name, value in means.items()}
        return states, row

    stacked_states, rows = run_chunks(stacked_states, chunk, chunks, log)
    trained = []
    for place in range(len(keys)):
        prefix = f"{place}/"
        curve: list[Row] = [
            {name.removeprefix(prefix): row[name] for name in row if name.startswith(prefix)} for row in rows
        ]
        state: TrainState = jax.tree.unflatten(structures.state, [x[place] for x in stacked_states])
        trained.append((state.parameters, curve_from_rows(LearningCurve, curve)))
    return trained
