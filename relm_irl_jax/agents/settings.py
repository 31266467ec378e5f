"""Settings of the agents and of their training.

Numbers that do not change the shape of an array are passed to compiled functions as arrays (the `hyperparameters` of
each agent), so that changing them compiles nothing again.
"""

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.frames import Frames

Discount = Annotated[float, Field(gt=0, lt=1)]


@dataclass(frozen=True)
class SiameseSettings:
    """Network and optimiser of the paper's agent, the siamese actor-critic."""

    width: PositiveInt = 512
    """Units of each hidden layer."""
    history: PositiveInt = 1
    """Number of last views that the network observes; the paper's is one, the original target-driven agent's four."""
    observe_reward: bool = False
    """Whether the fusion layer also receives the reward that ELM-IRL or RELM-IRL predicts for the current view and the
    target; the other methods predict none, and receive 0."""
    initialisation: Literal["he", "uniform"] = "he"
    """Initial weights: He's normal ones, with small ones for the policy; or the original agent's, uniform in
    ±1/√inputs, whose smaller activations suit its step size."""
    heads: Literal["room_type", "shared", "scene"] = "room_type"
    """Which scenes share the last hidden layer, the policy and the value. `scene` is the original agent's choice, which
    leaves scenes that were not trained without a head."""
    workers: PositiveInt = 512
    """Workers that step in lockstep, split evenly over the heads. More workers run more frames a second, and the
    hand-made reward then needs more frames to discover the farthest targets: 5M with 512."""
    t_max: PositiveInt = 20
    """Steps of each worker in an update (the paper's t_max). Once an update has more frames than there are pairs of a
    state and a target, more of them cost nothing; but fewer updates learn less."""
    discount: Discount = 0.99
    """Discount of the return."""
    optimizer: Literal["adam", "rmsprop"] = "adam"
    """`rmsprop` is the original agent's, with decay 0.99, 0.1 inside the root and a mean square that starts at 1, which
    together are close to gradient descent."""
    gradient: Literal["mean", "sum"] = "mean"
    """Mean or sum of the gradients of all workers' steps. The original agent applies each worker's sum over t_max steps
    by itself; the `sum` moves as far when all workers update at once. Adam does not depend on the scale."""
    learning_rate: PositiveFloat = 1e-3
    """Step size."""
    decay_frames: Frames | None = None
    """Frames over which the step size falls linearly to 0; None for a constant one."""
    gradient_clip: PositiveFloat = 40.0
    """Largest global norm of a gradient; for each worker, where gradients are summed."""
    value_weight: PositiveFloat = 0.25
    """Weight of the squared value error beside the policy loss."""
    entropy_weight: NonNegativeFloat = 0.03
    """Weight of the policy's entropy. With 0.01 the hand-made reward leaves targets of the largest rooms undiscovered:
    avoiding collisions by turning in place is learned first (success 0.89 after 3M frames; 1.00 with 0.03)."""
    seeds_at_once: Literal["auto", "always", "never"] = "auto"
    """Whether all seeds of a method train in one program. An accelerator trains several in little more time, and `auto`
    then does; a CPU gains nothing, and several devices share the workers of one seed."""


@dataclass(frozen=True)
class MetricSettings:
    """Network and optimiser of the metric agent, which learns distances between views."""

    counts: Literal["steps", "costs"] = "steps"
    """What the distance says about the path that the method's reward prefers: its number of steps, or its cost.
    Predicted costs differ between the two directions of a path, and no embedding fits them as well (RELM-IRL's SPL on
    new targets after 1.2M frames: .68 with steps, .64 with costs)."""
    width: PositiveInt = 512
    """Units of each hidden layer."""
    dimension: PositiveInt = 128
    """Dimension of the embedding of views."""
    groups: PositiveInt = 4
    """The distance is the mean of the Euclidean distances in this many equal parts of the embedding; with 1 it is
    Euclidean, and with `dimension` a sum of absolute differences. Paths on a grid are not straight lines: four parts
    fit them better than one or sixteen (SPL on new targets .74, .72 and .71 after 300 updates)."""
    symmetric: bool = True
    """Whether the distance is the same in both directions; worlds in which a step cannot be taken back need one that
    is not."""
    workers: PositiveInt = 256
    """Workers that step in lockstep, split evenly over the scenes."""
    t_max: PositiveInt = 16
    """Steps of each worker in an update."""
    states: PositiveInt = 64
    """States of each scene that an update draws."""
    goals: PositiveInt = 128
    """Goals of each scene that an update draws. The loss covers all pairs of the drawn states and goals."""
    learning_rate: PositiveFloat = 1e-3
    """Adam's largest step size; it falls to a fiftieth along a cosine."""
    policy_weight: NonNegativeFloat = 5.0
    """Weight of the policy's agreement with the best actions, beside the error in distances. Distances place a view
    that is never a goal, the policy loss sharpens paths (SPL on new targets .79, .81 and .78 with 1, 5 and 10)."""
    tolerance: NonNegativeFloat = 0.5
    """Costs to go that differ by no more than this many mean steps count as equal: predicted costs are not exact
    enough to tell them apart (RELM-IRL's SPL on new targets after 1.2M frames: .68 with 0, .72 with a half)."""
    successor_weight: NonNegativeFloat = 0.1
    """Weight of the distance between successor embeddings and the embeddings of the states that the actions led to. It
    places a view that is never a goal between its neighbours (SPL on new targets .56 without it, .70 with it, after
    300 updates)."""
    inverse_temperature: PositiveFloat = 2.0
    """Factor of the distances in the policy's logits while training."""
    evaluation_inverse_temperature: PositiveFloat = 6.0
    """The same in evaluation."""


@dataclass(frozen=True)
class LogSettings:
    """What a training leaves behind while it is under way."""

    checkpoint_minutes: NonNegativeFloat = 1.0
    """Minutes between two checkpoints, from which an interrupted training continues; 0 for one after every chunk of
    updates."""
    tensorboard: bool = True
    """Whether the learning curves are also written for TensorBoard."""
