"""Policy and value of every pair of a state and a target, computed once per update.

An update of many workers meets most pairs of a training target and a state of its scene, and many of them more than
once. Where there are no more pairs than frames, all of them are computed in advance, in a few large products; acting is
then a look-up of four logits, and the gradient of a loss in logits and values comes back to the pairs before it goes
through the network. What an update costs does not depend on its number of frames.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.siamese.frames import forward, tabulate
from relm_irl_jax.agent.siamese.network import SiameseActorCritic
from relm_irl_jax.world import Targets, World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Pairs:
    """Every target with every state of its scene. Those of one head stand together, head by head.

    Attributes:
        state: state in the world of each pair, by head.
        target: row of `Targets` of each pair, by head.
        first: number of each target's pair with the first state of its scene; those with the others follow.
    """

    state: tuple[Int32[Array, "pairs"], ...]
    target: tuple[Int32[Array, "pairs"], ...]
    first: Int32[Array, "targets"]

    @property
    def count(self) -> int:
        """Number of pairs."""
        return sum(map(len, self.state))

    def number(
        self, world: World, state: Int32[Array, "*batch"], target: Int32[Array, "*batch"]
    ) -> Int32[Array, "*batch"]:
        """Number of pairs.

        Args:
            world: the scenes.
            state: states, each in the scene of its target.
            target: rows of the targets.

        Returns:
            Their places in `Outputs`.
        """
        return self.first[target] + world.local[state]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Outputs:
    """What the network says.

    Attributes:
        logits: action logits.
        value: values.
    """

    logits: Float32[Array, "*batch 4"]
    value: Float32[Array, "*batch"]


def pairs_of(world: World, targets: Targets, n_heads: int) -> Pairs:
    """Number all pairs.

    Args:
        world: the scenes.
        targets: the targets.
        n_heads: number of heads.

    Returns:
        The pairs.
    """
    scene, at = np.asarray(world.scene), np.asarray(targets.state)
    head = np.asarray(world.head)[at]
    own = [np.flatnonzero(scene == scene[state]) for state in at]
    by_head = [np.flatnonzero(head == number) for number in range(n_heads)]
    order = np.concatenate(by_head)
    first = np.zeros(len(at), np.int32)
    first[order] = np.cumsum([0, *(len(own[row]) for row in order)])[:-1]
    nothing = np.zeros(0, np.int32)
    return Pairs(
        state=tuple(jnp.asarray(np.concatenate([nothing, *(own[row] for row in rows)]), jnp.int32) for rows in by_head),
        target=tuple(
            jnp.asarray(np.concatenate([nothing, *(np.full(len(own[row]), row) for row in rows)]), jnp.int32)
            for rows in by_head
        ),
        first=jnp.asarray(first),
    )


def outputs_of(
    network: SiameseActorCritic, parameters: Parameters, world: World, targets: Targets, pairs: Pairs
) -> Outputs:
    """Apply the network to every pair.

    Args:
        network: the network; it sees one view. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        pairs: the pairs.

    Returns:
        Policy and value of each, in the order of `Pairs.number`.
    """
    tables = tabulate(network, parameters, world.features, targets.state, None, targets.predicted)
    found = [
        forward(network, parameters, tables, state[None, :, None], target[None], jnp.asarray([head]))
        for head, (state, target) in enumerate(zip(pairs.state, pairs.target, strict=True))
    ]
    return Outputs(
        logits=jnp.concatenate([activations.logits[0] for activations in found]),
        value=jnp.concatenate([activations.value[0] for activations in found]),
    )
