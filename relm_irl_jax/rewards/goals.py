"""Goals: states that hindsight relabelling (Andrychowicz et al., 2017) uses as targets, and their costs.

This module separates training from evaluation: with `strict`, no evaluation target is a goal. The goals also depend on
the method's reward. RL can use any visited view as a goal, at a constant cost of each step. IRL has weights for the
targets of its demonstrations and the states along them. ELM-IRL and RELM-IRL predict weights for any pair of views.

Where nothing tells of the arrival at a goal, the reward alone says which views are the target's. Being paid a share p
of the reward for ever after n steps is worth γⁿ p, up to a constant factor. The best is therefore the least
n + ln p / ln γ: a step costs 1, and stopping in a view costs ln p / ln γ steps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, Float64, Int, Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.equation import linear_reward, paid_share
from relm_irl_jax.rewards.learned import LearnedRewards
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.rewards.settings import ManualSettings
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target, TaskSplit

IMAGINED_STARTS = 8
"""Random starts for which the weights of a goal are predicted; the costs use the mean of these weights."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Goals:
    """Goals of each scene and their costs; rows are padded at the end.

    Attributes:
        state: goals as local states of their scene; the training targets come first.
        count: number of goals in each scene.
        trained: number of training targets among them.
        cost: cost of each local state for each goal, in units of the goal's mean cost.
        stop: cost of stopping in each local state, infinite where it pays nothing, if the reward alone says where the
            goal is; None if the agent is told of the arrival.
    """

    state: Int32[Array, "scenes goals"]
    count: Int32[Array, "scenes"]
    trained: Int32[Array, "scenes"]
    cost: Float32[Array, "scenes goals locals"]
    stop: Float32[Array, "scenes goals locals"] | None = None


@dataclass(frozen=True)
class RewardAlone:
    """How the reward alone says where a goal is.

    Attributes:
        limit: predicted cost above which a view is not the target's, as a share of r_max.
        discount: γ.
    """

    limit: float
    discount: float

    def stop(self, share: Float64[np.ndarray, "goals states"]) -> Float64[np.ndarray, "goals states"]:
        """Cost of stopping, in steps.

        Args:
            share: p, the share of the largest reward that each view is paid.

        Returns:
            ln p / ln γ; infinite where p is 0.
        """
        with np.errstate(divide="ignore"):
            return np.log(share) / np.log(self.discount)


def goal_states(scenes: Sequence[Scene], split: TaskSplit, hindsight: str) -> list[Int[np.ndarray, "_"]]:
    """States that may be goals.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: `none` for the training targets, `strict` for all states except evaluation targets, `open` for all
            states.

    Returns:
        Local states of each scene, the training targets first.
    """
    trained = [np.asarray([t.state for t in split.training if t.scene == n], int) for n in range(len(scenes))]
    if hindsight == "none":
        return trained
    others = [np.setdiff1d(scene.reachable, states) for scene, states in zip(scenes, trained, strict=True)]
    if hindsight == "strict":
        others = [np.setdiff1d(states, list(split.evaluation_only(number))) for number, states in enumerate(others)]
    return [np.concatenate(parts) for parts in zip(trained, others, strict=True)]


def manual_goals(scenes: Sequence[Scene], split: TaskSplit, hindsight: str, settings: ManualSettings) -> Goals:
    """Goals of the RL baseline: every step costs the same.

    They are those of the control, too, by either protocol: to be paid at the target's view only is to be told of it.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which states may be goals.
        settings: the hand-made reward.

    Returns:
        The goals.

    Raises:
        InputError: a step has no cost, so that all paths are equally good.
    """
    if settings.step >= 0:
        raise InputError(f"manual.step: {settings.step} is not a cost; agents that learn from goals need it negative.")
    states = goal_states(scenes, split, hindsight)
    costs = [np.broadcast_to(1.0, (len(goals), scene.n_states)) for goals, scene in zip(states, scenes, strict=True)]
    return _pad_goals(states, costs, split)


