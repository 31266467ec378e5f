"""Settings of the agents and their training."""

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass

Discount = Annotated[float, Field(gt=0, lt=1)]


@dataclass(frozen=True)
class SiameseSettings:
    """Network and optimiser of the paper's agent, the siamese actor-critic."""

    width: PositiveInt = 512
    """Units of each hidden layer."""
    history: PositiveInt = 1
    """Last views that the network sees at once; the paper's is one, the original target-driven agent's four."""
    fusion: Literal["concatenation", "comparison"] = "concatenation"
    """What the fusion layer sees: the encodings of view and target side by side, as in the paper, or also the product,
    which tells how alike they are."""
    sees_reward: bool = False
    """Whether the fusion layer also sees the reward that ELM-IRL or RELM-IRL predicts for the current view and the
    target; other methods predict none, and see 0."""
    initial: Literal["he", "uniform"] = "he"
    """Weights at first: He's normal ones, with small ones for the policy; or the original agent's, uniform between
    ±1/√inputs, whose smaller activations its step size is made for."""
    heads: Literal["room_type", "shared", "scene"] = "room_type"
    """Which scenes share the last hidden layer, the policy and the value. `scene` is the original agent's choice, which
    leaves scenes that were not trained without a head."""
    workers: PositiveInt = 512
    """Workers that step in lockstep, split evenly over the heads. The more there are, the more frames a second, and the
    more frames the hand-made reward needs to discover the farthest targets: 5M with 512."""
    t_max: PositiveInt = 20
    """Steps of each worker per update (the paper's t_max). Once an update has more frames than there are pairs of a
    state and a target, more of them cost nothing; but the fewer updates there are, the less is learned."""
    discount: Discount = 0.99
    """Discount of the return."""
    optimizer: Literal["adam", "rmsprop"] = "adam"
    """`rmsprop` is the original agent's, with decay 0.99, 0.1 inside the root and a mean square that begins at 1, which
    together are close to gradient descent."""
    gradient: Literal["mean", "sum"] = "mean"
    """What an update follows, of the gradients of all workers' steps. The original agent applies each worker's sum over
    t_max steps by itself: workers that update at once go as far with the `sum`. Adam does not care for the scale."""
    learning_rate: PositiveFloat = 1e-3
    """Step size."""
    decay_frames: PositiveInt | None = None
    """Frames over which the step size falls to nothing along a line; None for a constant one."""
    gradient_clip: PositiveFloat = 40.0
    """Greatest global norm of a gradient; for each worker, where they are summed."""
    value_weight: PositiveFloat = 0.25
    """Weight of the squared value error beside the policy loss."""
    entropy_weight: NonNegativeFloat = 0.03
    """Weight of the policy's entropy. With 0.01 the hand-made reward leaves targets of the largest rooms undiscovered:
    avoiding collisions by turning in place is learned first (success 0.89 after 3M frames; 1.00 with 0.03)."""
    seeds_at_once: Literal["auto", "always", "never"] = "auto"
    """Whether all seeds of a method train in one program. One accelerator takes several in little more time, and `auto`
    has it do so; a processor gains nothing, and several devices share the workers of one seed."""
    cost_horizon: PositiveFloat = 6.0
    """Learned rewards cost up to r_max a step; their returns are divided by r_max times this many steps. Larger returns
    train less surely, smaller ones yield to the entropy bonus (IRL on Task I: SPL 0.92 with 6, 0.90 with 10)."""


@dataclass(frozen=True)
class MetricSettings:
    """Network, hindsight and optimiser of the metric agent."""

    hindsight: Literal["none", "strict", "open"] = "strict"
    """Views that the agent sets itself as targets, as far as its method's reward can price the way: only the training
    targets; every view met but those kept for evaluation; or every view met."""
    imagine: bool = True
    """Whether ELM-IRL and RELM-IRL, whose rewards are predicted for any pair of views, imagine targets also without
    hindsight (`none`): every view met but those kept for evaluation. RL and IRL are rewarded for the training targets
    alone then."""
    counts: Literal["steps", "costs"] = "steps"
    """What the distance says of the way that the method's reward prefers: how many steps it has, or what it costs.
    Predicted costs differ between the way there and the way back, and fit no space of distances as well (RELM-IRL's
    SPL on new targets after 1.2M frames: .68 with steps, .64 with costs)."""
    width: PositiveInt = 512
    """Units of each hidden layer."""
    dimension: PositiveInt = 128
    """Dimension of the embedding of views."""
    groups: PositiveInt = 4
    """The distance is the mean of the Euclidean distances in this many equal parts of the embedding; with 1 it is
    Euclidean, and with `dimension` a sum of absolute differences. Walks on a grid are no straight lines: several parts
    fit them better than one or sixteen (SPL on new targets .74, .72 and .71 after 300 updates)."""
    distance: Literal["euclidean", "interval"] = "euclidean"
    """What a part of the embedding measures: a Euclidean distance, or the length of a union of intervals, which can
    represent any distances, the way back longer than the way there or not."""
    symmetric: bool = True
    """Whether the Euclidean way back is as long as the way there; worlds in which a step cannot be taken back need a
    distance that is not."""
    bootstrap: bool = False
    """Whether a distance learns from the cost of a step and the learned distance behind it (temporal differences);
    otherwise from the least costs to go that dynamic programming finds on the experience graph."""
    workers: PositiveInt = 256
    """Workers that step in lockstep, split evenly over the scenes."""
    t_max: PositiveInt = 16
    """Steps of each worker per update."""
    states: PositiveInt = 64
    """States of each scene that an update draws."""
    goals: PositiveInt = 128
    """Goals of each scene that an update draws; all pairs of both are learned from."""
    target_share: Annotated[float, Field(ge=0, le=1)] = 0.25
    """Share of them drawn from the training targets alone, the others from all goals (SPL on trained targets .93
    without, 1.00 with a quarter; on new ones .90 and .89)."""
    learning_rate: PositiveFloat = 1e-3
    """Adam's greatest step size; it falls to a fiftieth along a cosine."""
    gradient_clip: PositiveFloat = 10.0
    """Greatest global norm of a gradient."""
    choice_weight: NonNegativeFloat = 5.0
    """Weight of the policy's agreement with the best actions, beside the error in distances. Distances place a view
    that is never a goal, choices sharpen the way (SPL on new targets .79, .81 and .78 with 1, 5 and 10)."""
    tolerance: NonNegativeFloat = 0.5
    """Costs to go that differ by no more than this many mean steps are equally good: predicted costs are not exact
    enough to tell them apart (RELM-IRL's SPL on new targets after 1.2M frames: .68 with 0, .72 with a half)."""
    successor_weight: NonNegativeFloat = 0.1
    """Weight of the successor embeddings' distance from the embeddings of the states met behind each action. It
    places a view that is never a goal between its neighbours (SPL on new targets .56 without it, .70 with it, after
    300 updates)."""
    sharpness: PositiveFloat = 2.0
    """Factor of the distances in the policy's logits while training."""
    acting_sharpness: PositiveFloat = 6.0
    """The same in evaluation."""


@dataclass(frozen=True)
class RecordSettings:
    """What a training leaves behind while it is under way."""

    checkpoint_minutes: NonNegativeFloat = 1.0
    """Minutes between two checkpoints, from which a training that was cut off goes on; 0 for one after every chunk of
    updates."""
    tensorboard: bool = True
    """Whether the learning curves are written for TensorBoard, too."""
