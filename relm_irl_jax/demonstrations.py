"""Recorded demonstrations: state-action lists of a person or another program, in place of the shortest-path
expert.

On disk a demonstration is one line of JSON, `{"states": [4, 8, 9], "actions": [0, 1]}`, with the states as
numbers of the scene's states and the actions as numbers of the columns of `Scene.graph` or as their names.
The last state is the target. In memory it is a `Trajectory`, or any object with the `obs` and `acts` of the
`imitation` library's trajectories, its observations being numbers of states.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import NO_ACTION, Expert, Trajectory, policy_expert, shortest_path_expert
from relm_irl_jax.scenes.scene import ACTIONS, Scene, successors

Elsewhere = Literal["shortest-path", "stay"]


def load_demonstrations(path: Path, scene: Scene) -> tuple[Trajectory, ...]:
    """Read demonstrations from a file of JSON lines.

    Args:
        path: the file.
        scene: the scene that they were recorded in.

    Returns:
        The demonstrations, in the file's order.

    Raises:
        InputError: names the line that is not a demonstration of this scene.
    """
    trajectories = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        if not line.strip():
            continue
        name = f"{path}:{number}"
        try:
            record = json.loads(line)
            states, actions = record["states"], record["actions"]
        except (json.JSONDecodeError, KeyError, TypeError) as error:
            raise InputError(
                f"{name}: not a JSON object with `states` and `actions` ({error}); correct the line."
            ) from error
        trajectories.append(read_demonstration(states, actions, scene, name))
    return tuple(trajectories)


def save_demonstrations(trajectories: Sequence[Trajectory], path: Path) -> None:
    """Write demonstrations as JSON lines.

    Args:
        trajectories: the demonstrations.
        path: the file, which is overwritten.
    """
    records = [{"states": t.states.tolist(), "actions": t.actions.tolist()} for t in trajectories]
    path.write_text("".join(json.dumps(record) + "\n" for record in records), encoding="utf-8")


def from_imitation(trajectory: Any, scene: Scene, name: str = "trajectory") -> Trajectory:
    """Read a trajectory of the `imitation` library.

    Args:
        trajectory: an object with `obs`, numbers of states, and `acts`.
        scene: the scene that it was recorded in.
        name: what errors call it.

    Returns:
        The demonstration.
    """
    return read_demonstration(list(trajectory.obs), list(trajectory.acts), scene, name)


def read_demonstration(states: Sequence[Any], actions: Sequence[Any], scene: Scene, name: str) -> Trajectory:
    """Check that a list of states and actions is a walk in a scene.

    Args:
        states: numbers of states, the last one being the target.
        actions: numbers or names of the actions between them.
        scene: the scene.
        name: what errors call the demonstration.

    Returns:
        The demonstration.

    Raises:
        InputError: the walk is not one that the scene allows; names the demonstration and the step.
    """
    if len(actions) != len(states) - 1 or not actions:
        raise InputError(
            f"{name}: {len(states)} states and {len(actions)} actions; a demonstration has one state more than it "
            "has actions, and at least one action."
        )
    try:
        numbers = [ACTIONS.index(a) if isinstance(a, str) else int(a) for a in actions]
        walked = np.asarray([int(state) for state in states], np.int32)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name}: {error}; states are numbers, actions numbers or one of {', '.join(ACTIONS)}."
        ) from error
    following = successors(scene.graph)
    for step, action in enumerate(numbers):
        state, onward = walked[step], walked[step + 1]
        if not (0 <= state < scene.n_states and 0 <= onward < scene.n_states and 0 <= action < len(ACTIONS)):
            raise InputError(f"{name}: step {step} names a state or an action that {scene.name} does not have.")
        if following[state, action] != onward:
            blocked = " through a wall" if following[state, action] == state else ""
            raise InputError(
                f"{name}: step {step} walks{blocked} from state {state} to {onward}, but {ACTIONS[action]} leads to "
                f"{following[state, action]} in {scene.name}; was it recorded in another scene?"
            )
    return Trajectory(states=walked, actions=np.asarray(numbers, np.int32), target=int(walked[-1]))


def demonstrated_expert(
    scene: Scene,
    trajectories: Sequence[Trajectory],
    elsewhere: Elsewhere | Int32[np.ndarray, "states"] = "shortest-path",
) -> Expert:
    """The expert that does what was demonstrated, and elsewhere what a named policy does.

    Where a demonstration passes a state twice the action that it took last counts, so that loops are left
    out; where demonstrations disagree the first one counts. The expert therefore arrives from every
    demonstrated state.

    Args:
        scene: the scene.
        trajectories: demonstrations with one target.
        elsewhere: what to do in states without a demonstration: take a shortest path, stay for ever, or the
            action given for each state.

    Returns:
        The expert; it may not be optimal, see `Expert.better`.

    Raises:
        InputError: the demonstrations have different targets, or there are none.
    """
    targets = {trajectory.target for trajectory in trajectories}
    if len(targets) != 1:
        raise InputError(f"{scene.name}: the demonstrations of one expert have one target, not {sorted(targets)}.")
    target = targets.pop()
    if isinstance(elsewhere, np.ndarray):
        action = elsewhere.astype(np.int32)
    elif elsewhere == "stay":
        action = np.full(scene.n_states, NO_ACTION, np.int32)
    else:
        action = shortest_path_expert(scene, target).action.copy()
    demonstrated: dict[int, int] = {}
    for trajectory in trajectories:
        # dict keeps each state's last action; states of earlier demonstrations are not overruled.
        own = dict(zip(trajectory.states[:-1].tolist(), trajectory.actions.tolist(), strict=True))
        demonstrated = own | demonstrated
    action[list(demonstrated)] = list(demonstrated.values())
    return policy_expert(scene, target, action)
