"""All pairs of a target and a state of its scene, numbered so that those of one head are consecutive."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, Int32

from relm_irl_jax.world import Targets, World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class StateTargetPairs:
    """Every target with every state of its scene, head by head.

    Attributes:
        state: for each head, state in the world of each pair.
        target: for each head, row of `Targets` of each pair.
        first: index of each target's pair with the first state of its scene; the pairs with the other states follow.
    """

    state: tuple[Int32[Array, "_"], ...]
    target: tuple[Int32[Array, "_"], ...]
    first: Int32[Array, "targets"]

    @property
    def count(self) -> int:
        """Number of pairs."""
        return sum(map(len, self.state))

    def index(
        self, world: World, state: Int32[Array, "*batch"], target: Int32[Array, "*batch"]
    ) -> Int32[Array, "*batch"]:
        """Index of pairs in the concatenation of all heads.

        Args:
            world: the scenes.
            state: states, each in the scene of its target.
            target: rows of the targets.

        Returns:
            The indices.
        """
        return self.first[target] + world.local[state]


def state_target_pairs(
    world: World, targets: Targets, scene_head: Int[np.ndarray, "scenes"], n_heads: int
) -> StateTargetPairs:
    """Number all pairs.

    Args:
        world: the scenes.
        targets: the targets.
        scene_head: head of each scene.
        n_heads: number of heads.

    Returns:
        The pairs.
    """
    scene, target_scene = np.asarray(world.scene), np.asarray(targets.scene)
    head = scene_head[target_scene]
    states = [np.flatnonzero(scene == number) for number in target_scene]
    by_head = [np.flatnonzero(head == number) for number in range(n_heads)]
    order = np.concatenate(by_head)
    first = np.zeros(len(target_scene), np.int32)
    first[order] = np.cumsum([0, *(len(states[row]) for row in order)])[:-1]
    empty = np.zeros(0, np.int32)

    def concatenate(parts: list[np.ndarray]) -> Array:
        return jnp.asarray(np.concatenate([empty, *parts]), jnp.int32)

    return StateTargetPairs(
        state=tuple(concatenate([states[row] for row in rows]) for rows in by_head),
        target=tuple(concatenate([np.full(len(states[row]), row) for row in rows]) for rows in by_head),
        first=jnp.asarray(first),
    )
