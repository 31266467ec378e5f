"""Pairs of states and drawn targets: the table on which an update with many targets acts and learns.

There are too many pairs of a state and an imagined target to evaluate all of them in an update (a million in six
rooms), and evaluating each frame takes more time than it needs to. So every update draws a few scenes (see
`relm_irl_jax.agents.siamese.size_classes`), a few targets of each, and evaluates these with all states of the scene.
Acting is then a look-up in a table of pairs, in which several times as many workers walk in little more time.
"""

from dataclasses import dataclass, field
from itertools import groupby

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.agents.siamese.network import SiameseActorCritic, Tables
from relm_irl_jax.agents.siamese.size_classes import SizeClass
from relm_irl_jax.types import Parameters
from relm_irl_jax.world import World


def first_pairs(classes: tuple[SizeClass, ...], at_once: int) -> tuple[int, ...]:
    """First pair of each class.

    Args:
        classes: scenes of similar size.
        at_once: targets of each drawn scene.

    Returns:
        The first pairs, and the number of all pairs.
    """
    return tuple(int(state) * at_once for state in np.cumsum([0, *(one.n_states for one in classes)]))


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class DrawnPairs:
    """What is the same for the pairs of every update. The pairs of a class are consecutive, and those of a state in it.

    Attributes:
        classes: scenes of similar size, of which an update draws one each.
        worker_class: class of each worker.
        worker_first: pair of each worker's target with the first state of the scene.
        at_once: targets of each drawn scene. Static.
    """

    classes: tuple[SizeClass, ...]
    worker_class: Int32[Array, "workers"]
    worker_first: Int32[Array, "workers"]
    at_once: int = field(metadata={"static": True})

    @property
    def first_pair(self) -> tuple[int, ...]:
        """First pair of each class, and the number of all pairs."""
        return first_pairs(self.classes, self.at_once)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class PairsOfUpdate:
    """The scenes and targets of one update, and what the pairs of a state and a target are. Padding is never visited.

    Attributes:
        in_world: state in the world of each class's states; where it is padded, the scene's last state.
        target: local states of the targets.
        successor: pair after each action, for the same target.
        reward: reward for arriving in the pair's state.
        arrived: whether the pair's state is its target.
        worker_target: pair of each worker's target with itself.
        worker_states: number of states of each worker's scene.
    """

    in_world: Int32[Array, "states"]
    target: Int32[Array, "classes targets"]
    successor: Int32[Array, "pairs 4"]
    reward: Float32[Array, "pairs"]
    arrived: Bool[Array, "pairs"]
    worker_target: Int32[Array, "workers"]
    worker_states: Int32[Array, "workers"]

    def start(self, pairs: DrawnPairs, position: Float32[Array, "workers"]) -> Int32[Array, "workers"]:
        """Pair of each worker's target with a state of its scene.

        Args:
            pairs: what is the same for every update.
            position: uniform numbers in [0, 1), which give the states.

        Returns:
            The pairs.
        """
        state = (position * self.worker_states.astype(jnp.float32)).astype(jnp.int32)
        return pairs.worker_first + jnp.minimum(state, self.worker_states - 1) * pairs.at_once


def drawn_pairs(classes: tuple[SizeClass, ...], at_once: int, workers: int) -> DrawnPairs:
    """Number the pairs of an update, and divide the workers among its targets.

    Args:
        classes: scenes of similar size.
        at_once: targets of each drawn scene.
        workers: workers, about in proportion to the mean numbers of states of the classes.

    Returns:
        The pairs.
    """
    states = np.asarray([np.mean(one.size) for one in classes])
    of_target = [max(1, round(workers * mean / states.sum() / at_once)) for mean in states]
    first_pair = first_pairs(classes, at_once)[:-1]
    firsts = [np.tile(first + np.arange(at_once), n) for first, n in zip(first_pair, of_target, strict=True)]
    return DrawnPairs(
        classes=classes,
        worker_class=jnp.asarray(np.repeat(np.arange(len(classes)), [len(first) for first in firsts]), jnp.int32),
        worker_first=jnp.asarray(np.concatenate(firsts), jnp.int32),
        at_once=at_once,
    )


