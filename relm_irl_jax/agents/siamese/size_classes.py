"""Scenes in classes of similar size, of which an update draws one scene each.

The cost of an update grows with the states of its scenes. A training in many scenes therefore draws a few of them for
each update. Compiled programs have fixed shapes, so that a scene is padded to the largest of its class; with classes of
similar size, little is padded. With no more scenes than are drawn, every class is one scene and nothing is padded.

In 60 rooms, 24 scenes with one target each find no more than six with four, the default, and take several times as
long.
"""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, Int, Int32

from relm_irl_jax.agents.padding import divide_by_size, pad_and_stack
from relm_irl_jax.rewards.imagined import ImaginedTargets
from relm_irl_jax.world import World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SizeClass:
    """Scenes of similar size, and their targets. States are local to their scene; padding is 0.

    Attributes:
        first_state: first state in the world of each scene.
        size: number of states of each scene.
        successor: state after each action.
        target: targets; the given training targets come first.
        trained: number of given training targets of each scene.
        targets: number of all targets of each scene.
        reward: reward for arriving in each state, for each target.
        head: head of the network that the scenes share. Static.
    """

    first_state: Int32[Array, "scenes"]
    size: Int32[Array, "scenes"]
    successor: Int32[Array, "scenes states 4"]
    target: Int32[Array, "scenes targets"]
    trained: Int32[Array, "scenes"]
    targets: Int32[Array, "scenes"]
    reward: Float32[Array, "scenes targets states"]
    head: int = field(metadata={"static": True})

    @property
    def n_scenes(self) -> int:
        """Number of scenes."""
        return self.size.shape[0]

    @property
    def n_states(self) -> int:
        """Number of states of the largest scene."""
        return self.successor.shape[1]


def size_classes(
    world: World, targets: ImaginedTargets, scene_head: Int[np.ndarray, "scenes"], at_once: int
) -> tuple[SizeClass, ...]:
    """Collect the scenes of every class and their targets.

    Args:
        world: the scenes.
        targets: targets of each scene.
        scene_head: head of each scene.
        at_once: number of classes; see `divide_by_size`.

    Returns:
        The classes.
    """
    sizes = np.bincount(np.asarray(world.scene), minlength=world.n_scenes)
    first_state = np.cumsum([0, *sizes])[:-1]
    successor = [
        np.asarray(world.successor)[first : first + n] - first for first, n in zip(first_state, sizes, strict=True)
    ]

    def of_class(scenes: Int[np.ndarray, "_"]) -> SizeClass:
        return SizeClass(
            first_state=jnp.asarray(first_state[scenes], jnp.int32),
            size=jnp.asarray(sizes[scenes], jnp.int32),
            successor=pad_and_stack([successor[number] for number in scenes]),
            target=pad_and_stack([targets.state[number] for number in scenes]),
            trained=jnp.stack([targets.trained[number] for number in scenes]),
            targets=jnp.asarray([len(targets.state[number]) for number in scenes], jnp.int32),
            reward=pad_and_stack([targets.reward[number] for number in scenes]),
            head=int(scene_head[scenes[0]]),
        )

    return tuple(of_class(scenes) for scenes in divide_by_size(sizes, scene_head, at_once))
