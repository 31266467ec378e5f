"""Recorded demonstrations: states and actions of a person or another program, instead of the shortest-path expert's.

In a file, each line is one demonstration as JSON, such as
`{"scene": "bathroom-0", "states": [4, 8, 9], "actions": [0, 1]}`; the scene may be left out where there is only one.
States are numbers of the scene's states, actions are columns of `Scene.graph` or names of actions, and the last state
is the target. In memory, a demonstration is a `Trajectory`; trajectories of the `imitation` library can be converted.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import NO_ACTION, Expert, Trajectory, expert_from_policy, shortest_path_expert
from relm_irl_jax.files import write_bytes
from relm_irl_jax.inputs import refuse_device
from relm_irl_jax.scenes.scene import ACTIONS, Scene, successors

DefaultPolicy = Literal["shortest-path", "stay"]
"""An expert's policy in states without a demonstration: take a shortest path, or stay forever."""


def load_demonstrations(path: Path, scene: Scene) -> tuple[Trajectory, ...]:
    """Read demonstrations from a file of JSON lines.

    Args:
        path: the file.
        scene: the scene that they were recorded in.

    Returns:
        The demonstrations, in the file's order.

    Raises:
        InputError: the file is missing or not UTF-8, or a line is not a demonstration in this scene; names the line.
    """
    return tuple(
        to_trajectory(line["states"], line["actions"], scene, name)
        for name, line in _lines(path)
        if line.get("scene", scene.name) == scene.name
    )


def load_demonstrations_by_scene(path: Path, scenes: Sequence[Scene]) -> list[tuple[Trajectory, ...]]:
    """Read demonstrations in several scenes from one file, whose lines name the scene.

    Args:
        path: the file.
        scenes: the scenes.

    Returns:
        The demonstrations in each scene, in the file's order.

    Raises:
        InputError: see `load_demonstrations`; or a line names none of the scenes, or no scene where there are several.
    """
    number = {scene.name: position for position, scene in enumerate(scenes)}
    loaded: list[list[Trajectory]] = [[] for _ in scenes]
    for name, line in _lines(path):
        scene = line.get("scene", scenes[0].name if len(scenes) == 1 else None)
        if scene not in number:
            raise InputError(f"{name}: `scene` is {scene!r}; give one of {', '.join(number)}.")
        loaded[number[scene]].append(to_trajectory(line["states"], line["actions"], scenes[number[scene]], name))
    return [tuple(of_scene) for of_scene in loaded]


