"""The pose graph and its distances, on rooms small enough to walk by hand."""

import numpy as np
from builders import grid_scene
from hypothesis import given, settings
from hypothesis import strategies as st

from relm_irl_jax.scenes.scene import COLLISION, UNREACHABLE, pose_graph, shortest_path_distances, successors

AHEAD, RIGHT, LEFT, BACK = range(4)


def test_corridor_by_hand():
    """Two places along +x: states 0-3 are headings 0, 90, 180, 270 at x=0, states 4-7 at x=0.5."""
    _, rotation, graph = pose_graph([(0, 0), (1, 0)])
    assert rotation.tolist() == [0, 90, 180, 270] * 2
    assert graph[0].tolist() == [COLLISION, 1, 3, COLLISION]
    assert graph[1].tolist() == [5, 2, 0, COLLISION]
    assert graph[3].tolist() == [COLLISION, 0, 2, 7]
    assert graph[5].tolist() == [COLLISION, 6, 4, 1]
    distance = shortest_path_distances(graph)
    assert distance[0, 5] == 2  # turn right, move ahead
    assert distance[0, 4] == 3  # and turn left again
    assert distance[7, 3] == 1  # move ahead towards -x
    assert (np.diag(distance) == 0).all()


def test_collisions_lead_back():
    scene = grid_scene(1, 1)
    assert (successors(scene.graph)[:, [AHEAD, BACK]] == np.arange(4)[:, None]).all()


def test_unreachable_places_are_marked():
    _, _, graph = pose_graph([(0, 0), (5, 5)])
    distance = shortest_path_distances(graph)
    assert (distance[:4, 4:] == UNREACHABLE).all()
    assert (distance[:4, :4] >= 0).all()


@settings(max_examples=30, deadline=None)
@given(places=st.sets(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=12))
def test_moves_and_turns_are_reversible(places):
    _, _, graph = pose_graph(sorted(places))
    states = np.arange(len(graph))
    assert (graph[graph[:, RIGHT], LEFT] == states).all()
    moved = graph[:, AHEAD] != COLLISION
    assert (graph[graph[moved, AHEAD], BACK] == states[moved]).all()
    distance = shortest_path_distances(graph)
    assert (distance == distance.T).all()


def test_distances_equal_a_plain_breadth_first_search():
    scene = grid_scene(3, 4)
    following = successors(scene.graph)
    for start in range(0, scene.n_states, 7):
        seen = {start: 0}
        frontier = [start]
        while frontier:
            reached = [int(n) for s in frontier for n in following[s] if int(n) not in seen]
            seen.update(dict.fromkeys(reached, seen[frontier[0]] + 1))
            frontier = list(dict.fromkeys(reached))
        assert [seen[s] for s in range(scene.n_states)] == scene.shortest_path_distance[start].tolist()
