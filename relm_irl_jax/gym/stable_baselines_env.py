"""Adapter to `stable_baselines3.common.vec_env.VecEnv`; importing it needs stable-baselines3."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from relm_irl_jax.gym.vector import ProblemVectorEnv


class StableBaselines3Env(VecEnv):
    """A vector environment with stable-baselines3's interface; see `stable_baselines3_env`.

    The last dictionary of an episode holds what stable-baselines3 expects there: `terminal_observation`,
    `TimeLimit.truncated`, and `episode` with reward `r`, length `l` and time `t`.

    Args:
        environment: a vector environment that resets in the same step.
    """

    def __init__(self, environment: ProblemVectorEnv):
        self.environment, self.render_mode = environment, environment.render_mode
        super().__init__(environment.num_envs, environment.single_observation_space, environment.single_action_space)
        self._returns, self._began = np.zeros(environment.num_envs), time.time()
        self._actions = np.zeros(environment.num_envs, np.int64)

    def reset(self):
        """Start an episode for every agent."""
        observation, _ = self.environment.reset(seed=self._seeds[0])
        self._reset_seeds()
        self._returns[:] = 0
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self):
        """Take the actions: observation, rewards, whether episodes ended, one dictionary for each agent."""
        observation, reward, terminated, truncated, facts = self.environment.step(self._actions)
        over, infos = terminated | truncated, [{} for _ in range(self.num_envs)]
        self._returns += reward
        for agent in np.flatnonzero(over):
            last = {name: facts["final_info"][name][agent].item() for name in ("distance", "shortest", "success")}
            length = int(facts["final_info"]["steps"][agent])
            infos[agent] = {
                "terminal_observation": facts["final_obs"][agent],
                "TimeLimit.truncated": bool(truncated[agent]),
                "episode": {"r": float(self._returns[agent]), "l": length, "t": time.time() - self._began},
                "is_success": bool(terminated[agent]),
                **last,
            }
        self._returns[over] = 0
        return observation, reward.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the environment."""
        self.environment.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """One image for each agent."""
        return self.environment.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices=None) -> list[Any]:
        """The environment's attribute, once for each agent."""
        return [getattr(self.environment, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices=None) -> None:
        """Set an attribute of the environment, for all agents."""
        setattr(self.environment, attr_name, value)

    def env_method(self, method_name: str, *method_args, indices=None, **method_kwargs) -> list[Any]:
        """Call a method of the environment once; the result, for each agent."""
        result = getattr(self.environment, method_name)(*method_args, **method_kwargs)
        return [result] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class, indices=None) -> list[bool]:
        """No agent's environment is wrapped, but all episodes are recorded as by stable-baselines3's `Monitor`."""
        recorded = wrapper_class.__name__ == "Monitor"
        return [recorded] * len(list(self._get_indices(indices)))
