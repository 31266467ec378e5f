"""PRESS with groups left out: the error on samples of a group, such as all pairs of one target, of a model without it.

Samples of one group resemble each other: whoever leaves out one alone is told by its neighbours what it was. For a
group B, with H the hat matrix of a prefix, M = (I - H_BB)⁻¹, and q, c the next orthonormal column's rows in B and
coefficients, the residuals of the model without the group are

    e = M r_B,      and one column on      u = M q,  s = 1 - qᵀu,      e' = e + u (qᵀe - c) / s,  M' = M + u uᵀ / s,

which for groups of one are the leverages and residuals of `basis_errors`. A group that determines a coefficient alone
keeps the error that it had before that column, as a sample does there.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from relm_irl_jax.elm.linear import room
from relm_irl_jax.errors import InputError

GREATEST_INVERSE = 1e9
"""Trace of (I - H_BB)⁻¹ from which a group keeps its last error: beyond it the quotient is rounding over rounding."""

TILE = 256
"""Places for samples whose residuals are followed through all prefixes at once; fewer take more time, and more leave
the processor's cache."""


def members_of(groups: Any, samples: int) -> Int[np.ndarray, "groups most"]:
    """Which samples belong to each group.

    Args:
        groups: one label per sample.
        samples: number of samples.

    Returns:
        Rows of each group's samples, in order; -1 where a group has fewer, and in groups of nobody, which make problems
        of similar shape share one compiled function.

    Raises:
        InputError: there are not as many labels as samples, or all are alike.
    """
    groups = np.asarray(groups)
    if groups.shape != (samples,):
        raise InputError(f"groups has shape {groups.shape}; it needs one label for each of the {samples} samples.")
    names, number, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    if len(names) < 2:
        raise InputError("groups: all samples belong to one group; leaving it out leaves none to fit.")
    order = np.argsort(number, kind="stable")
    place = np.arange(samples) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    members = np.full((room(len(names)), -(-sizes.max() // 4) * 4), -1)
    members[number[order], place] = order
    return members


def group_errors(
    Q: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    members: Int[Array, "groups most"],
    count: Int[Array, ""] | int,
    *,
    intercept: bool,
) -> tuple[Float[Array, "neurons"], Float[Array, ""], Int[Array, "neurons"]]:
    """Errors of every prefix with one group after the other left out.

    Args:
        Q: top block of the orthonormal basis, in column order; zero columns for dependent ones.
        T: targets, centred if there is an intercept.
        members: rows of each group's samples; -1 for nobody.
        count: number of samples, where zero rows pad them.
        intercept: whether the model fits one.

    Returns:
        Squared errors summed over samples and outputs, for every prefix and for no column at all; and the number of
        samples in groups that keep their last error.
    """
    C = Q.T @ T
    Q, T = (jnp.pad(z, ((0, 1), (0, 0))) for z in (Q, T))
    most = members.shape[1]
    together = max(1, TILE // most)
    tiles = -(-len(members) // together)
    members = jnp.pad(members, ((0, tiles * together - len(members)), (0, 0)), constant_values=-1)

    def tile(rows):
        """All prefixes for a few groups."""
        present = (rows >= 0).astype(Q.dtype)
        size = present.sum(1)
        others = jnp.where(intercept & (size > 0), count - size, jnp.inf)
        shift = present / others[:, None]
        M = jnp.eye(most, dtype=Q.dtype) + shift[:, :, None] * present[:, None]
        e = T[rows]
        e = e + shift[:, :, None] * e.sum(1, keepdims=True)

        def column(state, inputs):
            M, e, loss, free = state
            q, c = inputs
            u = jnp.einsum("gij,gj->gi", M, q)
            left = 1 - (q * u).sum(1)
            trace = jnp.trace(M, axis1=1, axis2=2) + (u**2).sum(1) / left
            free = free & (left > 0) & (trace < GREATEST_INVERSE)
            step = jnp.where(free, 1 / left, 0)[:, None] * u
            e = e + step[:, :, None] * (jnp.einsum("gi,gip->gp", q, e) - c)[:, None]
            M = M + step[:, :, None] * u[:, None]
            loss = jnp.where(free, (e**2).sum((1, 2)), loss)
            return (M, e, loss, free), (loss.sum(), jnp.where(free, 0, size).sum().astype(int))

        first = (e**2).sum((1, 2))
        rows_of_columns = jnp.moveaxis(Q[rows], 2, 0)
        _, sums = lax.scan(column, (M, e, first, size > 0), (rows_of_columns, C))
        return first.sum(), sums

    first, (losses, capped) = lax.map(tile, members.reshape(tiles, together, most))
    return losses.sum(0), first.sum(), capped.sum(0)
