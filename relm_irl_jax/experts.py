"""Experts: what a demonstrator does at every state of a scene on the way to one target.

The expert follows a shortest path. Everything here is per scene and runs on the host, in numpy.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene import UNREACHABLE, Scene, successors

NO_ACTION = -1
"""Entry of `Expert.action` where there is nothing to decide."""


@dataclass(frozen=True)
class Expert:
    """What a demonstrator does at every state on the way to one target.

    The target is absorbing: it has no decision and leads to itself. So does a state from which the target
    cannot be reached. Elsewhere `action` is the demonstrator's, and following `next_state` arrives at the
    target.

    Attributes:
        target: the state where the demonstrator stops.
        action: column of `Scene.graph` that the demonstrator takes, or `NO_ACTION`.
        next_state: state that the action leads to; the state itself where there is no decision.
        suboptimal: whether the action is strictly worse than the demonstrator's: the demonstrator, taking
            over after it, needs more steps to the target, or can no longer reach it. Ties are not
            sub-optimal.
        better: whether the action is strictly better; never so for a shortest-path expert.
    """

    target: int
    action: Int32[np.ndarray, "states"]
    next_state: Int32[np.ndarray, "states"]
    suboptimal: Bool[np.ndarray, "states 4"]
    better: Bool[np.ndarray, "states 4"]


@dataclass(frozen=True)
class Trajectory:
    """One demonstration: a walk from a start to a target.

    Attributes:
        states: the states in order, the last one being the target.
        actions: the action taken at each state but the last.
        target: the state where the walk ends.
    """

    states: Int32[np.ndarray, "steps+1"]
    actions: Int32[np.ndarray, "steps"]
    target: int

    @property
    def start(self) -> int:
        """The first state."""
        return int(self.states[0])


def shortest_path_expert(scene: Scene, target: int) -> Expert:
    """The expert that takes a shortest path to the target from every state.

    Among several shortest paths it takes the action that comes first in `ACTIONS`.

    Args:
        scene: the scene.
        target: the state to reach.

    Returns:
        The expert's decision at every state.
    """
    _check_states(scene, "target", [target])
    distance = scene.shortest_path_distance[:, target]
    steps = np.where(distance == UNREACHABLE, np.inf, distance)
    action = np.argmin(steps[successors(scene.graph)], axis=1).astype(np.int32)
    action[(distance == UNREACHABLE) | (np.arange(scene.n_states) == target)] = NO_ACTION
    return policy_expert(scene, target, action)


def policy_expert(scene: Scene, target: int, action: Int32[np.ndarray, "states"]) -> Expert:
    """The expert that follows a given deterministic policy, whether or not it is optimal.

    Args:
        scene: the scene.
        target: the state to reach; the policy's action there is ignored.
        action: the policy's action at every state, or `NO_ACTION` to stay.

    Returns:
        The expert. An action is called worse or better by the number of steps that the same policy then
        needs.
    """
    states = np.arange(scene.n_states, dtype=np.int32)
    following = successors(scene.graph)
    decides = (action != NO_ACTION) & (states != target)
    next_state = np.where(decides, following[states, np.where(decides, action, 0)], states).astype(np.int32)
    steps = _steps_to(target, next_state)
    decides &= np.isfinite(steps)
    own = steps[next_state][:, None]
    alternatives = steps[following]
    return Expert(
        target=int(target),
        action=np.where(decides, action, NO_ACTION).astype(np.int32),
        next_state=np.where(decides, next_state, states).astype(np.int32),
        suboptimal=decides[:, None] & (alternatives > own),
        better=decides[:, None] & (alternatives < own),
    )


def expert_trajectories(scene: Scene, target: int, starts: Iterable[int]) -> tuple[Trajectory, ...]:
    """Walk the shortest-path expert from each start to the target.

    Args:
        scene: the scene.
        target: the state to reach.
        starts: where the walks begin; each must be able to reach the target and must not be it.

    Returns:
        One trajectory per start, in the order given.
    """
    starts = list(starts)
    _check_states(scene, "start", starts)
    expert = shortest_path_expert(scene, target)
    return tuple(walk(scene, expert, start) for start in starts)


def walk(scene: Scene, expert: Expert, start: int) -> Trajectory:
    """Follow an expert from one start to its target.

    Args:
        scene: the scene, named in errors.
        expert: the expert to follow.
        start: where the walk begins.

    Returns:
        The trajectory.
    """
    if start == expert.target:
        raise InputError(f"{scene.name}: the walk to state {expert.target} starts at its target; give another start.")
    states = [int(start)]
    while states[-1] != expert.target:
        if expert.action[states[-1]] == NO_ACTION:
            raise InputError(
                f"{scene.name}: the walk from state {start} cannot reach the target {expert.target}; "
                "choose a start that can."
            )
        states.append(int(expert.next_state[states[-1]]))
    visited = np.asarray(states, np.int32)
    return Trajectory(states=visited, actions=expert.action[visited[:-1]], target=expert.target)


def sub_walks(
    trajectories: Sequence[Trajectory], forbidden: Collection[int] = ()
) -> Mapping[int, Int32[np.ndarray, "walked"]]:
    """Read further demonstrations off shortest paths.

    On a shortest path the walk between any two of its states is itself a shortest path, so every state after
    the first serves as one more target, with the states before it as demonstrations.

    Args:
        trajectories: shortest paths within one scene.
        forbidden: states that never serve as a target, for example those kept for evaluation.

    Returns:
        For each end state, in ascending order, the distinct states on the walks that lead to it, ascending.
    """
    excluded = {int(state) for state in forbidden}
    leading: dict[int, set[int]] = {}
    for trajectory in trajectories:
        states = trajectory.states.tolist()
        for position, end in enumerate(states[1:], start=1):
            if end not in excluded:
                leading.setdefault(end, set()).update(states[:position])
    return {end: np.asarray(sorted(leading[end]), np.int32) for end in sorted(leading)}


def _steps_to(target: int, next_state: Int32[np.ndarray, "states"]) -> np.ndarray:
    """Number of steps that a policy needs from each state to the target, infinite where it never arrives."""
    steps = np.full(len(next_state), np.inf)
    steps[target] = 0.0
    while True:
        updated = np.minimum(steps, steps[next_state] + 1.0)
        if np.array_equal(updated, steps):
            return steps
        steps = updated


def _check_states(scene: Scene, role: str, states: Sequence[int]) -> None:
    outside = [state for state in states if not 0 <= state < scene.n_states]
    if outside:
        raise InputError(
            f"{scene.name}: {role} {outside[0]} is not a state of the scene; give one of 0 to {scene.n_states - 1}."
        )
