"""PRESS of the model with all columns for several ridge penalties, from one singular value decomposition.

With centred H = U S Vᵀ, the hat matrix of penalty λ is

    Ĥ = U diag(s² / (s² + λ)) Uᵀ + 1/N,

and the residuals of a left-out group B are (I - Ĥ_BB)⁻¹ r_B, with r the residuals of the fit to all samples. If no
prefix is to be selected, this replaces one factorisation for each penalty.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Float64, Int

from relm_irl_jax.elm.leave_group_out import rows_by_group
from relm_irl_jax.elm.matrices import centre_columns, check_regression, float64
from relm_irl_jax.elm.orthogonalisation import rank_tolerance


def press_of_penalties(
    H: Any, T: Any, penalties: Sequence[float], groups: Any = None
) -> Float64[np.ndarray, "penalties"]:
    """Mean squared leave-one-out error, over samples and outputs, of the model with all columns and an intercept.

    Args:
        H: regressors, one row per sample.
        T: targets, one row per sample.
        penalties: λ on the squared coefficients, never on the intercept.
        groups: one label for each sample; all samples of a label are left out together. None leaves out one at a time.

    Returns:
        One error for each penalty; infinite if the remaining samples do not determine the model.

    Raises:
        InputError: unusable H, T or groups.
    """
    H, T = check_regression(H, T)
    group_rows = rows_by_group(np.arange(len(H)) if groups is None else groups, len(H))
    with float64():
        sums, rank = _sums_and_rank(centre_columns(H), centre_columns(T), group_rows, np.asarray(penalties, float))
    # Without penalty, the model fits exactly if it has at least as many columns as remaining samples.
    remaining = len(H) - 1 - (group_rows >= 0).sum(axis=1).max()
    exact = (np.asarray(penalties) == 0) & (int(rank) > remaining)
    return np.where(exact, np.inf, np.asarray(sums) / T.size)


@jax.jit
def _sums_and_rank(
    H: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    group_rows: Int[Array, "groups largest"],
    penalties: Float[Array, "penalties"],
) -> tuple[Float[Array, "penalties"], Int[Array, ""]]:
    """Squared errors of each penalty, summed over samples and outputs, and the rank of H; both matrices are centred."""
    U, S, _ = jnp.linalg.svd(H, full_matrices=False)
    UT = U.T @ T
    U_B, T_B = (jnp.pad(matrix, ((0, 1), (0, 0)))[group_rows] for matrix in (U, T))  # row -1 is zero
    present = group_rows >= 0
    pairs = (present[:, :, None] & present[:, None]).astype(H.dtype)
    nonzero = rank_tolerance(*H.shape) * S.max() < S

    def sum_of_squares(penalty):
        shrinkage = jnp.where(nonzero, S**2 / jnp.where(nonzero, S**2 + penalty, 1), 0)
        hat = jnp.einsum("gik,k,gjk->gij", U_B, shrinkage, U_B) + pairs / len(H)
        residual = T_B - U_B @ (shrinkage[:, None] * UT)
        return (jnp.linalg.solve(jnp.eye(hat.shape[1]) - hat, residual) ** 2).sum()

    return lax.map(sum_of_squares, penalties), nonzero.sum()
