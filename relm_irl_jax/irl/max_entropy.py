"""Maximum-entropy inverse reinforcement learning (Ziebart et al., 2008), causal, discounted, by soft value iteration.

The policy of maximum entropy that matches the expert's feature expectations chooses action a with probability
exp(Q(s, a) − V(s)), where

    Q(s, a) = w·ψ(s) + γ V(s'),    V(s) = log Σ_a exp Q(s, a),    V(g) = 0.

Its w minimises the convex function  E[V(s₀)] − w·μ_E + ½λ‖w‖²  over the states S₀. The gradient is the feature
expectations of the soft policy minus the expert's μ_E, plus λw. V is the fixed point of a contraction; the feature
expectations solve one linear system.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from scipy.optimize import minimize

from relm_irl_jax.irl.expectations import mean_feature_expectations
from relm_irl_jax.irl.problem import MaxMarginProblem, check_problem, relative_features, start_distribution
from relm_irl_jax.irl.settings import MaxEntropySettings
from relm_irl_jax.irl.solution import Solution, Status, normalised_solution

MAX_ITERATIONS = 500
"""Maximum number of L-BFGS steps."""

TOLERANCE = 1e-4
"""Largest entry of the gradient at which to stop, relative to the largest entry of μ_E."""


def max_entropy(
    problem: MaxMarginProblem,
    settings: MaxEntropySettings | None = None,
    *,
    discount: float = 0.99,
    r_max: float = 1.0,
) -> Solution:
    """Learn weights by maximum-entropy inverse reinforcement learning.

    Args:
        problem: the expert and the states S₀.
        settings: the regulariser; the default if None.
        discount: γ.
        r_max: size of the largest reward.

    Returns:
        The solution. Its gap is the largest entry of the gradient, relative to the largest entry of μ_E.

    Raises:
        InputError: the problem is ill posed.
    """
    settings = settings or MaxEntropySettings()
    check_problem(problem)
    target, states = problem.expert.target, np.unique(problem.states)
    relative = relative_features(problem.features, target)
    expert = mean_feature_expectations(relative, problem.expert.next_state, discount, states)
    size = max(float(np.abs(expert).max()), np.finfo(np.float64).tiny)
    with jax.enable_x64(True):
        arrays = (relative, problem.successors, start_distribution(problem), np.asarray(target), np.asarray(discount))
        arguments = tuple(map(jnp.asarray, arrays))

        def loss(w):
            value, visits = _soft_values(jnp.asarray(w), *arguments)
            objective = float(value) - w @ expert + 0.5 * settings.regularisation * w @ w
            return float(objective), np.asarray(visits) - expert + settings.regularisation * w

        minimum = minimize(
            loss,
            np.zeros(len(expert)),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": MAX_ITERATIONS, "gtol": TOLERANCE * size, "ftol": 0.0},
        )
        gap = float(np.abs(loss(minimum.x)[1]).max()) / size
    status = Status.OPTIMAL if gap <= TOLERANCE else Status.NOT_CONVERGED
    status = Status.INACCURATE if TOLERANCE < gap <= 100 * TOLERANCE else status
    return normalised_solution(problem, minimum.x, status, discount=discount, r_max=r_max, gap=gap)


@jax.jit
def _soft_values(
    w: Float[Array, "d"],
    features: Float[Array, "states d"],
    successors: Int[Array, "states 4"],
    distribution: Float[Array, "states"],
    target: Int[Array, ""],
    discount: Float[Array, ""],
) -> tuple[Float[Array, ""], Float[Array, "d"]]:
    """Mean soft value of the states S₀, and the feature expectations of the soft policy."""
    away = jnp.arange(len(features)) != target
    rewards = features @ w

    def quality(value):
        return rewards[:, None] + discount * value[successors]

    def improve(carry):
        value, _ = carry
        updated = jnp.where(away, jax.nn.logsumexp(quality(value), axis=1), 0.0)
        return updated, jnp.abs(updated - value).max()

    def not_converged(carry):
        value, change = carry
        return change > 1e-11 * jnp.maximum(1.0, jnp.abs(value).max())

    value, _ = jax.lax.while_loop(
        not_converged, improve, (jnp.zeros_like(rewards), jnp.asarray(jnp.inf, rewards.dtype))
    )
    policy = jnp.where(away[:, None], jax.nn.softmax(quality(value), axis=1), 0.0)
    n = len(features)
    transition = jnp.zeros((n, n), rewards.dtype).at[jnp.arange(n)[:, None], successors].add(policy)
    visits = jnp.linalg.solve(jnp.eye(n, dtype=rewards.dtype) - discount * transition.T, distribution)
    return distribution @ value, jnp.where(away, visits, 0.0) @ features
