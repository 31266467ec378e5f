"""Solutions of inverse reinforcement learning: weights, status and certificate."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float64, Int32

from relm_irl_jax.irl.margins import margins_under
from relm_irl_jax.irl.problem import MaxMarginProblem, reward


class Status(StrEnum):
    """Outcome of solving a problem."""

    OPTIMAL = "optimal"
    """Solved to the tolerances."""
    INACCURATE = "inaccurate"
    """Solved to looser tolerances; see the solution's gap and residual."""
    INFEASIBLE = "infeasible"
    """No w satisfies the constraints."""
    UNBOUNDED = "unbounded"
    """The objective has no maximum."""
    NOT_CONVERGED = "not converged"
    """The solver reached a limit or made no more progress."""
    NO_DECISION = "no decision"
    """No state of S₀ has a suboptimal action, so there is nothing to learn from."""
    INVALID = "invalid"
    """The problem is ill posed; the message says why."""
    FAILED = "failed"
    """The solver or its process crashed; the message says how."""


@dataclass(frozen=True)
class Solution:
    """Weights that solve a problem, with a certificate.

    The reward under `w` is `irl.reward(features, target, w)`.

    Attributes:
        w: weights; for the maximum-margin method, those of minimum norm among weights with the same reward. NaN unless
            the status is optimal or inaccurate.
        status: outcome of the solver.
        objective: the method's objective at w.
        share_of_lp: Σ p(margin) at w divided by the linear program's optimum; NaN if that was not solved or is 0.
        duality_gap: upper bound on optimum − objective, divided by max(1, |objective|).
        primal_residual: largest violation of the reward's bounds under w, divided by r_max.
        states: the states of S₀ that have a margin, ascending.
        margin: the margin of each of `states`.
        name: the problem's name.
        message: why there are no weights; empty if there are.
    """

    w: Float64[np.ndarray, "d"]
    status: Status
    objective: float
    share_of_lp: float
    duality_gap: float
    primal_residual: float
    states: Int32[np.ndarray, "margins"]
    margin: Float64[np.ndarray, "margins"]
    name: str = ""
    message: str = ""

    @property
    def solved(self) -> bool:
        """Whether there are weights."""
        return self.status in (Status.OPTIMAL, Status.INACCURATE)


def unsolved(problem: MaxMarginProblem, status: Status, message: str = "") -> Solution:
    """The solution of a problem that was not solved.

    Args:
        problem: the problem.
        status: the reason, as a status.
        message: the reason, in words.

    Returns:
        A solution with NaN in all numbers.
    """
    return Solution(
        w=np.full(problem.features.shape[1], np.nan),
        status=status,
        objective=np.nan,
        share_of_lp=np.nan,
        duality_gap=np.nan,
        primal_residual=np.nan,
        states=np.zeros(0, np.int32),
        margin=np.zeros(0),
        name=problem.name,
        message=message,
    )


def normalised_solution(
    problem: MaxMarginProblem, w: Float64[np.ndarray, "d"], status: Status, *, discount: float, r_max: float, gap: float
) -> Solution:
    """The solution of a method that leaves the scale of w open: w is scaled to a largest |reward| of r_max.

    Args:
        problem: the problem.
        w: weights of any scale.
        status: outcome of the method.
        discount: γ of the margins.
        r_max: largest |reward|, relative to the target's, after scaling.
        gap: the method's relative distance from its optimum.

    Returns:
        The solution; its objective is the sum of the margins.
    """
    largest = float(np.abs(reward(problem.features, problem.expert.target, w)).max())
    scaled = w * (r_max / largest) if largest > 0.0 else w
    states, margin = margins_under(problem, scaled, discount)
    return Solution(
        w=scaled,
        status=status,
        objective=float(margin.sum()),
        share_of_lp=np.nan,
        duality_gap=gap,
        primal_residual=0.0,
        states=states,
        margin=margin,
        name=problem.name,
    )
