"""The environment, step by step, on rooms that can be walked by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax import env
from relm_irl_jax.env import Episode, TargetRange
from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances
from relm_irl_jax.tasks import Target
from relm_irl_jax.world import build_targets, build_world, scene_offsets

AHEAD, RIGHT, LEFT, BACK = range(4)
SCENES = [grid_scene(2, 1), grid_scene(3, 3, features=np.zeros((36, 8), np.float32))]


def corridor():
    """Two places along +x; the target is state 5: the far place, facing +x."""
    scene = grid_scene(2, 1)
    return build_world([scene]), build_targets([scene], [Target(0, 5)])


def walk(actions, start, cap=10):
    world, targets = corridor()
    episode = Episode(jnp.int32(start), jnp.int32(0), jnp.int32(start), jnp.int32(0))
    transitions = []
    for action in actions:
        episode, transition = env.step(episode, jnp.int32(action), world, targets, jnp.int32(cap))
        transitions.append(transition)
    return episode, transitions


def test_corridor_by_hand():
    episode, transitions = walk([AHEAD, RIGHT, AHEAD], start=0)
    assert [int(t.next_state) for t in transitions] == [0, 1, 5]
    assert [bool(t.collided) for t in transitions] == [True, False, False]
    assert [bool(t.terminated) for t in transitions] == [False, False, True]
    assert int(episode.steps) == 3
    assert not any(bool(t.truncated) for t in transitions)


def test_the_last_allowed_step_truncates_unless_it_arrives():
    _, transitions = walk([RIGHT, RIGHT], start=0, cap=2)
    assert [bool(t.truncated) for t in transitions] == [False, True]
    assert not transitions[-1].terminated
    _, transitions = walk([RIGHT, AHEAD], start=0, cap=2)
    assert transitions[-1].terminated
    assert not transitions[-1].truncated


def test_a_batch_of_episodes_steps_as_one_by_one():
    world, targets = corridor()
    start = jnp.arange(8)
    episodes = Episode(start, jnp.zeros(8, jnp.int32), start, jnp.zeros(8, jnp.int32))
    actions = jnp.asarray([0, 1, 2, 3, 3, 2, 1, 0], jnp.int32)
    after, transitions = env.step(episodes, actions, world, targets, jnp.int32(9))
    for number in range(8):
        one = jax.tree.map(lambda x, i=number: x[i], episodes)
        single = jax.tree.leaves(env.step(one, actions[number], world, targets, jnp.int32(9)))
        batch = jax.tree.leaves((after, transitions))
        assert [x[number].item() for x in batch] == [x.item() for x in single]


def test_shortest_path_of_an_episode():
    world, targets = corridor()
    episode = Episode(jnp.int32(3), jnp.int32(0), jnp.int32(0), jnp.int32(7))
    assert int(env.shortest_path(episode, world, targets)) == 2  # from the start, wherever the worker is now


def two_scenes():
    scenes = [grid_scene(2, 1, features=np.zeros((8, 8), np.float32)), SCENES[1]]
    chosen = [Target(0, 5), Target(1, 0), Target(1, 17), Target(1, 35)]
    return scenes, build_world(scenes), build_targets(scenes, chosen)


def test_states_are_numbered_scene_by_scene():
    scenes, world, targets = two_scenes()
    assert scene_offsets(scenes) == [0, 8]
    assert world.scene.tolist() == [0] * 8 + [1] * 36
    assert world.local.tolist() == [*range(8), *range(36)]
    assert (np.asarray(world.scene)[np.asarray(world.successor)] == np.asarray(world.scene)[:, None]).all()
    assert targets.state.tolist() == [5, 8, 25, 43]
    np.testing.assert_array_equal(targets.distance[2, :36], scenes[1].shortest_path_distance[:, 17])


def test_resets_draw_start_and_target_uniformly():
    _, _, targets = two_scenes()
    target_range = TargetRange(jnp.int32(1), jnp.int32(3))
    draws = 40_000
    keys = jax.random.split(jax.random.key(0), draws)
    episodes = jax.vmap(lambda key: env.reset(key, targets, target_range))(keys)
    pairs = np.stack([episodes.target, episodes.start])
    distinct, counts = np.unique(pairs, axis=1, return_counts=True)
    counted = dict(zip(map(tuple, distinct.T), counts, strict=True))
    assert len(counted) == 3 * 35  # every pair but those of a target with itself
    assert all(start != targets.state[row] for row, start in counted)
    expected = draws / len(counted)
    chi_squared = sum((count - expected) ** 2 / expected for count in counted.values())
    assert chi_squared < 160  # 104 degrees of freedom: exceeded by chance once in 3000 keys, and the key is fixed
    assert (np.asarray(episodes.state) == np.asarray(episodes.start)).all()
    assert (np.asarray(episodes.steps) == 0).all()


def test_starts_that_cannot_reach_the_target_are_never_drawn():
    location, rotation, graph = pose_graph([(0, 0), (1, 0), (9, 9)])
    scene = Scene(
        "bathroom-0",
        "bathroom",
        location,
        rotation,
        graph,
        shortest_path_distances(graph),
        features=np.zeros((12, 2), np.float32),
    )
    targets = build_targets([scene], [Target(0, 2)])
    assert int(targets.n_starts[0]) == 7
    keys = jax.random.split(jax.random.key(1), 500)
    starts = jax.vmap(lambda key: env.reset(key, targets, TargetRange(jnp.int32(0), jnp.int32(1))).start)(keys)
    assert set(np.asarray(starts).tolist()) == set(range(8)) - {2}


def test_a_target_that_nothing_reaches_is_refused():
    scene = grid_scene(1, 1)
    cut = np.where(np.eye(4, dtype=bool), 0, -1).astype(np.int32)
    alone = Scene("bathroom-0", "bathroom", scene.location, scene.rotation, np.full((4, 4), -1, np.int32), cut)
    with pytest.raises(InputError, match="no state can reach target 0"):
        build_targets([alone], [Target(0, 0)])


def test_scenes_without_features_are_refused():
    scene = grid_scene(1, 1)
    bare = Scene(scene.name, scene.room_type, scene.location, scene.rotation, scene.graph, scene.shortest_path_distance)
    with pytest.raises(InputError, match="no features"):
        build_world([bare])
