"""Settings of the agents and of their training.

Numbers that do not change the shape of an array are passed to compiled functions as arrays, so that changing them does
not compile again.
"""

from typing import Literal

from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import Discount, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt, UnitInterval

FRAMES = {"siamese": 6_000_000, "metric": 5_000_000, "map": 256_000, "recurrent": 5_000_000, "savn": 5_000_000}
"""Training frames of each agent, unless the configuration says otherwise."""


@dataclass(frozen=True)
class SiameseSettings:
    """The paper's agent, the siamese actor-critic: network and optimiser."""

    width: PositiveInt = 256
    """Units of each hidden layer."""
    history: PositiveInt = 1
    """Number of last views that the network observes: one in the paper, four in the original target-driven agent."""
    observe_reward: bool = False
    """Whether the fusion layer also receives the reward that ELM-IRL or RELM-IRL predicts for the current view and the
    target; it receives 0 with other methods."""
    initialisation: Literal["he", "uniform", "distance"] = "distance"
    """Initial weights: He's normal distribution, with small weights for the policy (`he`), the original agent's uniform
    distribution on ±1/√inputs (`uniform`), whose smaller activations suit the original step size, or He's with a fusion
    layer and values that begin as a distance between the two views (`distance`), which many targets need."""
    heads: Literal["room_type", "shared", "scene"] = "shared"
    """Which scenes share the last hidden layer, the policy and the value. With `scene`, as
    in the original agent, scenes that were not trained have none."""
    workers: PositiveInt = 1024
    """Workers in lockstep, divided evenly among the heads."""
    t_max: PositiveInt = 10
    """Steps of each worker in an update (the paper's t_max)."""
    discount: Discount = 0.95
    """Discount factor of the return."""
    optimizer: Literal["adam", "rmsprop"] = "adam"
    """Adam, or the original agent's RMSProp, with decay 0.99, 0.1 inside the root and an initial mean square of 1,
    which is close to gradient descent."""
    gradient: Literal["mean", "sum"] = "mean"
    """Mean or sum of the gradients of all workers' steps. `sum` is the original agent's; Adam does not depend on it."""
    learning_rate: PositiveFloat = 3e-3
    """Step size."""
    decay: Literal["linear", "none"] = "linear"
    """Whether the step size decreases linearly to 0 over the training."""
    gradient_clip: PositiveFloat = 40.0
    """Largest global norm of a gradient; multiplied by the number of workers if gradients are summed."""
    value_weight: PositiveFloat = 0.25
    """Weight of the squared value error, relative to the policy loss."""
    entropy_weight: NonNegativeFloat = 0.03
    """Weight of the policy's entropy."""
    imagine: Literal["none", "told", "reward-alone"] = "reward-alone"
    """Whether the agent also trains on imagined targets, views of the training scenes that no task evaluates on.
    `told`: the simulator ends an episode at an imagined view; RL, ELM-IRL, RELM-IRL and the control with a constant
    cost use them. `reward-alone`: only the predicted reward of ELM-IRL and RELM-IRL tells of arrivals; the control is
    then paid where the view equals the target's. All others train on the given targets, and are told."""
    imagined_targets: PositiveInt = 1000
    """Largest number of imagined targets of each scene."""
    scenes_at_once: PositiveInt = 6
    """Scenes of an update with imagined targets, at most."""
    targets_at_once: PositiveInt = 4
    """Targets of each of these scenes in the update."""
    given_share: UnitInterval = 0.25
    """Share of given targets among those of an update. With `reward-alone`, nothing tells of arrivals there either, and
    fewer draws do not suffice. With `told`, 0.1 does, and more draws attract agents that look for a view near a given
    target."""
    near_starts: UnitInterval = 0.5
    """Share of episodes with imagined targets that start a random walk away from the target."""
    cost_limit: PositiveFloat = 0.05
    """With `reward-alone`, the predicted cost above which costs are equal, as a share of r_max."""
    seeds_at_once: Literal["auto", "always", "never"] = "auto"
    """Whether all seeds of a method train in one program. `auto` does so on a single accelerator."""


@dataclass(frozen=True)
class MetricSettings:
    """The metric agent, which learns distances between views: network and optimiser."""

    counts: Literal["steps", "costs"] = "steps"
    """Meaning of the distance: the number of steps, or the cost, of the optimal path under the method's reward.
    Predicted costs differ between the two directions of a path, and an embedding fits them less well."""
    width: PositiveInt = 512
    """Units of each hidden layer."""
    dimension: PositiveInt = 128
    """Dimension of the embedding of views."""
    groups: PositiveInt = 4
    """Number of equal parts of the embedding; the distance is the mean of the Euclidean distances in these parts. Paths
    on a grid are not straight lines: four parts fit them better than one or sixteen."""
    symmetric: bool = True
    """Whether the distance is the same in both directions. Set it to false for worlds in which some step cannot be
    undone by one action."""
    workers: PositiveInt = 256
    """Workers that step in lockstep, divided evenly among the scenes."""
    t_max: PositiveInt = 16
    """Steps of each worker in an update."""
    scenes_at_once: PositiveInt = 6
    """Scenes whose distances an update learns, at most; with more training scenes, others are drawn for each update."""
    states: PositiveInt = 64
    """States of each scene that an update draws."""
    goals: PositiveInt = 128
    """Goals of each scene that an update draws. The loss covers all pairs of the drawn states and goals."""
    learning_rate: PositiveFloat = 1e-3
    """Adam's initial step size; it decreases to a fiftieth along a cosine."""
    policy_weight: NonNegativeFloat = 5.0
    """Weight of the policy loss, relative to the squared error of distances. A smaller weight makes paths
    to trained targets longer, a larger one finds fewer new targets."""
    tolerance: NonNegativeFloat = 0.5
    """Largest difference, in mean steps, between costs to go that count as equal: predicted costs are not exact enough
    for smaller differences."""
    successor_weight: NonNegativeFloat = 0.1
    """Weight of the squared distance between successor embeddings and the embeddings of the next states. This term
    embeds a view that is never a goal close to its neighbours; without it far fewer new targets are found."""
    inverse_temperature: PositiveFloat = 2.0
    """Factor of the distances in the policy's logits during training."""
    evaluation_inverse_temperature: PositiveFloat = 6.0
    """Factor of the distances in the policy's logits during evaluation."""


