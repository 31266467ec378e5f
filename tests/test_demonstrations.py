import json
from types import SimpleNamespace

import numpy as np
import pytest

from relm_irl_jax.demonstrations import (
    expert_from_demonstrations,
    from_imitation,
    load_demonstrations,
    save_demonstrations,
    to_trajectory,
)
from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import NO_ACTION, follow_expert, shortest_path_expert, shortest_path_trajectories
from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances, successors


@pytest.fixture
def scene() -> Scene:
    places = [(x, z) for x in range(4) for z in range(3) if (x, z) != (1, 1)]
    location, rotation, graph = pose_graph(places)
    return Scene("grid", "bedroom", location, rotation, graph, shortest_path_distances(graph))


def test_what_is_saved_is_loaded(scene, tmp_path):
    trajectories = shortest_path_trajectories(scene, 20, [0, 5])
    save_demonstrations(trajectories, tmp_path / "recorded.jsonl")
    loaded = load_demonstrations(tmp_path / "recorded.jsonl", scene)
    for one, other in zip(trajectories, loaded, strict=True):
        np.testing.assert_array_equal(one.states, other.states)
        np.testing.assert_array_equal(one.actions, other.actions)
        assert one.target == other.target


def test_actions_have_names_and_trajectories_have_other_shapes(scene):
    named = to_trajectory([0, 1, 2], ["RotateRight", "RotateRight"], scene, "turn")
    np.testing.assert_array_equal(named.actions, [1, 1])
    other = from_imitation(SimpleNamespace(obs=np.array([0, 1, 2]), acts=np.array([1, 1])), scene)
    np.testing.assert_array_equal(other.states, named.states)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('{"states": [0, 1], "actions": [0]}', r"recorded.jsonl:1: step 0 moves from state 0 to 1, but MoveAhead"),
        ('{"states": [1, 5], "actions": [3]}', r"recorded.jsonl:1: step 0 moves through a wall from state 1"),
        ('{"states": [0, 99], "actions": [0]}', "step 0 names a state"),
        ('{"states": [0, 1], "actions": ["Jump"]}', "one of MoveAhead"),
        ('{"states": [0], "actions": []}', "1 states and 0 actions"),
        ('{"states": [0]}', "recorded.jsonl:1: not a JSON object"),
        ('{"states": 5, "actions": [0]}', "recorded.jsonl:1: not a JSON object"),
        ('{"states": [0, 9999999999], "actions": [0]}', "states are numbers"),
        ("nonsense", "recorded.jsonl:1: not a JSON object"),
        ('{"states": [0, true], "actions": [1]}', "True is not a whole number"),
        ('{"states": [0, 1.5], "actions": [1]}', "1.5 is not a whole number"),
        ('{"states": [0, Infinity], "actions": [1]}', "states are numbers"),
        ('{"states": [0, NaN], "actions": [1]}', "states are numbers"),
        ('{"states": ["0", 1], "actions": [1]}', "'0' is not a whole number"),
        ('{"states": [[0], 1], "actions": [1]}', "states are numbers"),
        ('{"states": {"0": 0, "1": 1}, "actions": [1]}', "must be lists"),
        ("[" * 100_000, "not a JSON object"),
    ],
)
def test_what_the_scene_does_not_allow_is_named(scene, tmp_path, line, message):
    (tmp_path / "recorded.jsonl").write_text(line + "\n")
    with pytest.raises(InputError, match=message) as refusal:
        load_demonstrations(tmp_path / "recorded.jsonl", scene)
    assert "\n" not in str(refusal.value)


def test_a_file_of_another_encoding_is_refused(scene, tmp_path):
    for content, message in ((b"caf\xe9", "is not UTF-8"), ("{}".encode("utf-16"), "is not UTF-8")):
        (tmp_path / "recorded.jsonl").write_bytes(content)
        with pytest.raises(InputError, match=message):
            load_demonstrations(tmp_path / "recorded.jsonl", scene)


def test_the_expert_does_what_was_demonstrated(scene):
    following = successors(scene.graph)
    # Turning right three times instead of left once, with a loop of two turns before it.
    actions = [1, 2, 1, 1, 1]
    states = [0]
    for action in actions:
        states.append(int(following[states[-1], action]))
    detour = to_trajectory(states, actions, scene, "detour")
    expert = expert_from_demonstrations(scene, [detour])
    np.testing.assert_array_equal(follow_expert(scene, expert, 0).states, [0, 1, 2, 3])
    assert expert.better[0, 2]
    best = shortest_path_expert(scene, 3)
    np.testing.assert_array_equal(expert.action[4:], best.action[4:])
    alone = expert_from_demonstrations(scene, [detour], default_policy="stay")
    assert (alone.action[4:] == NO_ACTION).all()
    np.testing.assert_array_equal(alone.next_state[:4], [1, 2, 3, 3])


def test_demonstrations_of_one_expert_have_one_target(scene):
    with pytest.raises(InputError, match="one target"):
        expert_from_demonstrations(
            scene, [*shortest_path_trajectories(scene, 20, [0]), *shortest_path_trajectories(scene, 3, [0])]
        )


def test_disagreeing_demonstrations_still_arrive(scene):
    generator = np.random.default_rng(0)
    following = successors(scene.graph)
    for _ in range(10):
        trajectories = []
        for start in generator.integers(4, scene.n_states, 4):
            states, actions = [int(start)], []
            while states[-1] != 2:
                actions.append(int(generator.integers(4)))
                states.append(int(following[states[-1], actions[-1]]))
            trajectories.append(to_trajectory(states, actions, scene, json.dumps(states)))
        expert = expert_from_demonstrations(scene, trajectories, default_policy="stay")
        for trajectory in trajectories:
            assert follow_expert(scene, expert, trajectory.start).target == 2
