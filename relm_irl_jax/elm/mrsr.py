"""MRSR: multi-response sparse regression, which ranks columns by how they enter a piecewise linear fit.

Standardise H and T. Let x_j be the columns, Y the fit so far and A the active set, grown by the largest cumulative
correlation ‖(T-Y)ᵀx_j‖. Y moves toward the least-squares fit Ȳ of the active set by the smallest γ in [0, 1] at which
an inactive column ties with the active ones.

With a_j = x_jᵀ(T-Y), correlation with the residual, and e_j = x_jᵀ(T-Ȳ), correlation with the residual of the
least-squares fit, the condition ‖a_j - γ b_j‖ = (1-γ) c reads, with s = γ/(1-γ) ≥ 0,

    ‖a_j + s e_j‖ = c.

The left side is convex in s, starts at ‖a_j‖ ≤ c and grows without bound: every column has exactly one crossing.
For the 1-norm, Newton's method from the right reaches it in a few steps, never enumerating sign vectors; since
(c - ‖a_j‖)/‖e_j‖ bounds it from below, most columns are never examined. For the 2-norm it is a root of a quadratic.

A column that enters adds one direction q to an orthonormal basis of the active set, and then

    e_j ← e_j - (q·x_j)(qᵀT),        a_j ← (1-γ) a_j + γ e_j:

a rank-one update of an m × p array and one product with the m columns, O(N·m + m·p) a step and no refit. The columns
are kept orthogonal to the basis, up to the current panel of `PANEL` steps, whose update is one matrix product.

The 1-norm is the paper's. The 2-norm does not depend on a rotation of the outputs, so p falls to the rank of T. The
two orders differ.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import lax
from jaxtyping import Array, Bool, Float, Float64, Int

from relm_irl_jax.elm.linear import PANEL, finite_pair, float64, padded, rank_tolerance, standardised
from relm_irl_jax.errors import InputError

CANDIDATES = 16
"""Columns whose crossing is computed at once, those with the least lower bounds first."""

REORTHOGONALISE = 0.05
"""Share of a column's norm below which its remainder is projected once more against the whole basis."""

NEWTON_STEPS = 100
"""Safety bound; Newton on a convex piecewise linear function ends by itself, usually in three to six steps."""


@dataclass(frozen=True)
class MRSRPath:
    """The order in which columns entered, and how.

    Attributes:
        order: all columns: those that entered, in their order, then those never entered, by index.
        entered: number of columns that entered.
        dependent: columns that depend numerically on those that entered, constant columns among them.
        step: γ after each entry; the last is 1 if the path ran to its end.
        correlation: cumulative correlation of the active columns with the residual at each entry.
        norm: norm of the cumulative correlation, 1 or 2.
    """

    order: Int[np.ndarray, "neurons"]
    entered: int
    dependent: Int[np.ndarray, "dependent"]
    step: Float64[np.ndarray, "entered"]
    correlation: Float64[np.ndarray, "entered"]
    norm: int


class MRSRSteps(NamedTuple):
    """Traced counterpart of `MRSRPath`; `K` is min(samples, neurons).

    Attributes:
        order: as in `MRSRPath`.
        entered: number of entries; the arrays below are zero beyond it.
        dependent: whether a column was found dependent.
        step: γ after each entry.
        correlation: of the active columns at each entry.
        basis: one orthonormal row per entry: prefixes span the centred columns in `order`.
    """

    order: Int[Array, "neurons"]
    entered: Int[Array, ""]
    dependent: Bool[Array, "neurons"]
    step: Float[Array, "K"]
    correlation: Float[Array, "K"]
    basis: Float[Array, "K samples"]


COMPACT = 1024
"""Rows from which those that have entered are dropped once they are half; each time compiles the loop once more."""


class _State(NamedTuple):
    label: Array  # [m] column that each row stands for: rows are dropped once half of them have entered
    W: Array  # [m, N] columns, as rows, less their part in the basis up to the current panel
    V: Array  # [PANEL, m] products of the panel's basis vectors with the rows of W
    basis: Array  # [K + PANEL, N]
    A: Array  # [m, p] correlations with the residual T-Y
    E: Array  # [m, p] correlations with the least-squares residual T-Ȳ
    c: Array  # correlation of the active columns
    c0: Array  # the first of these
    following: Array  # column to enter next
    open: Array  # [m] neither entered nor found dependent
    dependent: Array  # [m]
    order: Array  # [K + PANEL]
    step: Array
    correlation: Array
    entered: Array
    in_panel: Array
    running: Array


