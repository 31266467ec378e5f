from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from flax.traverse_util import flatten_dict
from interruption import assert_same, interrupt, resume
from scipy.signal import correlate

from relm_irl_jax.agents.map.agent import draw_chunk, train_on_rooms
from relm_irl_jax.agents.map.augmentation import draw_filter, gamma_corrected, random_convolution
from relm_irl_jax.agents.map.geometry import Extent
from relm_irl_jax.agents.map.loss import compute_loss, initial_parameters, prefix_lengths
from relm_irl_jax.agents.map.network import VIEW, MapNetwork
from relm_irl_jax.agents.map.rooms import places_along_side, room_from_graph, to_room
from relm_irl_jax.agents.map.training_rooms import GeneratedRooms, GivenRooms
from relm_irl_jax.agents.map.walks import draw_walks, relative_pose
from relm_irl_jax.agents.map.weights import load_weights, save_weights
from relm_irl_jax.agents.settings import MapSettings
from relm_irl_jax.agents.training import Chunks
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import save_arrays
from relm_irl_jax.scenes.rooms.training_rooms import training_numbers
from relm_irl_jax.scenes.scene import successors
from relm_irl_jax.stages.make_agent import check_agent
from relm_irl_jax.types import TrainingLog


@pytest.fixture(scope="module")
def scene():
    """A small room whose views are noise of a colour of their own."""
    bare = grid_scene(4, 3)
    generator = np.random.default_rng(0)
    colour = generator.integers(0, 255, (bare.n_states, 1, 1, 3))
    noise = generator.integers(-40, 40, (bare.n_states, VIEW, VIEW, 3))
    return replace(bare, observation=np.clip(colour + noise, 0, 255).astype(np.uint8))


def test_poses_seen_from_another_pose():
    # From (3, 5) facing +x: two ahead is x + 2, one to the right is z − 1.
    np.testing.assert_array_equal(relative_pose(np.int32([[0, 4, 7]]), np.int32([1, 5, 5])), [[3, 2, 1]])


def test_walks_are_odometry(scene):
    room = to_room(scene)
    walks = draw_walks(room, np.random.default_rng(0), walks=5, steps=12, targets=6, best_share=0.5)
    assert (walks.pose[:, 0] == 0).all()
    np.testing.assert_array_equal(walks.free.sum((1, 2)), 12)
    for number in range(5):
        poses = walks.pose[number][walks.valid[number]]
        assert len(set(map(tuple, poses.tolist()))) == len(poses)
        assert walks.free[number, poses[:, 1] + Extent().radius, poses[:, 2] + Extent().radius].all()
        assert walks.free[
            number, walks.target_pose[number, :, 1] + Extent().radius, walks.target_pose[number, :, 2] + Extent().radius
        ].all()
    # The same view has the same place relative to another view in every walk.
    state = np.array([[int((room.views == view).all((1, 2, 3)).argmax()) for view in row] for row in walks.views])
    for number in range(5):
        np.testing.assert_array_equal(
            walks.pose[number], relative_pose(room.pose[state[number]], room.pose[state[number, 0]])
        )


def test_poses_counted_along_moves_agree_with_the_grid(scene):
    known = to_room(scene)
    counted = room_from_graph(scene.views, successors(scene.graph), np.array([5, 7]), np.array([1, 5, 7]))
    np.testing.assert_array_equal(counted.pose, relative_pose(known.pose, known.pose[0]))
    np.testing.assert_array_equal(counted.distance, known.distance)
    np.testing.assert_array_equal(counted.best, [5, 7])
    np.testing.assert_array_equal(counted.targets, [1, 5, 7])


def test_states_that_the_first_cannot_reach_are_left_out(scene):
    graph = scene.graph.copy()
    graph[graph == 4] = -1  # nothing leads to state 4 any more
    room = room_from_graph(scene.views, successors(graph), np.array([3, 4, 5]), np.array([4, 6]))
    np.testing.assert_array_equal(room.views, np.delete(scene.views, 4, 0))
    np.testing.assert_array_equal(room.best, [3, 4])
    np.testing.assert_array_equal(room.targets, [5])


def test_places_along_a_side():
    assert places_along_side(successors(grid_scene(5, 3).graph)) == 5
    assert places_along_side(successors(grid_scene(40, 1).graph)) == 40
    apart = np.concatenate([successors(grid_scene(2, 1).graph), 8 + successors(grid_scene(1, 7).graph)])
    assert places_along_side(apart) == 7


