"""Leave-one-out errors of every prefix of the columns, from an orthonormal basis of them (Equation 34)."""

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

MAX_LEVERAGE = 1 - 1e-9
"""Leverage above which a sample's error is no longer updated, since rounding dominates the quotient."""

TILE = 32
"""Samples whose residuals are updated together through all prefixes: as many as fit in the processor's cache."""


def leave_one_out_sums(
    Q: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    count: Int[Array, ""],
    intercept: Bool[Array, ""],
) -> tuple[Float[Array, "neurons"], Float[Array, ""], Int[Array, "neurons"]]:
    """Squared leave-one-out errors of every prefix.

    Args:
        Q: orthonormal basis in column order, one row for each sample; zero columns for dependent ones.
        T: targets, centred if there is an intercept.
        count: number of samples; zero rows may pad Q and T.
        intercept: whether the model fits one, which adds 1/`count` to every leverage.

    Returns:
        Squared errors summed over samples and outputs, of every prefix and of the model without columns; and for every
        prefix, the number of samples whose leverage is one up to rounding.
    """
    rows = len(Q)
    base = jnp.where(intercept, 1 / count, 0.0).astype(Q.dtype)
    C = Q.T @ T
    changes = jnp.any(Q != 0, axis=0)

    def sum_over_tile(inputs):
        """All prefixes for a few samples."""
        t, q = inputs

        def add_column(state, inputs):
            residual, leverage, loss = state
            q, c, changes = inputs
            leverage = leverage + q**2
            residual = residual - q[:, None] * c
            regular = leverage < MAX_LEVERAGE
            error = jnp.sum(residual**2, axis=1) / jnp.where(regular, 1 - leverage, 1) ** 2
            loss = jnp.where(regular & changes, error, loss)
            return (residual, leverage, loss), (loss.sum(), jnp.sum(~regular))

        null = jnp.sum(t**2, axis=1) / jnp.where(base < 1, 1 - base, 1) ** 2
        _, sums = lax.scan(add_column, (t, jnp.full(len(t), base), null), (q.T, C, changes))
        return null.sum(), sums

    tiles = -(-rows // TILE)
    T, Q = (jnp.pad(matrix, ((0, tiles * TILE - rows), (0, 0))).reshape(tiles, TILE, -1) for matrix in (T, Q))
    null, (losses, irregular) = lax.map(sum_over_tile, (T, Q))
    return losses.sum(axis=0), null.sum(), irregular.sum(axis=0)
