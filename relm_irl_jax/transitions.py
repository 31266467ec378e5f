"""What a user's own reward function sees of a transition."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class TransitionFeatures:
    """One transition, as an agent could observe it. Fields are NumPy or JAX arrays.

    Attributes:
        view: features of the view before the action. In an environment that observes frames, this and the two that
            follow are frames.
        next_view: features of the view after the action.
        target: features of the target's view.
        action: number of the action.
        collided: whether the action left the state unchanged.
        arrived: whether the next state is the target.
    """

    view: Any
    next_view: Any
    target: Any
    action: Int[Any, ""]
    collided: Bool[Any, ""]
    arrived: Bool[Any, ""]


FeatureReward = Callable[[TransitionFeatures], Float[Any, ""] | Int[Any, ""] | float]
"""A reward as a pure function of one transition, for example `lambda t: 10 * t.arrived - 0.1 * t.collided - 0.01`.
To be used in training it must be traceable by JAX: `jax.numpy` instead of NumPy, no branches on values."""
