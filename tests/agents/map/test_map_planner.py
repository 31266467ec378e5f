import heapq

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from relm_irl_jax.agents.map.geometry import FORWARD, Extent
from relm_irl_jax.agents.map.planner import place_costs, plan
from relm_irl_jax.agents.map.sweeps import NEVER, from_lines, least_costs, to_lines
from relm_irl_jax.agents.map.walks import relative_pose
from relm_irl_jax.scenes.scene import pose_graph, shortest_path_distances, successors

AHEAD, RIGHT, LEFT, BACK = range(4)
RADIUS, SIDE = Extent().radius, Extent().side
PLACES = [(x, z) for x in range(6) for z in range(5) if (x, z) not in {(2, 1), (2, 2), (2, 3), (4, 0)}]


@pytest.fixture(scope="module")
def room():
    """Graph, distances and poses of a room with an obstacle, and the cost of its places in the frame of state 0."""
    location, rotation, graph = pose_graph(PLACES)
    pose = np.stack([rotation / 90, location[:, 1] / 0.5, location[:, 0] / 0.5], 1).astype(np.int32)
    frame = relative_pose(pose, pose[0]) + np.array([0, RADIUS, RADIUS], np.int32)
    cost = np.full((SIDE, SIDE, 1), NEVER, np.float32)
    cost[frame[:, 1], frame[:, 2]] = 1
    return successors(graph), shortest_path_distances(graph), frame, jnp.asarray(cost)


jitted = jax.jit(plan)
NO_DISCOUNT, DISCOUNT = jnp.float32(1), jnp.float32(0.9)


def current(frame):
    return jnp.asarray(frame[:, None] - np.array([[0], [RADIUS], [RADIUS]]), jnp.int32)


def test_least_costs_are_breadth_first_distances(room):
    _, distance, frame, cost = room
    for state in (0, 17, 42):
        found = np.asarray(from_lines(least_costs(cost, current(frame[state]))))[..., 0]
        np.testing.assert_array_equal(found[tuple(frame.T)], distance[state])


def moves(heading, z, x):
    """Poses that one action leads to, and whether it is a step into another place."""
    yield ((heading + 1) % 4, z, x), False
    yield ((heading - 1) % 4, z, x), False
    for sign in (1, -1):
        to = (heading, z + sign * int(FORWARD[heading][1]), x + sign * int(FORWARD[heading][0]))
        if min(to) >= 0 and max(to[1:]) < SIDE:
            yield to, True


def test_costs_and_values_are_those_of_one_pose_after_the_other():
    """Dijkstra's algorithm, and sums of gains in the order of the costs, on a maze of many turns."""
    generator = np.random.default_rng(3)
    cost = np.where(generator.random((SIDE, SIDE)) < 0.3, NEVER, 1 + generator.integers(0, 9, (SIDE, SIDE)) / 4)
    posterior = generator.random((4, SIDE, SIDE)) ** 8
    start = (2, RADIUS + 3, RADIUS - 5)
    least, order, queue = {start: 0.0}, [], [(0.0, start)]
    while queue:
        paid, pose = heapq.heappop(queue)
        if paid > least[pose]:
            continue
        order.append(pose)
        for to, step in moves(*pose):
            further = paid + (cost[to[1:]] if step else 1)
            if further < min(least.get(to, NEVER), NEVER):
                least[to] = further
                heapq.heappush(queue, (further, to))
    value = {}
    for pose in order:
        behind = [
            value[to]
            for to, step in moves(*pose)
            if to in value and least[to] + (cost[pose[1:]] if step else 1) == least[pose]
        ]
        value[pose] = 0.9 ** least[pose] * posterior[pose] + max(behind, default=0.0)
    at = jnp.asarray(np.array(start)[:, None] - [[0], [RADIUS], [RADIUS]], jnp.int32)
    found = jitted(
        jnp.asarray(posterior[..., None], jnp.float32), jnp.asarray(cost[..., None], jnp.float32), at, DISCOUNT
    )
    index = tuple(np.array(order).T)
    np.testing.assert_allclose(np.asarray(found.distance)[(*index, 0)], [least[pose] for pose in order])
    np.testing.assert_allclose(np.asarray(found.value)[(*index, 0)], [value[pose] for pose in order], rtol=1e-3)
    assert (np.asarray(found.distance) < NEVER).sum() == len(order)
    assert len(order) > 1000


