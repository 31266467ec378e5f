"""Steps of the environment alone: no policy, no reward, actions drawn in advance, episodes that end started anew."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int32, Key, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.env import Episode, TargetRange
from relm_irl_jax.types import TrainingProblem

STEPS = 512
"""Steps of each worker in a call."""


def environment_program(problem: TrainingProblem, workers: int) -> Callable[[], Any]:
    """`STEPS` steps of many workers as one compiled program.

    Args:
        problem: scenes, targets and cap.
        workers: number of workers.

    Returns:
        The program, which returns the last episodes, and for each step which episodes ended and how.
    """
    world, targets, cap = problem.world, problem.targets, jnp.int32(problem.cap)
    count = jnp.full((1, workers), targets.state.shape[0], jnp.int32)
    target_range = TargetRange(jnp.zeros_like(count), count)

    @jax.jit
    def run(episode: Episode, actions: Int32[Array, "step 1 worker"], keys: Key[Array, "_"]):
        def advance(episode: Episode, drawn: tuple[Int32[Array, "1 worker"], PRNGKeyArray]):
            action, key = drawn
            following, transition = env.step(episode, action, world, targets, cap)
            ended = transition.terminated | transition.truncated
            return env.select(ended, env.reset_all(key, targets, target_range), following), (
                transition.terminated,
                transition.truncated,
            )

        return jax.lax.scan(advance, episode, (actions, keys))

    start_key, action_key, reset_key = jax.random.split(jax.random.key(0), 3)
    episode = env.reset_all(start_key, targets, target_range)
    actions = jax.random.randint(action_key, (STEPS, *count.shape), 0, 4)
    keys = jax.random.split(reset_key, STEPS)
    return lambda: run(episode, actions, keys)


def gymnax_program(workers: int) -> Callable[[], Any] | None:
    """The same with gymnax's `FourRooms-misc`, whose `step` also starts episodes anew.

    Args:
        workers: number of workers.

    Returns:
        The program; None if gymnax is not installed.
    """
    try:
        import gymnax  # pyrefly: ignore[missing-import]
    except ImportError:
        return None
    environment, params = gymnax.make("FourRooms-misc")

    @jax.jit
    def run(state: Any, actions: Int32[Array, "step worker"], keys: Key[Array, "_"]):
        def advance(state: Any, drawn: tuple[Int32[Array, " worker"], PRNGKeyArray]):
            action, key = drawn
            _, state, _, *ended = jax.vmap(environment.step, (0, 0, 0, None))(
                jax.random.split(key, workers), state, action, params
            )
            return state, ended[:-1]

        return jax.lax.scan(advance, state, (actions, keys))

    start_key, action_key, step_key = jax.random.split(jax.random.key(0), 3)
    _, state = jax.vmap(environment.reset, (0, None))(jax.random.split(start_key, workers), params)
    actions = jax.random.randint(action_key, (STEPS, workers), 0, 4)
    keys = jax.random.split(step_key, STEPS)
    return lambda: run(state, actions, keys)
