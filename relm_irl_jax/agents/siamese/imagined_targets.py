"""Pairs of states and drawn targets: the table on which an update with many targets acts and learns.

There are too many pairs of a state and an imagined target to evaluate all of them in an update (a million in six
rooms), and evaluating each frame takes more time than it needs to. So every update draws a few targets of each scene
and evaluates these with all states of the scene. Acting is then a look-up in a table of pairs, in which several times
as many workers walk in little more time.
"""

from dataclasses import dataclass, field
from itertools import groupby

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.agents.siamese.network import SiameseActorCritic, Tables
from relm_irl_jax.rewards.imagined import ImaginedTargets
from relm_irl_jax.types import Parameters
from relm_irl_jax.world import World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class DrawnPairs:
    """What is the same for the pairs of every update. The pairs of a scene are consecutive, and those of a state in it.

    Attributes:
        successor: pair after each action, for the same target.
        first_state: first state in the world of each scene.
        worker_first: pair of each worker's target with the first state of the scene.
        worker_states: number of states of each worker's scene.
        sizes: number of states of each scene. Static.
        heads: head of each scene. Static.
        at_once: targets of each scene. Static.
    """

    successor: Int32[Array, "pairs 4"]
    first_state: Int32[Array, "scenes"]
    worker_first: Int32[Array, "workers"]
    worker_states: Int32[Array, "workers"]
    sizes: tuple[int, ...] = field(metadata={"static": True})
    heads: tuple[int, ...] = field(metadata={"static": True})
    at_once: int = field(metadata={"static": True})

    def start(self, position: Float32[Array, "workers"]) -> Int32[Array, "workers"]:
        """Pair of each worker's target with a state of its scene.

        Args:
            position: uniform numbers in [0, 1), which give the states.

        Returns:
            The pairs.
        """
        state = (position * self.worker_states.astype(jnp.float32)).astype(jnp.int32)
        return self.worker_first + jnp.minimum(state, self.worker_states - 1) * self.at_once


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TargetsOfUpdate:
    """The targets of one update and the rewards of their pairs.

    Attributes:
        state: local states of the targets.
        reward: reward for arriving in the pair's state.
        arrived: whether the pair's state is its target.
    """

    state: Int32[Array, "scenes targets"]
    reward: Float32[Array, "pairs"]
    arrived: Bool[Array, "pairs"]


def drawn_pairs(world: World, scene_head: np.ndarray, at_once: int, workers: int) -> DrawnPairs:
    """Number the pairs of an update, and divide the workers among its targets.

    Args:
        world: the scenes.
        scene_head: head of each scene.
        at_once: targets of each scene.
        workers: workers, about in proportion to the numbers of states of the scenes.

    Returns:
        The pairs.
    """
    sizes = np.bincount(np.asarray(world.scene), minlength=world.n_scenes)
    first_state = np.cumsum([0, *sizes])[:-1]
    first_pair = first_state * at_once
    slot = np.arange(at_once)
    successor, worker_first, worker_states = [], [], []
    for size, state, pair in zip(sizes, first_state, first_pair, strict=True):
        local = np.asarray(world.successor)[state : state + size] - state
        successor.append((pair + local[:, None] * at_once + slot[None, :, None]).reshape(-1, 4))
        of_target = max(1, round(workers * size / sizes.sum() / at_once))
        worker_first.append(np.tile(pair + slot, of_target))
        worker_states.append(np.full(of_target * at_once, size))
    return DrawnPairs(
        successor=jnp.asarray(np.concatenate(successor), jnp.int32),
        first_state=jnp.asarray(first_state, jnp.int32),
        worker_first=jnp.asarray(np.concatenate(worker_first), jnp.int32),
        worker_states=jnp.asarray(np.concatenate(worker_states), jnp.int32),
        sizes=tuple(int(size) for size in sizes),
        heads=tuple(int(head) for head in scene_head),
        at_once=at_once,
    )


def draw_targets(
    key: PRNGKeyArray, pairs: DrawnPairs, targets: ImaginedTargets, given_share: Float32[Array, ""]
) -> TargetsOfUpdate:
    """Draw the targets of an update.

    Args:
        key: source of randomness.
        pairs: the pairs.
        targets: all targets.
        given_share: probability that a target is drawn among the given ones, if the scene has any.

    Returns:
        The targets of the update.
    """
    states, rewards, arrived = [], [], []
    keys = jax.random.split(key, len(pairs.sizes))
    for number, size in enumerate(pairs.sizes):
        state, trained = targets.state[number], targets.trained[number]
        given_key, row_key = jax.random.split(keys[number])
        given = (jax.random.uniform(given_key, (pairs.at_once,)) < given_share) & (trained > 0)
        row = jax.random.randint(row_key, (pairs.at_once,), 0, jnp.where(given, trained, len(state)))
        states.append(state[row])
        rewards.append(targets.reward[number][row].T.reshape(-1))
        arrived.append((jnp.arange(size)[:, None] == state[row]).reshape(-1))
    return TargetsOfUpdate(jnp.stack(states), jnp.concatenate(rewards), jnp.concatenate(arrived))


def evaluate_drawn(
    network: SiameseActorCritic, parameters: Parameters, world: World, pairs: DrawnPairs, state: Int32[Array, "s t"]
) -> Outputs:
    """Evaluate the network on all pairs of an update; each view is embedded once.

    Args:
        network: the network; it observes one view. Static.
        parameters: θ.
        world: the scenes.
        pairs: the pairs.
        state: local states of the targets, [scenes targets].

    Returns:
        Policy and value of each pair.
    """
    in_world = state + pairs.first_state[:, None]
    tables = network.apply(parameters, world.features, in_world.reshape(-1), every_state=True, method="tables")
    assert isinstance(tables, Tables)
    assert tables.fusion is not None
    of_targets = tables.target.reshape(len(pairs.sizes), -1)
    outputs, first = [], 0
    for head, group in groupby(range(len(pairs.sizes)), key=pairs.heads.__getitem__):
        scenes = list(group)
        sizes = [pairs.sizes[number] for number in scenes]
        # A product with zeros and ones repeats the targets of a scene for its states; its gradient is a product, too,
        # while that of a look-up is added row by row.
        own = np.repeat(np.eye(len(scenes), dtype=np.float32), sizes, axis=0)
        of_states = tables.fusion[first : first + sum(sizes)]
        repeated = (own @ of_targets[scenes[0] : scenes[-1] + 1]).reshape(len(own), pairs.at_once, -1)
        outputs.append(network.apply(parameters, of_states, repeated, head, method="every_pair"))
        first += sum(sizes)
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *outputs)
