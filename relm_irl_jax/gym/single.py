"""Environments for one agent, stepped by looking up numbers in tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from relm_irl_jax.api.scenes import Scenes
from relm_irl_jax.config import Config
from relm_irl_jax.gym.problem import NavigationProblem, Options, checked_action
from relm_irl_jax.gym.scenes import navigation_problem, task_problem
from relm_irl_jax.gym.task_config import task_scenes
from relm_irl_jax.scenes.scene import ACTIONS, Scene
from relm_irl_jax.transitions import FeatureReward


class ProblemEnv(gymnasium.Env):
    """An environment for one agent in the scenes of a problem.

    Args:
        problem: scenes and targets; every episode draws its target uniformly, then its start uniformly from the other
            states that can reach it.
        render_mode: `rgb_array` for the current view and the target's view side by side, or None.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}  # noqa: RUF012

    def __init__(self, problem: NavigationProblem, render_mode: str | None = None):
        self.problem, self.render_mode = problem, render_mode
        self.action_space = spaces.Discrete(len(ACTIONS))
        self.observation_space = problem.space()
        self._successors: list[list[int]] = problem.successor.tolist()
        self._cap, self._history = problem.options.cap, problem.options.history
        self._row: int | None = None
        self._steps = self._shortest = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode; see `gymnasium.Env.reset`."""
        super().reset(seed=seed)
        tables = self.problem.tables
        row = self._row = int(self.np_random.integers(len(tables.state)))
        start = int(tables.start[row, self.np_random.integers(tables.n_starts[row])])
        self._states = [start] * self._history
        self._target, self._steps = int(tables.state[row]), 0
        self._distances: list[int] = tables.distance[row].tolist()
        self._shortest = self._distance()
        return self._observe(), self._info()

    def step(self, action):
        """Take one action; see `gymnasium.Env.step`.

        Raises:
            gymnasium.error.InvalidAction: the action is no whole number from 0 to 3.
        """
        if self._row is None:
            raise gymnasium.error.ResetNeeded("Call reset before step.")
        number = checked_action(action)
        before = self._states[0]
        state = self._successors[before][number]
        self._states = [state, *self._states[:-1]]
        self._steps += 1
        terminated = state == self._target
        truncated = self._steps >= self._cap and not terminated
        reward = self.problem.rewarded(before, number, state, self._target, state == before)
        return self._observe(), reward, terminated, truncated, self._info()

    def render(self):
        """The current view and the target's view, side by side, as RGB."""
        if self.render_mode is None or self._row is None:
            return None
        return self.problem.picture(self._states[0], self._target)

    def _observe(self) -> dict[str, np.ndarray]:
        view = self.problem.view
        if self._history == 1:
            return {"view": view(self._states[0]).copy(), "target": view(self._target).copy()}
        return {"view": np.stack([view(state) for state in self._states]), "target": view(self._target).copy()}

    def _distance(self) -> int:
        return self._distances[self.problem.local[self._states[0]]]

    def _info(self) -> dict[str, Any]:
        distance = self._distance()
        return {"distance": distance, "shortest": self._shortest, "steps": self._steps, "success": distance == 0}


class NavigationEnv(ProblemEnv):
    """Navigation in one scene, for one agent: `RelmIrl/Navigation-v0`.

    Args:
        scene: a scene, a scene file, or the name of a built-in room such as `bathroom-0`.
        target: a state, several states, or a category of objects, which stands for its best view. By default the target
            of every episode is the best view of a random object, or a random state if the scene has no labels.
        cap: number of steps after which an episode is truncated.
        obs: `features` or `frames`; for frames, views are not encoded.
        reward: a function of `relm_irl_jax.transitions.TransitionFeatures`; by default the hand-made reward.
        render_mode: `rgb_array` for the current view and the target's view side by side, or None.
        history: number of last views in an observation.
    """

    def __init__(
        self,
        scene: Scene | Path | str = "bathroom-0",
        target: int | str | Sequence[int] | None = None,
        *,
        cap: int = 100,
        obs: str = "features",
        reward: FeatureReward | None = None,
        render_mode: str | None = None,
        history: int = 1,
    ):
        options = Options(cap, obs, history, reward)
        super().__init__(navigation_problem(scene, target, options, rendered=render_mode is not None), render_mode)


class TaskEnv(ProblemEnv):
    """A task of the paper, for one agent: `RelmIrl/Task-v0`.

    Args:
        task: `I` for trained targets, `II` for new targets in the training scenes, `III` for similar ones in unseen
            scenes.
        seed: the seed that draws the targets, as `relm-irl train` does for the same seed.
        split: `train` for the training scenes and targets, which are the same for all tasks; `test` for the scenes and
            targets on which the task is evaluated.
        scenes: the training scenes: a list, `rooms` for the built-in rooms, or a folder of scene files.
        unseen: scenes of Task III, where the training scenes are a list.
        cap: number of steps after which an episode is truncated; by default the configuration's.
        obs: `features` or `frames`; for frames, views are not encoded.
        reward: a function of `relm_irl_jax.transitions.TransitionFeatures`; by default the hand-made reward.
        render_mode: `rgb_array` for the current view and the target's view side by side, or None.
        history: number of last views in an observation.
        config: numbers of scenes and targets, the encoder; by default those of `relm-irl train`.
    """

    def __init__(
        self,
        task: str = "II",
        seed: int = 0,
        split: str = "train",
        *,
        scenes: Scenes | None = None,
        unseen: Sequence[Scene] | None = None,
        cap: int | None = None,
        obs: str = "features",
        reward: FeatureReward | None = None,
        render_mode: str | None = None,
        history: int = 1,
        config: Config | None = None,
    ):
        chosen = task_scenes(task, scenes, unseen, cap, config)
        options = Options(chosen.config.tasks.cap, obs, history, reward, bounded=False)
        super().__init__(task_problem(chosen, seed, split, options, rendered=render_mode is not None), render_mode)
