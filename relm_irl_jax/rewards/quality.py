"""Quality of a reward, independent of agents: the target's rank, and the correlation of reward and distance.

If all rewards are negative and the simulator ends the episode at the target, even under a constant −1 the optimal
policy reaches the target. Reaching it therefore says little about a reward. Quality is measured before clipping, since
the bounds make many rewards equal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.stats import spearmanr

from relm_irl_jax.rewards.equation import LinearRewardForm, unclipped_reward
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target


@dataclass(frozen=True)
class RewardQuality:
    """Quality of one reward.

    Attributes:
        rank: rank of the target among all states of the scene by reward; 1 is the best.
        states: number of states of the scene.
        order: Spearman correlation between reward and closeness to the target; NaN for a constant reward.
    """

    rank: int
    states: int
    order: float


def reward_quality(
    scene: Scene,
    target: int,
    phi: Float64[np.ndarray, "states d"],
    weights: Float64[np.ndarray, "d"],
    form: LinearRewardForm,
) -> RewardQuality:
    """Measure the quality of a linear reward.

    Args:
        scene: the target's scene.
        target: the target's state.
        phi: reward features of the scene.
        weights: w.
        form: form of the reward.

    Returns:
        Rank and order.
    """
    values = unclipped_reward(weights, phi, phi[target], form)
    distance = scene.shortest_path_distance[:, target]
    others = (distance > 0) & (np.arange(len(values)) != target)
    constant = np.ptp(values[others]) == 0
    return RewardQuality(
        rank=1 + int((values[others] >= values[target]).sum()),
        states=len(values),
        order=np.nan if constant else float(spearmanr(values[others], -distance[others]).statistic),
    )


def predicted_reward_quality(
    scenes: Sequence[Scene],
    targets: Sequence[Target],
    predictor: RewardPredictor,
    generator: np.random.Generator,
    starts: int = 8,
) -> list[RewardQuality]:
    """Measure the quality of rewards predicted from several random starts for each target.

    Args:
        scenes: the targets' scenes.
        targets: the targets.
        predictor: predicts weights in these scenes.
        generator: source of randomness for starts.
        starts: number of starts for each target.

    Returns:
        One quality for each target and start.
    """
    qualities = []
    for target in targets:
        scene, phi = scenes[target.scene], predictor.phi[target.scene]
        possible = np.flatnonzero(scene.shortest_path_distance[:, target.state] > 0)
        start = generator.choice(possible, min(starts, len(possible)), replace=False)
        predicted = predictor.weights(target.scene, start, np.full_like(start, target.state))
        qualities += [reward_quality(scene, target.state, phi, weights, predictor.form) for weights in predicted]
    return qualities
