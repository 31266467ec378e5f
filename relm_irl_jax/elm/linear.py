"""What MRSR, PRESS and the regressor share: checked input, centring, and an orthonormal basis of every prefix.

All functions on `jax.Array` are pure and can be jitted and vmapped; they compute in the precision of their input.
`float64` is the context in which the public functions of this package call them.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Float64

from relm_irl_jax.errors import InputError

PANEL = 32
"""Columns that are orthogonalised one after another before the rest is updated by a matrix product."""


def float64() -> Any:
    """Context in which JAX computes in float64; the caller's global configuration stays as it is."""
    return jax.enable_x64(True)


def finite_matrix(value: Any, name: str) -> Float64[np.ndarray, "rows columns"]:
    """Check that `value` is a finite matrix; a vector counts as one column.

    Args:
        value: array-like of real numbers.
        name: how the message names it.

    Returns:
        The matrix in float64, on the host.

    Raises:
        InputError: it is empty, not a matrix, or holds NaN or infinity.
    """
    matrix = np.asarray(value, np.float64)
    if matrix.ndim == 1:
        matrix = matrix[:, None]
    if matrix.ndim != 2:
        raise InputError(f"{name} must be a matrix with one row per sample; it has {matrix.ndim} dimensions.")
    if matrix.size == 0:
        raise InputError(f"{name} is empty: its shape is {matrix.shape}.")
    if not np.isfinite(matrix).all():
        what = "NaN" if np.isnan(matrix).any() else "infinity"
        raise InputError(f"{name} contains {what}; every entry must be finite.")
    return matrix


def finite_pair(
    H: Any, T: Any
) -> tuple[Float64[np.ndarray, "samples neurons"], Float64[np.ndarray, "samples outputs"]]:
    """Check regressors and targets that share their rows.

    Args:
        H: regressors, one row per sample.
        T: targets, one row per sample; a vector counts as one output.

    Returns:
        Both in float64, on the host.

    Raises:
        InputError: either is unusable, or their numbers of rows differ.
    """
    H, T = finite_matrix(H, "H"), finite_matrix(T, "T")
    if len(H) != len(T):
        raise InputError(f"H has {len(H)} rows but T has {len(T)}; both need one row per sample.")
    return H, T


def centred(matrix: Any) -> Any:
    """Subtract each column's mean; columns that are constant up to rounding become exactly zero.

    Args:
        matrix: one row per sample, of NumPy or JAX.

    Returns:
        The same kind of array.
    """
    xp = matrix.__array_namespace__()
    rest = matrix - matrix.mean(axis=0)
    rounding = 4 * xp.finfo(matrix.dtype).eps * xp.abs(matrix).max(axis=0)
    return xp.where(xp.abs(rest).max(axis=0) <= rounding, 0, rest)


def standardised(matrix: Any) -> Any:
    """Centre each column and divide it by its norm; constant columns become zero. As `centred` otherwise."""
    xp = matrix.__array_namespace__()
    rest = centred(matrix)
    largest = xp.abs(rest).max(axis=0)
    rest = rest / xp.where(largest > 0, largest, 1)
    norm = xp.linalg.norm(rest, axis=0)
    return rest / xp.where(norm > 0, norm, 1)


def room(size: int) -> int:
    """Size to pad to, so that problems of similar shape share one compiled function."""
    if size <= 1:
        return size
    for small in (16, 64, 128, 256):
        if size <= small:
            return small
    return -(-size // 16) * 16


def padded(matrix: Float64[np.ndarray, "rows columns"]) -> Float64[np.ndarray, "more_rows more_columns"]:
    """Add zero rows and columns up to `room`."""
    rows, columns = matrix.shape
    return np.pad(matrix, ((0, room(rows) - rows), (0, room(columns) - columns)))


def rank_tolerance(rows: int, columns: int) -> float:
    """Share of a column's norm below which what is left of it counts as rounding."""
    return 10 * max(rows, columns) * float(np.finfo(np.float64).eps)


def orthonormal_prefixes(
    matrix: Float[Array, "rows columns"], tolerance: Float[Array, ""] | float
) -> tuple[Float[Array, "rows columns"], Bool[Array, "columns"]]:
    """Orthonormal basis whose first k columns span the first k columns of the matrix, for every k.

    Block Gram-Schmidt, every projection done twice. A column that depends on those before it gives a zero column,
    which leaves each prefix's span right; Householder's QR would put an arbitrary direction there.

    Args:
        matrix: any shape and rank.
        tolerance: share of a column's norm below which its remainder counts as zero.

    Returns:
        The basis, and which columns are independent of those before them.
    """
    columns = matrix.shape[1]
    width = min(PANEL, columns)
    panels = -(-columns // width)
    columns_as_rows = jnp.pad(matrix, ((0, 0), (0, panels * width - columns))).T  # one contiguous row per column
    floor = tolerance * jnp.linalg.norm(columns_as_rows, axis=1)

    def orthogonalise(row, basis):
        for _ in range(2):
            row = row - (basis @ row) @ basis
        return row

    def panel(number, basis):
        start = number * width
        block = orthogonalise_rows(lax.dynamic_slice_in_dim(columns_as_rows, start, width), basis)

        def column(i, done):
            rest = orthogonalise(block[i], done)
            norm = jnp.linalg.norm(rest)
            independent = norm > jnp.maximum(floor[start + i], jnp.finfo(matrix.dtype).tiny)
            return done.at[i].set(jnp.where(independent, rest / jnp.where(independent, norm, 1), 0))

        done = lax.fori_loop(0, width, column, jnp.zeros_like(block))
        return lax.dynamic_update_slice_in_dim(basis, done, start, 0)

    def orthogonalise_rows(block, basis):
        for _ in range(2):
            block = block - (block @ basis.T) @ basis
        return block

    basis = lax.fori_loop(0, panels, panel, jnp.zeros_like(columns_as_rows))[:columns]
    return basis.T, jnp.any(basis != 0, axis=1)
