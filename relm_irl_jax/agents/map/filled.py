"""Memory that is filled with what training saw in a scene.

In a scene in which the agent was trained, its walks have seen every view and counted every pose. The map of all these
views, in one frame for the scene, is what an episode's memory then begins with. The agent recognises its first view
among those seen, which says where it stands; the target is located on the map as in unseen scenes, by the network.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int32, UInt8

from relm_irl_jax.agents.map.geometry import Extent
from relm_irl_jax.agents.map.memory import add_view
from relm_irl_jax.agents.map.rooms import count_poses
from relm_irl_jax.world import World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FilledMaps:
    """The map of each scene of a world.

    Attributes:
        grid: sums of what all views of the scene say, by z, x.
        blocked: places on which no walk has stood.
        pose: pose at which each view of the world was seen first: heading, z and x in the frame of its scene's map.
    """

    grid: Float[Array, "scenes grid grid record"]
    blocked: Bool[Array, "scenes z x"]
    pose: Int32[Array, "views 3"]


def fill_maps(
    record: Float[Array, "views cells record"],
    views: UInt8[np.ndarray, "views height width 3"],
    world: World,
    extent: Extent,
) -> FilledMaps:
    """Draw the map of every scene from all its views.

    Args:
        record: what each view of the world says about the cells of its region.
        views: the views.
        world: the scenes; poses are counted along its moves.
        extent: how far the maps reach.

    Returns:
        The maps; their origin is in the middle of the scene. Of equal views, the first counts.
    """
    scene, successor = np.asarray(world.scene), np.asarray(world.successor)
    poses = np.zeros((len(scene), 3), np.int32)
    grids, blocked = [], []
    for number in range(world.n_scenes):
        states = np.flatnonzero(scene == number)
        kept, pose = count_poses(successor[states] - states[0])
        pose[:, 1:] -= (pose[:, 1:].min(0) + pose[:, 1:].max(0)) // 2
        free = np.zeros((extent.side, extent.side), bool)
        free[pose[:, 1] + extent.radius, pose[:, 2] + extent.radius] = True
        blocked.append(~free)
        grids.append(_draw(record[states[kept]], jnp.asarray(pose), extent))
        first: dict[bytes, int] = {}
        place = np.zeros(len(states), int)
        place[kept] = np.arange(len(kept))
        recognised = [first.setdefault(views[state].tobytes(), local) for local, state in enumerate(states.tolist())]
        poses[states] = pose[place[recognised]]
    return FilledMaps(jnp.stack(grids), jnp.asarray(np.stack(blocked)), jnp.asarray(poses))


@partial(jax.jit, static_argnames="extent")
def _draw(
    record: Float[Array, "views cells record"], pose: Int32[Array, "views 3"], extent: Extent
) -> Float[Array, "grid grid record"]:
    """Sum views on a grid, one after the other."""
    empty = jnp.zeros((extent.grid, extent.grid, record.shape[-1]), record.dtype)
    return jax.lax.scan(lambda grid, view: (add_view(grid, *view), None), empty, (record, pose))[0]