@dataclass(frozen=True)
class MapSettings:
    """The mapping agent, which draws a map while it searches: network, training and search."""

    weights: str = "auto"
    """Weights: those of the package (`package`), a file of weights, or `train` to train them. `auto` means those of the
    package for the built-in rooms, and training for other scenes."""
    rooms: PositiveInt = 600
    """Generated rooms to train on, if `scenes` is `rooms`: numbers from 1000 on, apart from every room of a task. Other
    training uses the training scenes."""
    memory: Literal["empty", "filled"] = "empty"
    """Memory at the start of an episode in a training scene: `filled` with the scene's map of all views that training
    has met, or `empty` as in unseen scenes."""
    walks: PositiveInt = 1
    """Walks of an update, all in one room."""
    views: PositiveInt = 64
    """Distinct views of a walk. The target is located after 1, 2, 4, ... of them."""
    targets: PositiveInt = 24
    """Targets of an update, the same for all walks."""
    best_share: UnitInterval = 0.7
    """Share of the targets that show an object best, as the targets of tasks do; the others are any views."""
    gamma: PositiveFloat = 1.0
    """Exponent of the brightness of all views, in training and search: below 1 it brings out what dark views show, such
    as those of ViZDoom, whose mean is a tenth of full brightness."""
    augmentation: Literal["none", "random-convolution"] = "none"
    """Whether the views of an update, targets too, pass through a convolution with random weights first, new ones for
    each update, so that colours and textures say little."""
    learning_rate: PositiveFloat = 1.5e-3
    """AdamW's largest step size; constant over the first half of the training, then down to 0 along a cosine."""
    weight_decay: NonNegativeFloat = 1e-2
    """AdamW's weight decay."""
    free_weight: NonNegativeFloat = 1.0
    """Weight of the loss of free places, relative to that of the target's pose."""
    discount: Discount = 0.9
    """Discount of a discovery per step."""
    caution: NonNegativeFloat = 3.0
    """Cost of entering a place per unit of log odds against its being free; chosen on rooms that no task uses."""
    confident: UnitInterval = 0.5
    """Probability of a pose above which the agent does not look around at the start."""
    turns: NonNegativeInt = 3
    """Largest number of turns when it looks around at the start."""
    temperature: PositiveFloat = 1.7
    """Divisor of the evidence for a pose: above 1, since neighbouring cells do not err independently. Chosen on rooms
    that no task uses."""


@dataclass(frozen=True)
class RecurrentSettings:
    """The recurrent agent, the siamese actor-critic with a memory of its episode: network and optimiser."""

    cell: Literal["gru", "lstm"] = "gru"
    """Kind of the recurrent cell. A GRU has three quarters of an LSTM's products."""
    width: PositiveInt = 512
    """Units of the layer that current and target view share."""
    memory: PositiveInt = 256
    """Units of the memory, of the fusion layer below it and of a head's hidden layer above it."""
    heads: Literal["room_type", "shared", "scene"] = "room_type"
    """Which scenes share the last hidden layer, the policy and the value, as of the siamese agent."""
    workers: PositiveInt = 512
    """Workers that step in lockstep, divided evenly among the heads."""
    t_max: PositiveInt = 20
    """Steps of each worker in an update. Learning goes back in time to the first of them; the memory itself lasts to
    the end of the episode."""
    discount: Discount = 0.99
    """Discount factor of the return."""
    learning_rate: PositiveFloat = 1e-3
    """Adam's step size."""
    gradient_clip: PositiveFloat = 1.0
    """Largest global norm of a gradient."""
    value_weight: PositiveFloat = 0.25
    """Weight of the squared value error, relative to the policy loss."""
    entropy_weight: NonNegativeFloat = 0.03
    """Weight of the policy's entropy."""


@dataclass(frozen=True)
class SavnSettings(RecurrentSettings):
    """The agent that learns to adapt, the recurrent agent's network with an interaction loss: network and optimiser."""

    t_max: PositiveInt = 24
    """Steps of each worker in an update, a multiple of `interval`. The meta-gradient goes back to the first of them."""
    adapted: Literal["policy", "top"] = "policy"
    """Weights that change during an episode: those of the policy layer, or also those of the hidden layer below it.
    Every episode has weights of its own."""
    inner_steps: NonNegativeInt = 4
    """Largest number of changes in an episode; with 0 the agent is the recurrent one. `evaluation.inner_steps`
    evaluates with another number."""
    interval: PositiveInt = 6
    """Steps after which the weights change, and on which the change depends."""
    inner_rate: PositiveFloat = 0.1
    """Step size of a change."""
    meta_gradient: Literal["first-order", "full"] = "full"
    """Whether the gradient also follows how a change depends on the network's own weights (`full`), or on those of the
    interaction loss alone (`first-order`)."""


@dataclass(frozen=True)
class LogSettings:
    """Checkpoints and TensorBoard files of running trainings."""

    checkpoint_minutes: NonNegativeFloat = 1.0
    """Minutes between checkpoints, from which an interrupted training continues; 0 for a checkpoint after every chunk
    of updates."""
    tensorboard: bool = True
    """Whether to write the learning curves for TensorBoard."""
