"""Geometry of the map: the agent's own frame, the region that a view covers, and the grid of the map.

*Frame.* The agent starts at place (0, 0) with heading 0. Heading k faces

    f_0 = (0, 1),  f_1 = (1, 0),  f_2 = (0, −1),  f_3 = (−1, 0)      as (x, z),  and r_k = f_{k+1} lies to its right.

Moves on the grid are exact, so counting actions (odometry) gives the pose (k, z, x) without error.

*View region.* A view of 90 degrees covers the cells with side u and depth v, |u| ≤ v ≤ REACH; at heading k the cell
lies at u·r_k + v·f_k from the agent. There are (REACH + 1)² of them, ordered by depth, then by side.

*Projection.* Image column j of n looks along the tangents [2j/n − 1, 2(j+1)/n − 1]; at depth v the cell u spans the
tangents [(u − ½)/v, (u + ½)/v]. The cell takes what the columns say about depth v, weighted by the share of its width
that each of them covers:

    cell(u, v) = Σ_j L_uv,j column(j, v),    L_uv,j = v · |column j ∩ cell u|

Cells at the edge of the view are half covered and weigh half. At depth 0 all columns weigh the same.

*Map grid.* An array of GRID × GRID cells whose entry (HALF, HALF) is the start. Poses within RADIUS cells of the
start are considered; all that they can see lies on the grid.
"""

import numpy as np
from jaxtyping import Float32, Int32

REACH = 11
"""Depth of the view region in cells."""

SPAN = 2 * REACH + 1
"""Width in cells of the square that holds a view region at any heading."""

N_CELLS = (REACH + 1) ** 2
"""Cells of a view region."""

RADIUS = 16
"""Greatest distance of a pose from the start along each axis, in cells: built-in rooms are at most 17 places wide."""

SIDE = 2 * RADIUS + 1
"""Rows and columns of the square of poses."""

GRID = 56
"""Rows and columns of the grid: at least 2 (RADIUS + REACH) + 1, a multiple of 8."""

HALF = GRID // 2
"""Row and column of the start on the grid."""

INNER = slice(HALF - RADIUS, HALF + RADIUS + 1)
"""The square of poses on the grid."""

FORWARD = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)], np.int32)
"""Step (x, z) of MoveAhead at each heading."""

RIGHT = np.roll(FORWARD, -1, axis=0)
"""Step (x, z) to the right at each heading."""


def _view_cells() -> Int32[np.ndarray, "cells 2"]:
    """Side and depth of each cell of a view region."""
    return np.array([(u, v) for v in range(REACH + 1) for u in range(-v, v + 1)], np.int32)


VIEW_CELLS = _view_cells()
"""Side u and depth v of each cell of a view region."""

OFFSETS: Int32[np.ndarray, "4 cells 2"] = (
    VIEW_CELLS[None, :, :1] * RIGHT[:, None] + VIEW_CELLS[None, :, 1:] * FORWARD[:, None]
).astype(np.int32)
"""Place (x, z) of each cell of a view region relative to the agent, at each heading."""


def projection_weights(depth: int, columns: int) -> Float32[np.ndarray, "side columns"]:
    """Weights that carry image columns to the cells of one depth.

    Args:
        depth: v in cells, 0 to `REACH`.
        columns: number of image columns n.

    Returns:
        L_uv for u = −v … v.
    """
    if depth == 0:
        return np.full((1, columns), 1 / columns, np.float32)
    edges = 2 * np.arange(columns + 1) / columns - 1
    side = np.arange(-depth, depth + 1)[:, None]
    upper = np.minimum(edges[1:], (side + 0.5) / depth)
    lower = np.maximum(edges[:-1], (side - 0.5) / depth)
    return (depth * np.maximum(upper - lower, 0)).astype(np.float32)