def draw_targets(key: PRNGKeyArray, pairs: DrawnPairs, given_share: Float32[Array, ""]) -> PairsOfUpdate:
    """Draw the scenes and the targets of an update.

    Args:
        key: source of randomness.
        pairs: scenes and targets.
        given_share: probability that a target is drawn among the given ones, if the scene has any.

    Returns:
        The pairs of the update.
    """
    at_once, slot = pairs.at_once, jnp.arange(pairs.at_once, dtype=jnp.int32)
    in_world, targets, successors, rewards, arrived, sizes = [], [], [], [], [], []
    keys = jax.random.split(key, len(pairs.classes))
    for number, one in enumerate(pairs.classes):
        given_key, row_key, scene_key = jax.random.split(keys[number], 3)
        drawn = jax.random.randint(scene_key, (), 0, one.n_scenes) if one.n_scenes > 1 else 0
        trained, size = one.trained[drawn], one.size[drawn]
        given = (jax.random.uniform(given_key, (at_once,)) < given_share) & (trained > 0)
        row = jax.random.randint(row_key, (at_once,), 0, jnp.where(given, trained, one.targets[drawn]))
        target = one.target[drawn][row]
        state = jnp.arange(one.n_states, dtype=jnp.int32)
        in_world.append(one.first_state[drawn] + jnp.minimum(state, size - 1))
        targets.append(target)
        local = one.successor[drawn][:, None] * at_once + slot[None, :, None]
        successors.append(pairs.first_pair[number] + local.reshape(-1, 4))
        rewards.append(one.reward[drawn, row].T.reshape(-1))
        arrived.append((state[:, None] == target).reshape(-1))
        sizes.append(size)
    of_worker = jnp.stack(targets)[pairs.worker_class, pairs.worker_first % at_once]
    return PairsOfUpdate(
        in_world=jnp.concatenate(in_world),
        target=jnp.stack(targets),
        successor=jnp.concatenate(successors),
        reward=jnp.concatenate(rewards),
        arrived=jnp.concatenate(arrived),
        worker_target=pairs.worker_first + of_worker * at_once,
        worker_states=jnp.stack(sizes)[pairs.worker_class],
    )


def evaluate_drawn(
    network: SiameseActorCritic, parameters: Parameters, world: World, pairs: DrawnPairs, drawn: PairsOfUpdate
) -> Outputs:
    """Evaluate the network on all pairs of an update; each view is embedded once.

    Args:
        network: the network; it observes one view. Static.
        parameters: θ.
        world: the scenes.
        pairs: the pairs.
        drawn: the scenes and targets of the update.

    Returns:
        Policy and value of each pair.
    """
    classes = pairs.classes
    everything = len(drawn.in_world) == len(world.features)  # one scene in each class: nothing is drawn or padded
    features = world.features if everything else world.features[drawn.in_world]
    first_state = jnp.asarray(pairs.first_pair[:-1], jnp.int32) // pairs.at_once
    rows = (drawn.target + first_state[:, None]).reshape(-1)
    tables = network.apply(parameters, features, rows, every_state=True, method="tables")
    assert isinstance(tables, Tables)
    assert tables.fusion is not None
    of_targets = tables.target.reshape(len(classes), -1)
    outputs, first = [], 0
    for head, group in groupby(range(len(classes)), key=lambda number: classes[number].head):
        members = list(group)
        states = [classes[number].n_states for number in members]
        # A product with zeros and ones repeats the targets of a scene for its states; its gradient is a product, too,
        # while that of a look-up is added row by row.
        own = np.repeat(np.eye(len(members), dtype=np.float32), states, axis=0)
        of_states = tables.fusion[first : first + sum(states)]
        repeated = (own @ of_targets[members[0] : members[-1] + 1]).reshape(len(own), pairs.at_once, -1)
        outputs.append(network.apply(parameters, of_states, repeated, head, method="every_pair"))
        first += sum(states)
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *outputs)