@pytest.fixture(scope="module")
def corridor():
    """A corridor of 40 places, the grey of whose views numbers them."""
    bare = grid_scene(40, 1)
    views = np.broadcast_to((np.arange(160) // 4)[:, None, None, None], (160, 2, 2, 3)).astype(np.uint8)
    return to_room(replace(bare, observation=views))


def test_walks_and_targets_keep_to_the_extent_of_a_wide_scene(corridor):
    reached = set()
    for seed in range(20):
        walks = draw_walks(corridor, np.random.default_rng(seed), walks=1, steps=60, targets=9, best_share=0.5)
        place, start = walks.views[0, :, 0, 0, 0].astype(int), int(walks.views[0, 0, 0, 0, 0])
        assert np.abs(place - start).max() <= 16
        assert walks.free.sum() == min(start + 16, 39) - max(start - 16, 0) + 1
        assert np.abs(walks.target_views[:, 0, 0, 0].astype(int) - start).max() <= 16
        assert np.abs(walks.target_pose[..., 1:]).max() <= 16
        reached |= set(place.tolist())
    assert len(reached) > 35
    wide = draw_walks(
        corridor, np.random.default_rng(0), walks=1, steps=9, targets=9, best_share=0.5, extent=Extent(40)
    )
    assert wide.extent == Extent(40)
    assert wide.free.sum() == 40


@pytest.mark.slow
def test_targets_beyond_the_extent_of_a_walk_teach_nothing(scene):
    network = MapNetwork(width=16, channels=8)
    walks = draw_walks(to_room(scene), np.random.default_rng(0), walks=1, steps=4, targets=2, best_share=0.0)
    pose = walks.target_pose.copy()
    pose[0, 0], pose[0, 1] = (2, -16, 16), (0, 17, 0)
    both = replace(walks, target_pose=pose)
    one = replace(walks, target_pose=pose[:, :1], target_views=walks.target_views[:1])
    parameters = initial_parameters(network)
    loss = jax.jit(compute_loss, static_argnames="network")
    two, single = (loss(parameters, each, network, jnp.float32(1))[1] for each in (both, one))
    np.testing.assert_allclose(two.pose, single.pose, rtol=1e-4)
    assert (single.pose > 1).all()


def test_targets_are_drawn_among_those_allowed(scene):
    allowed = np.array([2, 5, 9])
    room = room_from_graph(scene.views, successors(scene.graph), np.array([7]), allowed)
    walks = draw_walks(room, np.random.default_rng(0), walks=1, steps=4, targets=40, best_share=0.5)
    shown = {int((scene.views == view).all((1, 2, 3)).argmax()) for view in walks.target_views}
    assert shown == {2, 5, 7, 9}


def test_prefixes_double_up_to_the_whole_walk():
    assert prefix_lengths(1) == (1,)
    assert prefix_lengths(8) == (1, 2, 4, 8)
    assert prefix_lengths(11) == (1, 2, 4, 8, 11)


def test_the_window_of_rooms_moves_through_all_of_them(monkeypatch):
    monkeypatch.setattr("relm_irl_jax.agents.map.training_rooms.WINDOW", 6)
    rooms = GeneratedRooms(30)
    windows = [rooms.numbers_at(progress) for progress in np.linspace(0, 1, 50, endpoint=False).tolist()]
    assert {room for window in windows for room in window} == set(training_numbers(30))
    assert all(len(set(window)) == 6 for window in windows)
    assert windows[0] == training_numbers(6)


def test_walks_of_a_chunk_depend_on_its_number_alone(scene):
    rooms, settings = GivenRooms([to_room(scene)]), MapSettings(views=4, targets=2)
    one, same, other = (draw_chunk(rooms, settings, 3, number, Chunks(9, 2, 8)) for number in (5, 5, 6))
    assert len(one) == 2
    np.testing.assert_array_equal(one[1].pose, same[1].pose)
    assert not np.array_equal(one[1].target_pose, other[1].target_pose)


def test_random_convolutions_are_the_same_for_all_views_of_an_update(scene):
    views = np.concatenate([scene.views[:2], scene.views[:1]])
    weights = draw_filter(np.random.default_rng(1))
    filtered = np.asarray(random_convolution(jnp.asarray(views), weights))
    np.testing.assert_array_equal(filtered[0], filtered[2])
    padded = np.pad(views / 127.5 - 1.0, [(0, 0), (1, 1), (1, 1), (0, 0)])
    expected = [
        correlate(image[..., channel], weights[..., channel, out], "valid")
        for image in padded
        for out in range(3)
        for channel in range(3)
    ]
    expected = np.reshape(expected, (len(views), 3, 3, VIEW, VIEW)).sum(2).transpose(0, 2, 3, 1)
    np.testing.assert_allclose(filtered / 127.5 - 1.0, expected, atol=1e-4)


def test_gamma_correction_by_hand(scene):
    grey = np.array([[[0] * 3, [64] * 3, [255] * 3]], np.uint8)
    np.testing.assert_array_equal(gamma_corrected(grey, 0.5)[0, :, 0], (0, 128, 255))  # 255 √(64 / 255) = 127.7
    assert gamma_corrected(grey, 1.0) is grey
    rooms, settings = GivenRooms([to_room(scene)]), MapSettings(views=4, targets=2)
    (plain,), (bright,) = (draw_chunk(rooms, replace(settings, gamma=g), 3, 5, Chunks(9, 1, 8)) for g in (1.0, 0.5))
    np.testing.assert_array_equal(bright.views, gamma_corrected(plain.views, 0.5))
    np.testing.assert_array_equal(bright.target_views, gamma_corrected(plain.target_views, 0.5))


def test_one_convolution_in_ten_is_the_identity(scene):
    generator = np.random.default_rng(0)
    drawn = np.stack([draw_filter(generator) for _ in range(2000)])
    identity = (drawn[:, 1, 1] == np.eye(3)).all((1, 2))
    assert 0.08 < identity.mean() < 0.12
    np.testing.assert_allclose(drawn[~identity].std(), np.sqrt(1 / 27), rtol=0.02)
    unchanged = np.asarray(random_convolution(jnp.asarray(scene.views), drawn[identity][0]))
    np.testing.assert_allclose(unchanged, scene.views, atol=1e-4)


def test_augmentation_leaves_the_walks_as_they_are(scene):
    rooms, settings = GivenRooms([to_room(scene)]), MapSettings(views=4, targets=2)
    filtered = replace(settings, augmentation="random-convolution")
    (plain,), (augmented,) = (draw_chunk(rooms, each, 3, 5, Chunks(9, 1, 8)) for each in (settings, filtered))
    assert plain.convolution is None
    assert augmented.convolution.shape == (3, 3, 3, 3)
    np.testing.assert_array_equal(plain.target_pose, augmented.target_pose)


@pytest.mark.slow
@pytest.mark.parametrize("augmentation", ["none", "random-convolution"])
def test_a_short_training_learns_and_continues_after_an_interruption(scene, tmp_path, augmentation):
    network, rooms = MapNetwork(width=16, channels=8), GivenRooms([to_room(scene)])
    settings = MapSettings(views=8, targets=4, learning_rate=5e-3, augmentation=augmentation)

    def train(log):
        return train_on_rooms(jax.random.key(0), rooms, 4 * 64, settings, log, network)

    whole = train(TrainingLog())
    curve = whole[1]
    assert curve.frames.tolist() == [64, 128, 192, 256]
    if augmentation == "none":  # with random colours, 32 updates do not tell views of noise apart
        assert curve.location_loss[-1] < curve.location_loss[0] - 0.3
    interrupt(tmp_path, train)
    assert_same(resume(tmp_path, train)[0], whole)


def untrained(network):
    """Parameters of the right shapes, without compiling their initialisation."""
    generator = np.random.default_rng(0)
    shapes = jax.eval_shape(lambda: initial_parameters(network))
    return jax.tree.map(lambda leaf: generator.normal(size=leaf.shape).astype(np.float32), shapes)


def test_weights_survive_their_file(tmp_path):
    parameters = untrained(MapNetwork())
    save_weights(tmp_path / "weights.safetensors", parameters, {"rooms": "three"})
    read, provenance = load_weights(tmp_path / "weights.safetensors")
    assert provenance == {"rooms": "three"}
    assert jax.tree.structure(read) == jax.tree.structure(parameters)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-6), read, parameters)
    assert (tmp_path / "weights.safetensors").stat().st_size < 3e6


