"""Optimal behaviour under a known reward on a scene's graph, and what the IRL family shares about it."""

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64
from scipy.sparse import csc_array

from relm_irl_jax.irl.conic import minimise
from relm_irl_jax.irl.expectations import feature_expectations
from relm_irl_jax.irl.problem import (
    MaxMarginProblem,
    Solution,
    Status,
    margin_of,
    reward,
)


def optimal_policy(
    rewards: Float64[np.ndarray, "states actions"],
    successors: Int32[np.ndarray, "states actions"],
    target: int,
    discount: float,
) -> Int64[np.ndarray, "states"]:
    """An optimal deterministic policy, by policy iteration.

    Args:
        rewards: reward of taking an action in a state; that of staying at the target is 0.
        successors: next state for each action.
        target: the absorbing state.
        discount: γ.

    Returns:
        The action at every state; the first of several equally good ones. The target's means nothing.
    """
    states = np.arange(len(successors))
    action = np.argmax(rewards, axis=1)
    while True:
        value = policy_value(rewards, successors, target, discount, action)
        quality = rewards + discount * value[successors]
        best = np.argmax(quality, axis=1)
        # Only a real gain changes an action, so that rounding cannot make the iteration cycle.
        slack = 1e-10 * max(1.0, float(np.abs(value).max()))
        gains = quality[states, best] > quality[states, action] + slack
        gains[target] = False
        if not gains.any():
            return action
        action = np.where(gains, best, action)


def policy_value(
    rewards: Float64[np.ndarray, "states actions"],
    successors: Int32[np.ndarray, "states actions"],
    target: int,
    discount: float,
    action: Int64[np.ndarray, "states"],
) -> Float64[np.ndarray, "states"]:
    """Value of a deterministic policy whose episode ends at the target with a return of 0."""
    states = np.arange(len(successors))
    own = np.where(states == target, 0.0, rewards[states, action])
    return feature_expectations(own[:, None], policy_walk(successors, target, action), discount)[:, 0]


def policy_walk(
    successors: Int32[np.ndarray, "states actions"], target: int, action: Int64[np.ndarray, "states"]
) -> Int32[np.ndarray, "states"]:
    """The state that a policy leads to from each state, the target being absorbing."""
    states = np.arange(len(successors))
    return np.where(states == target, target, successors[states, action]).astype(np.int32)


def expected_value_difference(
    problem: MaxMarginProblem,
    w: Float64[np.ndarray, "d"],
    true_reward: Float64[np.ndarray, "states"],
    discount: float,
) -> float:
    """How much worse than the expert a planner under w does, by a true reward: Σ over S₀ of the loss, on
    average.

    Args:
        problem: gives the scene, the expert and S₀.
        w: learned weights.
        true_reward: the reward that counts, 0 at the target.
        discount: γ.

    Returns:
        Mean over S₀ of the expert's value less the planner's, relative to the mean size of the expert's.
    """
    target, following = problem.expert.target, problem.successors
    learned = reward(problem.features, target, w)
    action = optimal_policy(np.repeat(learned[:, None], 4, axis=1), following, target, discount)
    starts = np.unique(problem.states)
    own = feature_expectations(true_reward[:, None], policy_walk(following, target, action), discount)[starts, 0]
    expert = feature_expectations(true_reward[:, None], problem.expert.next_state, discount)[starts, 0]
    return float((expert - own).mean() / np.abs(expert).mean())


def simplex_program(
    quadratic: Float64[np.ndarray, "n n"], linear: Float64[np.ndarray, "n"]
) -> Float64[np.ndarray, "n"]:
    """Minimise ½aᵀQa − lᵀa over the probability simplex.

    Args:
        quadratic: Q, positive semidefinite.
        linear: l.

    Returns:
        a.
    """
    n = len(linear)
    rows = csc_array(np.vstack([np.ones((1, n)), -np.eye(n)]))
    right = np.concatenate([[1.0], np.zeros(n)])
    # In units of Q's size, or the tolerances would mean nothing for near policies.
    size = max(float(np.abs(quadratic).max()), float(np.abs(linear).max()), 1e-300)
    _, point, _, _ = minimise(csc_array(quadratic / size), -linear / size, rows, right, equalities=1)
    weights = np.maximum(point, 0.0)
    return weights / weights.sum()


def bounded_solution(
    problem: MaxMarginProblem,
    w: Float64[np.ndarray, "d"],
    status: Status,
    discount: float,
    r_max: float,
    gap: float,
    message: str = "",
) -> Solution:
    """The solution of a method whose w has no scale of its own: the largest reward gets the size r_max.

    Args:
        problem: the problem.
        w: weights of any scale.
        status: how they came about.
        discount: γ, for the margins.
        r_max: size of the largest reward, relative to the target's.
        gap: the method's own measure of what is left to gain, relative.
        message: what to say of the status.

    Returns:
        The solution; its objective is Σ of the margins.
    """
    largest = float(np.abs(reward(problem.features, problem.expert.target, w)).max())
    scaled = w * (r_max / largest) if largest > 0.0 else w
    states, margin = margin_of(problem, scaled, discount)
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
        message=message,
    )


def deviations(problem: MaxMarginProblem) -> Bool[np.ndarray, "states 4"]:
    """Actions that lead to a better or a worse outcome than the expert's; ties are as good as its own."""
    return problem.expert.suboptimal | problem.expert.better
