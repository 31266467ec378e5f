"""Gymnasium environments: the navigation task for one agent or many agents in lockstep.

`RelmIrl/Navigation-v0` is the decision process of `relm_irl_jax.env` with Gymnasium's interface:

    gymnasium.make("RelmIrl/Navigation-v0", scene="bathroom-0", target="toilet", cap=100)
    gymnasium.make_vec("RelmIrl/Navigation-v0", num_envs=64, scene="bathroom-0")

The actions are `relm_irl_jax.scenes.scene.ACTIONS`. An observation contains the current view and the target's view, as
feature vectors or as frames; with `history` above 1, the last views, the latest first. `info` contains `distance`
(length of a shortest path from the current state), `shortest` (the same from the start), `steps` and `success`, from
which success weighted by path length can be computed.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from relm_irl_jax import env
from relm_irl_jax.env import Episode, TargetRange
from relm_irl_jax.errors import InputError
from relm_irl_jax.features.cache import encode_scene
from relm_irl_jax.features.encoder import N_CALIBRATION_VIEWS, make_encoder
from relm_irl_jax.features.settings import EncoderSettings, settings_for
from relm_irl_jax.rewards.functions import RewardFunction, manual_reward
from relm_irl_jax.rewards.settings import ManualSettings
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.rooms.cache import built_in_room
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE
from relm_irl_jax.scenes.scene import ACTIONS, ROOM_TYPES, Scene
from relm_irl_jax.scenes.scene_file import load_scene
from relm_irl_jax.tasks import Target
from relm_irl_jax.world import build_targets, build_world


class _Core:
    """The scene's tables, and the environment's functions compiled for a number of agents."""

    def __init__(
        self,
        scene: Scene | Path | str,
        target: int | str | Sequence[int] | None,
        *,
        cap: int,
        obs: str,
        reward: RewardFunction | None,
        history: int,
        agents: int,
    ):
        if obs not in ("features", "frames"):
            raise InputError(f"obs = {obs!r} is refused; give features or frames.")
        if cap < 1:
            raise InputError(f"cap = {cap} is refused; give at least 1 step.")
        if history < 1:
            raise InputError(f"history = {history} is refused; give at least 1 view.")
        self.obs, self.cap, self.history = obs, cap, history
        self.scene = find_scene(scene)
        if self.scene.features is None:
            self.scene = _encoded(self.scene) if obs == "features" else _without_features(self.scene)
        chosen = [Target(0, state) for state in target_states(self.scene, target)]
        self.world = build_world([self.scene])
        self.targets = build_targets([self.scene], chosen)
        self.reward = manual_reward(ManualSettings()) if reward is None else reward
        self.target_range = TargetRange(jnp.zeros(agents, jnp.int32), jnp.full(agents, len(chosen), jnp.int32))
        self.target_state = np.asarray(self.targets.state)
        self.last_states = np.zeros((agents, history), np.int32)

    @cached_property
    def reset(self):
        """Function that starts an episode for every agent."""

        @jax.jit
        def reset(key):
            keys = jax.random.split(key, self.target_range.first.shape)
            return jax.vmap(lambda k, rows: env.reset(k, self.targets, rows))(keys, self.target_range)

        return reset

    @cached_property
    def step(self):
        """Function that takes one action with every agent; agents whose episode has ended start another one instead."""

        @jax.jit
        def advance(episode, action, over, key):
            next_episode, transition = env.step(episode, action, self.world, self.targets, jnp.int32(self.cap))
            reward = jax.vmap(lambda t: self.reward(t, self.world, self.targets))(transition)
            episode = env.select(over, self.reset(key), next_episode)
            return (
                episode,
                jnp.where(over, 0.0, reward),
                transition.terminated & ~over,
                transition.truncated & ~over,
            )

        return advance

    def observation_space(self) -> spaces.Dict:
        """Space of one observation."""
        if self.obs == "frames":
            box = spaces.Box(0, 255, self.scene.views.shape[1:], np.uint8)
        else:
            features = self.scene.encoded
            box = spaces.Box(features.min(), features.max(), features.shape[1:], np.float32)
        return spaces.Dict({"view": box if self.history == 1 else batch_space(box, self.history), "target": box})

    def observe(self, episode: Episode) -> dict[str, np.ndarray]:
        """Last views, the latest first, and target views; before the first step, the first view is repeated."""
        views = self.scene.views if self.obs == "frames" else self.scene.encoded
        state = np.asarray(episode.state)[:, None]
        earlier = np.where(np.asarray(episode.steps)[:, None] == 0, state, self.last_states[:, :-1])
        self.last_states = np.concatenate([state, earlier], axis=1)
        observed = self.last_states[:, 0] if self.history == 1 else self.last_states
        target = self.target_state[np.asarray(episode.target)]
        return {"view": views[observed].copy(), "target": views[target].copy()}

    def info(self, episode: Episode) -> dict[str, np.ndarray]:
        """Distance, shortest path, steps and success of every agent."""
        target = self.target_state[np.asarray(episode.target)]
        distance = self.scene.shortest_path_distance[np.asarray(episode.state), target]
        return {
            "distance": distance,
            "shortest": self.scene.shortest_path_distance[np.asarray(episode.start), target],
            "steps": np.asarray(episode.steps),
            "success": distance == 0,
        }

    def render(self, episode: Episode, agent: int) -> np.ndarray:
        """The current view and the target's view, side by side."""
        target = int(self.target_state[int(episode.target[agent])])
        return np.concatenate([self.scene.views[int(episode.state[agent])], self.scene.views[target]], axis=1)


