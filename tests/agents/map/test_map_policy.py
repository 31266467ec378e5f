"""The policy knows nothing but views, collisions and its memory."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.agents.map.agent import MapAgent, world_rooms, world_views
from relm_irl_jax.agents.map.augmentation import gamma_corrected
from relm_irl_jax.agents.map.geometry import Extent
from relm_irl_jax.agents.map.loss import initial_parameters
from relm_irl_jax.agents.map.memory import move, start_odometry
from relm_irl_jax.agents.map.network import VIEW, MapNetwork, look
from relm_irl_jax.agents.map.policy import map_policy
from relm_irl_jax.agents.map.rewarded import WIDTH, RewardedPolicy, nearness
from relm_irl_jax.agents.map.variants import explorer
from relm_irl_jax.agents.map.walks import relative_pose
from relm_irl_jax.agents.settings import MapSettings
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.functions import ManualReward
from relm_irl_jax.rewards.goals import Goals
from relm_irl_jax.scenes.scene import grid_poses, pose_graph, successors
from relm_irl_jax.types import Agent, Observation, Policy, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World

STEPS = 10
RADIUS = Extent().radius
STEP_COST = ManualReward(jnp.float32(0), jnp.float32(-1), jnp.float32(-1))
NETWORK = MapNetwork(width=16, channels=8)
STARTS = np.array([[0, 7, 13]])


@pytest.fixture(scope="module")
def parameters():
    return initial_parameters(NETWORK)


@pytest.fixture(scope="module")
def room():
    """Graph and views of a room of noise."""
    scene = grid_scene(4, 3)
    images = np.random.default_rng(0).integers(0, 255, (scene.n_states, VIEW, VIEW, 3)).astype(np.uint8)
    return successors(scene.graph), images


def world_of(*successors):
    sizes = [len(successor) for successor in successors]
    offsets = np.cumsum([0, *sizes[:-1]])
    numbers = np.arange(len(sizes))
    moves = np.concatenate([successor + offset for successor, offset in zip(successors, offsets, strict=True)])
    return World(
        successor=jnp.asarray(moves, jnp.int32),
        scene=jnp.asarray(np.repeat(numbers, sizes), jnp.int32),
        local=jnp.asarray(np.concatenate([np.arange(size) for size in sizes]), jnp.int32),
        features=jnp.zeros((sum(sizes), 1)),
        room_type=jnp.zeros(len(sizes), jnp.int32),
        training_scene=jnp.asarray(numbers, jnp.int32),
        names=tuple(f"bathroom-{number}" for number in numbers),
    )


def targets_of(*states):
    """Targets; the agent uses their states alone."""
    n = len(states)
    none = jnp.zeros((n, 1), jnp.int32)
    return Targets(jnp.asarray(states, jnp.int32), none[:, 0], none, none[:, 0], none)


act = jax.jit(lambda policy, *rest: policy.act(jax.random.key(0), *rest))


def actions(parameters, room, goals, starts):
    """Actions of episodes side by side."""
    successor, images = room
    world = world_of(successor)
    policy = MapAgent(lambda _: images, network=NETWORK).policy(parameters, world, targets_of(*goals))
    return acted(policy, world, goals, starts)


def acted(policy, world, goals, starts):
    """Actions of a policy in episodes side by side, and its memory in the end."""
    state = np.asarray(starts)
    collided, memory, chosen = np.zeros(state.shape, bool), policy.init(state.shape), []
    target = jnp.asarray(np.arange(state.size).reshape(state.shape) % len(goals), jnp.int32)
    for _ in range(STEPS):
        observation = Observation(jnp.asarray(state, jnp.int32), jnp.asarray(collided))
        memory, action = act(policy, memory, observation, target)
        following = np.asarray(world.successor)[state, np.asarray(action)]
        collided, state = following == state, following
        chosen.append(np.asarray(action))
    return np.stack(chosen), memory


@pytest.fixture(scope="module")
def reference(parameters, room):
    return actions(parameters, room, np.array([40, 21]), STARTS)


def test_it_looks_around_first(reference):
    chosen, memory = reference
    assert (chosen[:3] == 1).all()
    assert len(np.unique(chosen)) > 1
    assert (memory.steps == STEPS).all()


def test_renumbered_states_get_the_same_actions(parameters, room, reference):
    successor, images = room
    order = np.random.default_rng(1).permutation(len(successor))  # new number → old number
    new = np.argsort(order)
    renumbered = new[successor[order]].astype(np.int32), images[order]
    np.testing.assert_array_equal(actions(parameters, renumbered, new[[40, 21]], new[STARTS])[0], reference[0])


def test_a_moved_and_turned_frame_gives_the_same_actions(parameters, reference, room):
    # The same room, laid out from places that are shifted by (5, −7) and turned by 90 degrees.
    places = [(x, z) for x in range(4) for z in range(3)]
    turned = [(z + 5, -x - 7) for x, z in places]
    graph = successors(pose_graph(turned)[2])
    successor, images = room
    # Heading h of the old frame is heading h + 1 of the new one.
    new = np.array([4 * (state // 4) + (state % 4 + 1) % 4 for state in range(len(successor))])
    shown = np.empty_like(images)
    shown[new] = images
    assert (graph[new] == new[successor]).all()
    chosen = actions(parameters, (graph, shown), new[[40, 21]], new[STARTS])[0]
    np.testing.assert_array_equal(chosen, reference[0])


def goals_of(*rows):
    """Goals that name states alone."""
    width = max(map(len, rows))
    state = jnp.asarray([row + [0] * (width - len(row)) for row in rows], jnp.int32)
    count = jnp.asarray([len(row) for row in rows], jnp.int32)
    return Goals(state, count, jnp.zeros_like(count), jnp.zeros((len(rows), width, 1)))


def problem(world, targets, goals):
    return TrainingProblem(world, targets, STEP_COST, cap=20, frames=1, goals=goals)


def test_rooms_are_read_off_a_problem(room):
    successor, images = room
    n = len(successor)
    world = world_of(successor, successor)
    views = world_views({"bathroom-1": images[::-1], "bathroom-0": images}.__getitem__, world)
    given = problem(world, targets_of(3, n + 5, n + 6), goals_of([3, 8], [5, 6, 7]))
    first, second = world_rooms(given, views)
    np.testing.assert_array_equal(first.views, images)
    np.testing.assert_array_equal(second.views, images[::-1])
    np.testing.assert_array_equal(first.best, [3])
    np.testing.assert_array_equal(second.best, [5, 6])
    np.testing.assert_array_equal(first.targets, [3, 8])
    np.testing.assert_array_equal(second.targets, [5, 6, 7])


def test_wrong_views_are_refused(room):
    successor, images = room
    world = world_of(successor)
    for wrong in (images[1:], images[:, ::2, ::2]):
        with pytest.raises(InputError, match="48 RGB views of 64 × 64"):
            world_views(lambda _, wrong=wrong: wrong, world)


def test_it_is_an_agent_and_makes_policies(parameters, room):
    agent = MapAgent(lambda _: room[1], network=NETWORK)
    assert isinstance(agent, Agent)
    assert isinstance(agent.policy(parameters, world_of(room[0]), targets_of(3)), Policy)
    assert agent.requires == {"goals"}


def test_parameters_of_another_network_are_refused(parameters, room):
    """Some of them would be broadcast without an error."""
    agent = MapAgent(lambda _: room[1], network=NETWORK)
    wrong = {**parameters, "prior": {**parameters["prior"], "free": parameters["prior"]["free"][:1]}}
    with pytest.raises(ValueError, match="do not fit"):
        agent.policy(wrong, world_of(room[0]), targets_of(3))


def test_given_weights_are_not_trained(parameters, room):
    agent = MapAgent(lambda _: room[1], trained=lambda: parameters, network=NETWORK)
    given, curve = agent.train(jax.random.key(0), problem(world_of(room[0]), targets_of(3), None), TrainingLog())
    assert given is parameters
    assert len(curve.frames) == 0
    assert agent.requires == set()


@pytest.mark.slow
def test_training_through_the_agent(room):
    successor, images = room
    agent = MapAgent(lambda _: images, MapSettings(views=8, targets=4), network=NETWORK)
    given = problem(world_of(successor), targets_of(3), goals_of([3, 8]))
    _, curve = agent.train(jax.random.key(0), given, TrainingLog())
    assert np.isfinite(curve.location_loss).all()


def test_filled_memory_is_the_map_of_all_views(parameters, room):
    """Standing at every pose in turn draws the same map, but for the frame."""
    successor, images = room
    world = world_of(successor)
    agent = MapAgent(lambda _: images, MapSettings(memory="filled"), network=NETWORK)
    policy = agent.policy(parameters, world, targets_of(40, 21))
    filled = policy.filled
    pose = np.asarray(filled.pose)
    assert len(set(map(tuple, pose.tolist()))) == len(successor)
    assert not filled.blocked[0][pose[:, 1] + RADIUS, pose[:, 2] + RADIUS].any()
    assert (~filled.blocked).sum() == 12
    for state, action in ((0, 0), (5, 1), (9, 2), (30, 3)):  # a move leads from pose to pose
        odometry = start_odometry((), Extent())
        odometry = dataclasses.replace(odometry, pose=jnp.asarray(pose[state]))
        following = int(successor[state, action])
        moved = move(odometry, jnp.int32(action), jnp.bool_(following == state))
        np.testing.assert_array_equal(moved.pose, pose[following])
    memory = policy.init((1, 3))
    np.testing.assert_array_equal(memory.grid[0, 1], filled.grid[0])
    observation = Observation(jnp.asarray(STARTS, jnp.int32), jnp.zeros((1, 3), bool))
    after, _ = act(policy, memory, observation, jnp.zeros((1, 3), jnp.int32))
    np.testing.assert_array_equal(after.odometry.pose[0], pose[STARTS[0]])
    np.testing.assert_array_equal(after.grid, memory.grid)


def test_unseen_scenes_begin_with_an_empty_memory(parameters, room):
    world = dataclasses.replace(world_of(room[0]), training_scene=jnp.asarray([-1]))
    agent = MapAgent(lambda _: room[1], MapSettings(memory="filled"), network=NETWORK)
    assert agent.policy(parameters, world, targets_of(3)).filled is None


def test_views_are_corrected_in_search_as_in_training(parameters, room):
    successor, images = room
    bright = MapAgent(lambda _: images, MapSettings(gamma=0.5), network=NETWORK)
    given = MapAgent(lambda _: gamma_corrected(images, 0.5), network=NETWORK)
    policies = [agent.policy(parameters, world_of(successor), targets_of(40, 21)) for agent in (bright, given)]
    for name in ("record", "kernel"):
        np.testing.assert_array_equal(*(getattr(policy, name) for policy in policies))


def test_a_wider_map_says_the_same_about_a_room(parameters, room, reference):
    """Beyond the extent of rooms nothing was seen; within it, the evidence and the actions are the same."""
    successor, images = room
    world, goals = world_of(successor), np.array([40, 21])
    narrow = MapAgent(lambda _: images, network=NETWORK).policy(parameters, world, targets_of(*goals))
    wide = map_policy(
        parameters, look(NETWORK, parameters["network"], jnp.asarray(images)), goals, narrow.search, Extent(24)
    )
    assert (narrow.extent, wide.extent) == (Extent(), Extent(24))
    chosen, memory = acted(wide, world, goals, STARTS)
    np.testing.assert_array_equal(chosen, reference[0])
    target = jnp.asarray([[0, 1, 0]])
    one, other = narrow.belief(reference[1], target), wide.belief(memory, target)
    np.testing.assert_array_equal(other.pose, one.pose)
    np.testing.assert_allclose(other.free[..., 8:-8, 8:-8], one.free, rtol=1e-5)
    inner = other.probability[..., 8:-8, 8:-8]
    np.testing.assert_allclose(inner / inner.sum((2, 3, 4), keepdims=True), one.probability, rtol=1e-3, atol=1e-7)


def test_a_corridor_longer_than_any_room_is_searched_to_its_end(parameters):
    """Systematic search from one end of 24 places finds the view backwards at the other end, and counts right."""
    scene = grid_scene(24, 1)
    successor = successors(scene.graph)
    images, world = np.zeros((len(successor), VIEW, VIEW, 3), np.uint8), world_of(successor)
    goal = 4 * 23 + 3
    policy = explorer(MapAgent(lambda _: images, network=NETWORK).policy(parameters, world, targets_of(goal)))
    assert policy.extent == Extent(24)
    pose, state, collided = grid_poses(scene), 1, False  # the start faces along the corridor
    memory = policy.init((1, 1))
    for _ in range(250):
        observation = Observation(jnp.full((1, 1), state, jnp.int32), jnp.full((1, 1), collided))
        memory, action = act(policy, memory, observation, jnp.zeros((1, 1), jnp.int32))
        np.testing.assert_array_equal(memory.odometry.pose[0, 0], relative_pose(pose[state], pose[1]))
        following = int(successor[state, int(action[0, 0])])
        collided, state = following == state, following
        if state == goal:
            break
    assert state == goal


@pytest.mark.parametrize("use", ["prices", "prior"])
def test_a_reward_that_says_nothing_changes_nothing(parameters, room, reference, use):
    successor, images = room
    world, goals = world_of(successor), np.array([40, 21])
    policy = MapAgent(lambda _: images, network=NETWORK).policy(parameters, world, targets_of(*goals))
    alike = RewardedPolicy(policy, jnp.ones((2, len(successor))), use)
    np.testing.assert_array_equal(acted(alike, world, goals, STARTS)[0], reference[0])


def test_costs_of_views_are_noted_once_where_they_were_met(parameters, room):
    """Three turns at the start show four views of its place, a fourth one of them again."""
    successor, images = room
    world, goals = world_of(successor), np.array([40, 21])
    policy = MapAgent(lambda _: images, network=NETWORK).policy(parameters, world, targets_of(*goals))
    cost = jnp.asarray(np.random.default_rng(0).random((2, len(successor))), jnp.float32)
    rewarded = RewardedPolicy(policy, cost, "prices")
    memory, state = rewarded.init((1, 1)), 13
    for _ in range(5):
        observation = Observation(jnp.full((1, 1), state, jnp.int32), jnp.zeros((1, 1), bool))
        memory, _ = act(rewarded, memory, observation, jnp.ones((1, 1), jnp.int32))
        turned = dataclasses.replace(memory.memory, action=jnp.ones((1, 1), jnp.int32))
        memory, state = dataclasses.replace(memory, memory=turned), int(successor[state, 1])
    assert float(memory.views.sum()) == float(memory.views[0, 0, RADIUS, RADIUS]) == 4
    place = [4 * (13 // 4) + heading for heading in range(4)]
    np.testing.assert_allclose(memory.cost[0, 0, RADIUS, RADIUS], cost[1, jnp.asarray(place)].sum(), rtol=1e-6)


def test_the_prior_is_a_mean_over_places_by_hand():
    """Two places with costs 0.6 and 0.8, three apart: each counts with its Gaussian."""
    views = jnp.zeros((1, 33, 33)).at[0, 16, 16].set(2.0).at[0, 16, 19].set(1.0)
    cost = jnp.zeros((1, 33, 33)).at[0, 16, 16].set(1.2).at[0, 16, 19].set(0.8)
    far = np.exp(-0.5 * (3 / WIDTH) ** 2)
    expected = (2 * 0.4 + far * 0.2) / (2 + far + 1e-3)
    found = np.asarray(nearness(cost, views))
    assert found[0, 16, 16] == pytest.approx(expected, rel=1e-5)
    assert found[0, 0, 0] < 0.01
