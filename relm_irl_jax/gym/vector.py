"""Environments for many agents in lockstep, stepped by looking up arrays of numbers in tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from relm_irl_jax.api.scenes import Scenes
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.gym.problem import MANUAL, NavigationProblem, Options, checked_actions
from relm_irl_jax.gym.scenes import navigation_problem, task_problem
from relm_irl_jax.gym.task_config import task_scenes
from relm_irl_jax.scenes.scene import ACTIONS, Scene
from relm_irl_jax.transitions import FeatureReward


class ProblemVectorEnv(VectorEnv):
    """Many agents in lockstep in the scenes of a problem.

    Args:
        num_envs: number of agents.
        problem: scenes and targets, drawn for each agent as in `ProblemEnv`.
        render_mode: `rgb_array` for one image for each agent, or None.
        autoreset_mode: `NEXT_STEP`: an agent whose episode has ended starts another one on its next step, which ignores
            the action and has reward 0. `SAME_STEP`: it starts another one at once; the last observation and facts of
            the episode are `final_obs` and `final_info`.
    """

    def __init__(
        self,
        num_envs: int,
        problem: NavigationProblem,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ):
        if num_envs < 1:
            raise InputError(f"num_envs = {num_envs} is refused; give at least 1 agent.")
        mode = AutoresetMode(autoreset_mode)
        if mode == AutoresetMode.DISABLED:
            raise InputError("autoreset_mode: DISABLED is refused; give NEXT_STEP or SAME_STEP.")
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": 4, "autoreset_mode": mode}
        self.problem, self.num_envs, self.render_mode, self._same_step = (
            problem,
            num_envs,
            render_mode,
            mode == AutoresetMode.SAME_STEP,
        )
        self.single_action_space = spaces.Discrete(len(ACTIONS))
        self.single_observation_space = problem.space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._states: np.ndarray | None = None  # [agents, history], the latest first
        self._rows = self._start = self._steps = np.zeros(num_envs, np.int32)
        self._over = np.zeros(num_envs, bool)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode for every agent; see `gymnasium.vector.VectorEnv.reset`."""
        super().reset(seed=seed)
        self._states = np.zeros((self.num_envs, self.problem.options.history), np.int32)
        self._rows, self._start, self._steps = (np.zeros(self.num_envs, np.int32) for _ in range(3))
        self._begin(np.ones(self.num_envs, bool))
        self._over = np.zeros(self.num_envs, bool)
        return self._observe(), self._info()

    def step(self, actions):
        """Take one action with every agent; see `gymnasium.vector.VectorEnv.step`."""
        if self._states is None:
            raise gymnasium.error.ResetNeeded("Call reset before step.")
        numbers, waiting = checked_actions(actions, self.num_envs), self._over
        before = self._states[:, 0]
        state = self.problem.successor[before, numbers]
        self._states = np.concatenate([state[:, None], self._states[:, :-1]], axis=1)
        self._steps = self._steps + 1
        target = self.problem.tables.state[self._rows]
        terminated = (state == target) & ~waiting
        truncated = (self._steps >= self.problem.options.cap) & ~terminated & ~waiting
        reward = np.where(waiting, 0.0, self._rewards(before, numbers, state, target))
        final: dict[str, Any] = {}
        over = terminated | truncated
        if self._same_step and over.any():
            final = self._final(over)
        self._begin(over if self._same_step else waiting)
        self._over = np.zeros(self.num_envs, bool) if self._same_step else over
        return self._observe(), reward, terminated, truncated, self._info() | final

    def render(self):
        """One image for each agent: its view and its target's view, side by side."""
        if self.render_mode is None or self._states is None:
            return None
        target = self.problem.tables.state[self._rows]
        return tuple(self.problem.picture(int(s), int(t)) for s, t in zip(self._states[:, 0], target, strict=True))

    def _begin(self, which: np.ndarray) -> None:
        """Start an episode for some agents."""
        count = int(which.sum())
        if not count:
            return
        assert self._states is not None
        tables = self.problem.tables
        rows = self.np_random.integers(len(tables.state), size=count)
        start = tables.start[rows, self.np_random.integers(tables.n_starts[rows])]
        self._rows[which], self._start[which], self._steps[which] = rows, start, 0
        self._states[which] = start[:, None]

    def _rewards(self, before: np.ndarray, actions: np.ndarray, after: np.ndarray, target: np.ndarray) -> np.ndarray:
        collided = before == after
        if self.problem.options.reward is None:
            return np.where(after == target, MANUAL.target, np.where(collided, MANUAL.collision, MANUAL.step))
        transitions = zip(*(x.tolist() for x in (before, actions, after, target, collided)), strict=True)
        return np.asarray([self.problem.rewarded(*transition) for transition in transitions])

    def _observe(self) -> dict[str, np.ndarray]:
        assert self._states is not None
        states = self._states[:, 0] if self.problem.options.history == 1 else self._states
        return {"view": self.problem.views(states), "target": self.problem.views(self.problem.tables.state[self._rows])}

    def _info(self) -> dict[str, Any]:
        assert self._states is not None
        distance = self.problem.distance(self._states[:, 0], self._rows)
        info = {
            "distance": distance,
            "shortest": self.problem.distance(self._start, self._rows),
            "steps": self._steps.copy(),
            "success": distance == 0,
        }
        return info | {f"_{name}": np.ones(self.num_envs, bool) for name in info}

    def _final(self, over: np.ndarray) -> dict[str, Any]:
        """The last observations and facts of the episodes that end, as Gymnasium's vector environments give them."""
        observation = self._observe()
        last = np.empty(self.num_envs, object)
        for agent in np.flatnonzero(over):
            last[agent] = {name: values[agent] for name, values in observation.items()}
        facts = {name: np.where(over, values, 0) for name, values in self._info().items() if name[0] != "_"}
        facts |= {f"_{name}": over for name in facts}
        return {"final_obs": last, "_final_obs": over, "final_info": facts, "_final_info": over}


