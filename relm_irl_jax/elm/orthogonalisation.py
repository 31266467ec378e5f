"""An orthonormal basis whose prefixes span the prefixes of a matrix's columns, by block Gram-Schmidt."""

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

PANEL = 32
"""Columns that are orthogonalised one by one before the others are updated by a matrix product."""


def rank_tolerance(rows: int, columns: int) -> float:
    """Share of a column's norm below which its remainder counts as rounding error.

    After two projections the remainder is known to about this share, so that a larger one is a difference between the
    stored numbers. Among columns of a condition of 10⁴ and more, a combination computed beforehand may have such a
    difference by its own rounding, and counts as independent. The rule of `numpy.linalg.matrix_rank`, a share of the
    largest singular value, would call it dependent, but small independent columns, too.

    Args:
        rows: number of rows of the matrix.
        columns: number of its columns.

    Returns:
        10 max(rows, columns) ε, with ε the float64 machine epsilon.
    """
    return 10 * max(rows, columns) * float(np.finfo(np.float64).eps)


def orthonormal_prefix_basis(
    matrix: Float[Array, "rows columns"], tolerance: Float[Array, ""] | float
) -> tuple[Float[Array, "rows columns"], Bool[Array, "columns"]]:
    """Orthonormal basis Q whose first k columns span the first k columns of the matrix, for every k.

    Every projection is done twice, which makes Q orthonormal up to rounding. A column that depends on those before it
    gives a zero column, so that every prefix has the right span; Householder's QR would insert an arbitrary direction.

    Args:
        matrix: any shape and rank.
        tolerance: share of a column's norm below which its remainder counts as zero.

    Returns:
        Q, and which columns are independent of those before them.
    """
    columns = matrix.shape[1]
    width = min(PANEL, columns)
    panels = -(-columns // width)
    as_rows = jnp.pad(matrix, ((0, 0), (0, panels * width - columns))).T  # one contiguous row per column
    smallest = tolerance * jnp.linalg.norm(as_rows, axis=1)

    def project_out(vector, basis):
        """Subtract a vector's projection on the span of the basis."""
        for _ in range(2):
            vector = vector - (basis @ vector) @ basis
        return vector

    def project_out_block(block, basis):
        """Subtract the projections of a block of vectors, by matrix products."""
        for _ in range(2):
            block = block - (block @ basis.T) @ basis
        return block

    def orthogonalise_panel(number, basis):
        start = number * width
        block = project_out_block(lax.dynamic_slice_in_dim(as_rows, start, width), basis)

        def orthogonalise_column(i, panel):
            remainder = project_out(block[i], panel)
            norm = jnp.linalg.norm(remainder)
            independent = norm > jnp.maximum(smallest[start + i], jnp.finfo(matrix.dtype).tiny)
            return panel.at[i].set(jnp.where(independent, remainder / jnp.where(independent, norm, 1), 0))

        panel = lax.fori_loop(0, width, orthogonalise_column, jnp.zeros_like(block))
        return lax.dynamic_update_slice_in_dim(basis, panel, start, 0)

    basis = lax.fori_loop(0, panels, orthogonalise_panel, jnp.zeros_like(as_rows))[:columns]
    return basis.T, jnp.any(basis != 0, axis=1)
