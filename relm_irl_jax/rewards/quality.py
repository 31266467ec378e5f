"""How good a reward is, apart from any agent: where it ranks its target, and how it orders states by distance.

That the optimal policy under a reward reaches the target proves little where every reward is negative and the
simulator ends the episode: a constant −1 does it too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.stats import spearmanr

from relm_irl_jax.irl import reward
from relm_irl_jax.rewards.demonstrations import RewardBasis
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target


@dataclass(frozen=True)
class RewardQuality:
    """Judgement of one reward.

    Attributes:
        rank: position of the target among all states of the scene by reward, 1 being the best.
        states: number of states of the scene.
        order: Spearman correlation between reward and closeness to the target; NaN for a constant reward.
    """

    rank: int
    states: int
    order: float


def judge(scene: Scene, target: int, basis: RewardBasis, weights: Float64[np.ndarray, "d"]) -> RewardQuality:
    """Judge the reward that weights stand for.

    Args:
        scene: the target's scene, encoded.
        target: the target's state.
        basis: φ.
        weights: w.

    Returns:
        The judgement.
    """
    values = reward(basis(scene.encoded), target, weights)
    distance = scene.shortest_path_distance[:, target]
    others = (distance > 0) & (np.arange(len(values)) != target)
    constant = np.ptp(values[others]) == 0
    return RewardQuality(
        rank=1 + int((values[others] >= values[target]).sum()),
        states=len(values),
        order=np.nan if constant else float(spearmanr(values[others], -distance[others]).statistic),
    )


def judge_predictions(
    scenes: Sequence[Scene],
    targets: Sequence[Target],
    basis: RewardBasis,
    predict,
    generator: np.random.Generator,
    starts: int = 8,
) -> list[RewardQuality]:
    """Judge predicted rewards from several random starts of each target.

    Args:
        scenes: the targets' scenes, encoded.
        targets: targets, trained or not.
        basis: φ.
        predict: maps view features of starts and of the target to weights, one row a start.
        generator: source of randomness for starts.
        starts: starts a target.

    Returns:
        One judgement for each target and start.
    """
    judged = []
    for target in targets:
        scene = scenes[target.scene]
        able = np.flatnonzero(scene.shortest_path_distance[:, target.state] > 0)
        first = scene.encoded[generator.choice(able, min(starts, len(able)), replace=False)]
        wanted = np.broadcast_to(scene.encoded[target.state], first.shape)
        judged += [judge(scene, target.state, basis, weights) for weights in predict(first, wanted)]
    return judged
