"""The linear reward of the paper (Equation 1), relative to the target; all parts of the package compute it here.

    cost form:  r(s, g) = clip( w·(φ(s) − φ(g)), −r_max, −c_min )   for s ≠ g,     r(g, g) = 0
    free form:  r(s, g) = clip( w·φ(s), −r_max, r_max )

An episode ends at the target with a return of 0 (Algorithm 1, line 12). In the cost form this is consistent with the
reward, since r(g, g) = 0 and all other rewards are negative. In the free form, the paper's |r| ≤ r_max, rewards away
from the target may be positive, and staying there may then be optimal.
"""

from dataclasses import dataclass, field
from typing import Any, TypeVar

import jax
import numpy as np
from jaxtyping import Array, Float, Float64, Int

from relm_irl_jax.rewards.settings import IrlSettings

Scalar = float | Float[Array, ""]

AnyArray = TypeVar("AnyArray", np.ndarray, Array)
"""NumPy or JAX arrays; the result has the type of the arguments."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LinearRewardForm:
    """Bounds of the linear reward.

    Attributes:
        r_max: largest cost of a step; in the free form, the bound of |r|.
        minimum_cost: c_min, smallest cost of a step that does not reach the target, in the same units as `r_max`.
        relative: whether φ(g) is subtracted (cost form). Static.
    """

    r_max: Scalar
    minimum_cost: Scalar
    relative: bool = field(metadata={"static": True})


def form_of(settings: IrlSettings) -> LinearRewardForm:
    """Bounds of the reward that inverse reinforcement learning finds.

    Args:
        settings: settings of inverse reinforcement learning.
    """
    r_max = settings.max_margin.r_max
    return LinearRewardForm(r_max, settings.minimum_cost * r_max, settings.max_margin.form == "cost")


def unclipped_reward(weights: AnyArray, phi: AnyArray, target_phi: AnyArray, form: LinearRewardForm) -> AnyArray:
    """The linear reward before clipping, which orders states even if their clipped rewards are equal.

    Args:
        weights: w, [d] for all states or [states d].
        phi: φ of the states, [d] or [states d].
        target_phi: φ of the target, [d].
        form: the form.

    Returns:
        w·(φ(s) − φ(g)), or w·φ(s) in the free form; [] or [states].
    """
    namespace: Any = phi.__array_namespace__()
    return namespace.vecdot(weights, phi - target_phi if form.relative else phi)


def paid_share(
    weights: Float64[np.ndarray, "targets d"],
    phi: Float64[np.ndarray, "states d"],
    target: Int[np.ndarray, "targets"],
    form: LinearRewardForm,
    limit: float,
) -> Float64[np.ndarray, "targets states"]:
    """How much of r_max each view is paid where the reward alone says that it is the target's.

        p(s, g) = clip( 1 + ŵ·(φ(s) − φ(g)) / (limit · r_max), 0, 1 )

    Args:
        weights: ŵ of each target.
        phi: φ of the states.
        target: target states.
        form: bounds and form.
        limit: cost above which nothing is paid, as a share of r_max.

    Returns:
        The shares.
    """
    values = np.stack([unclipped_reward(w, phi, phi[g], form) for w, g in zip(weights, target, strict=True)])
    relative = values - values[np.arange(len(target)), target][:, None]
    return np.clip(1.0 + relative / (limit * float(form.r_max)), 0.0, 1.0)


def linear_reward(
    weights: AnyArray, phi: AnyArray, target_phi: AnyArray, at_target: AnyArray, form: LinearRewardForm
) -> AnyArray:
    """The reward that an agent receives for arriving in a state.

    Args:
        weights: w, [d] for all states or [states d].
        phi: φ of the states, [d] or [states d].
        target_phi: φ of the target, [d].
        at_target: whether each state is the target, [] or [states].
        form: bounds and form.

    Returns:
        r(s, g), [] or [states].
    """
    namespace: Any = phi.__array_namespace__()
    reward = unclipped_reward(weights, phi, target_phi, form)
    if not form.relative:
        return namespace.clip(reward, -form.r_max, form.r_max)
    cost = namespace.clip(reward, -form.r_max, -form.minimum_cost)
    return namespace.where(at_target, namespace.zeros_like(cost), cost)
