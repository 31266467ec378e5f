"""Predicted rewards: the extreme learning machine from (start view, target view) to reward weights (section 4.2)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float32, Float64, Int
from pydantic import Field, NonNegativeFloat, PositiveInt
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.demonstrations import DemonstratedReward
from relm_irl_jax.scenes.scene import Scene


@settings_dataclass(frozen=True)
class ElmSettings:
    """The extreme learning machine that predicts reward weights."""

    hidden: PositiveInt = 1950
    """Hidden neurons before selection (the paper's 1950)."""
    activation: Literal["tanh", "sigmoid", "relu", "rbf"] = "tanh"
    """Activation of the hidden neurons."""
    pairs: PositiveInt = 2000
    """Most (start, target) pairs that the machine is fitted on; more are thinned at random."""
    ordering: Literal["mrsr", "none"] = "mrsr"
    """Order in which the regularised machine adds neurons."""
    norm: Literal[1, 2] = 1
    """Norm of the cumulative correlation in MRSR; the paper's is 1."""
    selection: Literal["press", "none"] | Annotated[int, Field(ge=1)] = "press"
    """Neurons that the regularised machine keeps: the minimum of the PRESS curve, all, or a number."""
    ridge: NonNegativeFloat | Literal["press"] = 0.0
    """Ridge of the regularised machine's output weights, or `press` to choose it by PRESS."""
    leave_out: Literal["pair", "target"] = "pair"
    """What PRESS leaves out at a time: one pair, as in the paper, or all pairs of one target, whose weights are alike.
    The other pairs of a target tell what the weights of one of them are, so that leaving out one alone keeps more
    neurons than is good for new targets."""
    follow: bool = False
    """Predict from the current view instead of the episode's first one ("adjusted in real time", section 4.2)."""


@dataclass(frozen=True)
class PairData:
    """What the machine is fitted on.

    Attributes:
        inputs: view features of start and target, side by side.
        weights: reward weights of the pair.
        target: number of the pair's target.
    """

    inputs: Float32[np.ndarray, "pairs inputs"]
    weights: Float64[np.ndarray, "pairs d"]
    target: Int[np.ndarray, "pairs"]


def pair_inputs(
    start: Float32[np.ndarray, "pairs feature"], target: Float32[np.ndarray, "pairs feature"]
) -> Float32[np.ndarray, "pairs inputs"]:
    """Put view features of start and target side by side.

    Args:
        start: view features of starts.
        target: view features of targets.

    Returns:
        The machine's inputs.
    """
    return np.concatenate([start, target], axis=1)


class ScenePredictor:
    """A machine's predictions for all pairs of one scene's views.

    Every view is projected once as a start and once as a target, not once for each pair: ŵ(s, g) for all pairs of a
    room costs seconds instead of minutes.

    Args:
        views: view features of the scene.
        machine: the fitted machine.
    """

    def __init__(self, views: Float32[np.ndarray, "states feature"], machine: ELMRegressor):
        self._machine = machine
        views = np.asarray(views, np.float64)
        self._start = machine.hidden_.project(views)
        self._target = machine.hidden_.project(views, first=views.shape[1])

    def weights(
        self, start: Int[np.ndarray, "pairs"], target: Int[np.ndarray, "pairs"]
    ) -> Float64[np.ndarray, "pairs d"]:
        """Predicted weights, ŵ(s, g).

        Args:
            start: states.
            target: targets' states.

        Returns:
            The weights.
        """
        pairs = self._start[start] + self._target[target]
        return self._machine.hidden_.activate(pairs) @ self._machine.coef_ + self._machine.intercept_

    def weights_to(self, target: int) -> Float64[np.ndarray, "states d"]:
        """Predicted weights from every state to one target.

        Args:
            target: the target's state.

        Returns:
            The weights.
        """
        start = np.arange(len(self._start))
        return self.weights(start, np.full_like(start, target))

    def rewards_to(
        self, target: int, phi: Float64[np.ndarray, "states d"], form: Literal["cost", "free"]
    ) -> Float64[np.ndarray, "states"]:
        """Predicted reward for being in each state on the way to a target, by the weights from that state's own view.

            r̂(s, g) = ŵ(s, g)·(φ(s) − φ(g)), or ŵ(s, g)·φ(s) in the free form

        Args:
            target: the target's state.
            phi: φ of the scene's views.
            form: form of the reward.

        Returns:
            The rewards, unclipped.
        """
        return (self.weights_to(target) * (phi - phi[target] if form == "cost" else phi)).sum(1)


def pair_data(
    scenes: Sequence[Scene], records: Sequence[DemonstratedReward], most: int, generator: np.random.Generator
) -> PairData:
    """Collect (start, target) → w pairs from demonstrations.

    Args:
        scenes: encoded training scenes.
        records: demonstrated rewards.
        most: number of pairs kept; all pairs are equally likely to be.
        generator: source of randomness for thinning.

    Returns:
        The pairs, in the order of the records.
    """
    owner = np.repeat(np.arange(len(records)), [len(record.starts) for record in records])
    starts = np.concatenate([record.starts for record in records])
    if len(owner) > most:
        kept = np.sort(generator.choice(len(owner), most, replace=False))
        owner, starts = owner[kept], starts[kept]
    own = [records[number] for number in owner.tolist()]
    views = [scenes[record.target.scene].encoded for record in own]
    first = np.stack([view[start] for view, start in zip(views, starts, strict=True)])
    wanted = np.stack([view[record.target.state] for view, record in zip(views, own, strict=True)])
    return PairData(pair_inputs(first, wanted), np.stack([record.solution.w for record in own]), owner)


def fit_machine(data: PairData, settings: ElmSettings, seed: int, *, regularised: bool) -> ELMRegressor:
    """Fit the machine of ELM-IRL or of RELM-IRL; both draw the same hidden layer.

    Args:
        data: pairs.
        settings: the machine's settings.
        seed: the run's seed.
        regularised: order neurons by MRSR and keep those that PRESS chooses (section 4.3), or keep all.

    Returns:
        The fitted machine.
    """
    machine = ELMRegressor(
        n_hidden=settings.hidden,
        activation=settings.activation,
        ordering=settings.ordering if regularised else "none",
        norm=settings.norm,
        selection=settings.selection if regularised else "none",
        ridge=settings.ridge if regularised else 0.0,
        random_state=seed,
    )
    groups = data.target if settings.leave_out == "target" else None
    if machine.ordering == "none":
        return machine.fit(data.inputs, data.weights, groups)
    with progress_bar("ordering neurons", min(settings.hidden, len(data.inputs)), "neurons") as advance:
        return machine.fit(data.inputs, data.weights, groups, progress=advance)