def _lines(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """The lines of a file of demonstrations, each with its name in messages."""
    refuse_device(path)
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; give a file of demonstrations as JSON lines.") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 (byte {error.start}); save it as UTF-8.") from error
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        name = f"{path}:{number}"
        try:
            demonstration = json.loads(line)
            states, actions = demonstration["states"], demonstration["actions"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(
                f"{name}: not a JSON object with lists `states` and `actions` ({error}); correct the line."
            ) from error
        if not isinstance(states, list) or not isinstance(actions, list):
            raise InputError(f"{name}: not a JSON object as needed: `states` and `actions` must be lists; correct it.")
        yield name, demonstration


ByScene = Mapping[str, Sequence[Trajectory]]
"""Demonstrations by the name of their scene."""


def save_demonstrations(trajectories: ByScene | Sequence[Trajectory], path: Path) -> None:
    """Write demonstrations as JSON lines.

    Args:
        trajectories: the demonstrations; by the scene's name, which is then written, or in one scene.
        path: the file, which is overwritten.
    """
    write_bytes(path, _as_lines(trajectories))


def append_demonstrations(trajectories: ByScene, path: Path) -> int:
    """Add demonstrations to a file of JSON lines, which is created if it is missing.

    Args:
        trajectories: the demonstrations by the scene's name.
        path: the file.

    Returns:
        Number of demonstrations in the file.

    Raises:
        InputError: the file is not one of demonstrations.
    """
    before = sum(1 for _ in _lines(path)) if path.exists() else 0
    content = path.read_bytes() if before else b""
    separator = b"" if not content or content.endswith(b"\n") else b"\n"
    write_bytes(path, content + separator + _as_lines(trajectories))
    return before + sum(map(len, trajectories.values()))


def _as_lines(trajectories: ByScene | Sequence[Trajectory]) -> bytes:
    if isinstance(trajectories, Mapping):
        named = [({"scene": scene}, t) for scene, of_scene in trajectories.items() for t in of_scene]
    else:
        named = [({}, t) for t in trajectories]
    lines = [json.dumps(name | {"states": t.states.tolist(), "actions": t.actions.tolist()}) for name, t in named]
    return "".join(line + "\n" for line in lines).encode()


def from_imitation(trajectory: Any, scene: Scene, name: str = "trajectory") -> Trajectory:
    """Convert a trajectory of the `imitation` library.

    Args:
        trajectory: an object with `acts`, and with `obs` whose observations are numbers of states, or with `infos` that
            name `state` and `next_state` of each step, as `relm-irl demonstrations --format imitation` writes them.
        scene: the scene that it was recorded in.
        name: name of the trajectory in error messages.

    Returns:
        The demonstration.

    Raises:
        InputError: see `to_trajectory`.
    """
    states = list(trajectory.obs)
    if states and np.ndim(states[0]):
        try:
            infos = [json.loads(info) if isinstance(info, str) else info for info in trajectory.infos]
            states = [infos[0]["state"], *(info["next_state"] for info in infos)]
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise InputError(
                f"{name}: its observations are no numbers of states, and its `infos` name none ({error})."
            ) from error
    return to_trajectory(states, list(trajectory.acts), scene, name)


def to_trajectory(states: Sequence[Any], actions: Sequence[Any], scene: Scene, name: str) -> Trajectory:
    """Convert lists of states and actions, after checking that the scene's graph allows them.

    Args:
        states: numbers of states; the last one is the target.
        actions: numbers or names of the actions between them.
        scene: the scene.
        name: name of the demonstration in error messages.

    Returns:
        The demonstration.

    Raises:
        InputError: the path is impossible in the scene.
    """
    if len(actions) != len(states) - 1 or not actions:
        raise InputError(
            f"{name}: {len(states)} states and {len(actions)} actions; a demonstration has one state more than it "
            "has actions, and at least one action."
        )
    try:
        numbers = [ACTIONS.index(a) if isinstance(a, str) else _whole_number(a) for a in actions]
        visited = np.asarray([_whole_number(state) for state in states], np.int32)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"{name}: {error}; states are numbers, actions numbers or one of {', '.join(ACTIONS)}."
        ) from error
    next_states = successors(scene.graph)
    for step, action in enumerate(numbers):
        state, following = visited[step], visited[step + 1]
        if not (0 <= state < scene.n_states and 0 <= following < scene.n_states and 0 <= action < len(ACTIONS)):
            raise InputError(f"{name}: step {step} names a state or an action that {scene.name} does not have.")
        if next_states[state, action] != following:
            blocked = " through a wall" if next_states[state, action] == state else ""
            raise InputError(
                f"{name}: step {step} moves{blocked} from state {state} to {following}, but {ACTIONS[action]} leads to "
                f"{next_states[state, action]} in {scene.name}; was it recorded in another scene?"
            )
    return Trajectory(states=visited, actions=np.asarray(numbers, np.int32), target=int(visited[-1]))


def _whole_number(value: Any) -> int:
    """A number of a state or action; raises TypeError or ValueError for `true`, fractions and everything else."""
    if isinstance(value, bool | np.bool_ | str | bytes) or int(value) != value:
        raise ValueError(f"{value!r} is not a whole number")
    return int(value)


def expert_from_demonstrations(
    scene: Scene,
    trajectories: Sequence[Trajectory],
    default_policy: DefaultPolicy | Int32[np.ndarray, "states"] = "shortest-path",
) -> Expert:
    """The expert that takes the demonstrated actions, and follows a default policy in all other states.

    If a demonstration visits a state twice, the action of the last visit counts, so that loops are left out. If
    demonstrations disagree, the first one counts. The expert therefore arrives from every demonstrated state.

    Args:
        scene: the scene.
        trajectories: demonstrations with one target.
        default_policy: what to do in states without a demonstration, by name or as an action for each state.

    Returns:
        The expert. It need not be optimal, see `Expert.better`.

    Raises:
        InputError: the demonstrations have different targets, or there are none.
    """
    targets = {trajectory.target for trajectory in trajectories}
    if len(targets) != 1:
        raise InputError(f"{scene.name}: the demonstrations of one expert have one target, not {sorted(targets)}.")
    target = targets.pop()
    if isinstance(default_policy, np.ndarray):
        action = default_policy.astype(np.int32)
    elif default_policy == "stay":
        action = np.full(scene.n_states, NO_ACTION, np.int32)
    else:
        action = shortest_path_expert(scene, target).action.copy()
    demonstrated: dict[int, int] = {}
    for trajectory in trajectories:
        # The dict keeps each state's last action; earlier demonstrations take precedence.
        action_of_state = dict(zip(trajectory.states[:-1].tolist(), trajectory.actions.tolist(), strict=True))
        demonstrated = action_of_state | demonstrated
    action[list(demonstrated)] = list(demonstrated.values())
    return expert_from_policy(scene, target, action)