class NavigationEnv(gymnasium.Env):
    """The navigation task for one agent.

    Args:
        scene: a scene, a scene file, or the name of a built-in room such as `bathroom-0`.
        target: a state, several states, or a category of objects, which stands for its best view. By default the target
            of every episode is the best view of a random object, or a random state if the scene has no labels.
        cap: number of steps after which an episode is truncated.
        obs: `features` or `frames`.
        reward: a reward function; by default the hand-made reward.
        render_mode: `rgb_array` for the current view and the target's view side by side, or None.
        history: number of last views in an observation.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}  # noqa: RUF012

    def __init__(
        self,
        scene: Scene | Path | str = "bathroom-0",
        target: int | str | Sequence[int] | None = None,
        *,
        cap: int = 100,
        obs: str = "features",
        reward: RewardFunction | None = None,
        render_mode: str | None = None,
        history: int = 1,
    ):
        self._core = _Core(scene, target, cap=cap, obs=obs, reward=reward, history=history, agents=1)
        self.render_mode = render_mode
        self.action_space = spaces.Discrete(len(ACTIONS))
        self.observation_space = self._core.observation_space()
        self._key = jax.random.key(0)
        self._episode: Episode | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode; see `gymnasium.Env.reset`."""
        super().reset(seed=seed)
        self._key = jax.random.key(int(self.np_random.integers(2**31)))
        self._episode = self._core.reset(self._key)
        return self._first(self._core.observe(self._episode)), self._info()

    def step(self, action):
        """Take one action; see `gymnasium.Env.step`."""
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("Call reset before step.")
        self._episode, reward, terminated, truncated = self._core.step(
            self._episode, jnp.asarray([action], jnp.int32), jnp.zeros(1, bool), self._key
        )
        observation = self._first(self._core.observe(self._episode))
        return observation, float(reward[0]), bool(terminated[0]), bool(truncated[0]), self._info()

    def render(self):
        """The current view and the target's view, side by side, as RGB."""
        if self.render_mode is None or self._episode is None:
            return None
        return self._core.render(self._episode, 0)

    def _info(self) -> dict[str, Any]:
        assert self._episode is not None
        return {name: values[0].item() for name, values in self._core.info(self._episode).items()}

    @staticmethod
    def _first(batch: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {name: values[0] for name, values in batch.items()}


class NavigationVectorEnv(VectorEnv):
    """The navigation task for many agents in lockstep, stepped by one compiled program.

    An agent whose episode has ended starts another one on its next step, which ignores the action and has reward 0.

    Args:
        num_envs: number of agents.
        scene: see `NavigationEnv`.
        target: see `NavigationEnv`.
        cap: see `NavigationEnv`.
        obs: see `NavigationEnv`.
        reward: see `NavigationEnv`.
        render_mode: `rgb_array` for one image for each agent, or None.
        history: see `NavigationEnv`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4, "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        scene: Scene | Path | str = "bathroom-0",
        target: int | str | Sequence[int] | None = None,
        *,
        cap: int = 100,
        obs: str = "features",
        reward: RewardFunction | None = None,
        render_mode: str | None = None,
        history: int = 1,
    ):
        self._core = _Core(scene, target, cap=cap, obs=obs, reward=reward, history=history, agents=num_envs)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_action_space = spaces.Discrete(len(ACTIONS))
        self.single_observation_space = self._core.observation_space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._episode: Episode | None = None
        self._over = jnp.zeros(num_envs, bool)
        self._key = jax.random.key(0)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Start an episode for every agent; see `gymnasium.vector.VectorEnv.reset`."""
        super().reset(seed=seed)
        self._key = jax.random.key(int(self.np_random.integers(2**31)))
        self._episode = self._core.reset(self._key)
        self._over = jnp.zeros(self.num_envs, bool)
        return self._core.observe(self._episode), self._info()

    def step(self, actions):
        """Take one action with every agent; see `gymnasium.vector.VectorEnv.step`."""
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("Call reset before step.")
        self._key, key = jax.random.split(self._key)
        self._episode, reward, terminated, truncated = self._core.step(
            self._episode, jnp.asarray(actions, jnp.int32), self._over, key
        )
        self._over = terminated | truncated
        observation = self._core.observe(self._episode)
        return (
            observation,
            np.asarray(reward, np.float64),
            np.asarray(terminated),
            np.asarray(truncated),
            self._info(),
        )

    def render(self):
        """One image for each agent: its view and its target's view, side by side."""
        if self.render_mode is None or self._episode is None:
            return None
        return tuple(self._core.render(self._episode, agent) for agent in range(self.num_envs))

    def _info(self) -> dict[str, np.ndarray]:
        assert self._episode is not None
        info = self._core.info(self._episode)
        return info | {f"_{name}": np.ones(self.num_envs, bool) for name in info}


def find_scene(scene: Scene | Path | str) -> Scene:
    """Load the scene that an argument refers to.

    Args:
        scene: a scene, a scene file, or the name of a built-in room such as `bathroom-0`.

    Returns:
        The scene.

    Raises:
        InputError: there is no such scene.
    """
    if isinstance(scene, Scene):
        return scene
    room_type, _, number = str(scene).rpartition("-")
    if room_type in ROOM_TYPES and number.isdecimal():
        return built_in_room(room_type, int(number))
    if Path(scene).is_file():
        return load_scene(Path(scene))
    raise InputError(
        f"scene: {scene} is neither a scene file nor a built-in room; give a path, or a name such as {ROOM_TYPES[0]}-0."
    )


def target_states(scene: Scene, target: int | str | Sequence[int] | None) -> list[int]:
    """States that may be targets of episodes.

    Args:
        scene: the scene.
        target: a state, several states, a category of objects, or None.

    Returns:
        At least one state.

    Raises:
        InputError: the scene has no such state or category.
    """
    views = best_views(scene) if scene.visible_object is not None else {}
    if target is None:
        return sorted(set(views.values())) or list(range(scene.n_states))
    if isinstance(target, str):
        if target not in views:
            shown = ", ".join(sorted(views)) or "no labelled object"
            raise InputError(f"target: {scene.name} shows no {target}; it shows {shown}.")
        return [views[target]]
    states = [int(state) for state in np.atleast_1d(target)]
    outside = [state for state in states if not 0 <= state < scene.n_states]
    if outside or not states:
        raise InputError(f"target: {outside} is not in {scene.name}; give states from 0 to {scene.n_states - 1}.")
    return states


def _encoded(scene: Scene) -> Scene:
    """The scene with features of the default encoder; random weights are calibrated on the scene's views."""
    calibration_views = scene.views[:: max(1, scene.n_states // N_CALIBRATION_VIEWS)]
    settings = settings_for(EncoderSettings(), built_in=scene.source == SOURCE)
    return encode_scene(scene, make_encoder(settings, calibration_views))


def _without_features(scene: Scene) -> Scene:
    """The scene with empty feature vectors, for environments whose observations are frames."""
    return replace(scene, features=np.zeros((scene.n_states, 0), np.float32))
