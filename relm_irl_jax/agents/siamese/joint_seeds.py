"""Training of several seeds in one compiled program.

Parameters, random keys, targets and reward of the seeds are stacked on a first axis, over which the update is vmapped;
the scenes are shared. The results of a seed are the same as if it were trained alone, up to the order of sums. An
accelerator that one seed does not keep busy trains several in little more time; a CPU would not be faster.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.heads import worker_target_ranges
from relm_irl_jax.agents.padding import pad_and_stack
from relm_irl_jax.agents.rollout import EpisodeSums
from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.training import (
    init_train_state,
    pairs_if_cheaper,
    run_updates,
    scene_heads,
    update_form,
    update_inputs,
)
from relm_irl_jax.agents.siamese.update import UpdateForm, UpdateInputs
from relm_irl_jax.agents.training import (
    LearningCurve,
    TrainState,
    curve_from_rows,
    learning_row,
    run_chunks,
    split_into_chunks,
)
from relm_irl_jax.types import Parameters, Row, TrainingLog, TrainingProblem


def stack_padded(trees: Sequence[Any]) -> list[jax.Array]:
    """Stack the arrays of pytrees of the same structure on a new first axis.

    Args:
        trees: pytrees; shorter arrays are padded with zeros at the end, which does not change valid indices.

    Returns:
        The stacked arrays, in the order of `jax.tree.leaves`.
    """

    def stack(arrays: Sequence[jax.Array]) -> jax.Array:
        if len({array.shape for array in arrays}) == 1:
            return jnp.stack(arrays)
        return pad_and_stack(arrays)

    return [stack(arrays) for arrays in zip(*map(jax.tree.leaves, trees), strict=True)]


@dataclass(frozen=True)
class _Structures:
    """Pytree structures of one seed's state and inputs."""

    state: jax.tree_util.PyTreeDef
    inputs: jax.tree_util.PyTreeDef


@partial(jax.jit, static_argnames=("structures", "form", "updates"))
def _run_updates_of_seeds(
    states: list[jax.Array],
    seed_inputs: list[jax.Array],
    shared: UpdateInputs,
    *,
    structures: _Structures,
    form: UpdateForm,
    updates: int,
) -> tuple[list[jax.Array], EpisodeSums]:
    """Run several updates of all seeds as one program; `seed_inputs` are targets, target ranges, rewards and pairs."""

    def run_seed(state: list[jax.Array], inputs: list[jax.Array]) -> tuple[list[jax.Array], EpisodeSums]:
        targets, target_range, reward, pairs = jax.tree.unflatten(structures.inputs, inputs)
        task = replace(shared.task, targets=targets, target_range=target_range, reward=reward)
        train_state: TrainState = jax.tree.unflatten(structures.state, state)
        update_inputs = replace(shared, task=task, pairs=pairs)
        train_state, sums = run_updates(train_state, update_inputs, form=form, updates=updates)
        return jax.tree.leaves(train_state), sums

    return jax.vmap(run_seed)(states, seed_inputs)


def train_seeds(
    keys: Sequence[PRNGKeyArray], problems: Sequence[TrainingProblem], settings: SiameseSettings, log: TrainingLog
) -> list[tuple[Parameters, LearningCurve]]:
    """Train one network for each seed, in one program.

    Args:
        keys: source of all randomness of each seed.
        problems: the problem of each seed, all with the same scenes, cap, frames, return scale, number of targets and
            kind of reward.
        settings: the agent's settings.
        log: receives the progress, and restores an interrupted training. Its rows have the columns of every seed; their
            names start with the position of the seed.

    Returns:
        The network's parameters and the learning curve of each seed.

    Raises:
        InputError: the settings do not suit the problems.
    """
    shared = problems[0]
    scene_head = scene_heads(shared.world, settings)
    form = update_form(settings, int(scene_head.max()) + 1)
    n_heads = form.network.n_heads
    ranges = [worker_target_ranges(each.targets, scene_head, n_heads, settings.workers, "siamese") for each in problems]
    frames_per_update = ranges[0].first.size * settings.t_max
    pairs = [pairs_if_cheaper(each, scene_head, form.network, frames_per_update) for each in problems]
    pairs = [None] * len(pairs) if None in pairs else pairs
    inputs = [
        update_inputs(problem, settings, target_range, problem_pairs)
        for problem, target_range, problem_pairs in zip(problems, ranges, pairs, strict=True)
    ]
    states = [init_train_state(key, each, form) for key, each in zip(keys, inputs, strict=True)]
    seed_inputs = [(each.task.targets, each.task.target_range, each.task.reward, each.pairs) for each in inputs]
    structures = _Structures(jax.tree.structure(states[0]), jax.tree.structure(seed_inputs[0]))
    stacked_states, stacked_inputs = stack_padded(states), stack_padded(seed_inputs)
    chunks = split_into_chunks(shared.frames, frames_per_update)

    def chunk(states: list[jax.Array], number: int) -> tuple[list[jax.Array], Row]:
        states, sums = _run_updates_of_seeds(
            states, stacked_inputs, inputs[0], structures=structures, form=form, updates=chunks.updates
        )
        row = {"frames": float((number + 1) * chunks.frames)}
        for position in range(len(keys)):
            means = learning_row(jax.tree.map(lambda x, position=position: x[position], sums), number, chunks)
            row |= {f"{position}/{name}": value for name, value in means.items()}
        return states, row

    stacked_states, rows = run_chunks(stacked_states, chunk, chunks, log)
    trained = []
    for position in range(len(keys)):
        prefix = f"{position}/"
        curve: list[Row] = [
            {name.removeprefix(prefix): row[name] for name in row if name.startswith(prefix)} for row in rows
        ]
        state: TrainState = jax.tree.unflatten(structures.state, [x[position] for x in stacked_states])
        trained.append((state.parameters, curve_from_rows(LearningCurve, curve)))
    return trained
