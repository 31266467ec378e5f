"""Inverse reinforcement learning: reward weights from the behaviour of an expert.

`max_margin` and `solve_many` solve the paper's maximum-margin problem (Eq. 1-8); `learn_weights` also offers other
methods. Names are imported on first use, so that the workers of `solve_many` load neither JAX nor cvxpy.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import lazy_getattr

if TYPE_CHECKING:
    from relm_irl_jax.irl.expectations import feature_expectations as feature_expectations
    from relm_irl_jax.irl.methods import WeightsOf as WeightsOf
    from relm_irl_jax.irl.methods import learn_weights as learn_weights
    from relm_irl_jax.irl.methods import learn_weights_by as learn_weights_by
    from relm_irl_jax.irl.parallel import solve_many as solve_many
    from relm_irl_jax.irl.problem import MaxMarginProblem as MaxMarginProblem
    from relm_irl_jax.irl.problem import relative_features as relative_features
    from relm_irl_jax.irl.problem import reward as reward
    from relm_irl_jax.irl.reference import reference_max_margin as reference_max_margin
    from relm_irl_jax.irl.settings import IrlMethodSettings as IrlMethodSettings
    from relm_irl_jax.irl.settings import MaxMarginSettings as MaxMarginSettings
    from relm_irl_jax.irl.solution import Solution as Solution
    from relm_irl_jax.irl.solution import Status as Status
    from relm_irl_jax.irl.solver import max_margin as max_margin

_MODULES = {
    "feature_expectations": "expectations",
    "IrlMethodSettings": "settings",
    "learn_weights": "methods",
    "learn_weights_by": "methods",
    "WeightsOf": "methods",
    "solve_many": "parallel",
    "MaxMarginProblem": "problem",
    "MaxMarginSettings": "settings",
    "relative_features": "problem",
    "reward": "problem",
    "reference_max_margin": "reference",
    "Solution": "solution",
    "Status": "solution",
    "max_margin": "solver",
}

__all__ = sorted(_MODULES)

__getattr__ = lazy_getattr(__name__, _MODULES)
