"""Clarabel, a general conic solver, applied to the maximum-margin program and to other quadratic programs.

Clarabel's standard form is min ½xᵀPx + qᵀx subject to Ax + s = b, s in a cone. It is used for sparse maximum-margin
programs, and for dense ones if `interior_point.py` does not reach an optimum.
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

from relm_irl_jax.irl.convex_program import ConvexProgram, DualVariables
from relm_irl_jax.irl.solution import Status

_STATUS = {
    "Solved": Status.OPTIMAL,
    "AlmostSolved": Status.INACCURATE,
    "PrimalInfeasible": Status.INFEASIBLE,
    "AlmostPrimalInfeasible": Status.INFEASIBLE,
    "DualInfeasible": Status.UNBOUNDED,
    "AlmostDualInfeasible": Status.UNBOUNDED,
    "NumericalError": Status.FAILED,
}


def solve_with_clarabel(program: ConvexProgram) -> tuple[Status, Float64[np.ndarray, "rank"], DualVariables]:
    """Solve a maximum-margin program with Clarabel.

    Args:
        program: the program.

    Returns:
        Clarabel's status, the point c and the dual variables. `ConvexProgram.dual_bound` certifies them.
    """
    n_states, n_margins, rank = len(program.lower), program.n_margins, program.rank
    rows, margin_index = program.rows_with_penalty()
    n_rows = len(margin_index)
    basis = eye_array(n_states, format="csr") if program.basis is None else csr_array(program.basis)
    selects_margin = csr_array((np.ones(n_rows), (np.arange(n_rows), margin_index)), shape=(n_rows, n_margins))
    # The unknowns are c, t and, if |r| is penalised, its upper bound u.
    blocks = [[basis, None], [-basis, None], [-csr_array(rows), selects_margin]]
    right_side = [program.upper, -program.lower, np.zeros(n_rows)]
    linear = [np.zeros(rank), -np.ones(n_margins)]
    if program.l1_weight > 0.0:
        identity = eye_array(n_states, format="csr")
        blocks = [[*row, None] for row in blocks] + [[basis, None, -identity], [-basis, None, -identity]]
        right_side += [np.zeros(n_states), np.zeros(n_states)]
        linear.append(np.full(n_states, program.l1_weight))
    q = np.concatenate(linear)
    p = csc_array((len(q), len(q)))
    if program.quadratic is not None:
        p = csc_array(program.quadratic)
        p.resize((len(q), len(q)))
    a, b = csc_array(block_array(blocks)), np.concatenate(right_side)
    status, point, z, _ = minimise_quadratic(p, q, a, b, equalities=0)
    ends = np.cumsum([n_states, n_states, n_rows, *[n_states] * (2 * (program.l1_weight > 0.0))])
    upper_duals, lower_duals, margin_duals, *l1_duals = np.split(z, ends[:-1])
    reward_duals = upper_duals - lower_duals + (l1_duals[0] - l1_duals[1] if l1_duals else 0.0)
    return status, point[:rank], DualVariables(margin_duals, reward_duals)


def minimise_quadratic(
    p: csc_array, q: Float64[np.ndarray, "n"], a: csc_array, b: Float64[np.ndarray, "rows"], *, equalities: int
) -> tuple[Status, Float64[np.ndarray, "n"], Float64[np.ndarray, "rows"], float]:
    """Minimise ½xᵀPx + qᵀx subject to Ax ≤ b, the first rows holding with equality.

    Args:
        p: P, positive semidefinite; only its upper triangle is read.
        q: q.
        a: A.
        b: b.
        equalities: number of rows that hold with equality.

    Returns:
        Clarabel's status, x, the dual variables, and the duality gap divided by max(1, |objective|).
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
