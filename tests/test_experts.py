import numpy as np
import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import (
    NO_ACTION,
    expert_from_policy,
    shortest_path_expert,
    shortest_path_trajectories,
    sub_trajectories,
)
from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances, successors


@pytest.fixture
def scene() -> Scene:
    places = [(x, z) for x in range(4) for z in range(3) if (x, z) != (1, 1)]
    location, rotation, graph = pose_graph(places)
    return Scene("grid", "bedroom", location, rotation, graph, shortest_path_distances(graph))


def test_the_expert_is_optimal_at_every_state(scene):
    for target in (0, 17, 43):
        expert = shortest_path_expert(scene, target)
        distance = scene.shortest_path_distance[:, target]
        elsewhere = np.arange(scene.n_states) != target
        assert (distance[expert.next_state[elsewhere]] == distance[elsewhere] - 1).all()
        own = distance[expert.next_state][:, None]
        np.testing.assert_array_equal(
            expert.suboptimal[elsewhere], (distance[successors(scene.graph)] > own)[elsewhere]
        )
        assert not expert.better.any()
        assert expert.action[target] == NO_ACTION
        assert expert.next_state[target] == target
        assert not expert.suboptimal[target].any()


def test_among_shortest_paths_the_first_action_is_taken(scene):
    expert = shortest_path_expert(scene, 0)
    distance = scene.shortest_path_distance[:, 0][successors(scene.graph)]
    for state in range(1, scene.n_states):
        assert expert.action[state] == np.flatnonzero(distance[state] == distance[state].min())[0]


def test_trajectories_follow_edges_of_the_graph_to_the_target(scene):
    for trajectory in shortest_path_trajectories(scene, 20, [0, 5, 33]):
        assert trajectory.states[-1] == trajectory.target == 20
        assert len(trajectory.actions) == scene.shortest_path_distance[trajectory.start, 20]
        np.testing.assert_array_equal(scene.graph[trajectory.states[:-1], trajectory.actions], trajectory.states[1:])


def test_a_start_that_cannot_arrive_is_named():
    location, rotation, graph = pose_graph([(0, 0), (5, 5)])
    island = Scene("island", "bedroom", location, rotation, graph, shortest_path_distances(graph))
    with pytest.raises(InputError, match="from state 4 cannot reach the target 0"):
        shortest_path_trajectories(island, 0, [4])
    expert = shortest_path_expert(island, 0)
    np.testing.assert_array_equal(expert.next_state[4:], np.arange(4, 8))
    assert not expert.suboptimal[4:].any()
    with pytest.raises(InputError, match="start 99"):
        shortest_path_trajectories(island, 0, [99])


def test_sub_trajectories_are_optimal_and_spare_excluded_targets(scene):
    trajectories = shortest_path_trajectories(scene, 20, [0, 5])
    excluded = int(trajectories[0].states[2])
    grouped = sub_trajectories(trajectories, excluded={excluded})
    assert excluded not in grouped
    assert 20 in grouped
    for end, states in grouped.items():
        for trajectory in trajectories:
            places = trajectory.states.tolist()
            if end not in places:
                continue
            for start in places[: places.index(end)]:
                assert start in states
                steps = places.index(end) - places.index(start)
                assert steps == scene.shortest_path_distance[start, end]
    expected = sum(len(set(trajectory.states[1:].tolist()) - {excluded}) for trajectory in trajectories[:1])
    assert len(sub_trajectories(trajectories[:1], {excluded})) == expected


def test_a_detour_is_worse_than_some_alternative(scene):
    # From (0, 0) facing the target, turning right three times instead of left once.
    best = shortest_path_expert(scene, 3)
    np.testing.assert_array_equal(best.action[:3], [2, 1, 1])
    detour = expert_from_policy(scene, 3, np.asarray([1, *best.action[1:]], np.int32))
    np.testing.assert_array_equal(detour.better[0], [False, False, True, False])
    assert not detour.suboptimal[0, 2]


def test_a_policy_that_never_arrives_decides_nothing(scene):
    best = shortest_path_expert(scene, 3)
    loop = best.action.copy()
    loop[[40, 41]] = [1, 2]
    stuck = expert_from_policy(scene, 3, loop)
    assert (stuck.action[[40, 41]] == NO_ACTION).all()
    np.testing.assert_array_equal(stuck.next_state[[40, 41]], [40, 41])
