"""Pure functions with gymnax's interface, for agents that are jitted and vmapped together with their environment.

    environment, params = functional_env(TaskVectorEnv(task="II", seed=0, split="train").problem)
    observation, state = environment.reset(key, params)
    observation, state, reward, done, info = environment.step(key, state, action, params)

This is the interface of gymnax before version 1.0, which PureJaxRL and others expect; `step` of later versions returns
`terminated` and `truncated` in place of `done`. As in gymnax, `step` starts another episode when one ends: the
observation is then the new episode's first, and `info["terminated"]` and `info["truncated"]` say how the last one
ended. An action outside 0 to 3 is taken as the nearest one, since compiled functions raise no errors.
"""

from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.env import Episode, TargetRange
from relm_irl_jax.gym.problem import MANUAL, NavigationProblem
from relm_irl_jax.rewards.functions import OwnReward, manual_reward
from relm_irl_jax.transitions import FeatureReward
from relm_irl_jax.world import Targets, World, build_targets, build_world

Observation = dict[str, Array]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EnvParams:
    """What the environment depends on; a pytree of arrays.

    Attributes:
        world: the scenes, with the features that are observed.
        targets: the targets.
        max_steps_in_episode: number of steps after which an episode is truncated.
    """

    world: World
    targets: Targets
    max_steps_in_episode: Int32[Array, ""]


@dataclass(frozen=True)
class FunctionalEnv:
    """Target-driven navigation as pure functions of one agent; `jax.vmap` makes them many agents'.

    Attributes:
        reward: a function of `TransitionFeatures`; None for the hand-made reward.
        default_params: scenes and targets.
    """

    reward: FeatureReward | None
    default_params: EnvParams = field(compare=False)

    @property
    def num_actions(self) -> int:
        """Number of actions."""
        return 4

    def reset(self, key: PRNGKeyArray, params: EnvParams | None = None) -> tuple[Observation, Episode]:
        """Start an episode.

        Args:
            key: source of randomness.
            params: scenes and targets; None for the default ones.

        Returns:
            The observation and the state.
        """
        params = params or self.default_params
        count = jnp.int32(params.targets.state.shape[0])
        episode = env.reset(key, params.targets, TargetRange(jnp.int32(0), count))
        return self._observe(episode, params), episode

    def step(
        self, key: PRNGKeyArray, state: Episode, action: Int32[Array, ""] | int, params: EnvParams | None = None
    ) -> tuple[Observation, Episode, Float32[Array, ""], Bool[Array, ""], dict[str, Any]]:
        """Take one action; start another episode if this one ends.

        Args:
            key: source of randomness.
            state: the state.
            action: number of the action.
            params: scenes and targets; None for the default ones.

        Returns:
            Observation, state, reward, whether the episode ended, and facts: `terminated`, `truncated`, `distance` from
            the state after the action, and `steps` taken.
        """
        params = params or self.default_params
        number = jnp.clip(jnp.asarray(action, jnp.int32), 0, 3)
        after, transition = env.step(state, number, params.world, params.targets, params.max_steps_in_episode)
        done = transition.terminated | transition.truncated
        facts = {
            "terminated": transition.terminated,
            "truncated": transition.truncated,
            "distance": params.targets.distance[after.target, params.world.local[after.state]],
            "steps": after.steps,
        }
        following = env.select(done, self.reset(key, params)[1], after)
        return self._observe(following, params), following, self._reward(transition, params), done, facts

    def _reward(self, transition: env.Transition, params: EnvParams) -> Float32[Array, ""]:
        if self.reward is None:
            return manual_reward(MANUAL)(transition, params.world, params.targets)
        return OwnReward(params.world.features, self.reward)(transition, params.world, params.targets)

    @staticmethod
    def _observe(episode: Episode, params: EnvParams) -> Observation:
        features = params.world.features
        return {"view": features[episode.state], "target": features[params.targets.state[episode.target]]}


def functional_env(problem: NavigationProblem) -> tuple[FunctionalEnv, EnvParams]:
    """The pure functions of a problem.

    Args:
        problem: scenes with features, and targets; the attribute `problem` of every environment of this package.

    Returns:
        The environment and its parameters. A reward other than the hand-made one must be traceable by JAX.

    Raises:
        InputError: a scene has no features, as where frames are observed.
    """
    params = EnvParams(
        world=build_world(problem.scenes),
        targets=build_targets(problem.scenes, problem.targets),
        max_steps_in_episode=jnp.int32(problem.options.cap),
    )
    return FunctionalEnv(problem.options.reward, params), params
