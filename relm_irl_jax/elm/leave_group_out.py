"""Leave-one-group-out errors of every prefix: all samples of a group, such as the pairs of one target, are left out.

Samples of one group resemble each other. If a single sample is left out, the others of its group still determine the
prediction, and the error says nothing about new groups.

For a group B, let Ĥ be the hat matrix of a prefix, M = (I - Ĥ_BB)⁻¹ and r_B the residuals of the fit to all samples.
The residuals of the fit without the group are

    e = M r_B.

Let q be the rows in B of the next column of an orthonormal basis, and c that column's product with the targets. The
prefix with this column has

    u = M q,    s = 1 - qᵀu,    e ← e + u (qᵀe - c) / s,    M ← M + u uᵀ / s.

Groups of one sample have the leverages and residuals of Equation 34. If a group alone determines a coefficient, its
error is that of the prefix before that column, as for a sample of leverage one.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from relm_irl_jax.errors import InputError

MAX_INVERSE_TRACE = 1e9
"""Trace of (I - Ĥ_BB)⁻¹ above which a group's error is no longer updated, since rounding dominates the quotient."""

TILE = 256
"""Samples whose residuals are updated together through all prefixes: as many as fit in the processor's cache."""


def rows_by_group(groups: Any, samples: int) -> Int[np.ndarray, "groups largest"]:
    """Row numbers of each group's samples.

    Args:
        groups: one label for each sample.
        samples: number of samples.

    Returns:
        One row for each group, in the order of the sorted labels, padded with -1. Rows of only -1 are appended, so that
        problems of similar shape share one compiled function.

    Raises:
        InputError: there are not as many labels as samples, or all are equal.
    """
    groups = np.asarray(groups)
    if groups.shape != (samples,):
        raise InputError(f"groups has shape {groups.shape}; it needs one label for each of the {samples} samples.")
    labels, number, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    if len(labels) < 2:
        raise InputError("groups: all samples belong to one group; give at least two groups.")
    order = np.argsort(number, kind="stable")
    position = np.arange(samples) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    rows = np.full((-(-len(labels) // 16) * 16, -(-sizes.max() // 4) * 4), -1)
    rows[number[order], position] = order
    return rows


def leave_group_out_sums(
    Q: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    group_rows: Int[Array, "groups largest"],
    count: Int[Array, ""],
    intercept: Bool[Array, ""],
) -> tuple[Float[Array, "neurons"], Float[Array, ""], Int[Array, "neurons"]]:
    """Squared leave-one-group-out errors of every prefix.

    Args:
        Q: orthonormal basis in column order, one row for each sample; zero columns for dependent ones.
        T: targets, centred if there is an intercept.
        group_rows: result of `rows_by_group`.
        count: number of samples; zero rows may pad Q and T.
        intercept: whether the model fits one.

    Returns:
        Squared errors summed over samples and outputs, of every prefix and of the model without columns; and for every
        prefix, the number of samples in groups whose error is that of a smaller prefix.
    """
    C = Q.T @ T
    Q, T = (jnp.pad(matrix, ((0, 1), (0, 0))) for matrix in (Q, T))  # row -1 is zero
    largest = group_rows.shape[1]
    per_tile = max(1, TILE // largest)
    tiles = -(-len(group_rows) // per_tile)
    group_rows = jnp.pad(group_rows, ((0, tiles * per_tile - len(group_rows)), (0, 0)), constant_values=-1)

    def sum_over_tile(rows):
        """All prefixes for a few groups."""
        present = (rows >= 0).astype(Q.dtype)
        size = present.sum(1)
        others = jnp.where(intercept & (size > 0), count - size, jnp.inf)
        shift = present / others[:, None]
        M = jnp.eye(largest, dtype=Q.dtype) + shift[:, :, None] * present[:, None]
        e = T[rows]
        e = e + shift[:, :, None] * e.sum(1, keepdims=True)

        def add_column(state, inputs):
            M, e, loss, regular = state
            q, c = inputs
            u = jnp.einsum("gij,gj->gi", M, q)
            s = 1 - (q * u).sum(1)
            trace = jnp.trace(M, axis1=1, axis2=2) + (u**2).sum(1) / s
            regular = regular & (s > 0) & (trace < MAX_INVERSE_TRACE)
            step = jnp.where(regular, 1 / s, 0)[:, None] * u
            e = e + step[:, :, None] * (jnp.einsum("gi,gip->gp", q, e) - c)[:, None]
            M = M + step[:, :, None] * u[:, None]
            loss = jnp.where(regular, (e**2).sum((1, 2)), loss)
            return (M, e, loss, regular), (loss.sum(), jnp.where(regular, 0, size).sum().astype(int))

        null = (e**2).sum((1, 2))
        columns = jnp.moveaxis(Q[rows], 2, 0)
        _, sums = lax.scan(add_column, (M, e, null, size > 0), (columns, C))
        return null.sum(), sums

    null, (losses, irregular) = lax.map(sum_over_tile, group_rows.reshape(tiles, per_tile, largest))
    return losses.sum(0), null.sum(), irregular.sum(0)
