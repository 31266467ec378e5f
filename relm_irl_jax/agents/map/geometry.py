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

*Extent.* Poses within `radius` cells of the start along each axis are considered. The map is a grid of cells, the start
in its middle, on which all lies that these poses can see. `Extent` says how large both are. Nothing else records it:
what needs it reads it off the arrays that it was made for.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int32

REACH = 11
"""Depth of the view region in cells."""

SPAN = 2 * REACH + 1
"""Width in cells of the square that holds a view region at any heading."""

N_CELLS = (REACH + 1) ** 2
"""Cells of a view region."""

STEP = 8
"""Cells in which the radius of an extent grows, so that scenes of similar width share compiled programs."""


@dataclass(frozen=True)
class Extent:
    """How far the map reaches.

    Attributes:
        radius: greatest distance of a pose from the start along each axis, in cells. The default holds the built-in
            rooms, which are at most 17 places wide.
    """

    radius: int = 16

    @property
    def side(self) -> int:
        """Rows and columns of the square of poses."""
        return 2 * self.radius + 1

    @property
    def grid(self) -> int:
        """Rows and columns of the grid, a multiple of 8; poses see REACH cells beyond their square."""
        return 2 * (self.radius + REACH + 1)

    @property
    def half(self) -> int:
        """Row and column of the start on the grid."""
        return self.grid // 2

    @property
    def inner(self) -> slice:
        """Rows, and columns, of the square of poses on the grid."""
        return slice(self.half - self.radius, self.half + self.radius + 1)

    @staticmethod
    def of_places(places: int) -> "Extent":
        """The smallest extent that holds scenes from every start in them.

        Args:
            places: places along the longest side of the widest scene.

        Returns:
            The extent, not below the default.
        """
        return Extent(max(Extent().radius, -(-(places - 1) // STEP) * STEP))

    @staticmethod
    def of_side(side: int) -> "Extent":
        """The extent of a square of poses.

        Args:
            side: its rows.
        """
        return Extent(side // 2)

    @staticmethod
    def of_grid(grid: int) -> "Extent":
        """The extent of a grid.

        Args:
            grid: its rows.
        """
        return Extent(grid // 2 - REACH - 1)


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
