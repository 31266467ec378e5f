"""Scenes and targets as device arrays: the tables that the environment and the agents index.

The states of all scenes are numbered consecutively, scene by scene, so that one integer identifies a state of any
scene and workers in different scenes step in one program.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tables import scene_offsets as scene_offsets
from relm_irl_jax.tables import successor_table, target_tables
from relm_irl_jax.tasks import Target


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class World:
    """Several scenes, with all their states numbered consecutively.

    Attributes:
        successor: next state for each action; a collision leads back to the state.
        scene: number of each state's scene.
        local: number of each state within its scene.
        features: encoded view of each state.
        room_type: number of each scene's room type among those of the training scenes; -1 for other room types.
        training_scene: number of each scene among the training scenes; -1 for other scenes.
        names: names of the scenes, for messages. Static.
    """

    successor: Int32[Array, "states 4"]
    scene: Int32[Array, "states"]
    local: Int32[Array, "states"]
    features: Float32[Array, "states feature"]
    room_type: Int32[Array, "scenes"]
    training_scene: Int32[Array, "scenes"]
    names: tuple[str, ...] = field(metadata={"static": True})

    @property
    def n_scenes(self) -> int:
        """Number of scenes."""
        return len(self.names)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Targets:
    """Targets of episodes, in the order of their scenes.

    Attributes:
        state: the target's state in the world.
        scene: number of the target's scene.
        start: states that can reach the target, without the target itself; rows are padded at the end.
        n_starts: number of valid entries in each row of `start`.
        distance: smallest number of actions to the target from each local state of its scene; -1 if there is no path,
            and in the padding.
        predicted_reward: predicted reward r̂(s, g) of each state of the world for this target, in [-1, 0]; 0 in other
            scenes. None unless the agent observes it.
    """

    state: Int32[Array, "targets"]
    scene: Int32[Array, "targets"]
    start: Int32[Array, "targets starts"]
    n_starts: Int32[Array, "targets"]
    distance: Int32[Array, "targets locals"]
    predicted_reward: Float32[Array, "targets states"] | None = None


def build_world(scenes: Sequence[Scene], training: Sequence[Scene] | None = None) -> World:
    """Concatenate scenes.

    Args:
        scenes: encoded scenes.
        training: the training scenes, which define the numbers of room types; by default `scenes`.

    Returns:
        The world; state `local` of scene `i` has number `scene_offsets(scenes)[i] + local`.

    Raises:
        InputError: a scene has no features.
    """
    sizes = [scene.n_states for scene in scenes]
    known = scenes if training is None else training
    room_types = list(dict.fromkeys(scene.room_type for scene in known))
    names = [scene.name for scene in known]
    return World(
        successor=jnp.asarray(successor_table(scenes)),
        scene=jnp.asarray(np.repeat(np.arange(len(scenes)), sizes), jnp.int32),
        local=jnp.asarray(np.concatenate([np.arange(size) for size in sizes]), jnp.int32),
        features=jnp.asarray(np.concatenate([scene.encoded for scene in scenes]), jnp.float32),
        room_type=jnp.asarray([_number(room_types, scene.room_type) for scene in scenes], jnp.int32),
        training_scene=jnp.asarray([_number(names, scene.name) for scene in scenes], jnp.int32),
        names=tuple(scene.name for scene in scenes),
    )


def _number(names: Sequence[str], name: str) -> int:
    """Position of a name in a list; -1 if it is not in the list."""
    return names.index(name) if name in names else -1


def build_targets(scenes: Sequence[Scene], targets: Sequence[Target]) -> Targets:
    """Tabulate starts and distances of targets.

    Args:
        scenes: the scenes of the world, in its order.
        targets: the targets in the order of their scenes; `Target.scene` is an index into `scenes`.

    Returns:
        The tables, one row for each target.

    Raises:
        InputError: no other state of its scene can reach a target.
        ValueError: the targets are not in the order of their scenes.
    """
    tables = target_tables(scenes, targets)
    return Targets(
        state=jnp.asarray(tables.state),
        scene=jnp.asarray(tables.scene),
        start=jnp.asarray(tables.start),
        n_starts=jnp.asarray(tables.n_starts),
        distance=jnp.asarray(tables.distance),
    )
