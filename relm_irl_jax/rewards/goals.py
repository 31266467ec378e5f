"""Views that the metric agent sets itself as targets, and what a step towards each costs by its method's own reward.

The wall between training and evaluation stands here: `strict` leaves out every target that is kept for evaluation.
A method prices what its reward covers. RL recognises any view that it has met: a step costs a step. IRL has weights
for the targets of its demonstrations and for the states along them. ELM-IRL and RELM-IRL predict weights for any pair
of views: an imagined target, priced from an imagined start.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from relm_irl_jax.agent.metric.costs import Goals
from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.errors import InputError
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.assemble import ManualSettings
from relm_irl_jax.rewards.demonstrations import DemonstratedReward, IrlSettings, RewardBasis
from relm_irl_jax.rewards.prediction import ScenePredictor
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import TaskSplit

IMAGINED_STARTS = 8
"""Starts from which the weights of an imagined target are predicted; their mean prices the way to it."""


def goal_states(scenes: Sequence[Scene], split: TaskSplit, hindsight: str) -> list[np.ndarray]:
    """States that may be goals.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: `none` for the training targets, `strict` for all states but the targets kept for evaluation, `open`
            for all states.

    Returns:
        Local states, scene by scene, the training targets first.
    """
    trained = [np.asarray([t.state for t in split.training if t.scene == n], int) for n in range(len(scenes))]
    if hindsight == "none":
        return trained
    others = [np.setdiff1d(scene.reachable, own) for scene, own in zip(scenes, trained, strict=True)]
    if hindsight == "strict":
        others = [np.setdiff1d(own, list(split.evaluation_only(number))) for number, own in enumerate(others)]
    return [np.concatenate(both) for both in zip(trained, others, strict=True)]


def manual_goals(scenes: Sequence[Scene], split: TaskSplit, hindsight: str, settings: ManualSettings) -> Goals:
    """Goals of the RL baseline: reaching one is the reward, and every step on the way costs the same.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which views may be goals.
        settings: the hand-made reward.

    Returns:
        The goals.

    Raises:
        InputError: a step costs nothing, so that no way is better than another.
    """
    if settings.step >= 0:
        raise InputError(f"manual.step: {settings.step} costs nothing; the metric agent needs a negative one.")
    states = goal_states(scenes, split, hindsight)
    return _goals(states, [np.ones((len(own), s.n_states)) for own, s in zip(states, scenes, strict=True)], split)


def demonstrated_goals(
    scenes: Sequence[Scene],
    split: TaskSplit,
    hindsight: str,
    records: Sequence[DemonstratedReward],
    basis: RewardBasis,
    settings: IrlSettings,
) -> Goals:
    """Goals of the IRL baseline: the targets of demonstrations, and in hindsight the states along them.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which views may be goals.
        records: demonstrated rewards.
        basis: φ.
        settings: the inverse reinforcement learning's settings.

    Returns:
        The goals.
    """
    weights: list[dict[int, list[np.ndarray]]] = [{} for _ in scenes]
    for record in records:
        weights[record.target.scene].setdefault(record.target.state, []).append(record.solution.w)
    states = [
        np.asarray([state for state in allowed.tolist() if state in own])
        for allowed, own in zip(goal_states(scenes, split, hindsight), weights, strict=True)
    ]
    mean = [
        np.stack([np.mean(own[state], axis=0) for state in chosen.tolist()])
        for chosen, own in zip(states, weights, strict=True)
    ]
    return _goals(states, _linear_costs(scenes, states, mean, basis, settings), split)


def predicted_goals(
    scenes: Sequence[Scene],
    split: TaskSplit,
    hindsight: str,
    machine: ELMRegressor,
    basis: RewardBasis,
    settings: IrlSettings,
    generator: np.random.Generator,
    *,
    follow: bool = False,
) -> Goals:
    """Goals of ELM-IRL and RELM-IRL: any view, at the price that the machine predicts for the pair of views.

    The pair is that of an imagined start and the goal, −ŵ(s₀, g)·(φ(s) − φ(g)), ŵ being the mean over some starts; or
    that of each view on the way and the goal, −ŵ(s, g)·(φ(s) − φ(g)), a reward that follows the agent.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which views may be goals.
        machine: the fitted machine.
        basis: φ.
        settings: the inverse reinforcement learning's settings.
        generator: source of randomness of the imagined starts.
        follow: whether the prediction follows the agent.

    Returns:
        The goals.
    """
    states = goal_states(scenes, split, hindsight)
    if follow:
        return _goals(states, _following_costs(scenes, states, machine, basis, settings), split)
    weights = []
    for scene, own in zip(scenes, states, strict=True):
        starts = generator.choice(scene.reachable, (IMAGINED_STARTS, len(own)))
        predictor = ScenePredictor(scene.encoded, machine)
        weights.append(np.mean([predictor.weights(start, own) for start in starts], axis=0))
    return _goals(states, _linear_costs(scenes, states, weights, basis, settings), split)


def _linear_costs(
    scenes: Sequence[Scene],
    states: Sequence[np.ndarray],
    weights: Sequence[np.ndarray],
    basis: RewardBasis,
    settings: IrlSettings,
) -> list[np.ndarray]:
    """−w·(φ(s) − φ(g)), clipped as the reward is; in the free form −w·φ(s), at least the least cost."""
    costs = []
    for scene, own, w in zip(scenes, states, weights, strict=True):
        phi = basis(scene.encoded)
        cost = -w @ phi.T
        if settings.program.form == "cost":
            cost += (w * phi[own]).sum(1)[:, None]
        costs.append(_clipped(cost, settings))
    return costs


def _following_costs(
    scenes: Sequence[Scene],
    states: Sequence[np.ndarray],
    machine: ELMRegressor,
    basis: RewardBasis,
    settings: IrlSettings,
) -> list[np.ndarray]:
    """−ŵ(s, g)·(φ(s) − φ(g)) for every state and goal, clipped; in the free form −ŵ(s, g)·φ(s)."""
    costs = []
    with progress_bar("predicting rewards", sum(map(len, states)), "goals") as advance:
        for scene, own in zip(scenes, states, strict=True):
            predictor, phi = ScenePredictor(scene.encoded, machine), basis(scene.encoded)
            cost = np.empty((len(own), scene.n_states))
            for row, goal in enumerate(own.tolist()):
                cost[row] = -predictor.rewards_to(goal, phi, settings.program.form)
                advance(1)
            costs.append(_clipped(cost, settings))
    return costs


def _clipped(cost: np.ndarray, settings: IrlSettings) -> np.ndarray:
    r_max = settings.program.r_max
    return np.clip(cost, settings.least_cost * r_max, r_max)


def _goals(states: Sequence[np.ndarray], costs: Sequence[np.ndarray], split: TaskSplit) -> Goals:
    """Pad goals and costs; each goal's mean cost becomes 1, so that distances to all of them count steps.

    No way becomes better than another by it: the unit of a reward does not matter to its optimal policy, but a space
    in which one goal lies twice as far from everything as its neighbour does not exist.
    """
    count = np.asarray([len(own) for own in states])
    state = np.zeros((len(states), count.max()), np.int32)
    cost = np.ones((len(states), count.max(), max(own.shape[1] for own in costs)), np.float32)
    for number, (own, price) in enumerate(zip(states, costs, strict=True)):
        state[number, : len(own)] = own
        cost[number, : len(own), : price.shape[1]] = price / price.mean(1, keepdims=True)
    trained = np.bincount([target.scene for target in split.training], minlength=len(states))
    return Goals(jnp.asarray(state), jnp.asarray(count, jnp.int32), jnp.asarray(trained, jnp.int32), jnp.asarray(cost))