def test_weights_of_another_network_are_refused(tmp_path):
    save_weights(tmp_path / "small.safetensors", untrained(MapNetwork(width=8)), {})
    with pytest.raises(InputError, match="do not fit"):
        load_weights(tmp_path / "small.safetensors")
    (tmp_path / "broken.safetensors").write_bytes(b"none")
    with pytest.raises(InputError, match="cannot be read"):
        load_weights(tmp_path / "broken.safetensors")
    with pytest.raises(InputError, match="is missing"):
        load_weights(tmp_path / "missing.safetensors")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"prior/scale": np.float32(np.nan)}, "`prior/scale` is not finite"),
        ({"prior/scale": np.float64(1e200)}, "`prior/scale` is not finite in single precision"),
        ({"prior/scale": np.int32(1)}, "`prior/scale` has the type int32"),
        ({"prior/scale": np.ones(2, np.float32)}, "do not fit"),
        ({"prior/scale/x": np.float32(1)}, "do not fit"),
        ({"prior": np.float32(1)}, "do not fit"),
    ],
)
def test_damaged_weights_are_refused_before_the_work(tmp_path, changes, said):
    path = tmp_path / "weights.safetensors"
    save_arrays(path, {"/".join(k): v for k, v in flatten_dict(untrained(MapNetwork())).items()} | changes)
    config = Config(agent="map", methods=("rl",), map=MapSettings(weights=str(path)))
    with pytest.raises(InputError, match=said) as refusal:
        check_agent(config, ["III"])
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


def test_the_weights_that_come_with_the_package_load():
    parameters, provenance = load_weights()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(parameters))
    assert "from number 1000" in provenance["rooms"]
    assert provenance["command"] == "make weights"