def test_lines_hold_every_pose_once():
    values = jnp.arange(4 * SIDE**2 * 2, dtype=jnp.float32).reshape(4, SIDE, SIDE, 2)
    np.testing.assert_array_equal(from_lines(to_lines(values)), values)


def test_a_certain_target_is_reached_along_a_shortest_path(room):
    following, distance, frame, cost = room
    for state, goal in ((0, 50), (13, 71), (80, 3)):
        posterior = jnp.zeros((4, SIDE, SIDE, 1)).at[(*frame[goal], 0)].set(1.0)
        for left in range(distance[state, goal], 0, -1):
            chosen = jitted(posterior, cost, current(frame[state]), DISCOUNT)
            state = following[state, int(chosen.action[0])]
            assert distance[state, goal] == left - 1


def test_the_path_collects_what_lies_on_its_way():
    cost = jnp.ones((SIDE, SIDE, 1))
    # Three ahead on the left and on the right; the way to the right passes by another possible pose.
    posterior = jnp.zeros((4, SIDE, SIDE, 1)).at[1, RADIUS, RADIUS + 3, 0].set(0.4)
    posterior = posterior.at[3, RADIUS, RADIUS - 3, 0].set(0.4).at[1, RADIUS, RADIUS + 2, 0].set(0.1)
    chosen = jitted(posterior, cost, jnp.zeros((3, 1), jnp.int32), DISCOUNT)
    assert chosen.action[0] == RIGHT
    assert int(chosen.goal[0]) == (SIDE + RADIUS) * SIDE + RADIUS + 3
    np.testing.assert_allclose(chosen.value[1, RADIUS, RADIUS + 3, 0], 0.4 * 0.9**4 + 0.1 * 0.9**3, rtol=1e-5)


def test_discounting_prefers_what_is_near():
    cost = jnp.ones((SIDE, SIDE, 1))
    posterior = jnp.zeros((4, SIDE, SIDE, 1)).at[0, RADIUS + 12, RADIUS, 0].set(0.6)
    posterior = posterior.at[0, RADIUS - 1, RADIUS, 0].set(0.4)
    assert jitted(posterior, cost, jnp.zeros((3, 1), jnp.int32), DISCOUNT).action[0] == BACK
    assert jitted(posterior, cost, jnp.zeros((3, 1), jnp.int32), NO_DISCOUNT).action[0] == AHEAD


def test_a_walled_in_agent_turns():
    cost = jnp.full((SIDE, SIDE, 1), NEVER)
    posterior = jnp.full((4, SIDE, SIDE, 1), 1 / (4 * SIDE**2)).at[:, RADIUS, RADIUS].set(0.0)
    assert jitted(posterior, cost, jnp.zeros((3, 1), jnp.int32), DISCOUNT).action[0] in (RIGHT, LEFT)


def test_costs_of_places():
    free = jnp.array([[[2.0], [-2.0], [-2.0], [-2.0]]])
    stood = jnp.array([[[False], [False], [True], [True]]])
    blocked = jnp.array([[[False], [False], [False], [True]]])
    np.testing.assert_allclose(place_costs(free, stood, blocked, jnp.float32(1.5))[0, :, 0], (1, 4, 1, NEVER))


def test_a_path_of_many_turns_is_followed_from_its_beginning():
    """Corridors that run to and fro across the whole square: 576 steps, more than four times its side."""
    cost = np.full((SIDE, SIDE, 1), NEVER, np.float32)
    cost[::2] = 1
    cost[1::4, -1] = cost[3::4, 0] = 1
    posterior = jnp.zeros((4, SIDE, SIDE, 1)).at[1, 0, 0, 0].set(1.0)
    start = jnp.array([[0], [RADIUS], [RADIUS]], jnp.int32)
    chosen = jitted(posterior, jnp.asarray(cost), start, DISCOUNT)
    assert int(chosen.goal[0]) == SIDE**2
    assert chosen.action[0] in (RIGHT, LEFT)  # the corridor of the start runs along x
    np.testing.assert_allclose(chosen.distance[1, 0, 0, 0], 17 * 32 + 16 * 2 + 1 + 2 * 16)
