"""Maximum-entropy IRL (Ziebart et al., 2008), causal and discounted, by soft value iteration.

The most random behaviour that matches the expert's feature expectations acts by exp(Q − V) with

    Q(s, a) = w·ψ(s) + γ V(s'),    V(s) = log Σ_a exp Q(s, a),    V(g) = 0,

and its w minimises the convex  E[V(s₀)] − w·μ_E + ½λ‖w‖²  over the starts S₀, whose gradient is the soft
policy's feature expectations less the expert's, plus λw. V is a fixed point of a contraction; its gradient
solves one linear system.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from pydantic import PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass as settings_dataclass
from scipy.optimize import minimize

from relm_irl_jax.irl.control import bounded_solution
from relm_irl_jax.irl.expectations import feature_expectations
from relm_irl_jax.irl.problem import MaxMarginProblem, Solution, Status, check_problem, relative_features


@settings_dataclass(frozen=True)
class MaxEntSettings:
    """How maximum-entropy IRL proceeds."""

    regularisation: PositiveFloat = 1e-4
    """λ; without it a deterministic expert drives w to infinity."""
    iterations: PositiveInt = 500
    """Most steps of L-BFGS."""
    tolerance: PositiveFloat = 1e-4
    """Size of the gradient, relative to the expert's feature expectations, at which to stop."""


def maximum_entropy(
    problem: MaxMarginProblem,
    settings: MaxEntSettings | None = None,
    discount: float = 0.99,
    r_max: float = 1.0,
) -> Solution:
    """Learn weights by maximum-entropy IRL.

    Args:
        problem: the expert and the starts.
        settings: regulariser and limits; the defaults where None.
        discount: γ.
        r_max: size of the largest reward.

    Returns:
        The solution. Its gap is the size of the gradient, relative to the expert's feature expectations.
    """
    settings = settings or MaxEntSettings()
    check_problem(problem)
    target, starts = problem.expert.target, np.unique(problem.states)
    relative = relative_features(problem.features, target)
    expert = feature_expectations(relative, problem.expert.next_state, discount)[starts].mean(axis=0)
    weight = np.zeros(len(relative))
    weight[starts] = 1.0 / len(starts)
    size = max(float(np.abs(expert).max()), np.finfo(np.float64).tiny)
    with jax.enable_x64(True):
        scene = tuple(map(jnp.asarray, (relative, problem.successors, weight)))

        def loss(w):
            value, visits = _soft_values(jnp.asarray(w), *scene, target=target, discount=discount)
            objective = float(value) - w @ expert + 0.5 * settings.regularisation * w @ w
            return float(objective), np.asarray(visits) - expert + settings.regularisation * w

        found = minimize(
            loss,
            np.zeros(len(expert)),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": settings.iterations, "gtol": settings.tolerance * size, "ftol": 0.0},
        )
        gap = float(np.abs(loss(found.x)[1]).max()) / size
    status = Status.OPTIMAL if gap <= settings.tolerance else Status.NOT_CONVERGED
    status = Status.INACCURATE if settings.tolerance < gap <= 100 * settings.tolerance else status
    return bounded_solution(problem, found.x, status, discount, r_max, gap)


@partial(jax.jit, static_argnames=("target", "discount"))
def _soft_values(
    w: Float[Array, "d"],
    features: Float[Array, "states d"],
    successors: Int[Array, "states 4"],
    weight: Float[Array, "states"],
    *,
    target: int,
    discount: float,
) -> tuple[Float[Array, ""], Float[Array, "d"]]:
    """Mean soft value of the starts, and the soft policy's feature expectations."""
    away = jnp.arange(len(features)) != target
    rewards = features @ w

    def quality(value):
        return rewards[:, None] + discount * value[successors]

    def improve(carry):
        value, _ = carry
        updated = jnp.where(away, jax.nn.logsumexp(quality(value), axis=1), 0.0)
        return updated, jnp.abs(updated - value).max()

    def goes_on(carry):
        value, change = carry
        return change > 1e-11 * jnp.maximum(1.0, jnp.abs(value).max())

    value, _ = jax.lax.while_loop(goes_on, improve, (jnp.zeros_like(rewards), jnp.asarray(jnp.inf, rewards.dtype)))
    policy = jax.nn.softmax(quality(value), axis=1) * away[:, None]
    n = len(features)
    transition = jnp.zeros((n, n), rewards.dtype).at[jnp.arange(n)[:, None], successors].add(policy)
    visits = jnp.linalg.solve(jnp.eye(n, dtype=rewards.dtype) - discount * transition.T, weight)
    return weight @ value, (visits * away) @ features