class NavigationVectorEnv(ProblemVectorEnv):
    """Navigation in one scene, for many agents: the vector form of `RelmIrl/Navigation-v0`.

    Args:
        num_envs: number of agents.
        scene: see `NavigationEnv`.
        target: see `NavigationEnv`.
        cap: see `NavigationEnv`.
        obs: see `NavigationEnv`.
        reward: see `NavigationEnv`; called for one agent after the other.
        render_mode: `rgb_array` for one image for each agent, or None.
        history: see `NavigationEnv`.
        autoreset_mode: see `ProblemVectorEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scene: Scene | Path | str = "bathroom-0",
        target: int | str | Sequence[int] | None = None,
        *,
        cap: int = 100,
        obs: str = "features",
        reward: FeatureReward | None = None,
        render_mode: str | None = None,
        history: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ):
        options = Options(cap, obs, history, reward)
        problem = navigation_problem(scene, target, options, rendered=render_mode is not None)
        super().__init__(num_envs, problem, render_mode, autoreset_mode)


class TaskVectorEnv(ProblemVectorEnv):
    """A task of the paper, for many agents: the vector form of `RelmIrl/Task-v0`.

    Args:
        num_envs: number of agents.
        task: see `TaskEnv`.
        seed: see `TaskEnv`.
        split: see `TaskEnv`.
        scenes: see `TaskEnv`.
        unseen: see `TaskEnv`.
        cap: see `TaskEnv`.
        obs: see `TaskEnv`.
        reward: see `TaskEnv`; called for one agent after the other.
        render_mode: `rgb_array` for one image for each agent, or None.
        history: see `TaskEnv`.
        config: see `TaskEnv`.
        autoreset_mode: see `ProblemVectorEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
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
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ):
        chosen = task_scenes(task, scenes, unseen, cap, config)
        options = Options(chosen.config.tasks.cap, obs, history, reward, bounded=False)
        problem = task_problem(chosen, seed, split, options, rendered=render_mode is not None)
        super().__init__(num_envs, problem, render_mode, autoreset_mode)
