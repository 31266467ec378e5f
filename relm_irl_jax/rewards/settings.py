"""Settings of rewards: hand-made, learned from demonstrations, predicted, and for hindsight relabelling."""

from pathlib import Path
from typing import Literal

from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import (
    Discount,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    RealNumber,
    UnitInterval,
)
from relm_irl_jax.irl import IrlMethodSettings, MaxMarginSettings


@dataclass(frozen=True)
class ManualSettings:
    """The hand-made reward of the RL baseline."""

    target: RealNumber = 10.0
    """Reward for reaching the target."""
    collision: RealNumber = -0.1
    """Reward for an action that collides."""
    step: RealNumber = -0.01
    """Reward for any other action."""


@dataclass(frozen=True)
class IrlSettings(IrlMethodSettings):
    """Demonstrations, and inverse reinforcement learning from them."""

    max_margin: MaxMarginSettings = MaxMarginSettings(regularisation=10.0, compare_with_lp=False)
    """The maximum-margin program; its form, discount and r_max apply to all methods. With λ = 10, solutions keep
    most of the linear program's objective, and predicted rewards rank new targets far higher than with a smaller λ."""
    demonstrations: Path | None = None
    """File of recorded demonstrations as JSON lines. They replace the expert's for the training targets that they lead
    to; those that lead elsewhere are not used. If they are not shortest paths, `irl.max_margin.penalty` must be 2."""
    trajectories: PositiveInt = 16
    """Expert trajectories for each training target, from distinct random starts."""
    pooling: Literal["target", "trajectory"] = "target"
    """One problem for all trajectories to a target, or one for each trajectory."""
    dimension: NonNegativeInt = 64
    """Number of principal components of the view features that form φ; 0 uses all of them."""
    sub_trajectories: bool = True
    """Whether states along the demonstrations serve as further targets for the extreme learning machine: every part of
    a shortest path is a shortest path."""
    minimum_cost: UnitInterval = 0.6
    """Smallest cost of a step in the learned reward, as a share of r_max; with 0, the agent can stay in states without
    cost. The larger it is, the nearer are optimal paths under predicted rewards to shortest paths."""
    cost_horizon: PositiveFloat = 6.0
    """Agents that learn values divide learned rewards by r_max times this number of steps. Larger returns train less
    reliably, smaller ones are dominated by the entropy bonus."""
    processes: NonNegativeInt = 0
    """Processes that solve problems in parallel; 0 for one on each core, or for joblib's configuration."""


@dataclass(frozen=True)
class ElmSettings:
    """The extreme learning machine that predicts reward weights."""

    hidden: PositiveInt = 1950
    """Hidden neurons before selection (1950 in the paper)."""
    activation: Literal["tanh", "sigmoid", "relu", "rbf"] = "tanh"
    """Activation of the hidden neurons."""
    pairs: PositiveInt = 2000
    """Largest number of (start, target) pairs to fit; if there are more, a random subset is used."""
    ordering: Literal["mrsr", "none"] = "mrsr"
    """Order of the regularised regressor's neurons: by MRSR, or random (`none`)."""
    norm: Literal[1, 2] = 1
    """Norm of the cumulative correlation in MRSR; 1 in the paper."""
    selection: Literal["press", "none"] | PositiveInt = "press"
    """Neurons that the regularised regressor keeps: the minimum of the PRESS curve, all (`none`), or a number."""
    ridge: NonNegativeFloat | Literal["press"] = 0.0
    """Ridge penalty on the regularised regressor's output weights, or `press` to choose it by PRESS."""
    leave_out: Literal["pair", "target"] = "pair"
    """What PRESS leaves out at a time: one pair, as in the paper, or all pairs of one target. Pairs of one target have
    similar weights; with `pair`, the remaining pairs reveal the weights of the one left out, and more neurons are kept
    than is best for new targets."""
    predict_from: Literal["start", "current"] = "start"
    """View from which weights are predicted: the first of the episode, or the current one ("adjusted in real time",
    section 4.2)."""


@dataclass(frozen=True)
class GoalSettings:
    """Goals of hindsight relabelling, for agents that use it."""

    hindsight: Literal["none", "strict", "open"] = "strict"
    """States that may be goals, if the method has a reward for them: only the training targets (`none`), all states
    except evaluation targets (`strict`), or all states (`open`)."""
    imagine: bool = True
    """Whether ELM-IRL and RELM-IRL, which predict rewards for any pair of views, use the goals of `strict` if
    `hindsight` is `none`. RL and IRL then have the training targets only."""
    arrival: Literal["told", "reward-alone"] = "told"
    """Whether ELM-IRL and RELM-IRL are told which state a goal is, or the predicted reward alone says which views are
    the target's. For all other methods, and for the control, both are the same."""
    cost_limit: PositiveFloat = 0.05
    """With `reward-alone`, the predicted cost above which a view is not the target's, as a share of r_max."""
    discount: Discount = 0.95
    """With `reward-alone`, the discount factor by which a view that pays less is given up for one that is farther."""
