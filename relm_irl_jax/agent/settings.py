"""Settings of the agent and its training."""

from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass

Discount = Annotated[float, Field(gt=0, lt=1)]


@dataclass(frozen=True)
class AgentSettings:
    """Network and optimiser of the actor-critic."""

    width: PositiveInt = 512
    """Units of each hidden layer."""
    heads: Literal["room_type", "shared"] = "room_type"
    """Which scenes share the last hidden layer, the policy and the value."""
    workers: PositiveInt = 256
    """Workers that step in lockstep, split evenly over the heads."""
    t_max: PositiveInt = 16
    """Steps of each worker per update (the paper's t_max)."""
    discount: Discount = 0.99
    """Discount of the return."""
    learning_rate: PositiveFloat = 1e-3
    """Adam's step size."""
    gradient_clip: PositiveFloat = 40.0
    """Greatest global norm of a gradient."""
    value_weight: PositiveFloat = 0.25
    """Weight of the squared value error beside the policy loss."""
    entropy_weight: Annotated[float, Field(ge=0)] = 0.03
    """Weight of the policy's entropy. With 0.01 the hand-made reward leaves targets of the largest rooms undiscovered:
    avoiding collisions by turning in place is learned first (success 0.89 after 3M frames; 1.00 with 0.03)."""
    cost_horizon: PositiveFloat = 6.0
    """Learned rewards cost up to r_max a step; their returns are divided by r_max times this many steps. Larger returns
    train less surely, smaller ones yield to the entropy bonus (IRL on Task I: SPL 0.92 with 6, 0.90 with 10)."""
