"""The maximum-margin problem as a concave program over coordinates of the reward, solved by Clarabel.

With r = Bc, the reward relative to the target's is a linear map of c as well, and the program is

    maximise   Σ_s p(t_s) − ½ cᵀPc − λ₁ Σ_s |r(s)|
    subject to t_owner(i) ≤ (Mc)_i  for every margin row i,    lower ≤ Bc ≤ upper.

Where the features can express every reward, c is r itself: B is the identity, the rows of M stay as sparse as
the walks they sum, and the bounds are a box. Otherwise B is a thin orthonormal basis of the rewards that can
be expressed. This module knows neither features nor JAX, so that solver processes start fast.
"""

from dataclasses import dataclass

import numpy as np
from clarabel import DefaultSettings, DefaultSolver, NonnegativeConeT  # pyrefly: ignore[missing-module-attribute]
from jaxtyping import Float64, Int64
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, triu

from relm_irl_jax.irl.coordinates import Coordinates
from relm_irl_jax.irl.problem import MarginRows, MaxMarginSettings, Status

_STATUS = {
    "Solved": Status.OPTIMAL,
    "AlmostSolved": Status.INACCURATE,
    "PrimalInfeasible": Status.INFEASIBLE,
    "AlmostPrimalInfeasible": Status.INFEASIBLE,
    "DualInfeasible": Status.UNBOUNDED,
    "AlmostDualInfeasible": Status.UNBOUNDED,
    "NumericalError": Status.FAILED,
}


@dataclass(frozen=True)
class Program:
    """The program of the module's docstring as data.

    Attributes:
        basis: B, or None for the identity.
        lower: least reward of each state.
        upper: greatest reward of each state.
        rows: M.
        owner: position of each row's state among the margins.
        quadratic: P.
        absolute: λ₁.
        penalty: factor of p on negative margins.
    """

    basis: Float64[np.ndarray, "states rank"] | None
    lower: Float64[np.ndarray, "states"]
    upper: Float64[np.ndarray, "states"]
    rows: csr_array
    owner: Int64[np.ndarray, "rows"]
    quadratic: csc_array
    absolute: float
    penalty: float

    @property
    def n_margins(self) -> int:
        """Number of states with a margin."""
        return int(self.owner[-1]) + 1

    @property
    def rank(self) -> int:
        """Number of coordinates."""
        return len(self.lower) if self.basis is None else self.basis.shape[1]

    def reward(self, point: Float64[np.ndarray, "rank"]) -> Float64[np.ndarray, "states"]:
        """The reward Bc."""
        return point if self.basis is None else self.basis @ point

    def margin(self, point: Float64[np.ndarray, "rank"]) -> Float64[np.ndarray, "margins"]:
        """The margin of each state at c."""
        margin = np.full(self.n_margins, np.inf)
        np.minimum.at(margin, self.owner, self.rows @ point)
        return margin

    def margin_sum(self, margin: Float64[np.ndarray, "margins"]) -> float:
        """Σ p(margin), the pure program's objective."""
        return float(np.minimum(margin, self.penalty * margin).sum())

    def objective(self, point: Float64[np.ndarray, "rank"]) -> float:
        """The objective at c."""
        regulariser = 0.5 * point @ (self.quadratic @ point) + self.absolute * np.abs(self.reward(point)).sum()
        return self.margin_sum(self.margin(point)) - float(regulariser)


@dataclass(frozen=True)
class Optimum:
    """What a solver found.

    Attributes:
        status: how it ended.
        point: c; meaningful where the status is optimal or inaccurate.
        bound: no c that satisfies the constraints has a larger objective, by the solver's dual solution.
    """

    status: Status
    point: Float64[np.ndarray, "rank"]
    bound: float


