"""Mehrotra's primal-dual interior-point method, specialised to the maximum-margin program.

A general solver factorises the sparse system of all constraints, thousands of rows for a program of 64 unknowns. Here
the margins t and all slacks are eliminated analytically. With slacks s, dual variables z and weights ω = z/s, each
Newton step needs one positive definite matrix of the size of c,

    K = P + Bᵀ diag(ω) B + Σ_k Σ_{i of margin k} ω_i (m_i − m̄_k)(m_i − m̄_k)ᵀ,    m̄_k = Σ ω_i m_i / Σ ω_i,

where the margin rows m_i are centred by their weighted mean because t_k is eliminated. A step costs one symmetric
product, one Cholesky factorisation and two solves.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.linalg.blas import dsyrk  # pyrefly: ignore[missing-module-attribute]
from scipy.linalg.lapack import dpotrf, dpotrs  # pyrefly: ignore[missing-module-attribute]

from relm_irl_jax.irl.convex_program import ConvexProgram, DualVariables

MAX_STEPS = 80
"""Newton steps before giving up."""

DIAGONAL_SHIFTS = (0.0, 1e-15, 1e-13, 1e-11)
"""Shifts of K's diagonal, relative to its largest entry, tried in turn until rounding errors leave K positive definite.
Shifted steps are less exact; the certificate judges the point that they lead to."""

TOLERANCE = 1e-9
"""Complementarity and residuals at which to stop, relative to the size of the objective and of the bounds."""


class _Newton(NamedTuple):
    """Quantities shared by the predictor and the corrector of a step: K, ω with sums and means, residuals."""

    factor: Float64[np.ndarray, "rank rank"]
    weight: Float64[np.ndarray, "constraints"]
    total: Float64[np.ndarray, "margins"]
    mean: Float64[np.ndarray, "margins rank"]
    primal: Float64[np.ndarray, "constraints"]
    dual_c: Float64[np.ndarray, "rank"]
    dual_t: Float64[np.ndarray, "margins"]


def solve_by_interior_point(program: ConvexProgram) -> tuple[Float64[np.ndarray, "rank"], DualVariables]:
    """Solve a program by the interior-point method.

    Args:
        program: the program. If |r| is penalised, the bounds must not let rewards be positive.

    Returns:
        The point c and the dual variables; if a step fails, those before it. `ConvexProgram.dual_bound` certifies them.
    """
    rows, margin_index = program.rows_with_penalty()
    m = rows if isinstance(rows, np.ndarray) else rows.toarray()
    first_row = np.flatnonzero(np.r_[True, margin_index[1:] != margin_index[:-1]])
    basis, quadratic = program.basis, program.quadratic
    n, k, n_margins = len(program.lower), program.rank, program.n_margins
    ones = np.ones(n)
    linear = program.l1_weight * (ones if basis is None else ones @ basis)  # −λ₁ Σ|r| = λ₁ Σ r if r ≤ 0.
    bounds = np.concatenate([program.upper, -program.lower, np.zeros(len(margin_index))])
    size = float(np.max(program.upper - program.lower))

    def constraints(c, t):  # The left side of Bc ≤ upper, −Bc ≤ −lower and t − Mc ≤ 0.
        r = c if basis is None else basis @ c
        return np.concatenate([r, -r, t[margin_index] - m @ c])

    def transposed(z):
        reward_duals = z[:n] - z[n : 2 * n]
        gradient = reward_duals if basis is None else reward_duals @ basis
        return gradient - z[2 * n :] @ m, np.add.reduceat(z[2 * n :], first_row)

    def direction(step, s, z, complement):
        right_c, right_t = transposed(complement / s - step.weight * step.primal)
        right_c, right_t = right_c - step.dual_c, right_t - step.dual_t
        # The equations of the margins are Σω·dt − Σ ω_i m_i·dc = right_t.
        dc, _ = dpotrs(step.factor, right_c + right_t @ step.mean, lower=1)
        dt = right_t / step.total + step.mean @ dc
        ds = -step.primal - constraints(dc, dt)
        return dc, dt, ds, -(complement + z * ds) / s

    c, t = np.zeros(k), np.full(n_margins, -size)
    s = np.maximum(bounds - constraints(c, t), size)
    z = np.ones(len(bounds))
    matrix, diagonal = np.empty((k, k), order="F"), np.arange(k)
    stacked = np.empty((len(margin_index) + (0 if basis is None else n), k))
    for _ in range(MAX_STEPS):
        gradient_c, gradient_t = transposed(z)
        dual_c, dual_t = gradient_c - linear, gradient_t - 1.0
        if quadratic is not None:
            dual_c += quadratic @ c
        primal = constraints(c, t) + s - bounds
        gap = float(s @ z)
        scale = max(1.0, abs(float(t.sum())))
        if (
            gap <= TOLERANCE * scale
            and np.abs(primal).max() <= TOLERANCE * size
            and max(np.abs(dual_c).max(), np.abs(dual_t).max()) <= TOLERANCE * scale
        ):
            break
        weight = z / s
        row_total = np.add.reduceat(weight[2 * n :], first_row)
        row_mean = np.add.reduceat(weight[2 * n :, None] * m, first_row) / row_total[:, None]
        bound_weight = weight[:n] + weight[n : 2 * n]
        np.multiply(np.sqrt(weight[2 * n :])[:, None], m - row_mean[margin_index], out=stacked[-len(margin_index) :])
        if basis is not None:
            np.multiply(np.sqrt(bound_weight)[:, None], basis, out=stacked[:n])
        matrix[:] = 0.0 if quadratic is None else quadratic
        matrix = dsyrk(1.0, stacked.T, beta=1.0, c=matrix, lower=1, overwrite_c=1)
        if basis is None:
            matrix[diagonal, diagonal] += bound_weight
        unshifted = matrix[diagonal, diagonal].copy()
        for shift in DIAGONAL_SHIFTS:
            matrix[diagonal, diagonal] = unshifted + shift * unshifted.max()
            factor, failed = dpotrf(matrix, lower=1, clean=0)
            if not failed:
                break
        else:
            break

        step = _Newton(factor, weight, row_total, row_mean, primal, dual_c, dual_t)
        _, _, ds, dz = direction(step, s, z, s * z)
        length = min(_longest_step(s, ds), _longest_step(z, dz), 1.0)
        sigma = (float((s + length * ds) @ (z + length * dz)) / gap) ** 3
        dc, dt, ds, dz = direction(step, s, z, s * z + ds * dz - sigma * gap / len(s))
        length = min(0.995 * min(_longest_step(s, ds), _longest_step(z, dz)), 1.0)
        if not np.isfinite(length) or length < 1e-10:
            break
        c, t, s, z = c + length * dc, t + length * dt, s + length * ds, z + length * dz
    return c, DualVariables(margins=z[2 * n :], rewards=z[:n] - z[n : 2 * n] - program.l1_weight)


def _longest_step(value: Float64[np.ndarray, "n"], step: Float64[np.ndarray, "n"]) -> float:
    """The largest step length at which all values stay nonnegative."""
    falling = step < 0.0
    return float(np.min(-value[falling] / step[falling])) if falling.any() else np.inf
