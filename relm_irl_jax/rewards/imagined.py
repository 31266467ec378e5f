"""Imagined targets: views of the training scenes that an agent trains on besides the given targets, and their rewards.

The predicted reward needs no expert for a target, so that any view met can be one ("the reward function can be adjusted
... according to the change in the target image"). Evaluation targets are left out. Two protocols:

- *told*: the simulator ends the episode at the imagined view. Any cost of a step teaches the shortest path then.
- *reward-alone*: nothing tells of the arrival, not even at given targets. Only the reward says where the target is:

      r(s, g) = r_max · clip( 1 + ŵ·(φ(s) − φ(g)) / limit, 0, 1 )

  This is the cost form with r_max added, which changes no optimal policy, since nothing ends an episode: values far
  from the target are then 0 and not a long sum of costs, and are learned in half the frames. A limit below r_max makes
  the reward of most states 0. An action that collides pays 0: with any more, an agent would rather stand before a wall
  in a state of some reward than search.

ŵ is the mean of the weights predicted from some random starts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, Float64, Int, Int32

from relm_irl_jax.rewards.equation import linear_reward, paid_share
from relm_irl_jax.rewards.goals import IMAGINED_STARTS, goal_states
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import TaskSplit


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ImaginedTargets:
    """Targets of each scene and their rewards, scene by scene.

    Attributes:
        state: targets as local states of their scene; the given training targets come first.
        trained: number of given training targets among them.
        reward: reward for arriving in each local state, for each target.
        collision: largest reward of an action that collides; infinite if collisions are paid like other actions.
        told: whether the episode ends at the target.
    """

    state: tuple[Int32[Array, "_"], ...]
    trained: tuple[Int32[Array, ""], ...]
    reward: tuple[Float32[Array, "_ _"], ...]
    collision: Float32[Array, ""]
    told: Bool[Array, ""]


States = list[Int[np.ndarray, "_"]]


def imagined_states(scenes: Sequence[Scene], split: TaskSplit, largest: int, generator: np.random.Generator) -> States:
    """Draw the states that are targets: the training targets, and others that no task evaluates on.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        largest: largest number of targets of a scene besides its training targets.
        generator: source of randomness.

    Returns:
        Local states of each scene, the training targets first.
    """
    drawn = []
    for number, states in enumerate(goal_states(scenes, split, "strict")):
        trained = sum(target.scene == number for target in split.training)
        others = states[trained:]
        if len(others) > largest:
            others = np.sort(generator.choice(others, largest, replace=False))
        drawn.append(np.concatenate([states[:trained], others]))
    return drawn


def constant_rewards(
    scenes: Sequence[Scene],
    split: TaskSplit,
    states: States,
    *,
    step: float,
    target: float,
    collision: float,
    told: bool,
) -> ImaginedTargets:
    """The same reward for every step but the one to the target, whatever is seen.

    Args:
        scenes: training scenes.
        split: the targets of all tasks.
        states: the targets of each scene.
        step: reward of a step.
        target: reward for reaching the target.
        collision: largest reward of an action that collides.
        told: whether the episode ends at the target.

    Returns:
        The targets.
    """

    def rewards(number: int) -> Float64[np.ndarray, "targets states"]:
        rewards = np.full((len(states[number]), scenes[number].n_states), step)
        rewards[np.arange(len(rewards)), states[number]] = target
        return rewards

    return _targets(states, split, rewards, collision, told=told)


def predicted_rewards(
    split: TaskSplit, states: States, predictor: RewardPredictor, generator: np.random.Generator, limit: float | None
) -> ImaginedTargets:
    """Rewards of ELM-IRL and RELM-IRL.

    Args:
        split: the targets of all tasks.
        states: the targets of each scene.
        predictor: predicts weights in the training scenes.
        generator: source of randomness of the starts.
        limit: cost above which costs are equal, as a share of r_max, if the reward alone says where the target is;
            None if the agent is told of arrivals.

    Returns:
        The targets.
    """
    r_max = float(predictor.form.r_max)

    def rewards(number: int) -> Float64[np.ndarray, "targets states"]:
        targets, phi = states[number], predictor.phi[number]
        starts = generator.choice(len(phi), (IMAGINED_STARTS, len(targets)))
        weights = np.mean([predictor.weights(number, start, targets) for start in starts], axis=0)
        if limit is None:
            at_target = np.arange(len(phi)) == targets[:, None]
            rows = zip(weights, targets, at_target, strict=True)
            return np.stack([linear_reward(w, phi, phi[g], at, predictor.form) for w, g, at in rows])
        return r_max * paid_share(weights, phi, targets, predictor.form, limit)

    return _targets(states, split, rewards, np.inf if limit is None else 0.0, told=limit is None)


def _targets(
    states: States,
    split: TaskSplit,
    rewards: Callable[[int], Float64[np.ndarray, "targets states"]],
    collision: float,
    *,
    told: bool,
) -> ImaginedTargets:
    trained = np.bincount([target.scene for target in split.training], minlength=len(states))
    return ImaginedTargets(
        state=tuple(jnp.asarray(of_scene, jnp.int32) for of_scene in states),
        trained=tuple(jnp.int32(count) for count in trained),
        reward=tuple(jnp.asarray(rewards(number), jnp.float32) for number in range(len(states))),
        collision=jnp.float32(collision),
        told=jnp.asarray(told),
    )