def _crossing_1(A, E, c, open_):
    """First crossing for the 1-norm: s and its column; s is infinite where there is none."""
    size, slope = jnp.abs(A).sum(axis=1), jnp.abs(E).sum(axis=1)
    grows = slope > 0
    lower = jnp.where(open_ & grows, jnp.maximum(c - size, 0) / jnp.where(grows, slope, 1), jnp.inf)
    groups = min(CANDIDATES, len(lower))
    per_group = -(-len(lower) // groups)
    lower = jnp.pad(lower, (0, groups * per_group - len(lower)), constant_values=jnp.inf)

    def examine(state):
        """Find the crossings of the columns with the least bound in each group."""
        lower, best, winner = state
        rows = jnp.arange(groups) * per_group + jnp.argmin(lower.reshape(groups, per_group), axis=1)
        waits = lower[rows] < best
        row = jnp.minimum(rows, len(A) - 1)
        a, e = A[row], E[row]

        def newton(state):
            s, _, step = state
            at = a + s[:, None] * e
            rise = jnp.sum(jnp.sign(at) * e, axis=1)
            value = jnp.abs(at).sum(axis=1)
            new = jnp.clip(s - (value - c) / jnp.where(rise > 0, rise, jnp.inf), 0, s)
            return new, jnp.any(new < s * (1 - 1e-15)), step + 1

        start = jnp.where(waits, (c + size[row]) / jnp.where(waits, slope[row], 1), 0)
        s, _, _ = lax.while_loop(lambda state: state[1] & (state[2] < NEWTON_STEPS), newton, (start, True, 0))
        s = jnp.where(waits, s, jnp.inf)
        first = jnp.argmin(s)
        better = s[first] < best
        return (
            lower.at[rows].set(jnp.inf),
            jnp.where(better, s[first], best),
            jnp.where(better, row[first], winner).astype(jnp.int32),
        )

    _, best, winner = lax.while_loop(
        lambda state: jnp.min(state[0]) < state[1],
        examine,
        (lower, jnp.asarray(jnp.inf, A.dtype), jnp.zeros((), jnp.int32)),
    )
    return best, winner


def _crossing_2(A, E, c, open_):
    """First crossing for the 2-norm: the root ≥ 0 of |e|²s² + 2(a·e)s + |a|² - c², in the form without cancellation."""
    ee, ae, aa = jnp.sum(E * E, axis=1), jnp.sum(A * E, axis=1), jnp.sum(A * A, axis=1)
    gap = jnp.maximum(c**2 - aa, 0)
    root = jnp.sqrt(ae**2 + ee * gap)
    forward = jnp.where(ae > 0, gap / jnp.where(ae > 0, ae + root, 1), (root - ae) / jnp.where(ee > 0, ee, 1))
    s = jnp.where(open_ & (ee > 0), forward, jnp.inf)
    winner = jnp.argmin(s).astype(jnp.int32)
    return s[winner], winner


def mrsr_steps(
    H: Float[Array, "samples neurons"], T: Float[Array, "samples outputs"], norm: Literal[1, 2] = 1
) -> MRSRSteps:
    """Pure core of `mrsr`, for `jax.jit` and `jax.vmap`; precision is that of the input.

    Args:
        H: regressors.
        T: targets.
        norm: 1 or 2.

    Returns:
        The path, with fixed shapes.
    """
    return _steps(standardised(H), standardised(T), rank_tolerance(*H.shape), norm)


def _steps(X, T, tolerance, norm) -> MRSRSteps:
    """`mrsr_steps` of standardised data; zero rows and columns may pad them."""
    state = _begin(X, T, norm)
    dependent, done = state.dependent, 0
    neurons = X.shape[1]
    while neurons - done >= COMPACT:
        done += (neurons - done) // 2
        state = _advance(state, T, tolerance, done, norm)
        state, dependent = _compact(state, dependent, neurons - done)
    state = _advance(state, T, tolerance, min(X.shape), norm)
    return _finish(state, dependent)


def _size(A, norm):
    """Norm of the correlations of every column."""
    return jnp.abs(A).sum(axis=-1) if norm == 1 else jnp.linalg.norm(A, axis=-1)


def _begin(X, T, norm) -> _State:
    """Nothing has entered; the column of the largest correlation is due."""
    samples, neurons = X.shape
    K = min(samples, neurons)
    A = X.T @ T
    size = _size(A, norm)
    start = jnp.argmax(size).astype(jnp.int32)
    constant = ~jnp.any(X != 0, axis=0)
    return _State(
        label=jnp.arange(neurons, dtype=jnp.int32),
        W=X.T,
        V=jnp.zeros((PANEL, neurons), X.dtype),
        basis=jnp.zeros((K + PANEL, samples), X.dtype),
        A=A,
        E=A,
        c=size[start],
        c0=size[start],
        following=start,
        open=~constant,
        dependent=constant,
        order=jnp.zeros(K + PANEL, jnp.int32),
        step=jnp.zeros(K + PANEL, X.dtype),
        correlation=jnp.zeros(K + PANEL, X.dtype),
        entered=jnp.zeros((), jnp.int32),
        in_panel=jnp.zeros((), jnp.int32),
        running=size[start] > jnp.finfo(X.dtype).tiny,
    )


def _advance(state: _State, T, tolerance, until, norm) -> _State:
    """Enter columns, in whole panels, until `until` have entered or the path ends."""
    K = len(state.step) - PANEL
    crossing = _crossing_1 if norm == 1 else _crossing_2

    def enter(state: _State) -> _State:
        """Enter the column that is due, or mark it dependent, and move to the next crossing."""
        j, k, i = state.following, state.entered, state.in_panel
        panel = lax.dynamic_slice_in_dim(state.basis, k - i, PANEL)
        x = state.W[j] - state.V[:, j] @ panel
        # A unit column of which little is left carries the rounding of all that was subtracted.
        x = lax.cond(
            jnp.linalg.norm(x) < REORTHOGONALISE,
            lambda x, basis: x - (basis @ x) @ basis,
            lambda x, basis: x,
            x,
            state.basis,
        )
        length = jnp.linalg.norm(x)
        fits = length > tolerance
        q = jnp.where(fits, x / jnp.where(fits, length, 1), 0)
        v = jnp.where(state.open, state.W @ q, 0)
        # Written out once: fused into each of the sums over it, the update would be computed again in all of them.
        E = lax.optimization_barrier(state.E - v[:, None] * (q @ T))
        open_ = state.open.at[j].set(False)
        s, following = crossing(state.A, E, state.c, open_)
        ends = ~jnp.isfinite(s)
        gamma = jnp.where(ends, 1.0, s / (1 + jnp.where(ends, 0.0, s)))
        A = (1 - gamma) * state.A + gamma * E
        c = (1 - gamma) * state.c
        new = lax.convert_element_type(fits, state.entered.dtype)
        last = jnp.maximum(k - 1 + new, 0)
        return state._replace(
            V=state.V.at[i].set(v),
            basis=state.basis.at[k].set(q),
            A=A,
            E=E,
            c=c,
            following=following,
            open=open_,
            dependent=state.dependent.at[j].set(~fits),
            order=state.order.at[k].set(jnp.where(fits, state.label[j], 0)),
            # Steps while nothing enters belong to the last entry: their shares of the way that is left multiply.
            step=state.step.at[last].set(1 - jnp.where(fits, 1, 1 - state.step[last]) * (1 - gamma)),
            correlation=state.correlation.at[k].set(jnp.where(fits, state.c, 0)),
            entered=k + new,
            in_panel=i + new,
            running=~ends & (c > tolerance * state.c0) & (k + new < K),
        )

    def panel(state: _State) -> _State:
        state = lax.while_loop(lambda s: s.running & (s.in_panel < PANEL), enter, state)
        rows = lax.dynamic_slice_in_dim(state.basis, state.entered - state.in_panel, PANEL)
        W = state.W - state.V.T @ rows
        left = jnp.linalg.norm(W, axis=1) > tolerance
        return state._replace(
            W=W,
            V=jnp.zeros_like(state.V),
            in_panel=jnp.zeros_like(state.in_panel),
            dependent=state.dependent | (state.open & ~left),
            open=state.open & left,
        )

    return lax.while_loop(lambda s: s.running & (s.entered < until), panel, state)


def _compact(state: _State, dependent, rows: int) -> tuple[_State, Array]:
    """Drop rows that are not open, of which at most `rows` are unless the path has ended; note which were dependent."""
    keep = jnp.argsort(~state.open, stable=True)[:rows]
    kept = state._replace(
        label=state.label[keep],
        W=state.W[keep],
        V=state.V[:, keep],
        A=state.A[keep],
        E=state.E[keep],
        following=jnp.argmax(keep == state.following).astype(jnp.int32),
        open=state.open[keep],
        dependent=state.dependent[keep],
    )
    return kept, dependent.at[state.label].set(state.dependent)


def _finish(state: _State, dependent) -> MRSRSteps:
    """Put the columns that never entered behind those that did."""
    neurons, K = len(dependent), len(state.step) - PANEL
    place = jnp.arange(K) < state.entered
    rank = jnp.full(neurons, neurons).at[jnp.where(place, state.order[:K], neurons)].set(jnp.arange(K), mode="drop")
    return MRSRSteps(
        order=jnp.argsort(rank, stable=True),
        entered=state.entered,
        dependent=dependent.at[state.label].set(state.dependent),
        step=state.step[:K],
        correlation=state.correlation[:K],
        basis=state.basis[:K],
    )


_begin_jit = jax.jit(_begin, static_argnames="norm")
_advance_jit = jax.jit(_advance, static_argnames="norm", donate_argnums=0)
_compact_jit = jax.jit(_compact, static_argnames="rows")
_finish_jit = jax.jit(_finish)


def _steps_from_host(X, T, tolerance, norm, report: Callable[[int], None]) -> MRSRSteps:
    """`_steps`, one program a panel, so that the host can say how far it is."""
    samples, neurons = X.shape
    state = _begin_jit(X, T, norm=norm)
    dependent, done, entered = jnp.copy(state.dependent), 0, 0  # the state is donated
    while True:
        last = neurons - done < COMPACT
        done += (neurons - done) // 2
        until = min(samples, neurons) if last else done
        while state.running and entered < until:
            state = _advance_jit(state, T, tolerance, min(entered + PANEL, until), norm=norm)
            report(int(state.entered) - entered)
            entered = int(state.entered)
        if last:
            return _finish_jit(state, dependent)
        state, dependent = _compact_jit(state, dependent, rows=neurons - done)


def mrsr_path(H: Any, T: Any, norm: int = 1) -> MRSRPath:
    """Rank the columns of H by multi-response sparse regression on T, with the path's record.

    Args:
        H: regressors, one row per sample; standardised inside.
        T: targets, one row per sample; standardised inside.
        norm: norm of the cumulative correlation: 1, the paper's, or 2.

    Returns:
        Order and path.

    Raises:
        InputError: unusable H or T, or another norm.
    """
    path, _ = path_and_basis(H, T, norm)
    return path


def path_and_basis(
    H: Any, T: Any, norm: int, report: Callable[[int], None] = lambda entered: None
) -> tuple[MRSRPath, Float[Array, "entered samples"]]:
    """`mrsr_path` and the orthonormal basis of the centred columns in its order, for who goes on with it.

    `report` is called with the number of columns that entered since its last call.
    """
    H, T = finite_pair(H, T)
    if norm not in (1, 2):
        raise InputError(f"norm must be 1 or 2, not {norm!r}.")
    samples, neurons = H.shape
    X, T = standardised(H), standardised(T)
    if norm == 2:
        T = _rotated(T)
    with float64():
        steps = _steps_from_host(padded(X), padded(T), rank_tolerance(samples, neurons), norm, report)
    entered = int(steps.entered)
    order = np.asarray(steps.order)
    path = MRSRPath(
        order=order[order < neurons].astype(np.int64),
        entered=entered,
        dependent=np.flatnonzero(np.asarray(steps.dependent)[:neurons]),
        step=np.asarray(steps.step[:entered]),
        correlation=np.asarray(steps.correlation[:entered]),
        norm=norm,
    )
    return path, steps.basis[:entered, :samples]


def _rotated(T: Float64[np.ndarray, "samples outputs"]) -> Float64[np.ndarray, "samples rank"]:
    """Rotate the outputs so that as few columns as T has rank hold all of it; their products stay as they are."""
    if T.shape[1] == 1:
        return T
    triangle, columns = scipy.linalg.qr(T.T, mode="r", pivoting=True, check_finite=False)
    sizes = np.abs(np.diagonal(np.asarray(triangle)))
    rank = max(1, int(np.sum(sizes > rank_tolerance(*T.shape) * sizes[0])))
    rotated = np.empty((len(T), rank))
    rotated[np.asarray(columns)] = np.asarray(triangle)[:rank].T
    return rotated


def mrsr(H: Any, T: Any, norm: int = 1) -> Int[np.ndarray, "neurons"]:
    """Order of the columns of H: first what explains T most. Args, errors: as in `mrsr_path`, whose `order` this is."""
    return mrsr_path(H, T, norm).order
