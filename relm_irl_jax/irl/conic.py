"""Clarabel on a program's standard form, min ½xᵀPx + qᵀx subject to Ax + s = b and s ≥ 0.

The method of choice where the program is sparse, and the one to fall back on anywhere.
"""

import numpy as np
from clarabel import (
    DefaultSettings,  # pyrefly: ignore[missing-module-attribute]
    DefaultSolver,  # pyrefly: ignore[missing-module-attribute]
    NonnegativeConeT,  # pyrefly: ignore[missing-module-attribute]
    ZeroConeT,  # pyrefly: ignore[missing-module-attribute]
)
from jaxtyping import Float64
from scipy.sparse import block_array, csc_array, csr_array, eye_array, triu

from relm_irl_jax.irl.problem import Status
from relm_irl_jax.irl.program import Multipliers, Program

_STATUS = {
    "Solved": Status.OPTIMAL,
    "AlmostSolved": Status.INACCURATE,
    "PrimalInfeasible": Status.INFEASIBLE,
    "AlmostPrimalInfeasible": Status.INFEASIBLE,
    "DualInfeasible": Status.UNBOUNDED,
    "AlmostDualInfeasible": Status.UNBOUNDED,
    "NumericalError": Status.FAILED,
}


def conic(program: Program) -> tuple[Status, Float64[np.ndarray, "rank"], Multipliers]:
    """Solve a program.

    Args:
        program: the program.

    Returns:
        How the solver says it ended, c and the multipliers, to be judged by `Program.bound`.
    """
    n_states, n_margins, rank = len(program.lower), program.n_margins, program.rank
    rows, owners = program.stacked_rows()
    n_rows = len(owners)
    basis = eye_array(n_states, format="csr") if program.basis is None else csr_array(program.basis)
    owner = csr_array((np.ones(n_rows), (np.arange(n_rows), owners)), shape=(n_rows, n_margins))
    # Unknowns are c, t and, where |r| is penalised, its bound u.
    blocks = [[basis, None], [-basis, None], [-csr_array(rows), owner]]
    right = [program.upper, -program.lower, np.zeros(n_rows)]
    linear = [np.zeros(rank), -np.ones(n_margins)]
    if program.absolute > 0.0:
        identity = eye_array(n_states, format="csr")
        blocks = [[*row, None] for row in blocks] + [[basis, None, -identity], [-basis, None, -identity]]
        right += [np.zeros(n_states), np.zeros(n_states)]
        linear.append(np.full(n_states, program.absolute))
    q = np.concatenate(linear)
    p = csc_array((len(q), len(q)))
    if program.quadratic is not None:
        p = csc_array(program.quadratic)
        p.resize((len(q), len(q)))
    a, b = csc_array(block_array(blocks)), np.concatenate(right)
    status, point, z, _ = minimise(p, q, a, b, equalities=0)
    ends = np.cumsum([n_states, n_states, n_rows, *[n_states] * (2 * (program.absolute > 0.0))])
    held_above, held_below, margins, *signs = np.split(z, ends[:-1])
    prices = held_above - held_below + (signs[0] - signs[1] if signs else 0.0)
    return status, point[:rank], Multipliers(margins, prices)


def minimise(
    p: csc_array, q: Float64[np.ndarray, "n"], a: csc_array, b: Float64[np.ndarray, "rows"], equalities: int
) -> tuple[Status, Float64[np.ndarray, "n"], Float64[np.ndarray, "rows"], float]:
    """Minimise ½xᵀPx + qᵀx, the first rows of Ax = b holding with equality and the others as Ax ≤ b.

    Args:
        p: P, of which the upper triangle counts.
        q: q.
        a: A.
        b: b.
        equalities: number of rows that hold with equality.

    Returns:
        How Clarabel says it ended, x, the multipliers and the duality gap, relative.
    """
    settings = DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.max_threads = 1
    settings.direct_solve_method = "qdldl"
    cones = [ZeroConeT(equalities)] * (equalities > 0) + [NonnegativeConeT(len(b) - equalities)]
    result = DefaultSolver(csc_array(triu(p)), q, a, b, cones, settings).solve()
    status = _STATUS.get(str(result.status), Status.NOT_CONVERGED)
    gap = abs(result.obj_val - result.obj_val_dual) / max(1.0, abs(result.obj_val))
    return status, np.asarray(result.x), np.asarray(result.z), gap
