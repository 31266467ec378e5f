"""Experts: deterministic policies that lead to one target of a scene, and the trajectories that follow them.

The paper's expert takes shortest paths. Everything here concerns one scene and runs in numpy.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene import UNREACHABLE, Scene, successors

NO_ACTION = -1
"""Entry of `Expert.action` where the expert has no decision."""


@dataclass(frozen=True)
class Expert:
    """A deterministic policy for one target, and a comparison of its actions with all others.

    The target is absorbing: the expert has no decision there, and its next state is itself. The same holds for states
    from which the policy does not reach the target. From all other states, following `next_state` reaches the target.

    Attributes:
        target: the state where the expert stops.
        action: column of `Scene.graph` that the expert takes, or `NO_ACTION`.
        next_state: state that the action leads to; the state itself if there is no decision.
        suboptimal: whether an action is strictly worse than the expert's: afterwards the expert needs more steps to the
            target, or cannot reach it. An action after which it needs equally many steps is not suboptimal.
        better: whether an action is strictly better than the expert's; never for a shortest-path expert.
    """

    target: int
    action: Int32[np.ndarray, "states"]
    next_state: Int32[np.ndarray, "states"]
    suboptimal: Bool[np.ndarray, "states 4"]
    better: Bool[np.ndarray, "states 4"]


@dataclass(frozen=True)
class Trajectory:
    """One demonstration: a path from a start to a target.

    Attributes:
        states: the states in order; the last one is the target.
        actions: the action taken in each state but the last.
        target: the last state.
    """

    states: Int32[np.ndarray, "visited"]
    actions: Int32[np.ndarray, "visited-1"]
    target: int

    @property
    def start(self) -> int:
        """The first state."""
        return int(self.states[0])


def shortest_path_expert(scene: Scene, target: int) -> Expert:
    """The expert that takes a shortest path to the target from every state.

    Among several shortest paths, it takes the action that comes first in `ACTIONS`.

    Args:
        scene: the scene.
        target: the state to reach.

    Returns:
        The expert.
    """
    _check_states(scene, "target", [target])
    distance = scene.shortest_path_distance[:, target]
    steps = np.where(distance == UNREACHABLE, np.inf, distance)
    action = np.argmin(steps[successors(scene.graph)], axis=1).astype(np.int32)
    action[(distance == UNREACHABLE) | (np.arange(scene.n_states) == target)] = NO_ACTION
    return expert_from_policy(scene, target, action)


def expert_from_policy(scene: Scene, target: int, action: Int32[np.ndarray, "states"]) -> Expert:
    """The expert that follows a given deterministic policy, whether or not it is optimal.

    Args:
        scene: the scene.
        target: the state to reach; the policy's action there is ignored.
        action: the policy's action in every state, or `NO_ACTION` to stay forever.

    Returns:
        The expert. Actions are compared by the number of steps that the policy needs to the target afterwards.
    """
    states = np.arange(scene.n_states, dtype=np.int32)
    following = successors(scene.graph)
    decides = (action != NO_ACTION) & (states != target)
    next_state = np.where(decides, following[states, np.where(decides, action, 0)], states).astype(np.int32)
    steps = _steps_to(target, next_state)
    decides &= np.isfinite(steps)
    expert_steps = steps[next_state][:, None]
    alternatives = steps[following]
    return Expert(
        target=int(target),
        action=np.where(decides, action, NO_ACTION).astype(np.int32),
        next_state=np.where(decides, next_state, states).astype(np.int32),
        suboptimal=decides[:, None] & (alternatives > expert_steps),
        better=decides[:, None] & (alternatives < expert_steps),
    )


def shortest_path_trajectories(scene: Scene, target: int, starts: Iterable[int]) -> tuple[Trajectory, ...]:
    """Follow the shortest-path expert from each start to the target.

    Args:
        scene: the scene.
        target: the state to reach.
        starts: start states. Each must be able to reach the target, and must not be it.

    Returns:
        One trajectory for each start, in the given order.

    Raises:
        InputError: a start or the target is not a state, or a start cannot reach the target or is the target.
    """
    starts = list(starts)
    _check_states(scene, "start", starts)
    expert = shortest_path_expert(scene, target)
    return tuple(follow_expert(scene, expert, start) for start in starts)


def follow_expert(scene: Scene, expert: Expert, start: int) -> Trajectory:
    """Follow an expert from one start to its target.

    Args:
        scene: the scene, for error messages.
        expert: the expert.
        start: the start state.

    Returns:
        The trajectory.

    Raises:
        InputError: the start cannot reach the target or is the target.
    """
    if start == expert.target:
        raise InputError(f"{scene.name}: the path to state {expert.target} starts at its target; give another start.")
    states = [int(start)]
    while states[-1] != expert.target:
        if expert.action[states[-1]] == NO_ACTION:
            raise InputError(
                f"{scene.name}: the path from state {start} cannot reach the target {expert.target}; "
                "choose a start that can."
            )
        states.append(int(expert.next_state[states[-1]]))
    visited = np.asarray(states, np.int32)
    return Trajectory(states=visited, actions=expert.action[visited[:-1]], target=expert.target)


def sub_trajectories(
    trajectories: Sequence[Trajectory], excluded: Collection[int] = ()
) -> Mapping[int, Int32[np.ndarray, "visited"]]:
    """Extract further demonstrations from shortest paths.

    The part of a shortest path between any two of its states is itself a shortest path. So every state after the first
    one can serve as a further target, with the states before it as demonstrations.

    Args:
        trajectories: shortest paths in one scene.
        excluded: states that must not serve as targets, for example evaluation targets.

    Returns:
        For each further target, in ascending order, the distinct states on the paths that lead to it, ascending.
    """
    not_targets = {int(state) for state in excluded}
    starts: dict[int, set[int]] = {}
    for trajectory in trajectories:
        states = trajectory.states.tolist()
        for position, end in enumerate(states[1:], start=1):
            if end not in not_targets:
                starts.setdefault(end, set()).update(states[:position])
    return {end: np.asarray(sorted(starts[end]), np.int32) for end in sorted(starts)}


def _steps_to(target: int, next_state: Int32[np.ndarray, "states"]) -> Float64[np.ndarray, "states"]:
    """Number of steps from each state to the target under a policy; infinite if it never arrives."""
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
