"""Goals: states that serve as targets after the fact, and what each state costs with each goal.

The wall between training and evaluation for hindsight relabelling (Andrychowicz et al., 2017) stands here: `strict`
leaves out every target that is kept for evaluation. Each method's reward covers other goals. RL recognises any view
that was visited, and every step costs the same. IRL has weights for the targets of its demonstrations and the states
along them. ELM-IRL and RELM-IRL predict weights for any pair of views.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, Float64, Int, Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.equation import linear_reward
from relm_irl_jax.rewards.learned import LearnedRewards
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.rewards.settings import ManualSettings
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target, TaskSplit

IMAGINED_STARTS = 8
"""Starts from which the weights of an imagined target are predicted; the mean weights give the costs."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Goals:
    """Goals of each scene and their costs; rows are padded at the end.

    Attributes:
        state: goals as local states of their scene; the training targets come first.
        count: number of goals in each scene.
        trained: number of training targets among them.
        cost: cost of a step into each local state for each goal, in units of the goal's mean cost.
    """

    state: Int32[Array, "scenes goals"]
    count: Int32[Array, "scenes"]
    trained: Int32[Array, "scenes"]
    cost: Float32[Array, "scenes goals locals"]


def goal_states(scenes: Sequence[Scene], split: TaskSplit, hindsight: str) -> list[Int[np.ndarray, "_"]]:
    """States that may be goals.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: `none` for the training targets, `strict` for all states but the targets kept for evaluation, `open`
            for all states.

    Returns:
        Local states of each scene, the training targets first.
    """
    trained = [np.asarray([t.state for t in split.training if t.scene == n], int) for n in range(len(scenes))]
    if hindsight == "none":
        return trained
    others = [np.setdiff1d(scene.reachable, own) for scene, own in zip(scenes, trained, strict=True)]
    if hindsight == "strict":
        others = [np.setdiff1d(own, list(split.evaluation_only(number))) for number, own in enumerate(others)]
    return [np.concatenate(both) for both in zip(trained, others, strict=True)]


def manual_goals(scenes: Sequence[Scene], split: TaskSplit, hindsight: str, settings: ManualSettings) -> Goals:
    """Goals of the RL baseline: every step costs the same.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which states may be goals.
        settings: the hand-made reward.

    Returns:
        The goals.

    Raises:
        InputError: a step costs nothing, so that no path is better than another.
    """
    if settings.step >= 0:
        raise InputError(f"manual.step: {settings.step} costs nothing; learning from goals needs a negative one.")
    states = goal_states(scenes, split, hindsight)
    return _goals(states, [np.ones((len(own), s.n_states)) for own, s in zip(states, scenes, strict=True)], split)


def demonstrated_goals(scenes: Sequence[Scene], split: TaskSplit, hindsight: str, learned: LearnedRewards) -> Goals:
    """Goals of the IRL baseline: the targets of demonstrations, and with relabelling the states along them.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which states may be goals.
        learned: the learned rewards.

    Returns:
        The goals.
    """
    weights: list[dict[int, list[np.ndarray]]] = [{} for _ in scenes]
    for reward in learned.demonstrated:
        weights[reward.target.scene].setdefault(reward.target.state, []).append(reward.solution.w)
    states = [
        np.asarray([state for state in allowed.tolist() if state in own])
        for allowed, own in zip(goal_states(scenes, split, hindsight), weights, strict=True)
    ]

    def costs(target: Target) -> Float64[np.ndarray, "states"]:
        return _costs(np.mean(weights[target.scene][target.state], axis=0), target, learned)

    return _goals(states, _costs_of_goals(states, costs), split)


def predicted_goals(
    scenes: Sequence[Scene],
    split: TaskSplit,
    hindsight: str,
    predictor: RewardPredictor,
    generator: np.random.Generator,
    *,
    from_current_view: bool,
) -> Goals:
    """Goals of ELM-IRL and RELM-IRL: any state, with costs by predicted weights.

    The weights are the mean prediction from some imagined starts, or those predicted from each state's own view.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which states may be goals.
        predictor: predicts weights in these scenes.
        generator: source of randomness of the imagined starts.
        from_current_view: whether weights are predicted from the current view.

    Returns:
        The goals.
    """
    states = goal_states(scenes, split, hindsight)
    if from_current_view:
        with progress_bar("predicting rewards", sum(map(len, states)), "goals") as advance:

            def costs(target: Target) -> Float64[np.ndarray, "states"]:
                advance(1)
                return _positive(-predictor.rewards_to(target), predictor)

            return _goals(states, _costs_of_goals(states, costs), split)
    weights = []
    for number, (scene, own) in enumerate(zip(scenes, states, strict=True)):
        starts = generator.choice(scene.reachable, (IMAGINED_STARTS, len(own)))
        predicted = np.mean([predictor.weights(number, start, own) for start in starts], axis=0)
        weights.append(dict(zip(own.tolist(), predicted, strict=True)))
    return _goals(states, _costs_of_goals(states, lambda g: _costs(weights[g.scene][g.state], g, predictor)), split)


def _costs_of_goals(
    states: Sequence[Int[np.ndarray, "_"]], costs: Callable[[Target], Float64[np.ndarray, "_"]]
) -> list[Float64[np.ndarray, "goals states"]]:
    """Costs of all states of a scene for each of its goals, scene by scene."""
    return [np.stack([costs(Target(number, goal)) for goal in own.tolist()]) for number, own in enumerate(states)]


def _costs(
    weights: Float64[np.ndarray, "d"], target: Target, rewards: LearnedRewards | RewardPredictor
) -> Float64[np.ndarray, "states"]:
    """Cost of every state of the target's scene under weights."""
    phi = rewards.phi[target.scene]
    at_target = np.arange(len(phi)) == target.state
    return _positive(-linear_reward(weights, phi, phi[target.state], at_target, rewards.form), rewards)


def _positive(
    cost: Float64[np.ndarray, "states"], rewards: LearnedRewards | RewardPredictor
) -> Float64[np.ndarray, "states"]:
    """Costs to plan with: at least the smallest one, also in the free form, whose rewards may be positive."""
    return np.maximum(cost, rewards.form.minimum_cost)


def _goals(states: Sequence[Int[np.ndarray, "_"]], costs: Sequence[np.ndarray], split: TaskSplit) -> Goals:
    """Pad goals and costs; each goal's mean cost becomes 1, so that costs to go count steps for every goal.

    This changes no optimal path, since scaling a reward changes no optimal policy. It makes distances to all goals
    comparable, which an embedding needs: with goals of different scales, one goal would be twice as far from every
    state as its neighbour.
    """
    count = np.asarray([len(own) for own in states])
    state = np.zeros((len(states), count.max()), np.int32)
    cost = np.ones((len(states), count.max(), max(own.shape[1] for own in costs)), np.float32)
    for number, (own, of_goal) in enumerate(zip(states, costs, strict=True)):
        state[number, : len(own)] = own
        cost[number, : len(own), : of_goal.shape[1]] = of_goal / of_goal.mean(1, keepdims=True)
    trained = np.bincount([target.scene for target in split.training], minlength=len(states))
    return Goals(jnp.asarray(state), jnp.asarray(count, jnp.int32), jnp.asarray(trained, jnp.int32), jnp.asarray(cost))
