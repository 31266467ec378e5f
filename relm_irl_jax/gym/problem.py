"""The tables of an environment: scenes, targets, what is observed, and how transitions are rewarded."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from jaxtyping import Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.features.settings import Observed
from relm_irl_jax.rewards.settings import ManualSettings
from relm_irl_jax.scenes.scene import ACTIONS, Scene
from relm_irl_jax.tables import TargetTables, scene_offsets, successor_table, target_tables
from relm_irl_jax.tasks import Target
from relm_irl_jax.transitions import FeatureReward, TransitionFeatures

MANUAL = ManualSettings()


@dataclass(frozen=True)
class Options:
    """How an environment is presented to the agent.

    Attributes:
        cap: number of steps after which an episode is truncated.
        obs: `features` or `frames`.
        history: number of last views in an observation.
        reward: a function of `TransitionFeatures`; None for the hand-made reward.
        bounded: whether the space of features has the bounds of these scenes; if not, it has none, so that the spaces
            of training and test environments are equal.
    """

    cap: int = 100
    obs: str = "features"
    history: int = 1
    reward: FeatureReward | None = None
    bounded: bool = True

    def __post_init__(self):
        if self.obs not in get_args(Observed):
            raise InputError(f"obs = {self.obs!r} is refused; give features or frames.")
        if self.cap < 1:
            raise InputError(f"cap = {self.cap} is refused; give at least 1 step.")
        if self.history < 1:
            raise InputError(f"history = {self.history} is refused; give at least 1 view.")
        if self.reward is not None and not callable(self.reward):
            raise InputError(f"reward = {self.reward!r} is refused; give a function of a transition's features.")


@dataclass(frozen=True, eq=False)
class NavigationProblem:
    """Scenes and targets of an environment.

    Attributes:
        scenes: the scenes, with what is observed: features or views.
        targets: the targets of episodes, in the order of their scenes.
        options: how they are presented.
        pictures: views of each scene, for rendering; None where nothing is rendered.
        successor: next state in the world of each state and action.
        tables: starts and distances of the targets.
        scene: number of each state's scene.
        local: number of each state within its scene.
    """

    scenes: Sequence[Scene]
    targets: Sequence[Target]
    options: Options
    pictures: Sequence[np.ndarray] | None = None
    successor: Int32[np.ndarray, "states 4"] = field(init=False)
    tables: TargetTables = field(init=False)
    scene: Int32[np.ndarray, "states"] = field(init=False)
    local: Int32[np.ndarray, "states"] = field(init=False)

    def __post_init__(self):
        sizes = [scene.n_states for scene in self.scenes]
        offsets = np.repeat(scene_offsets(self.scenes), sizes)
        for name, value in (
            ("successor", successor_table(self.scenes)),
            ("tables", target_tables(self.scenes, self.targets)),
            ("scene", np.repeat(np.arange(len(sizes)), sizes).astype(np.int32)),
            ("local", (np.arange(sum(sizes)) - offsets).astype(np.int32)),
        ):
            object.__setattr__(self, name, value)

    @cached_property
    def observed(self) -> list[np.ndarray]:
        """What is observed of the views of each scene."""
        frames = self.options.obs == "frames"
        return [scene.views if frames else scene.encoded for scene in self.scenes]

    def space(self) -> spaces.Dict:
        """Space of one observation."""
        shape = self.observed[0].shape[1:]
        if self.options.obs == "frames":
            box = spaces.Box(0, 255, shape, np.uint8)
        elif self.options.bounded:
            low, high = min(x.min() for x in self.observed), max(x.max() for x in self.observed)
            box = spaces.Box(low, high, shape, np.float32)
        else:
            box = spaces.Box(-np.inf, np.inf, shape, np.float32)
        history = self.options.history
        return spaces.Dict({"view": box if history == 1 else batch_space(box, history), "target": box})

    def view(self, state: int) -> np.ndarray:
        """What is observed in a state of the world; not a copy."""
        return self.observed[self.scene[state]][self.local[state]]

    def views(self, states: Int32[np.ndarray, "*batch"]) -> np.ndarray:
        """What is observed in several states: a new array [*batch, ...]."""
        if len(self.observed) == 1:
            return self.observed[0][states]
        result = np.empty((*states.shape, *self.observed[0].shape[1:]), self.observed[0].dtype)
        scene, local = self.scene[states], self.local[states]
        for number in np.unique(scene):
            here = scene == number
            result[here] = self.observed[number][local[here]]
        return result

    def distance(self, states: Int32[np.ndarray, "*batch"], rows: Int32[np.ndarray, "*batch"]) -> np.ndarray:
        """Smallest number of actions from states to targets."""
        return self.tables.distance[rows, self.local[states]]

    def rewarded(self, before: int, action: int, after: int, target: int, collided: bool) -> float:
        """Reward of one transition between states of the world; `target` is a state, too."""
        reward, arrived = self.options.reward, after == target
        if reward is None:
            return MANUAL.target if arrived else MANUAL.collision if collided else MANUAL.step
        views = (self.view(state) for state in (before, after, target))
        facts = (np.int32(action), np.bool_(collided), np.bool_(arrived))
        return float(reward(TransitionFeatures(*views, *facts)))  # pyrefly: ignore

    def picture(self, state: int, target: int) -> np.ndarray:
        """The view of a state and the target's view, side by side."""
        assert self.pictures is not None
        return np.concatenate([self.pictures[self.scene[s]][self.local[s]] for s in (state, target)], axis=1)


def checked_action(action: object) -> int:
    """The number of an action.

    Args:
        action: what an agent gives.

    Returns:
        0 to 3.

    Raises:
        gymnasium.error.InvalidAction: it is no action.
    """
    try:
        number = operator.index(action)  # pyrefly: ignore
    except TypeError as error:
        raise gymnasium.error.InvalidAction(f"{action!r} is no action; {_ALLOWED}") from error
    if not 0 <= number < len(ACTIONS):
        raise gymnasium.error.InvalidAction(f"{number} is no action; {_ALLOWED}")
    return number


def checked_actions(actions: object, count: int) -> Int32[np.ndarray, "agents"]:
    """The numbers of the actions of several agents.

    Args:
        actions: what the agents give.
        count: number of agents.

    Returns:
        0 to 3 for each agent.

    Raises:
        gymnasium.error.InvalidAction: one is no action, or there is not one for each agent.
    """
    numbers = np.asarray(actions)
    if numbers.shape != (count,) or not np.issubdtype(numbers.dtype, np.integer):
        raise gymnasium.error.InvalidAction(
            f"Actions of shape {numbers.shape} and type {numbers.dtype} are given; {count} whole numbers are needed."
        )
    if numbers.min() < 0 or numbers.max() >= len(ACTIONS):
        wrong = next(int(number) for number in numbers if not 0 <= number < len(ACTIONS))
        raise gymnasium.error.InvalidAction(f"{wrong} is no action; {_ALLOWED}")
    return numbers.astype(np.int32)


_ALLOWED = "give " + ", ".join(f"{number} ({name})" for number, name in enumerate(ACTIONS)) + "."
