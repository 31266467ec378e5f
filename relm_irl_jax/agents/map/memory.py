"""The map that the agent draws in its own frame.

Odometry is exact on the grid: an action that did not collide moves the pose by one step or one right angle. Each view
that is seen for the first time adds what it says about its region, turned by the heading and shifted by the
place, to the grid:

    F(y) = Σ_t c_t f_t,   W(y) = Σ_t c_t,   O(y) = Σ_t c_t o_t        over the views t that cover cell y

and what the memory says about a cell is

    m(y) = F / (1 + W)              mean feature, drawn to 0 where little was seen
    w(y) = W / (1 + W)              coverage, 0 where nothing was seen
    logit p_free(y) = b + ρ(|y|) + κ O / √(1 + W)

with b, κ and the profile ρ over the distance |y| from the start learned. Places stood on are free, and a collision says
that the cell ahead (or behind) is not, whatever the views say.

Sources: Henriques and Vedaldi (2018), allocentric memory; Chaplot et al. (2020), occupancy from views.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int, Int32

from relm_irl_jax.agents.map.geometry import FORWARD, OFFSETS, Extent
from relm_irl_jax.agents.map.network import CHANNELS, FIELDS, RECORD, SCALARS

SURE = 9.0
"""Logit of what the agent knows from standing there or from a collision."""

_TURNED = np.array(
    [
        [
            *range(SCALARS),
            *(SCALARS + 4 * field + (direction - heading) % 4 for field in range(FIELDS) for direction in range(4)),
            *range(CHANNELS, RECORD),
        ]
        for heading in range(4)
    ],
    np.int32,
)
"""Channel of the camera's frame that fills each channel of the map's, at each heading."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Odometry:
    """Where the agent stands in its own frame, and where it has been.

    Attributes:
        pose: heading, z and x; z and x in cells from the start.
        seen: poses whose views are in the memory, by heading, z and x.
        blocked: places that a collision showed to be blocked, by z and x.
    """

    pose: Int32[Array, "*batch 3"]
    seen: Bool[Array, "*batch 4 z x"]
    blocked: Bool[Array, "*batch z x"]


def start_odometry(batch: tuple[int, ...], extent: Extent) -> Odometry:
    """The odometry before the first view.

    Args:
        batch: shape of the batch.
        extent: how far the map reaches.

    Returns:
        It, at the start, with nothing seen.
    """
    return Odometry(
        pose=jnp.zeros((*batch, 3), jnp.int32),
        seen=jnp.zeros((*batch, 4, extent.side, extent.side), bool),
        blocked=jnp.zeros((*batch, extent.side, extent.side), bool),
    )


def move(odometry: Odometry, action: Int32[Array, ""], collided: Bool[Array, ""]) -> Odometry:
    """Count one action.

    Args:
        odometry: where the agent stood, without batch axes.
        action: 0 ahead, 1 turn right, 2 turn left, 3 back; -1 for none.
        collided: whether the action left the pose as it was.

    Returns:
        Where it stands. A place outside the square of poses is clipped to its edge.
    """
    radius = Extent.of_side(odometry.blocked.shape[-1]).radius
    heading, place = odometry.pose[0], odometry.pose[1:]
    sign = jnp.where(action == 0, 1, jnp.where(action == 3, -1, 0))
    step = sign * jnp.asarray(FORWARD[:, ::-1])[heading]
    turn = jnp.where(action == 1, 1, jnp.where(action == 2, -1, 0))
    ahead = jnp.clip(place + step, -radius, radius)
    hit = collided & (sign != 0)
    z, x = ahead[0] + radius, ahead[1] + radius
    pose = jnp.concatenate([((heading + turn) % 4)[None], jnp.where(hit, place, ahead)])
    return Odometry(pose.astype(jnp.int32), odometry.seen, odometry.blocked.at[z, x].max(hit))


def grid_rows(pose: Int[Array, "3"], extent: Extent) -> Int[Array, "cells"]:
    """Number of the grid cell that each cell of a view region falls on.

    Args:
        pose: heading, z and x.
        extent: how far the map reaches.

    Returns:
        Row times the grid's columns plus column, for each cell.
    """
    offsets = jnp.asarray(OFFSETS)[pose[0]]
    return (extent.half + pose[1] + offsets[:, 1]) * extent.grid + extent.half + pose[2] + offsets[:, 0]


def turned(record: Float[Array, "cells record"], heading: Int[Array, ""]) -> Float[Array, "cells record"]:
    """Turn the directions of a view region's features into the map's frame.

    Args:
        record: what a view says.
        heading: the camera's heading in the map.

    Returns:
        The same, as the map holds it.
    """
    return record[:, jnp.asarray(_TURNED)[heading]]


def add_view(
    grid: Float[Array, "z x record"], record: Float[Array, "cells record"], pose: Int[Array, "3"]
) -> Float[Array, "z x record"]:
    """Add what a view says to the grid.

    Args:
        grid: the sums so far.
        record: what the view says about the cells of its region.
        pose: heading, z and x at which it was seen.

    Returns:
        The sums with the view.
    """
    rows = grid_rows(pose, Extent.of_grid(len(grid)))
    flat = grid.reshape(-1, grid.shape[-1]).at[rows].add(turned(record, pose[0]))
    return flat.reshape(grid.shape)


def summarise(
    grid: Float[Array, "*batch z x record"],
) -> tuple[Float32[Array, "*batch z x kernel"], Float32[Array, "*batch z x"]]:
    """What the memory says about each cell of the grid.

    Args:
        grid: the sums F, W and O.

    Returns:
        Mean features, coverage and a bounded occupancy, which targets are looked for in; and the evidence
        O / √(1 + W) that a cell is free.
    """
    grid = grid.astype(jnp.float32)
    weight, free = grid[..., -2:-1], grid[..., -1:]
    evidence = free * jax.lax.rsqrt(1 + weight)
    seen = jnp.concatenate([grid[..., :-2] / (1 + weight), weight / (1 + weight), jnp.tanh(evidence)], -1)
    return seen, evidence[..., 0]


def free_logits(
    evidence: Float32[Array, "*batch grid grid"],
    bias: Float32[Array, "z x"],
    scale: Float32[Array, ""],
    odometry: Odometry,
) -> Float32[Array, "*batch z x"]:
    """Log odds that each place is free.

    Args:
        evidence: what views say, on the grid.
        bias: b + ρ for each place.
        scale: κ.
        odometry: what standing there and collisions say.

    Returns:
        The log odds on the square of poses.
    """
    inner = Extent.of_grid(evidence.shape[-1]).inner
    logits = bias + scale * evidence[..., inner, inner]
    logits = jnp.where(odometry.seen.any(-3), SURE, logits)
    return jnp.where(odometry.blocked, -SURE, logits)
