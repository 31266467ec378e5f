"""Apprenticeship learning (Abbeel and Ng, 2004): weights under which no policy found so far is close to the expert.

Let μ(π) be the feature expectations of a policy, averaged over the states S₀, and μ_E the expert's. Each round chooses
the w that separates the expert best from the policies found so far, and adds the policy that is optimal under w:

- `projection`: w = μ_E − μ̄, after μ̄ has moved to the point nearest to μ_E on the segment from μ̄ to the new policy's μ;
- `max-margin`: w = μ_E − μ̄, with μ̄ the point nearest to μ_E in the convex hull of all policies' μ. This is the
  direction of the maximum of t subject to w·μ_E ≥ w·μ_j + t and ‖w‖ ≤ 1.

The margin t = ‖w‖ falls to 0. Abbeel and Ng then mix the policies. Here the result is a reward instead: the w whose
optimal policy came closest to the expert. All features are relative to the target's, see `problem.py`.
"""

import numpy as np
from jaxtyping import Float64
from scipy.sparse import csc_array

from relm_irl_jax.irl.clarabel_solver import minimise_quadratic
from relm_irl_jax.irl.expectations import mean_feature_expectations
from relm_irl_jax.irl.policy_iteration import next_states, optimal_policy
from relm_irl_jax.irl.problem import MaxMarginProblem, check_problem, relative_features
from relm_irl_jax.irl.settings import ApprenticeshipSettings
from relm_irl_jax.irl.solution import Solution, Status, normalised_solution

MAX_ROUNDS = 100
"""Maximum number of policies."""

TOLERANCE = 1e-6
"""Distance from μ_E at which to stop, relative to the first policy's distance."""


def apprenticeship(
    problem: MaxMarginProblem,
    settings: ApprenticeshipSettings | None = None,
    *,
    discount: float = 0.99,
    r_max: float = 1.0,
) -> Solution:
    """Learn weights by apprenticeship learning.

    Args:
        problem: the expert and the states S₀.
        settings: the variant; the default if None.
        discount: γ.
        r_max: size of the largest reward.

    Returns:
        The solution. Its gap is the best policy's distance from μ_E, relative to the first policy's. It is called
        inaccurate if a mixture of policies reaches μ_E but no single policy does.

    Raises:
        InputError: the problem is ill posed.
    """
    settings = settings or ApprenticeshipSettings()
    check_problem(problem)
    target, states = problem.expert.target, np.unique(problem.states)
    relative = relative_features(problem.features, target)

    def expectation(next_state):
        return mean_feature_expectations(relative, next_state, discount, states)

    expert = expectation(problem.expert.next_state)
    # The first policy never moves.
    expectations = [expectation(np.arange(len(relative), dtype=np.int32))]
    mean = expectations[0]
    first = float(np.linalg.norm(expert - mean))
    best, best_distance, hull = np.zeros(len(expert)), np.inf, first
    for _ in range(MAX_ROUNDS):
        w = expert - mean
        hull = float(np.linalg.norm(w))
        if hull <= TOLERANCE * first:
            break
        action = optimal_policy(relative @ w, problem.successors, target, discount)
        policy = expectation(next_states(problem.successors, target, action))
        distance = float(np.linalg.norm(expert - policy))
        if distance < best_distance:
            best, best_distance = w, distance
        if distance <= TOLERANCE * first:
            break
        expectations.append(policy)
        if settings.variant == "projection":
            step = policy - mean
            length = float(step @ w) / max(float(step @ step), np.finfo(np.float64).tiny)
            mean = mean + np.clip(length, 0.0, 1.0) * step
        else:
            differences = np.stack([expert - each for each in expectations])
            mean = expert - _shortest_mixture(differences @ differences.T) @ differences
    gap = best_distance / first if first > 0.0 else 0.0
    status = Status.INACCURATE if hull <= 1e-2 * first else Status.NOT_CONVERGED
    status = Status.OPTIMAL if gap <= TOLERANCE else status
    return normalised_solution(problem, best, status, discount=discount, r_max=r_max, gap=gap)


def _shortest_mixture(gram: Float64[np.ndarray, "n n"]) -> Float64[np.ndarray, "n"]:
    """The weights a ≥ 0 with Σa = 1 that minimise ½aᵀQa, for the Gram matrix Q of vectors: their shortest mixture."""
    n = len(gram)
    rows = csc_array(np.vstack([np.ones((1, n)), -np.eye(n)]))
    right_side = np.concatenate([[1.0], np.zeros(n)])
    # Divided by the size of Q, so that the solver's tolerances remain meaningful for policies close to each other.
    size = max(float(np.abs(gram).max()), 1e-300)
    _, point, _, _ = minimise_quadratic(csc_array(gram / size), np.zeros(n), rows, right_side, equalities=1)
    weights = np.maximum(point, 0.0)
    return weights / weights.sum()
