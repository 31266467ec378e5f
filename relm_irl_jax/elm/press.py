"""PRESS: the leave-one-out error of every prefix of the columns of H, from one factorisation (Equation 34).

For the least-squares fit of T on the first k columns of H with ridge λ, the residual of sample i without it is

    ε_i = (t_i - h_i β) / (1 - ℓ_i),        ℓ_i = h_i P h_iᵀ,        P = (HᵀH + λI)⁻¹,

where h_i is the i-th row of H and ℓ_i its leverage. (The paper calls h_i and b_i input weights; they are the row of H
and β.) Let Q be an orthonormal basis of [H; √λ I] in column order, and q_i the rows of Q that belong to samples. Then

    ℓ_i = Σ_{j≤k} q_ij²,        t_i - h_i β = t_i - Σ_{j≤k} q_ij (Q_jᵀT):

leverages are cumulative sums, and each column subtracts one rank-one term from the residuals. For an unpenalised
intercept, H and T are centred and 1/N is added to each leverage; the errors are exact for the model with intercept.

Special cases:

- A column that depends on those before it changes nothing: its prefix has the error of the prefix before it.
- A sample of leverage one alone determines a coefficient. Without the sample, the column of that coefficient depends on
  the others and would be skipped, so the sample's error is that of the prefix before this column.
- A prefix whose rank is the number of samples (minus one for an intercept) fits all samples: its error is infinite.

Samples that resemble each other can be left out together; see `leave_group_out`.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float64, Int

from relm_irl_jax.elm.leave_group_out import leave_group_out_sums, rows_by_group
from relm_irl_jax.elm.leave_one_out import leave_one_out_sums
from relm_irl_jax.elm.matrices import centre_columns, check_regression, float64, pad_columns, pad_outputs
from relm_irl_jax.elm.orthogonalisation import orthonormal_prefix_basis, rank_tolerance
from relm_irl_jax.errors import InputError


@dataclass(frozen=True)
class PressPath:
    """Leave-one-out errors of all prefixes.

    Attributes:
        curve: mean squared leave-one-out error, over samples and outputs, of the first 1, 2, … columns.
        null_error: the same error of the model without columns, which is the intercept or zero.
        dependent: columns that depend on those before them.
        unit_leverage: for each prefix, the number of samples whose leverage is one up to rounding.
        ridge: penalty λ on the squared coefficients.
    """

    curve: Float64[np.ndarray, "neurons"]
    null_error: float
    dependent: Int[np.ndarray, "dependent"]
    unit_leverage: Int[np.ndarray, "neurons"]
    ridge: float

    @property
    def rank(self) -> int:
        """Number of independent columns."""
        return len(self.curve) - len(self.dependent)

    @property
    def best_size(self) -> int:
        """Number of columns with the smallest error; 1 if no error is finite."""
        return int(np.argmin(self.curve)) + 1


def press_path(H: Any, T: Any, ridge: float = 0.0, *, intercept: bool = False, groups: Any = None) -> PressPath:
    """Leave-one-out errors of every prefix of the columns of H.

    Args:
        H: regressors in the order of the prefixes, one row per sample.
        T: targets, one row per sample.
        ridge: penalty λ ≥ 0 on the squared coefficients, never on the intercept.
        intercept: whether to fit an intercept.
        groups: one label for each sample; all samples of a label are left out together. None leaves out one at a time.

    Returns:
        The errors, the dependent columns, and the numbers of samples of leverage one.

    Raises:
        InputError: unusable H, T, ridge or groups.
    """
    H, T = check_regression(H, T)
    if not (np.isfinite(ridge) and ridge >= 0):
        raise InputError(f"ridge must be a finite number of at least 0, not {ridge}.")
    group_rows = None if groups is None else rows_by_group(groups, len(H))
    if intercept:
        H, T = centre_columns(H), centre_columns(T)
    with float64():
        Q, independent = _row_basis(pad_columns(H), float(ridge), rank_tolerance(*H.shape), penalised=ridge > 0)
        errors = _prefix_errors(Q, pad_outputs(T), group_rows, len(H), intercept, ridge == 0)
    return _to_path(errors, np.asarray(independent)[: H.shape[1]], float(ridge), T.shape)


def press_path_of_basis(
    basis: Float64[np.ndarray, "entered samples"],
    T: Float64[np.ndarray, "samples outputs"],
    columns: int,
    groups: Any = None,
) -> PressPath:
    """As `press_path` without ridge and with intercept, from the basis that MRSR has computed.

    Args:
        basis: one orthonormal row for each independent column, in order; it spans the centred columns.
        T: targets, one row per sample.
        columns: length of the curve; columns beyond the basis depend on those before them.
        groups: as in `press_path`.

    Returns:
        The errors, the dependent columns, and the numbers of samples of leverage one.

    Raises:
        InputError: unusable groups.
    """
    group_rows = None if groups is None else rows_by_group(groups, len(T))
    Q = np.zeros((len(T), columns))
    Q[:, : len(basis)] = basis.T
    with float64():
        T = centre_columns(T)
        errors = _prefix_errors(pad_columns(Q), pad_outputs(T), group_rows, len(T), True, True)
    return _to_path(errors, np.arange(columns) < len(basis), 0.0, T.shape)


def press_curve(H: Any, T: Any, ridge: float = 0.0, *, intercept: bool = False) -> Float64[np.ndarray, "neurons"]:
    """Mean squared leave-one-out error, over samples and outputs, of the first 1, 2, … columns of H.

    Args:
        H: regressors in the order of the prefixes, one row per sample.
        T: targets, one row per sample.
        ridge: penalty λ ≥ 0 on the squared coefficients, never on the intercept.
        intercept: whether to fit an intercept.

    Returns:
        One error for each prefix; infinite if the prefix fits every sample exactly.

    Raises:
        InputError: unusable H, T or ridge.
    """
    return press_path(H, T, ridge, intercept=intercept).curve


@partial(jax.jit, static_argnames="penalised")
def _row_basis(
    H: Float[Array, "samples neurons"],
    ridge: Float[Array, ""] | float,
    tolerance: Float[Array, ""] | float,
    *,
    penalised: bool,
) -> tuple[Float[Array, "samples neurons"], Bool[Array, "neurons"]]:
    """Rows of samples of the basis of [H; √λ I], or of H alone, and which columns are independent."""
    stacked = H
    if penalised:
        stacked = jnp.concatenate([H, jnp.sqrt(ridge) * jnp.eye(H.shape[1], dtype=H.dtype)])
    Q, independent = orthonormal_prefix_basis(stacked, tolerance)
    return Q[: len(H)], independent


@jax.jit
def _prefix_errors(
    Q: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    group_rows: Int[Array, "groups largest"] | None,
    count: Int[Array, ""],
    intercept: Bool[Array, ""],
    saturates: Bool[Array, ""],
) -> tuple[Float[Array, "neurons"], Float[Array, ""], Int[Array, "neurons"]]:
    """Errors of every prefix and of the model without columns, summed over outputs and averaged over samples.

    The third result is the number of samples of leverage one. `saturates` says that a prefix of full row rank fits
    every sample exactly, which is true without ridge.
    """
    if group_rows is None:
        sums, null, unit_leverage = leave_one_out_sums(Q, T, count, intercept)
    else:
        sums, null, unit_leverage = leave_group_out_sums(Q, T, group_rows, count, intercept)
    rank = jnp.cumsum(jnp.any(Q != 0, axis=0))
    full = saturates & (rank >= count - intercept.astype(rank.dtype))
    return jnp.where(full, jnp.inf, sums / count), null / count, unit_leverage


def _to_path(errors: Any, independent: Bool[np.ndarray, "neurons"], ridge: float, shape: tuple[int, ...]) -> PressPath:
    """Remove the padding from errors, and average them over the outputs of targets of a given shape."""
    curve, null, unit_leverage = errors
    columns, outputs = len(independent), shape[1]
    return PressPath(
        curve=np.asarray(curve)[:columns] / outputs,
        null_error=float(null) / outputs,
        dependent=np.flatnonzero(~independent),
        unit_leverage=np.asarray(unit_leverage)[:columns],
        ridge=ridge,
    )
