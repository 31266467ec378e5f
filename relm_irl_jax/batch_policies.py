"""Evaluation of a user's own policy: a function from a batch of observations to actions, in any framework.

A `BatchPolicy` sees what the Gymnasium environments show, for many agents at once:

    observation = {"view": [agents, ...], "target": [agents, ...]}     features or frames
    policy(observation) -> [agents] numbers of actions

A model of stable-baselines3 is `lambda observation: model.predict(observation)[0]`. A policy with a memory has a method
`reset(agents)`, which is called with the number of agents before their first observation. Row i then belongs to one
agent for a whole episode, and all agents' episodes begin together.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int32, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import Episodes, draw_episodes
from relm_irl_jax.scenes.scene import ACTIONS
from relm_irl_jax.world import Targets, World

BatchPolicy = Callable[[dict[str, np.ndarray]], Any]
"""Maps observations of many agents to the numbers of their actions."""

OBSERVATION_BYTES = 2**27
"""Most memory of the observations of agents that act side by side."""


@dataclass(frozen=True)
class Protocol:
    """How a policy is evaluated.

    Attributes:
        cap: number of steps after which an episode counts as failed.
        episodes: number of episodes in each scene.
        history: number of last views in an observation, the latest first.
    """

    cap: int
    episodes: int
    history: int = 1

    def __post_init__(self):
        if self.history < 1:
            raise InputError(f"history = {self.history} is refused; give at least 1 view.")


def evaluate_batch_policy(
    key: PRNGKeyArray,
    policy: BatchPolicy,
    world: World,
    targets: Targets,
    observed: Sequence[np.ndarray],
    protocol: Protocol,
    *,
    advance: Callable[[int], None] | None = None,
) -> Episodes:
    """Run episodes in every scene; starts and targets are those of `relm_irl_jax.evaluation.evaluate` for the same key.

    Args:
        key: source of the starts and targets; the policy's randomness is its own.
        policy: the policy.
        world: the scenes.
        targets: the targets; every scene has at least one.
        observed: what is observed of the views of each scene, [states, ...].
        protocol: cap, number of episodes and observation.
        advance: called with the number of episodes that have ended since its last call.

    Returns:
        The finished episodes.

    Raises:
        InputError: the policy does not return one action for each agent.
    """
    drawn, _ = draw_episodes(key, targets, world.n_scenes, protocol.episodes)
    shortest = np.asarray(env.shortest_path(drawn, world, targets))
    start, target = np.asarray(drawn.start).ravel(), np.asarray(targets.state)[np.asarray(drawn.target).ravel()]
    length, success = np.zeros(target.shape, np.int32), np.zeros(target.shape, bool)
    views = _Views(world, observed)
    lanes = max(1, OBSERVATION_BYTES // max(1, views.bytes * (protocol.history + 1)))
    for begin in range(0, len(target), lanes):
        lane = slice(begin, begin + lanes)
        length[lane], success[lane] = _run(policy, views, start[lane], target[lane], protocol)
        if advance is not None:
            advance(len(length[lane]))
    shape = drawn.target.shape
    return Episodes(
        target=np.asarray(drawn.target),
        start=np.asarray(drawn.start),
        length=length.reshape(shape),
        shortest=shortest,
        success=success.reshape(shape),
    )


class _Views:
    """What is observed in states of the world, and where actions lead."""

    def __init__(self, world: World, observed: Sequence[np.ndarray]):
        self.scene, self.local = np.asarray(world.scene), np.asarray(world.local)
        self.successor, self.observed = np.asarray(world.successor), observed
        self.bytes = observed[0][0].nbytes

    def __getitem__(self, states: np.ndarray) -> np.ndarray:
        result = np.empty((*states.shape, *self.observed[0].shape[1:]), self.observed[0].dtype)
        scene, local = self.scene[states], self.local[states]
        for number in np.unique(scene):
            here = scene == number
            result[here] = self.observed[number][local[here]]
        return result


def _run(
    policy: BatchPolicy, views: _Views, start: np.ndarray, target: np.ndarray, protocol: Protocol
) -> tuple[Int32[np.ndarray, "agents"], np.ndarray]:
    """Lengths and successes of episodes that begin together; an agent whose episode has ended stays where it is."""
    if hasattr(policy, "reset"):
        policy.reset(len(start))  # pyrefly: ignore
    cap, history = protocol.cap, protocol.history
    states = np.repeat(start[:, None], history, axis=1)
    length, success = np.full(len(start), cap, np.int32), np.zeros(len(start), bool)
    target_views = views[target]
    for step in range(1, cap + 1):
        seen = views[states[:, 0]] if history == 1 else views[states]
        actions = _checked(policy({"view": seen, "target": target_views}), len(start))
        state = np.where(success, states[:, 0], views.successor[states[:, 0], actions])
        states = np.concatenate([state[:, None], states[:, :-1]], axis=1)
        arrives = (state == target) & ~success
        length[arrives] = step
        success |= arrives
        if success.all():
            break
    return length, success


def _checked(actions: Any, agents: int) -> np.ndarray:
    numbers = np.asarray(actions)
    if numbers.shape != (agents,) or not np.issubdtype(numbers.dtype, np.integer):
        raise InputError(
            f"policy: returned {numbers.dtype} of shape {numbers.shape} for {agents} agents; return one whole number "
            f"from 0 to {len(ACTIONS) - 1} for each."
        )
    if not ((numbers >= 0) & (numbers < len(ACTIONS))).all():
        raise InputError(f"policy: returned actions outside 0 to {len(ACTIONS) - 1}; return numbers in that range.")
    return numbers
