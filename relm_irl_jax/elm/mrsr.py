"""MRSR: multi-response sparse regression, which orders columns by when they enter a piecewise linear fit (section
4.3.1).

Let x_j be the standardised columns of H, T the standardised targets, and Y the fit so far. A column's cumulative
correlation with the residual is c_j = ‖(T - Y)ᵀx_j‖ (Equation 26). The active set A holds the columns of the largest
one (Equation 27). Y moves toward the least-squares fit Ȳ of A (Equation 28),

    Y ← Y + γ (Ȳ - Y)        (Equation 29),

by the smallest γ in [0, 1] at which an inactive column ties with the active ones (Equations 31 and 32). That column
enters next. For one output and the 1-norm, this is least-angle regression.

With N samples, m columns and p outputs, a step costs O(Nm + mp); see `active_set` for the update and `step_length` for
γ.

The 1-norm is the paper's. The 2-norm is invariant under rotations of the outputs, so that rank(T) rotated outputs are
enough. The two norms give different orders.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from jaxtyping import Float64, Int

from relm_irl_jax.elm.active_set import ActiveSet, drop_settled_rows, enter_panel, init_active_set
from relm_irl_jax.elm.matrices import check_regression, float64, pad_columns, pad_outputs, standardise_columns
from relm_irl_jax.elm.orthogonalisation import rank_tolerance
from relm_irl_jax.errors import InputError

MIN_ROWS_TO_DROP = 1024
"""Smallest number of rows for which rows of settled columns are dropped when they are half of all rows. Every drop
changes shapes and therefore compiles again."""


@dataclass(frozen=True)
class MRSRPath:
    """The order in which columns entered, with the steps of the fit.

    Attributes:
        order: all columns: first those that entered, in the order of entry, then the others by index.
        entered: number of columns that entered.
        dependent: columns that were found to depend numerically on those that entered, before the path ended; constant
            columns are among them.
        step: γ after each entry; the last is 1 if the path is complete.
        correlation: cumulative correlation of the active set with the residual at each entry.
        basis: one orthonormal row for each entry; the first k span the first k columns of `order`, centred.
        norm: norm of the cumulative correlation, 1 or 2.
    """

    order: Int[np.ndarray, "neurons"]
    entered: int
    dependent: Int[np.ndarray, "dependent"]
    step: Float64[np.ndarray, "entered"]
    correlation: Float64[np.ndarray, "entered"]
    basis: Float64[np.ndarray, "entered samples"]
    norm: int


def mrsr(H: Any, T: Any, norm: int = 1) -> Int[np.ndarray, "neurons"]:
    """Order the columns of H by their entry into the MRSR path.

    Args:
        H: regressors, one row per sample; the function standardises them.
        T: targets, one row per sample; the function standardises them.
        norm: norm of the cumulative correlation: 1, the paper's, or 2.

    Returns:
        Indices of all columns.

    Raises:
        InputError: unusable H or T, or another norm.
    """
    return mrsr_path(H, T, norm).order


def mrsr_path(H: Any, T: Any, norm: int = 1, *, progress: Callable[[int], None] = lambda entered: None) -> MRSRPath:
    """Order the columns of H, and return the steps of the fit.

    Args:
        H: regressors, one row per sample; the function standardises them.
        T: targets, one row per sample; the function standardises them.
        norm: norm of the cumulative correlation: 1, the paper's, or 2.
        progress: called with the number of columns that entered since the last call.

    Returns:
        Order and steps.

    Raises:
        InputError: unusable H or T, or another norm.
    """
    H, T = check_regression(H, T)
    if norm not in (1, 2):
        raise InputError(f"norm must be 1 or 2, not {norm!r}.")
    samples, columns = H.shape
    X, T = standardise_columns(H), standardise_columns(T)
    if norm == 2:
        T = _rotate_to_rank(T)
    with float64():
        state = _enter_all(pad_columns(X), pad_outputs(T), rank_tolerance(samples, columns), norm, progress)
        entered = int(state.entered)
        order = np.asarray(state.order)[:entered].astype(np.int64)
        return MRSRPath(
            order=np.concatenate([order, np.setdiff1d(np.arange(columns), order)]),
            entered=entered,
            dependent=np.flatnonzero(np.asarray(state.dependent)[:columns]),
            step=np.asarray(state.step)[:entered],
            correlation=np.asarray(state.entry_correlation)[:entered],
            basis=np.asarray(state.basis)[:entered, :samples],
            norm=norm,
        )


def _enter_all(
    X: Float64[np.ndarray, "samples columns"],
    T: Float64[np.ndarray, "samples outputs"],
    tolerance: float,
    norm: int,
    progress: Callable[[int], None],
) -> ActiveSet:
    """Enter columns until the path ends, one panel at a time."""
    state = init_active_set(X, T, norm=norm)
    columns, rows, entered = X.shape[1], X.shape[1], 0
    while True:
        fewer_rows = rows - rows // 2 if rows >= MIN_ROWS_TO_DROP else 0
        while state.running and entered < columns - fewer_rows:
            state = enter_panel(state, T, tolerance, norm=norm)
            progress(int(state.entered) - entered)
            entered = int(state.entered)
        if not fewer_rows:
            return state
        rows = fewer_rows
        state = drop_settled_rows(state, rows=rows)


def _rotate_to_rank(T: Float64[np.ndarray, "samples outputs"]) -> Float64[np.ndarray, "samples rank"]:
    """Rotate the outputs so that all but rank(T) of them are zero, and drop those; products of rows do not change."""
    if T.shape[1] == 1:
        return T
    triangle, columns = scipy.linalg.qr(T.T, mode="r", pivoting=True, check_finite=False)
    sizes = np.abs(np.diagonal(np.asarray(triangle)))
    rank = max(1, int(np.sum(sizes > rank_tolerance(*T.shape) * sizes[0])))
    rotated = np.empty((len(T), rank))
    rotated[np.asarray(columns)] = np.asarray(triangle)[:rank].T
    return rotated
