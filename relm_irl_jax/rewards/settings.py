"""Settings of the rewards: hand-made, learned from demonstrations, predicted, and used to relabel goals."""

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.irl import IrlMethodSettings, MaxMarginSettings
from relm_irl_jax.rewards.equation import LinearRewardForm


@dataclass(frozen=True)
class ManualSettings:
    """The hand-made reward of the RL baseline."""

    target: float = 10.0
    """Reward for reaching the target."""
    collision: float = -0.1
    """Reward for an action that collides."""
    step: float = -0.01
    """Reward for any other action."""


@dataclass(frozen=True)
class IrlSettings(IrlMethodSettings):
    """Demonstrations, and inverse reinforcement learning from them."""

    max_margin: MaxMarginSettings = MaxMarginSettings(regularisation=10.0, compare_with_lp=False)
    """The maximum-margin program; its form, discount and r_max hold for all methods. λ = 10 keeps 94% of the linear
    program's objective, and weights predicted for new targets rank them far higher than with a smaller λ."""
    trajectories: PositiveInt = 16
    """Expert trajectories for each training target, from distinct random starts."""
    pooling: Literal["target", "trajectory"] = "target"
    """One problem for all trajectories to a target, or one for each trajectory."""
    dimension: NonNegativeInt = 64
    """Principal components of the view features that make φ; 0 keeps all of them."""
    sub_trajectories: bool = True
    """Let states along the demonstrations serve as further targets for the extreme learning machine: a part of a
    shortest path is a shortest path."""
    minimum_cost: Annotated[float, Field(ge=0, le=1)] = 0.6
    """Smallest cost of a step in the learned reward, as a share of r_max; with 0, states that cost nothing invite the
    agent to stay. Paths that are optimal under predicted rewards are longer than the shortest by 0.9% with 0.3 and by
    0.1% with 0.6, and the metric agent's SPL on new targets is .72 and .80 (RELM-IRL, 1.2M frames)."""
    cost_horizon: PositiveFloat = 6.0
    """Returns of learned rewards are divided by r_max times this many steps before agents learn values from them.
    Larger returns train less reliably, smaller ones are dominated by the entropy bonus (IRL on Task I: SPL 0.92 with
    6, 0.90 with 10)."""
    processes: Annotated[int, Field(ge=0)] = 0
    """Processes that solve problems in parallel; 0 takes one for each core, or what joblib is configured for."""

    def form(self) -> LinearRewardForm:
        """Bounds of the learned reward."""
        r_max = self.max_margin.r_max
        return LinearRewardForm(r_max, self.minimum_cost * r_max, self.max_margin.form == "cost")


@dataclass(frozen=True)
class ElmSettings:
    """The extreme learning machine that predicts reward weights."""

    hidden: PositiveInt = 1950
    """Hidden neurons before selection (the paper's 1950)."""
    activation: Literal["tanh", "sigmoid", "relu", "rbf"] = "tanh"
    """Activation of the hidden neurons."""
    pairs: PositiveInt = 2000
    """Largest number of (start, target) pairs to fit; more are thinned at random."""
    ordering: Literal["mrsr", "none"] = "mrsr"
    """Order in which the regularised regressor adds neurons."""
    norm: Literal[1, 2] = 1
    """Norm of the cumulative correlation in MRSR; the paper's is 1."""
    selection: Literal["press", "none"] | Annotated[int, Field(ge=1)] = "press"
    """Neurons that the regularised regressor keeps: the minimum of the PRESS curve, all, or a number."""
    ridge: NonNegativeFloat | Literal["press"] = 0.0
    """Ridge of the regularised regressor's output weights, or `press` to choose it by PRESS."""
    leave_out: Literal["pair", "target"] = "pair"
    """What PRESS leaves out at a time: one pair, as in the paper, or all pairs of one target, whose weights are alike.
    With the former, the other pairs of a target reveal the weights of the one left out, so that more neurons are kept
    than is good for new targets."""
    predict_from: Literal["start", "current"] = "start"
    """View from which weights are predicted: the episode's first, or the current one ("adjusted in real time",
    section 4.2)."""


@dataclass(frozen=True)
class GoalSettings:
    """States that serve as targets after the fact (hindsight relabelling), for agents that learn from them."""

    hindsight: Literal["none", "strict", "open"] = "strict"
    """States that may be goals, as far as the method's reward covers them: only the training targets (`none`), every
    state but the targets kept for evaluation (`strict`), or every state (`open`)."""
    imagine: bool = True
    """Whether ELM-IRL and RELM-IRL, whose rewards are predicted for any pair of views, take goals as in `strict` where
    `hindsight` is `none`. RL and IRL are rewarded for the training targets alone then."""
