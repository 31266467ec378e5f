"""The maximum-margin problem of the paper (Eq. 3-8): what is given, what is asked for, what comes back.

The reward is linear in the features, r(s) = w·φ(s). With V(s) the feature expectations of the expert's policy
from s (`expectations.py`), a*(s) the expert's action and s'_a the state that action a leads to, the margin of
a state is

    m(s) = min over sub-optimal a of  w·(V(s'_a*) − V(s'_a))

and the problem is to maximise Σ_{s ∈ S₀} p(m(s)), less a regulariser, over the w whose reward stays within
bounds on all states of the scene. p(x) = x unless a penalty for violated margins is asked for.

**The absorbing target, once and for all.** The expert stays at its target g for ever, so every value contains
a tail of w·φ(g)'s, while an agent's episode ends at g with a return of 0. Both agree when the reward is
counted relative to the target's: w·ψ(s) with ψ(s) = φ(s) − φ(g), which is 0 at g. Values then differ from
those of w·φ by the constant w·φ(g)/(1−γ) at every state, reachable or not, so margins and optimal policies
are the same and nothing is lost. `relative_features` is that subtraction; every method of this package and
every user of its w goes through it.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float64, Int32, Int64, Real
from pydantic import Field, PositiveFloat
from pydantic.dataclasses import dataclass as settings_dataclass
from scipy.sparse import csr_array

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import NO_ACTION, Expert

Form = Literal["cost", "free"]
Variant = Literal["lp", "lp-l2", "lp-l1"]


@settings_dataclass(frozen=True)
class MaxMarginSettings:
    """How a maximum-margin problem is stated."""

    form: Form = "cost"
    """Bounds of the reward: `cost`, −r_max ≤ w·(φ(s) − φ(g)) ≤ 0, or `free`, |w·φ(s)| ≤ r_max (the
    paper's)."""
    variant: Variant = "lp-l2"
    """Regulariser: none (`lp`), ½λ‖w‖² (`lp-l2`, strictly convex), or λ Σ_s |r(s)| (`lp-l1`, Ng and
    Russell's)."""
    discount: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.99
    """Discount γ of the feature expectations."""
    regularisation: PositiveFloat = 1e-3
    """λ for each state of S₀; the pure `lp` ignores it."""
    r_max: PositiveFloat = 1.0
    """Bound of the reward."""
    penalty: Annotated[float, Field(ge=1.0)] = 1.0
    """Factor on negative margins, p(x) = x for x ≥ 0 and penalty·x below; 2 is Ng and Russell's, for experts
    that are not optimal. Above 1, actions that are better than the expert's have a margin too."""
    pure_share: bool = True
    """Whether to solve the pure program too, to report the share of its objective that a regularised one
    keeps."""


@dataclass(frozen=True)
class MaxMarginProblem:
    """One problem: an expert, and the states at which it is asked to be better than its alternatives.

    Problems of one scene should share their `features` array: it is factorised once.

    Attributes:
        features: φ(s) for all states of the scene.
        successors: next state for each action, see `scenes.scene.successors`.
        expert: the expert's decision at every state.
        states: S₀, the states of one trajectory or of all of a target's; repeated ones count once.
        name: what messages call the problem, for example the trajectory's start and target.
    """

    features: Real[np.ndarray, "states d"]
    successors: Int32[np.ndarray, "states 4"]
    expert: Expert
    states: Int32[np.ndarray, "asked"]
    name: str = ""


class Status(StrEnum):
    """How a solution came about."""

    OPTIMAL = "optimal"
    """Solved to the tolerances."""
    INACCURATE = "inaccurate"
    """A solution to reduced tolerances; see its gap and residual."""
    INFEASIBLE = "infeasible"
    """No w satisfies the constraints."""
    UNBOUNDED = "unbounded"
    """The objective has no maximum."""
    NOT_CONVERGED = "not converged"
    """The solver stopped at a limit or for lack of progress."""
    NO_DECISION = "no decision"
    """No state asked for has an action that is worse than the expert's, so nothing is learned."""
    INVALID = "invalid"
    """The problem cannot be stated; the message says why."""
    FAILED = "failed"
    """The solver or its process broke; the message says how."""


@dataclass(frozen=True)
class Solution:
    """A solved problem and its certificate.

    The reward that `w` stands for is `reward(features, target, w)`.

    Attributes:
        w: the weights of least norm for the reward found; all NaN unless the status is optimal or inaccurate.
        status: how the solution came about.
        objective: value of the program's objective at w.
        share_of_lp: Σ p(margin) at w over the pure program's optimum; NaN where that was not asked for or is
            0.
        duality_gap: upper bound on how far `objective` is below the optimum, relative to max(1, |objective|).
        primal_residual: largest violation of the reward's bounds by w, relative to r_max.
        states: the states of S₀ at which a margin is asked for, ascending.
        margin: the margin at each of `states`.
        name: the problem's name.
        message: why there is no solution; empty where there is one.
    """

    w: Float64[np.ndarray, "d"]
    status: Status
    objective: float
    share_of_lp: float
    duality_gap: float
    primal_residual: float
    states: Int32[np.ndarray, "decisions"]
    margin: Float64[np.ndarray, "decisions"]
    name: str = ""
    message: str = ""

    @property
    def solved(self) -> bool:
        """Whether there is a w."""
        return self.status in (Status.OPTIMAL, Status.INACCURATE)


@dataclass(frozen=True)
class MarginRows:
    """The margins of a problem as a linear map of the reward relative to the target's.

    Attributes:
        weights: one row for each pair of a state and an action that differs from the expert's in value; times
            r(s) − r(g) it is the advantage of the expert's action, w·(V(s'_a*) − V(s'_a)). The target's
            column is 0.
        owner: position in `states` of each row's state.
        states: the states that have a row, ascending.
    """

    weights: csr_array
    owner: Int64[np.ndarray, "rows"]
    states: Int32[np.ndarray, "decisions"]


def relative_features(features: Real[np.ndarray, "states d"], target: int) -> Float64[np.ndarray, "states d"]:
    """ψ(s) = φ(s) − φ(g): the features under which ending an episode at the target and staying there are the
    same.

    Args:
        features: φ(s) for all states.
        target: g.

    Returns:
        ψ(s) for all states; zero at the target.
    """
    exact = np.asarray(features, np.float64)
    return exact - exact[target]


def reward(
    features: Real[np.ndarray, "states d"], target: int, w: Float64[np.ndarray, "d"]
) -> Float64[np.ndarray, "states"]:
    """The reward of every state under w, relative to the target's and so 0 at the target.

    Args:
        features: φ(s) for all states.
        target: the state where the episode ends.
        w: weights.

    Returns:
        w·(φ(s) − φ(g)).
    """
    return relative_features(features, target) @ w


def margin_rows(problem: MaxMarginProblem, settings: MaxMarginSettings) -> MarginRows:
    """State the margins of a problem as sparse rows over the states that the expert's walks visit.

    Args:
        problem: the problem.
        settings: gives the discount, and whether better actions have a margin too.

    Returns:
        The rows; none where no state asked for has a worse action.
    """
    expert = problem.expert
    asked = np.unique(problem.states)
    compared = expert.suboptimal | expert.better if settings.penalty > 1.0 else expert.suboptimal
    position, action = np.nonzero(compared[asked])
    state = asked[position]
    gain = _path_sums(expert, expert.next_state[state], settings.discount)
    loss = _path_sums(expert, problem.successors[state, action], settings.discount)
    states, owner = np.unique(state, return_inverse=True)
    return MarginRows(csr_array(gain - loss), owner, states.astype(np.int32))


def margin_of(
    problem: MaxMarginProblem, w: Float64[np.ndarray, "d"], discount: float
) -> tuple[Int32[np.ndarray, "decisions"], Float64[np.ndarray, "decisions"]]:
    """The margins of any w, whatever method it is from.

    Args:
        problem: the problem.
        w: weights.
        discount: γ.

    Returns:
        The states that have a margin, and the margins.
    """
    rows = margin_rows(problem, MaxMarginSettings(discount=discount))
    margin = np.full(len(rows.states), np.inf)
    np.minimum.at(margin, rows.owner, rows.weights @ reward(problem.features, problem.expert.target, w))
    return rows.states, margin


def check_problem(problem: MaxMarginProblem, settings: MaxMarginSettings | None = None) -> None:
    """Refuse a problem that cannot be stated.

    Args:
        problem: the problem.
        settings: how it is stated; None for methods to which an expert that is beaten is no obstacle.

    Raises:
        InputError: names the problem, what is wrong with it and the remedy.
    """
    name, expert = problem.name or f"the problem of target {problem.expert.target}", problem.expert
    states = np.unique(problem.states)
    if len(states) and not 0 <= states[0] <= states[-1] < len(problem.features):
        raise InputError(f"{name}: asks for states outside the scene's 0 to {len(problem.features) - 1}.")
    stuck = states[(expert.action[states] == NO_ACTION) & (states != expert.target)]
    if len(stuck):
        raise InputError(
            f"{name}: the expert cannot reach the target {expert.target} from state {stuck[0]}; "
            "leave out trajectories that do not arrive."
        )
    beaten, action = np.nonzero(expert.better[states])
    if len(beaten) and settings is not None and settings.penalty == 1.0:
        raise InputError(
            f"{name}: at state {states[beaten[0]]} action {action[0]} is better than the expert's action "
            f"{expert.action[states[beaten[0]]]}; for experts that are not optimal set the penalty to 2."
        )


def unsolved(problem: MaxMarginProblem, status: Status, message: str = "") -> Solution:
    """The solution that stands for having none.

    Args:
        problem: the problem that was not solved.
        status: why.
        message: why, in words.

    Returns:
        A solution without numbers.
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


def _path_sums(expert: Expert, starts: Int32[np.ndarray, "paths"], discount: float) -> csr_array:
    """Discounted visits Σ_t γᵗ [s_t = s] of the expert's walk from each start, the target's left out."""
    current, path, weight = starts, np.arange(len(starts)), 1.0
    rows, columns, values = [], [], []
    while len(current) and weight > np.finfo(np.float64).eps / 8:
        stays = expert.next_state[current] == current
        away = current != expert.target
        rows.append(path[away])
        columns.append(current[away])
        values.append(np.where(stays, weight / (1.0 - discount), weight)[away])
        current, path = expert.next_state[current[~stays]], path[~stays]
        weight *= discount
    shape = (len(starts), len(expert.next_state))
    if not rows:
        return csr_array(shape)
    return csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
