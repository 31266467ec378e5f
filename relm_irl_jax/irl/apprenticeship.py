"""Apprenticeship learning (Abbeel and Ng, 2004): a reward under which no known policy comes close to the
expert.

With μ(π) the feature expectations of a policy, averaged over the starts S₀, and μ_E the expert's, each round
asks which w tells the expert best from the policies found so far, and adds the policy that is optimal under
that w:

- `projection`: w = μ_E − μ̄, and μ̄ moves to the point nearest to μ_E on the line from μ̄ to the new policy's
μ;
- `max-margin`: w = μ_E − μ̄ with μ̄ the point nearest to μ_E in the convex hull of all policies' μ, which is
  the direction of max t subject to w·μ_E ≥ w·μ_j + t, ‖w‖ ≤ 1.

The margin t = ‖w‖ falls to 0. The paper then mixes policies; a reward is wanted here, so the w is returned
whose own optimal policy came closest to the expert. All features are relative to the target's, see
`problem.py`.
"""

from typing import Literal

import numpy as np
from pydantic import PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.irl.control import bounded_solution, optimal_policy, policy_walk, simplex_program
from relm_irl_jax.irl.expectations import feature_expectations
from relm_irl_jax.irl.problem import MaxMarginProblem, Solution, Status, check_problem, relative_features


@settings_dataclass(frozen=True)
class ApprenticeshipSettings:
    """How apprenticeship learning proceeds."""

    variant: Literal["projection", "max-margin"] = "projection"
    """How the next w is chosen."""
    rounds: PositiveInt = 100
    """Most policies to try."""
    tolerance: PositiveFloat = 1e-6
    """Distance from the expert's feature expectations, relative to the first policy's, at which to stop."""


def apprenticeship(
    problem: MaxMarginProblem,
    settings: ApprenticeshipSettings | None = None,
    discount: float = 0.99,
    r_max: float = 1.0,
) -> Solution:
    """Learn weights by apprenticeship learning.

    Args:
        problem: the expert and the starts.
        settings: variant and limits; the defaults where None.
        discount: γ.
        r_max: size of the largest reward.

    Returns:
        The solution. Its gap is the distance of the best policy's feature expectations from the expert's,
        relative to the first policy's; a hull that reaches the expert while no single policy does is called
        inaccurate.
    """
    settings = settings or ApprenticeshipSettings()
    check_problem(problem)
    target, starts = problem.expert.target, np.unique(problem.states)
    relative = relative_features(problem.features, target)

    def expectation(next_state):
        return feature_expectations(relative, next_state, discount)[starts].mean(axis=0)

    expert = expectation(problem.expert.next_state)
    # The first policy stays where it is.
    found = [expectation(np.arange(len(relative), dtype=np.int32))]
    mean = found[0]
    first = float(np.linalg.norm(expert - mean))
    best, best_distance, hull = np.zeros(len(expert)), np.inf, first
    for _ in range(settings.rounds):
        w = expert - mean
        hull = float(np.linalg.norm(w))
        if hull <= settings.tolerance * first:
            break
        action = optimal_policy(np.repeat((relative @ w)[:, None], 4, axis=1), problem.successors, target, discount)
        own = expectation(policy_walk(problem.successors, target, action))
        distance = float(np.linalg.norm(expert - own))
        if distance < best_distance:
            best, best_distance = w, distance
        if distance <= settings.tolerance * first:
            break
        found.append(own)
        if settings.variant == "projection":
            step = own - mean
            length = float(step @ w) / max(float(step @ step), np.finfo(np.float64).tiny)
            mean = mean + np.clip(length, 0.0, 1.0) * step
        else:
            away = np.stack([expert - policy for policy in found])
            mean = expert - simplex_program(away @ away.T, np.zeros(len(found))) @ away
    gap = best_distance / first if first > 0.0 else 0.0
    if gap <= settings.tolerance:
        status = Status.OPTIMAL
    else:
        status = Status.INACCURATE if hull <= 1e-2 * first else Status.NOT_CONVERGED
    return bounded_solution(problem, best, status, discount, r_max, gap)
