"""PRESS: the leave-one-out error of every prefix of the columns, from one factorisation.

For a least-squares fit of T on the first k columns of H, leaving out sample i changes its residual to

    ε_i = (t_i - h_i β) / (1 - ℓ_i),        ℓ_i = h_i (HᵀH + λI)⁻¹ h_iᵀ,

with h_i the i-th *row*. Let Q be an orthonormal basis of [H; √λ I] in column order and Q' its top block, one row per
sample. Then for every prefix k

    ℓ_i = Σ_{j≤k} Q'_ij²,        t_i - h_i β = t_i - Σ_{j≤k} Q'_ij (Q'_jᵀ T),

so leverages are cumulative sums and residuals lose one rank-one term per column. An intercept that is fitted without
penalty is a centring of H and T and 1/N more leverage; the errors stay exact for the model with its intercept.

Where the formula has no value:
- A column that depends on those before it changes nothing: its prefix repeats the error before it.
- A sample whose leverage reaches one determines a coefficient alone. Refitted without it, the column that it alone
  determines is dependent and would be skipped, so the sample keeps the error that it had before that column.
- A prefix whose rank reaches the number of samples (less the intercept) fits everything: its error is infinite.

Samples that resemble each other can be left out together; see `groups`.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Float64, Int

from relm_irl_jax.elm.groups import group_errors, members_of
from relm_irl_jax.elm.linear import centred, finite_pair, float64, orthonormal_prefixes, padded, rank_tolerance
from relm_irl_jax.errors import InputError

LEVERAGE_CAP = 1 - 1e-9
"""Leverage from which a sample keeps its last error: beyond it the quotient is rounding over rounding."""

TILE = 32
"""Samples whose residuals are followed through all prefixes at once."""


@dataclass(frozen=True)
class PressPath:
    """Leave-one-out errors of all prefixes, with what had to be handled.

    Attributes:
        curve: mean squared leave-one-out error, over samples and outputs, of the first 1, 2, … columns.
        empty: the same of the model without columns: the intercept alone, or zero.
        rank: number of independent columns.
        dropped: columns that depend on those before them.
        capped: samples, in each prefix, whose leverage is one up to rounding.
        ridge: penalty λ on the squared coefficients.
    """

    curve: Float64[np.ndarray, "neurons"]
    empty: float
    rank: int
    dropped: Int[np.ndarray, "dropped"]
    capped: Int[np.ndarray, "neurons"]
    ridge: float

    @property
    def best(self) -> int:
        """Number of columns with the least error; 1 where no error is finite."""
        return int(np.argmin(self.curve)) + 1


class PressErrors(NamedTuple):
    """Traced counterpart of `PressPath`, its errors summed over the outputs."""

    curve: Float[Array, "neurons"]
    empty: Float[Array, ""]
    capped: Int[Array, "neurons"]


def basis_errors(
    Q: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    *,
    intercept: bool,
    saturates: bool,
    count: Int[Array, ""] | int | None = None,
    members: Int[Array, "groups most"] | None = None,
) -> PressErrors:
    """Leave-one-out errors from a basis that is already there.

    Args:
        Q: top block of the orthonormal basis, in column order; zero columns for dependent ones.
        T: targets, centred if there is an intercept.
        intercept: whether the model fits one.
        saturates: whether a prefix of full row rank fits the targets exactly, which is so without ridge.
        count: number of samples where zero rows pad them.
        members: rows of the samples that are left out together; each by itself where None.

    Returns:
        Errors of every prefix, summed over outputs and averaged over samples.
    """
    count = len(Q) if count is None else count
    changed = jnp.any(Q != 0, axis=0)
    if members is None:
        losses, first, capped = _sample_errors(Q, T, count, changed, intercept=intercept)
    else:
        losses, first, capped = group_errors(Q, T, members, count, intercept=intercept)
    full = saturates & (jnp.cumsum(changed) >= count - intercept)
    return PressErrors(jnp.where(full, jnp.inf, losses / count), first / count, capped)


def _sample_errors(Q, T, count, changed, *, intercept):
    """As `group_errors`, every sample a group by itself, without the inverses."""
    rows = len(Q)
    base = (1 / count if intercept else 0.0) * jnp.ones((), Q.dtype)
    C = Q.T @ T

    def tile(inputs):
        """All prefixes for a few samples, whose residuals stay in the processor's cache."""
        t, q = inputs

        def column(state, inputs):
            residual, leverage, loss = state
            q, c, changed = inputs
            leverage = leverage + q**2
            residual = residual - q[:, None] * c
            free = leverage < LEVERAGE_CAP
            new = jnp.sum(residual**2, axis=1) / jnp.where(free, 1 - leverage, 1) ** 2
            loss = jnp.where(free & changed, new, loss)
            return (residual, leverage, loss), (loss.sum(), jnp.sum(~free))

        first = jnp.sum(t**2, axis=1) / jnp.where(base < 1, 1 - base, 1) ** 2
        _, sums = lax.scan(column, (t, jnp.full(len(t), base), first), (q.T, C, changed))
        return first.sum(), sums

    tiles = -(-rows // TILE)
    extra = tiles * TILE - rows
    first, (losses, capped) = lax.map(
        tile,
        (
            jnp.pad(T, ((0, extra), (0, 0))).reshape(tiles, TILE, -1),
            jnp.pad(Q, ((0, extra), (0, 0))).reshape(tiles, TILE, -1),
        ),
    )
    return losses.sum(axis=0), first.sum(), capped.sum(axis=0)


def press_errors(
    H: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    ridge: Float[Array, ""] | float = 0.0,
    *,
    intercept: bool = False,
    penalised: bool = True,
) -> tuple[PressErrors, Bool[Array, "neurons"]]:
    """Pure core of `press_curve`, for `jax.jit` and `jax.vmap`; precision is that of the input.

    Args:
        H: regressors in the order of the prefixes.
        T: targets.
        ridge: penalty λ, may be traced.
        intercept: fit an unpenalised intercept.
        penalised: False leaves the penalty out altogether; `ridge` must then be zero.

    Returns:
        Errors, summed over outputs and averaged over samples, and which columns are independent.
    """
    if intercept:
        H, T = centred(H), centred(T)
    return _errors(H, T, ridge, rank_tolerance(*H.shape), len(H), intercept=intercept, penalised=penalised)


def _errors(H, T, ridge, tolerance, count, members=None, *, intercept, penalised):
    """`press_errors` of data that are centred if there is an intercept; zero rows and columns may pad them."""
    stacked = H
    if penalised:
        stacked = jnp.concatenate([H, jnp.sqrt(ridge) * jnp.eye(H.shape[1], dtype=H.dtype)])
    Q, independent = orthonormal_prefixes(stacked, tolerance)
    top = Q[: len(H)]
    errors = basis_errors(top, T, intercept=intercept, saturates=not penalised, count=count, members=members)
    return errors, independent


_errors_jit = jax.jit(_errors, static_argnames=("intercept", "penalised"))


def press_path(H: Any, T: Any, ridge: float = 0.0, *, intercept: bool = False, groups: Any = None) -> PressPath:
    """Leave-one-out errors of every prefix of the columns of H, with diagnostics.

    Args:
        H: regressors in the order of the prefixes, one row per sample.
        T: targets, one row per sample.
        ridge: penalty λ ≥ 0 on the squared coefficients, never on the intercept.
        intercept: fit an intercept; the default is the model Hβ as it stands.
        groups: one label per sample; samples of one label are left out together. None leaves out one at a time.

    Returns:
        The curve and what had to be handled.

    Raises:
        InputError: unusable H, T, ridge or groups.
    """
    H, T = finite_pair(H, T)
    if not (np.isfinite(ridge) and ridge >= 0):
        raise InputError(f"ridge must be a finite number of at least 0, not {ridge}.")
    members = None if groups is None else members_of(groups, len(H))
    if intercept:
        H, T = centred(H), centred(T)
    with float64():
        errors, independent = _errors_jit(
            padded(H),
            padded(T),
            float(ridge),
            rank_tolerance(*H.shape),
            len(H),
            members,
            intercept=intercept,
            penalised=ridge > 0,
        )
    return _path_of(errors, np.asarray(independent)[: H.shape[1]], ridge, T.shape[1])


def basis_path(
    basis: Float[Array, "entered samples"],
    T: Float64[np.ndarray, "samples outputs"],
    neurons: int,
    groups: Any = None,
) -> PressPath:
    """Leave-one-out errors with intercept from a basis of the centred columns, such as MRSR leaves behind.

    Args:
        basis: one orthonormal row per independent column, in order.
        T: targets.
        neurons: length of the curve; columns beyond the basis are dependent.
        groups: as in `press_path`.

    Returns:
        The curve and what had to be handled.

    Raises:
        InputError: unusable groups.
    """
    members = None if groups is None else members_of(groups, len(T))
    Q = np.zeros((len(T), neurons))
    Q[:, : len(basis)] = np.asarray(basis).T
    with float64():
        errors = _basis_errors_jit(
            padded(Q), padded(centred(T)), intercept=True, saturates=True, count=len(T), members=members
        )
    return _path_of(errors, np.arange(neurons) < len(basis), 0.0, T.shape[1])


_basis_errors_jit = jax.jit(basis_errors, static_argnames=("intercept", "saturates"))


def _path_of(errors, independent, ridge, outputs) -> PressPath:
    """Bring traced errors to the host, as means over the outputs too."""
    neurons = len(independent)
    return PressPath(
        curve=np.asarray(errors.curve)[:neurons] / outputs,
        empty=float(errors.empty) / outputs,
        rank=int(independent.sum()),
        dropped=np.flatnonzero(~independent),
        capped=np.asarray(errors.capped)[:neurons],
        ridge=float(ridge),
    )


def press_curve(H: Any, T: Any, ridge: float = 0.0, *, intercept: bool = False) -> Float64[np.ndarray, "neurons"]:
    """Mean squared leave-one-out error, over samples and outputs, of the first 1, 2, … columns of H.

    Args, errors: as in `press_path`, whose `curve` this is. Infinite from where a prefix fits every sample exactly.
    """
    return press_path(H, T, ridge, intercept=intercept).curve