def state_program(
    rows: MarginRows, coordinates: Coordinates, target: int, settings: MaxMarginSettings, weight: float
) -> Program:
    """State the program of one problem.

    Args:
        rows: the problem's margins.
        coordinates: the scene's factorisation for the settings' form.
        target: the target's state.
        settings: form, variant, bound and penalty.
        weight: λ of the settings' variant.

    Returns:
        The program. In the cost form the target's own reward, which is 0, is left out of it.
    """
    cost = settings.form == "cost"
    n_states = len(coordinates.left)
    kept = np.delete(np.arange(n_states), target) if cost else np.arange(n_states)
    # The rows act on r(s) − r(g); r(g) is 0 in the cost form, and a variable like any other in the free form.
    weights = rows.weights
    if not cost:
        at_target = csr_array(-weights.sum(axis=1)[:, None])
        unit = csr_array(([1.0], ([0], [target])), shape=(1, n_states))
        weights = csr_array(weights + at_target @ unit)
    l2 = weight if settings.variant == "lp-l2" else 0.0
    if coordinates.full:
        basis = None
        margins = csr_array(weights[:, kept])
        size = len(kept)
        quadratic = csc_array(l2 * coordinates.penalty[np.ix_(kept, kept)]) if l2 else csc_array((size, size))
    else:
        left = coordinates.left - coordinates.left[target] if cost else coordinates.left
        basis, margins, size = left[kept], csr_array(weights @ left), left.shape[1]
        quadratic = csc_array(diags_array(l2 / coordinates.singular**2)) if l2 else csc_array((size, size))
    return Program(
        basis=basis,
        lower=np.full(len(kept), -settings.r_max),
        upper=np.full(len(kept), 0.0 if cost else settings.r_max),
        rows=margins,
        owner=rows.owner,
        quadratic=quadratic,
        absolute=weight if settings.variant == "lp-l1" else 0.0,
        penalty=settings.penalty,
    )


def solve(program: Program) -> Optimum:
    """Solve a program by Clarabel's interior-point method, in its standard form min ½xᵀPx + qᵀx, Ax + s = b,
    s ≥ 0.

    Args:
        program: the program.

    Returns:
        The optimum, with a named status where there is none.
    """
    n_states, n_margins = len(program.lower), program.n_margins
    n_rows, rank = len(program.owner), program.rank
    basis = eye_array(n_states, format="csr") if program.basis is None else csr_array(program.basis)
    owner = csr_array((np.ones(n_rows), (np.arange(n_rows), program.owner)), shape=(n_rows, n_margins))
    # Columns: c, t and, where |r| is not linear, its bound u.
    signed = program.absolute > 0.0 and bool((program.upper > 0.0).any())
    blocks = [[basis, None, None], [-basis, None, None], [-program.rows, owner, None]]
    right = [program.upper, -program.lower, np.zeros(n_rows)]
    linear = [np.zeros(rank), -np.ones(n_margins)]
    if program.penalty > 1.0:
        blocks.append([-program.penalty * program.rows, owner, None])
        right.append(np.zeros(n_rows))
    if signed:
        identity = eye_array(n_states, format="csr")
        blocks += [[basis, None, -identity], [-basis, None, -identity]]
        right += [np.zeros(n_states), np.zeros(n_states)]
        linear.append(np.full(n_states, program.absolute))
    else:
        blocks = [row[:2] for row in blocks]
        linear[0] = -program.absolute * np.asarray(basis.sum(axis=0))
    a, b, q = csc_array(block_array(blocks)), np.concatenate(right), np.concatenate(linear)
    p = csc_array(triu(program.quadratic))
    p.resize((len(q), len(q)))
    cones = [NonnegativeConeT(len(b))]
    result = DefaultSolver(p, q, a, b, cones, _clarabel_settings()).solve()
    status = _STATUS.get(str(result.status), Status.NOT_CONVERGED)
    return Optimum(status, np.asarray(result.x)[:rank], -result.obj_val_dual)


def _clarabel_settings() -> DefaultSettings:
    settings = DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.max_threads = 1
    settings.direct_solve_method = "qdldl"
    return settings
