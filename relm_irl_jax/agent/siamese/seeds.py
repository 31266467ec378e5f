"""Several seeds of one training in one compiled program.

Each seed has its own parameters, random keys, targets and reward, stood on a first axis over which the update is
mapped; the scenes are shared. A seed's numbers are those that it would have alone, up to the order of sums. An
accelerator that one seed leaves half idle takes several in little more time; a processor gains nothing.
"""

from collections.abc import Sequence
from functools import partial
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agent.learning import (
    LearningCurve,
    Parameters,
    Row,
    TrainingRecord,
    curve_of,
    cut,
    learning_row,
    run_chunks,
)
from relm_irl_jax.agent.rollout import EpisodeSums
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.network import SiameseActorCritic
from relm_irl_jax.agent.siamese.train import begin, cheaper_pairs, check_cap, network_of, run_chunk, worker_lanes
from relm_irl_jax.agent.siamese.update import Learner, Setting
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.world import Targets, World

Tree = TypeVar("Tree")


def stacked(trees: Sequence[Tree]) -> Tree:
    """Stand structures of one form on a new first axis.

    Args:
        trees: structures whose arrays differ in length at most; shorter ones are padded with zeros at the end, so that
            no index that was valid changes its meaning.

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


@partial(jax.jit, static_argnames=("network", "settings", "cap", "updates"))
def run_chunk_of_seeds(
    learners: Learner,
    setting: Setting,
    *,
    network: SiameseActorCritic,
    settings: SiameseSettings,
    cap: int,
    updates: int,
) -> tuple[Learner, EpisodeSums]:
    """Run several updates of all seeds as one program.

    Args:
        learners: the states of training; the first axis of every array is the seed.
        setting: scenes, which are shared, and targets, lanes and rewards, whose first axis is the seed.
        network: the network. Static.
        settings: the agent's settings. Static.
        cap: number of steps after which an episode is truncated. Static.
        updates: number of updates. Static.

    Returns:
        The next states of training, and sums over the episodes that ended, by seed.
    """
    one = partial(run_chunk, network=network, settings=settings, cap=cap, updates=updates)
    own = Setting(world=None, targets=0, lane=0, reward_model=0, return_scale=None, pairs=0)  # pyrefly: ignore
    return jax.vmap(one, in_axes=(0, own))(learners, setting)


def train_seeds(
    keys: Sequence[PRNGKeyArray],
    world: World,
    targets: Sequence[Targets],
    reward_models: Sequence[RewardModel],
    return_scale: float,
    n_heads: int,
    settings: SiameseSettings,
    cap: int,
    frames: int,
    record: TrainingRecord = TrainingRecord(),  # noqa: B008  it has no state
) -> list[tuple[Parameters, LearningCurve]]:
    """Train one agent a seed, all at once.

    Args:
        keys: source of all randomness of each seed.
        world: the training scenes.
        targets: the training targets of each seed, as many in all.
        reward_models: the reward of each seed, of one kind.
        return_scale: size of a typical return, by which returns are divided.
        n_heads: number of heads.
        settings: the agent's settings.
        cap: number of steps after which an episode is truncated, at least `settings.t_max`.
        frames: frames of all workers of a seed together; rounded up to whole chunks of updates.
        record: where the course of training is left, and found again. Its rows have the columns of every seed, with the
            place of the seed before their names.

    Returns:
        The network's parameters and the learning curve of each seed.

    Raises:
        InputError: the cap is below t_max, or the lanes cannot be laid.
    """
    check_cap(cap, settings)
    network = network_of(settings, n_heads)
    lanes = [worker_lanes(own, world, n_heads, settings.workers) for own in targets]
    learners = stacked(
        [begin(key, world, own, lane, network, settings) for key, own, lane in zip(keys, targets, lanes, strict=True)]
    )
    pairs = [cheaper_pairs(world, own, network, lanes[0].first.size * settings.t_max) for own in targets]
    shared = (stacked(targets), stacked(lanes), stacked(reward_models), jnp.float32(return_scale))
    setting = Setting(world, *shared, None if None in pairs else stacked(pairs))
    chunks = cut(frames, lanes[0].first.size * settings.t_max)

    def chunk(learners: Learner, number: int) -> tuple[Learner, Row]:
        learners, sums = run_chunk_of_seeds(
            learners, setting, network=network, settings=settings, cap=cap, updates=chunks.updates
        )
        row = {"frames": float((number + 1) * chunks.frames)}
        for place in range(len(keys)):
            own = learning_row(jax.tree.map(lambda x, place=place: x[place], sums), number, chunks)
            row |= {f"{place}/{name}": value for name, value in own.items()}
        return learners, row

    learners, rows = run_chunks(learners, chunk, chunks, record)
    trained = []
    for place in range(len(keys)):
        prefix = f"{place}/"
        own: list[Row] = [
            {name.removeprefix(prefix): row[name] for name in row if name.startswith(prefix)} for row in rows
        ]
        parameters = jax.tree.map(lambda x, place=place: x[place], learners.parameters)
        trained.append((parameters, curve_of(LearningCurve, own)))
    return trained
