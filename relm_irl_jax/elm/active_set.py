"""The active set of MRSR as arrays of fixed shape, and the entry of columns into it.

A column that enters adds one vector q to an orthonormal basis of the active set. With the least-squares fit
Ȳ = Σ q (qᵀT) (Equation 28), the correlations a_j = x_jᵀ(T - Y) and e_j = x_jᵀ(T - Ȳ) become

    e_j ← e_j - (q·x_j)(qᵀT),        a_j ← (1 - γ) a_j + γ e_j        (Equation 29):

a rank-one update of a columns × outputs array and one product with all columns, instead of a refit.

All columns are stored as remainders orthogonal to the basis, so that q is the normalised remainder of the column that
enters. Within a panel of `PANEL` entries only the products q·x_j are stored; the end of the panel subtracts them from
all columns by one matrix product.
"""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from relm_irl_jax.elm.orthogonalisation import PANEL
from relm_irl_jax.elm.step_length import first_tie

REORTHOGONALISE = 0.05
"""Share of a column's norm below which its remainder is orthogonalised once more against the whole basis."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ActiveSet:
    """State of MRSR between two entries.

    Rows stand for columns of X that may still enter, K for min(samples, columns), and slots for K + `PANEL`.

    Attributes:
        column: column of X that each row stands for.
        remainder: columns, as rows, minus their projection on the basis before the current panel.
        products: q·x_j of the panel's basis vectors with every row.
        basis: orthonormal basis of the active set, one row per entry.
        correlation: a_j = x_jᵀ(T - Y) with the residual.
        target_correlation: e_j = x_jᵀ(T - Ȳ) with the residual of the least-squares fit.
        active_correlation: cumulative correlation c of the active set (Equation 27).
        first_correlation: its value at the first entry.
        next_row: row whose column enters next.
        inactive: rows that have neither entered nor been found dependent.
        dependent: columns of X that depend numerically on those that entered; constant ones are among them.
        order: columns of X in the order of their entries.
        step: γ after each entry.
        entry_correlation: c at each entry.
        entered: number of entries.
        in_panel: number of entries in the current panel.
        running: whether another column enters.
    """

    column: Int[Array, "rows"]
    remainder: Float[Array, "rows samples"]
    products: Float[Array, "panel rows"]
    basis: Float[Array, "slots samples"]
    correlation: Float[Array, "rows outputs"]
    target_correlation: Float[Array, "rows outputs"]
    active_correlation: Float[Array, ""]
    first_correlation: Float[Array, ""]
    next_row: Int[Array, ""]
    inactive: Bool[Array, "rows"]
    dependent: Bool[Array, "columns"]
    order: Int[Array, "slots"]
    step: Float[Array, "slots"]
    entry_correlation: Float[Array, "slots"]
    entered: Int[Array, ""]
    in_panel: Int[Array, ""]
    running: Bool[Array, ""]


@partial(jax.jit, static_argnames="norm")
def init_active_set(X: Float[Array, "samples columns"], T: Float[Array, "samples outputs"], *, norm: int) -> ActiveSet:
    """The state before the first entry; the column of the largest cumulative correlation is next.

    Args:
        X: standardised columns; constant ones are zero, and zero rows and columns may pad them.
        T: standardised targets.
        norm: norm of the cumulative correlation (Equation 26), 1 or 2.

    Returns:
        The state.
    """
    samples, columns = X.shape
    slots = min(samples, columns) + PANEL
    correlation = X.T @ T
    cumulative = jnp.abs(correlation).sum(axis=-1) if norm == 1 else jnp.linalg.norm(correlation, axis=-1)
    first = jnp.argmax(cumulative).astype(jnp.int32)
    constant = ~jnp.any(X != 0, axis=0)
    return ActiveSet(
        column=jnp.arange(columns, dtype=jnp.int32),
        remainder=X.T,
        products=jnp.zeros((PANEL, columns), X.dtype),
        basis=jnp.zeros((slots, samples), X.dtype),
        correlation=correlation,
        target_correlation=correlation,
        active_correlation=cumulative[first],
        first_correlation=cumulative[first],
        next_row=first,
        inactive=~constant,
        dependent=constant,
        order=jnp.zeros(slots, jnp.int32),
        step=jnp.zeros(slots, X.dtype),
        entry_correlation=jnp.zeros(slots, X.dtype),
        entered=jnp.zeros((), jnp.int32),
        in_panel=jnp.zeros((), jnp.int32),
        running=cumulative[first] > jnp.finfo(X.dtype).tiny,
    )


@partial(jax.jit, static_argnames="norm", donate_argnames="state")
def enter_panel(
    state: ActiveSet, T: Float[Array, "samples outputs"], tolerance: Float[Array, ""] | float, *, norm: int
) -> ActiveSet:
    """Enter up to `PANEL` columns, fewer if the path ends, and subtract them from the other columns.

    Args:
        state: the state; its buffers are donated.
        T: standardised targets.
        tolerance: norm below which the remainder of a column counts as zero, and share of the first cumulative
            correlation below which the path ends.
        norm: norm of the cumulative correlation, 1 or 2.

    Returns:
        The state after the panel.
    """
    state = lax.while_loop(
        lambda state: state.running & (state.in_panel < PANEL),
        lambda state: _enter_column(state, T, tolerance, norm),
        state,
    )
    panel = lax.dynamic_slice_in_dim(state.basis, state.entered - state.in_panel, PANEL)
    remainder = state.remainder - state.products.T @ panel
    independent = jnp.linalg.norm(remainder, axis=1) > tolerance
    dependent = state.dependent[state.column] | (state.inactive & ~independent)
    return replace(
        state,
        remainder=remainder,
        products=jnp.zeros_like(state.products),
        in_panel=jnp.zeros_like(state.in_panel),
        dependent=state.dependent.at[state.column].set(dependent),
        inactive=state.inactive & independent,
    )


def _enter_column(state: ActiveSet, T, tolerance, norm: int) -> ActiveSet:
    """Enter the next column, or mark it dependent, and move the fit until another one ties."""
    row, k, i = state.next_row, state.entered, state.in_panel
    panel = lax.dynamic_slice_in_dim(state.basis, k - i, PANEL)
    x = state.remainder[row] - state.products[:, row] @ panel
    # A small remainder of a unit column contains the rounding errors of everything that was subtracted.
    x = lax.cond(
        jnp.linalg.norm(x) < REORTHOGONALISE,
        lambda x, basis: x - (basis @ x) @ basis,
        lambda x, basis: x,
        x,
        state.basis,
    )
    length = jnp.linalg.norm(x)
    enters = length > tolerance
    q = jnp.where(enters, x / jnp.where(enters, length, 1), 0)
    products = jnp.where(state.inactive, state.remainder @ q, 0)
    # The barrier stores E once; otherwise XLA fuses its computation into each of the sums over it.
    E = lax.optimization_barrier(state.target_correlation - products[:, None] * (q @ T))
    inactive = state.inactive.at[row].set(False)
    s, next_row = first_tie(state.correlation, E, state.active_correlation, inactive, norm)
    ends = ~jnp.isfinite(s)
    gamma = jnp.where(ends, 1.0, s / (1 + jnp.where(ends, 0.0, s)))
    c = (1 - gamma) * state.active_correlation
    entered = k + enters.astype(k.dtype)
    last = jnp.maximum(entered - 1, 0)
    # If the column did not enter, its step extends that of the last entry: the remaining fractions 1 - γ multiply.
    previous_step = jnp.where(enters, 0, state.step[last])
    return replace(
        state,
        products=state.products.at[i].set(products),
        basis=state.basis.at[k].set(q),
        correlation=(1 - gamma) * state.correlation + gamma * E,
        target_correlation=E,
        active_correlation=c,
        next_row=next_row,
        inactive=inactive,
        dependent=state.dependent.at[state.column[row]].set(~enters),
        order=state.order.at[k].set(jnp.where(enters, state.column[row], 0)),
        step=state.step.at[last].set(1 - (1 - previous_step) * (1 - gamma)),
        entry_correlation=state.entry_correlation.at[k].set(jnp.where(enters, state.active_correlation, 0)),
        entered=entered,
        in_panel=i + enters.astype(i.dtype),
        running=~ends & (c > tolerance * state.first_correlation) & (entered < len(state.step) - PANEL),
    )


@partial(jax.jit, static_argnames="rows")
def drop_settled_rows(state: ActiveSet, *, rows: int) -> ActiveSet:
    """Keep some rows, the inactive ones first; rows of columns that entered or are dependent need no more updates.

    Args:
        state: the state.
        rows: number of rows to keep; at most that many are inactive unless the path has ended.

    Returns:
        The smaller state.
    """
    kept = jnp.argsort(~state.inactive, stable=True)[:rows].astype(state.next_row.dtype)
    return replace(
        state,
        column=state.column[kept],
        remainder=state.remainder[kept],
        products=state.products[:, kept],
        correlation=state.correlation[kept],
        target_correlation=state.target_correlation[kept],
        next_row=jnp.argmax(kept == state.next_row).astype(jnp.int32),
        inactive=state.inactive[kept],
    )
