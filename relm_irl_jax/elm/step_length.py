"""Step length of MRSR: the smallest step at which an inactive column ties with the active set (Equations 31 and 32).

With a_j = x_jᵀ(T - Y), c its norm on the active set, and e_j = x_jᵀ(T - Ȳ), column j ties at the step length γ where

    ‖a_j - γ b_j‖ = (1 - γ) c,        b_j = a_j - e_j,

which, with s = γ / (1 - γ) ≥ 0, is

    ‖a_j + s e_j‖ = c.

The left side is convex in s, starts at ‖a_j‖ ≤ c and grows without bound unless e_j = 0: each column ties at exactly
one s. The smallest s over the inactive columns is the step.

For the 1-norm, Newton's method from the right finds s in a few iterations, without enumerating sign vectors. Since
(c - ‖a_j‖) / ‖e_j‖ is a lower bound of s, columns are solved in the order of increasing bounds, until the smallest s is
below all remaining bounds. For the 2-norm, s is a root of a quadratic.
"""

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

COLUMNS_AT_ONCE = 16
"""Columns whose s is computed in one pass."""

NEWTON_STEPS = 100
"""Safety limit; Newton's method on a convex piecewise linear function terminates, usually after three to six steps."""


def first_tie(
    A: Float[Array, "columns outputs"],
    E: Float[Array, "columns outputs"],
    c: Float[Array, ""],
    inactive: Bool[Array, "columns"],
    norm: int,
) -> tuple[Float[Array, ""], Int[Array, ""]]:
    """First inactive column to tie with the active set.

    Args:
        A: correlations a_j with the residual.
        E: correlations e_j with the residual of the least-squares fit.
        c: cumulative correlation of the active set.
        inactive: columns that may enter.
        norm: 1 or 2.

    Returns:
        s = γ / (1 - γ), infinite if no column ties, and the column.
    """
    return _first_tie_1(A, E, c, inactive) if norm == 1 else _first_tie_2(A, E, c, inactive)


def _first_tie_1(A, E, c, inactive):
    size, slope = jnp.abs(A).sum(axis=1), jnp.abs(E).sum(axis=1)
    grows = slope > 0
    bound = jnp.where(inactive & grows, jnp.maximum(c - size, 0) / jnp.where(grows, slope, 1), jnp.inf)
    blocks = min(COLUMNS_AT_ONCE, len(bound))
    per_block = -(-len(bound) // blocks)
    bound = jnp.pad(bound, (0, blocks * per_block - len(bound)), constant_values=jnp.inf)

    def examine(state):
        """Solve for the column with the smallest bound in each block."""
        bound, best, winner = state
        positions = jnp.arange(blocks) * per_block + jnp.argmin(bound.reshape(blocks, per_block), axis=1)
        competitive = bound[positions] < best
        column = jnp.minimum(positions, len(A) - 1)
        a, e = A[column], E[column]

        def newton(state):
            s, _, step = state
            at = a + s[:, None] * e
            derivative = jnp.sum(jnp.sign(at) * e, axis=1)
            value = jnp.abs(at).sum(axis=1)
            new = jnp.clip(s - (value - c) / jnp.where(derivative > 0, derivative, jnp.inf), 0, s)
            return new, jnp.any(new < s * (1 - 1e-15)), step + 1

        start = jnp.where(competitive, (c + size[column]) / jnp.where(competitive, slope[column], 1), 0)
        s, _, _ = lax.while_loop(lambda state: state[1] & (state[2] < NEWTON_STEPS), newton, (start, True, 0))
        s = jnp.where(competitive, s, jnp.inf)
        first = jnp.argmin(s)
        better = s[first] < best
        return (
            bound.at[positions].set(jnp.inf),
            jnp.where(better, s[first], best),
            jnp.where(better, column[first].astype(winner.dtype), winner),
        )

    start = (bound, jnp.asarray(jnp.inf, A.dtype), jnp.zeros((), jnp.int32))
    _, best, winner = lax.while_loop(lambda state: jnp.min(state[0]) < state[1], examine, start)
    return best, winner


def _first_tie_2(A, E, c, inactive):
    """The root s ≥ 0 of ‖e‖²s² + 2(a·e)s + ‖a‖² - c², in the form without cancellation."""
    ee, ae, aa = jnp.sum(E * E, axis=1), jnp.sum(A * E, axis=1), jnp.sum(A * A, axis=1)
    gap = jnp.maximum(c**2 - aa, 0)
    root = jnp.sqrt(ae**2 + ee * gap)
    positive = jnp.where(ae > 0, gap / jnp.where(ae > 0, ae + root, 1), (root - ae) / jnp.where(ee > 0, ee, 1))
    s = jnp.where(inactive & (ee > 0), positive, jnp.inf)
    winner = jnp.argmin(s).astype(jnp.int32)
    return s[winner], winner
