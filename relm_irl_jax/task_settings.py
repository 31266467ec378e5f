"""Settings of the tasks and of their evaluation; importing them loads neither NumPy nor JAX."""

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import NonNegativeInt, PositiveInt


@dataclass(frozen=True)
class TaskSettings:
    """Numbers of training and evaluation targets, and the step cap."""

    training_targets: PositiveInt = 20
    """Training targets, distributed over the training scenes (20 in the paper)."""
    new_targets_per_scene: Annotated[PositiveInt, Field(ge=2)] = 8
    """Task II targets in each training scene: half near a training target, half best views of other objects."""
    cap: PositiveInt = 100
    """Steps after which an episode is truncated. The paper's text says 5000, but its tables fit 100."""


@dataclass(frozen=True)
class EvaluationSettings:
    """How trained agents are evaluated."""

    episodes: PositiveInt = 1000
    """Episodes in each scene."""
    new_targets: Literal["paper", "uniform"] = "paper"
    """Task II targets: near a training target or an object's best view (`paper`), or drawn uniformly (`uniform`)."""
    policy: Literal["sample", "greedy"] = "sample"
    """Draw actions from the policy (`sample`), or take the most probable one (`greedy`)."""
    inner_steps: NonNegativeInt | None = None
    """Largest number of changes of the agent savn's weights in an episode; by default as many as in training."""
