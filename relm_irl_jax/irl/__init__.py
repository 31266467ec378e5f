"""Inverse reinforcement learning: reward weights from expert trajectories.

Names are imported when they are first used, so that the solver's processes load neither JAX nor cvxpy.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import on_first_use

if TYPE_CHECKING:
    from relm_irl_jax.irl.expectations import feature_expectations as feature_expectations
    from relm_irl_jax.irl.methods import MethodSettings as MethodSettings
    from relm_irl_jax.irl.methods import learn as learn
    from relm_irl_jax.irl.problem import MaxMarginProblem as MaxMarginProblem
    from relm_irl_jax.irl.problem import MaxMarginSettings as MaxMarginSettings
    from relm_irl_jax.irl.problem import Solution as Solution
    from relm_irl_jax.irl.problem import Status as Status
    from relm_irl_jax.irl.problem import relative_features as relative_features
    from relm_irl_jax.irl.problem import reward as reward
    from relm_irl_jax.irl.reference import reference_max_margin as reference_max_margin
    from relm_irl_jax.irl.solver import max_margin as max_margin
    from relm_irl_jax.irl.solver import solve_many as solve_many

_HOME = {
    "feature_expectations": "expectations",
    "MethodSettings": "methods",
    "learn": "methods",
    "MaxMarginProblem": "problem",
    "MaxMarginSettings": "problem",
    "Solution": "problem",
    "Status": "problem",
    "relative_features": "problem",
    "reward": "problem",
    "reference_max_margin": "reference",
    "max_margin": "solver",
    "solve_many": "solver",
}

__all__ = sorted(_HOME)

__getattr__ = on_first_use(__name__, _HOME)