def demonstrated_goals(scenes: Sequence[Scene], split: TaskSplit, hindsight: str, learned: LearnedRewards) -> Goals:
    """Goals of the IRL baseline: the targets of demonstrations, and with hindsight the states along them.

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
        weights[reward.target.scene].setdefault(reward.target.state, []).append(reward.weights)
    states = [
        np.asarray([state for state in allowed.tolist() if state in of_scene])
        for allowed, of_scene in zip(goal_states(scenes, split, hindsight), weights, strict=True)
    ]

    def costs(target: Target) -> Float64[np.ndarray, "states"]:
        return _costs(np.mean(weights[target.scene][target.state], axis=0), target, learned)

    return _pad_goals(states, _costs_of_goals(states, costs), split)


def predicted_goals(
    scenes: Sequence[Scene],
    split: TaskSplit,
    hindsight: str,
    predictor: RewardPredictor,
    generator: np.random.Generator,
    *,
    from_current_view: bool,
    alone: RewardAlone | None = None,
) -> Goals:
    """Goals of ELM-IRL and RELM-IRL: any state, with costs from predicted weights.

    The weights are the mean prediction over some random starts, or those predicted from each state's view.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        hindsight: which states may be goals.
        predictor: predicts weights in these scenes.
        generator: source of randomness of the starts.
        from_current_view: whether weights are predicted from the current view.
        alone: how the reward alone says where a goal is; None if the agent is told of arrivals.

    Returns:
        The goals.
    """
    states = goal_states(scenes, split, hindsight)
    if alone is not None:
        shares = []
        for number, (scene, goals) in enumerate(zip(scenes, states, strict=True)):
            predicted = _mean_weights(predictor, number, scene, goals, generator)
            shares.append(paid_share(predicted, predictor.phi[number], goals, predictor.form, alone.limit))
        steps = [np.ones_like(share) for share in shares]
        return _pad_goals(states, steps, split, [alone.stop(share) for share in shares])
    if from_current_view:
        with progress_bar("predicting rewards", sum(map(len, states)), "goals") as advance:

            def costs(target: Target) -> Float64[np.ndarray, "states"]:
                advance(1)
                return _positive(-predictor.rewards_to(target), predictor)

            return _pad_goals(states, _costs_of_goals(states, costs), split)
    weights = []
    for number, (scene, goals) in enumerate(zip(scenes, states, strict=True)):
        predicted = _mean_weights(predictor, number, scene, goals, generator)
        weights.append(dict(zip(goals.tolist(), predicted, strict=True)))
    costs_of_goals = _costs_of_goals(states, lambda g: _costs(weights[g.scene][g.state], g, predictor))
    return _pad_goals(states, costs_of_goals, split)


def _mean_weights(
    predictor: RewardPredictor,
    number: int,
    scene: Scene,
    goals: Int[np.ndarray, "goals"],
    generator: np.random.Generator,
) -> Float64[np.ndarray, "goals d"]:
    """Mean of the weights predicted for each goal from some random starts."""
    starts = generator.choice(scene.reachable, (IMAGINED_STARTS, len(goals)))
    return np.mean([predictor.weights(number, start, goals) for start in starts], axis=0)


def _costs_of_goals(
    states: Sequence[Int[np.ndarray, "_"]], costs: Callable[[Target], Float64[np.ndarray, "_"]]
) -> list[Float64[np.ndarray, "goals states"]]:
    """Costs of all states of a scene for each of its goals, scene by scene."""
    return [np.stack([costs(Target(number, goal)) for goal in goals.tolist()]) for number, goals in enumerate(states)]


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
    """Costs for planning: at least `minimum_cost`, also in the free form, whose rewards may be positive."""
    return np.maximum(cost, rewards.form.minimum_cost)


def _pad_goals(
    states: Sequence[Int[np.ndarray, "_"]],
    costs: Sequence[np.ndarray],
    split: TaskSplit,
    stops: Sequence[np.ndarray] | None = None,
) -> Goals:
    """Pad goals and costs, and divide the costs of each goal by their mean, so that the unit of costs is a mean step.

    The division changes no optimal path. It makes distances to all goals comparable, which an embedding needs: with
    different scales, one goal could be twice as far from every state as a neighbouring goal. There are as many columns
    as states in the largest scene, so that all methods, seeds and kinds of hindsight share one compiled training.
    """
    count = np.asarray([len(goals) for goals in states])
    largest = max(of_scene.shape[1] for of_scene in costs)
    state = np.zeros((len(states), largest), np.int32)
    cost = np.ones((len(states), largest, largest), np.float32)
    for number, (goals, of_scene) in enumerate(zip(states, costs, strict=True)):
        state[number, : len(goals)] = goals
        cost[number, : len(goals), : of_scene.shape[1]] = of_scene / of_scene.mean(1, keepdims=True)
    stop = None if stops is None else np.full_like(cost, np.inf)
    for number, of_scene in enumerate(stops or ()):
        assert stop is not None
        stop[number, : of_scene.shape[0], : of_scene.shape[1]] = of_scene
    trained = np.bincount([target.scene for target in split.training], minlength=len(states))
    return Goals(
        state=jnp.asarray(state),
        count=jnp.asarray(count, jnp.int32),
        trained=jnp.asarray(trained, jnp.int32),
        cost=jnp.asarray(cost),
        stop=None if stop is None else jnp.asarray(stop),
    )
