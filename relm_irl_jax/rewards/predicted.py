"""Prediction of reward weights from the views of start and target by an extreme learning machine (section 4.2).

    ŵ(s₀, g) = ELM([x(s₀), x(g)])

with x the encoder's view features. A prediction needs no expert for the pair.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int

from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.elm.hidden_layer import Projection
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.demonstrated import DemonstratedReward
from relm_irl_jax.rewards.equation import LinearRewardForm, linear_reward
from relm_irl_jax.rewards.settings import ElmSettings
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target

SCENES_AT_ONCE = 8
"""Scenes whose projections a predictor keeps: their size is that of the hidden layer for every view."""


@dataclass(frozen=True)
class PairData:
    """Training data of the regressor.

    Attributes:
        inputs: view features of start and target, concatenated.
        weights: reward weights of the pair.
        target: number of the pair's target, a group label for PRESS.
    """

    inputs: Float32[np.ndarray, "pairs inputs"]
    weights: Float64[np.ndarray, "pairs d"]
    target: Int[np.ndarray, "pairs"]


def pair_inputs(
    start: Float32[np.ndarray, "pairs feature"], target: Float32[np.ndarray, "pairs feature"]
) -> Float32[np.ndarray, "pairs inputs"]:
    """Concatenate view features of start and target.

    Args:
        start: view features of starts.
        target: view features of targets.

    Returns:
        The regressor's inputs.
    """
    return np.concatenate([start, target], axis=1)


def pair_data(
    scenes: Sequence[Scene],
    demonstrated: Sequence[DemonstratedReward],
    largest: int,
    generator: np.random.Generator,
) -> PairData:
    """Collect (start, target) → w pairs from demonstrations.

    Args:
        scenes: encoded training scenes.
        demonstrated: demonstrated rewards.
        largest: largest number of pairs; if there are more, a random subset is drawn.
        generator: source of randomness of the subset.

    Returns:
        The pairs, in the order of the demonstrated rewards.
    """
    index = np.repeat(np.arange(len(demonstrated)), [len(reward.starts) for reward in demonstrated])
    starts = np.concatenate([reward.starts for reward in demonstrated])
    if len(index) > largest:
        drawn = np.sort(generator.choice(len(index), largest, replace=False))
        index, starts = index[drawn], starts[drawn]
    rewards = [demonstrated[number] for number in index.tolist()]
    views = [scenes[reward.target.scene].encoded for reward in rewards]
    start_views = np.stack([view[start] for view, start in zip(views, starts, strict=True)])
    target_views = np.stack([view[reward.target.state] for view, reward in zip(views, rewards, strict=True)])
    return PairData(pair_inputs(start_views, target_views), np.stack([reward.weights for reward in rewards]), index)


def fit_regressor(data: PairData, settings: ElmSettings, seed: int, *, regularised: bool) -> ELMRegressor:
    """Fit the regressor of ELM-IRL or RELM-IRL; both draw the same hidden layer.

    Args:
        data: pairs.
        settings: the regressor's settings.
        seed: the run's seed.
        regularised: whether to order neurons by MRSR and select them by PRESS (section 4.3), or to keep all.

    Returns:
        The fitted regressor.
    """
    regressor = ELMRegressor(
        n_hidden=settings.hidden,
        activation=settings.activation,
        ordering=settings.ordering if regularised else "none",
        norm=settings.norm,
        selection=settings.selection if regularised else "none",
        ridge=settings.ridge if regularised else 0.0,
        random_state=seed,
    )
    groups = data.target if settings.leave_out == "target" else None
    if regressor.ordering == "none":
        return regressor.fit(data.inputs, data.weights, groups)
    with progress_bar("ordering neurons", min(settings.hidden, len(data.inputs)), "neurons") as advance:
        return regressor.fit(data.inputs, data.weights, groups, progress=advance)


class RewardPredictor:
    """Predicted weights and rewards for all pairs of views within scenes.

    Each view is projected by the input layer once as a start and once as a target, not once for each pair. All pairs of
    a room then take seconds instead of minutes. The projections of `SCENES_AT_ONCE` scenes are kept.

    Args:
        scenes: encoded scenes.
        phi: reward features of each scene.
        regressor: the fitted regressor.
        form: bounds of the reward.
    """

    def __init__(
        self,
        scenes: Sequence[Scene],
        phi: Sequence[Float64[np.ndarray, "_ d"]],
        regressor: ELMRegressor,
        form: LinearRewardForm,
    ):
        self.phi, self.form = tuple(phi), form
        self._regressor = regressor
        self._views = [scene.encoded for scene in scenes]
        self._kept: dict[int, tuple[Projection, Projection]] = {}

    def _projected(self, scene: int) -> tuple[Projection, Projection]:
        """The products of a scene's views with the weights of starts and of targets."""
        if scene not in self._kept:
            view, hidden = np.asarray(self._views[scene], np.float64), self._regressor.hidden_
            if len(self._kept) == SCENES_AT_ONCE:
                del self._kept[next(iter(self._kept))]
            self._kept[scene] = hidden.project(view), hidden.project(view, first=view.shape[1])
        return self._kept[scene]

    def weights(
        self, scene: int, start: Int[np.ndarray, "pairs"], target: Int[np.ndarray, "pairs"]
    ) -> Float64[np.ndarray, "pairs d"]:
        """Predicted weights ŵ(s₀, g) of pairs of one scene.

        Args:
            scene: number of the scene.
            start: states.
            target: target states.

        Returns:
            The weights.
        """
        as_start, as_target = self._projected(scene)
        pairs = as_start[start] + as_target[target]
        return self._regressor.hidden_.activate(pairs) @ self._regressor.coef_ + self._regressor.intercept_

    def weights_to(self, target: Target) -> Float64[np.ndarray, "states d"]:
        """Predicted weights from every state of the target's scene.

        Args:
            target: the target.

        Returns:
            ŵ(s, g) for each state s.
        """
        start = np.arange(len(self.phi[target.scene]))
        return self.weights(target.scene, start, np.full_like(start, target.state))

    def rewards_to(self, target: Target) -> Float64[np.ndarray, "states"]:
        """Predicted reward of every state of the target's scene, with weights predicted from the view of that state.

        Args:
            target: the target.

        Returns:
            r(s, g) with ŵ(s, g).
        """
        phi = self.phi[target.scene]
        at_target = np.arange(len(phi)) == target.state
        return linear_reward(self.weights_to(target), phi, phi[target.state], at_target, self.form)
