"""A primal-dual interior-point method that uses the shape of the maximum-margin program.

A general solver factorises the sparse system of all constraints, thousands of rows for a program of 64
unknowns. Here the margins t and all slacks are eliminated by hand. With x = (c, t), slacks s, multipliers z
and weights z/s, what is left of Mehrotra's Newton step is one positive definite matrix of the size of c,

    K = P + Bᵀ diag(ω) B + Σ_s Σ_{i of s} ω_i (m_i − m̄_s)(m_i − m̄_s)ᵀ,    m̄_s = Σ ω_i m_i / Σ ω_i,

where eliminating a state's t has centred its margin rows m_i by their weighted mean. One symmetric product
and one Cholesky factorisation a step, two solves with it.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.linalg.blas import dsyrk  # pyrefly: ignore[missing-module-attribute]
from scipy.linalg.lapack import dpotrf, dpotrs  # pyrefly: ignore[missing-module-attribute]

from relm_irl_jax.irl.program import Multipliers, Program

STEPS = 80
"""Newton steps before giving up."""

LIFTS = (0.0, 1e-15, 1e-13, 1e-11)
"""What is added to K's diagonal, relative to its largest entry, until rounding no longer hides that K is positive
definite. A lifted step is less exact; the certificate judges where such steps lead."""

TOLERANCE = 1e-9
"""Complementarity and residuals, relative to the objective's and the bounds' size, at which to stop."""


class _Newton(NamedTuple):
    """What the two directions of a step share: the factorised K and the residuals."""

    factor: Float64[np.ndarray, "rank rank"]
    weight: Float64[np.ndarray, "constraints"]
    total: Float64[np.ndarray, "margins"]
    mean: Float64[np.ndarray, "margins rank"]
    primal: Float64[np.ndarray, "constraints"]
    dual_c: Float64[np.ndarray, "rank"]
    dual_t: Float64[np.ndarray, "margins"]


def interior_point(program: Program) -> tuple[Float64[np.ndarray, "rank"], Multipliers]:
    """Solve a program.

    Args:
        program: the program; rewards must have one sign where |r| is penalised.

    Returns:
        c and the multipliers, to be judged by their certificate; where a step breaks down, those before it.
    """
    rows, owner = program.stacked_rows()
    m = rows if isinstance(rows, np.ndarray) else rows.toarray()
    first = np.flatnonzero(np.r_[True, owner[1:] != owner[:-1]])
    basis, quadratic = program.basis, program.quadratic
    n, k, n_margins = len(program.lower), program.rank, program.n_margins
    ones = np.ones(n)
    linear = program.absolute * (ones if basis is None else ones @ basis)  # −λ₁ Σ|r| = λ₁ Σ r for r ≤ 0.
    bounds = np.concatenate([program.upper, -program.lower, np.zeros(len(owner))])
    size = float(np.max(program.upper - program.lower))

    def forward(c, t):
        r = c if basis is None else basis @ c
        return np.concatenate([r, -r, t[owner] - m @ c])

    def backward(z):
        held = z[:n] - z[n : 2 * n]
        return (held if basis is None else held @ basis) - z[2 * n :] @ m, np.add.reduceat(z[2 * n :], first)

    def direction(step, s, z, complement):
        right_c, right_t = backward(complement / s - step.weight * step.primal)
        right_c, right_t = right_c - step.dual_c, right_t - step.dual_t
        # The margins' own equations: total·dt − Σ ω_i m_i·dc = right_t.
        dc, _ = dpotrs(step.factor, right_c + right_t @ step.mean, lower=1)
        dt = right_t / step.total + step.mean @ dc
        ds = -step.primal - forward(dc, dt)
        return dc, dt, ds, -(complement + z * ds) / s

    c, t = np.zeros(k), np.full(n_margins, -size)
    s = np.maximum(bounds - forward(c, t), size)
    z = np.ones(len(bounds))
    matrix, diagonal = np.empty((k, k), order="F"), np.arange(k)
    stacked = np.empty((len(owner) + (0 if basis is None else n), k))
    for _ in range(STEPS):
        gradient_c, gradient_t = backward(z)
        dual_c, dual_t = gradient_c - linear, gradient_t - 1.0
        if quadratic is not None:
            dual_c += quadratic @ c
        primal = forward(c, t) + s - bounds
        gap = float(s @ z)
        scale = max(1.0, abs(float(t.sum())))
        if (
            gap <= TOLERANCE * scale
            and np.abs(primal).max() <= TOLERANCE * size
            and max(np.abs(dual_c).max(), np.abs(dual_t).max()) <= TOLERANCE * scale
        ):
            break
        weight = z / s
        total = np.add.reduceat(weight[2 * n :], first)
        mean = np.add.reduceat(weight[2 * n :, None] * m, first) / total[:, None]
        held = weight[:n] + weight[n : 2 * n]
        np.multiply(np.sqrt(weight[2 * n :])[:, None], m - mean[owner], out=stacked[-len(owner) :])
        if basis is not None:
            np.multiply(np.sqrt(held)[:, None], basis, out=stacked[:n])
        matrix[:] = 0.0 if quadratic is None else quadratic
        matrix = dsyrk(1.0, stacked.T, beta=1.0, c=matrix, lower=1, overwrite_c=1)
        if basis is None:
            matrix[diagonal, diagonal] += held
        own = matrix[diagonal, diagonal].copy()
        for lift in LIFTS:
            matrix[diagonal, diagonal] = own + lift * own.max()
            factor, failed = dpotrf(matrix, lower=1, clean=0)
            if not failed:
                break
        else:
            break

        step = _Newton(factor, weight, total, mean, primal, dual_c, dual_t)
        _, _, ds, dz = direction(step, s, z, s * z)
        length = min(_reach(s, ds), _reach(z, dz), 1.0)
        sigma = (float((s + length * ds) @ (z + length * dz)) / gap) ** 3
        dc, dt, ds, dz = direction(step, s, z, s * z + ds * dz - sigma * gap / len(s))
        length = min(0.995 * min(_reach(s, ds), _reach(z, dz)), 1.0)
        if not np.isfinite(length) or length < 1e-10:
            break
        c, t, s, z = c + length * dc, t + length * dt, s + length * ds, z + length * dz
    return c, Multipliers(margins=z[2 * n :], rewards=z[:n] - z[n : 2 * n] - program.absolute)


def _reach(value: Float64[np.ndarray, "n"], step: Float64[np.ndarray, "n"]) -> float:
    """How far along the step all values stay positive."""
    falling = step < 0.0
    return float(np.min(-value[falling] / step[falling])) if falling.any() else np.inf
