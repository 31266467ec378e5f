"""Episodes in the files of other libraries, read as those libraries read them."""

import json
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.demonstrations import from_imitation
from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import Trajectory, shortest_path_trajectories
from relm_irl_jax.exports.episodes import StepRewards, observe
from relm_irl_jax.exports.imitation import write_imitation
from relm_irl_jax.exports.minari import write_minari

ROOM = grid_scene(3, 1, features=np.arange(36, dtype=np.float32).reshape(12, 3))
REWARDS = StepRewards(target=10.0, collision=-0.1, step=-0.01)
WALKS = (
    # Ahead is a wall; then a turn to +x, and two steps to the last place.
    Trajectory(np.asarray([0, 0, 1, 5, 9], np.int32), np.asarray([0, 1, 0, 0], np.int32), 9),
    *shortest_path_trajectories(ROOM, 8, [1]),
)


@pytest.fixture(scope="module")
def episodes():
    return observe(ROOM, WALKS, REWARDS)


def test_rewards_by_hand(episodes):
    assert episodes[0].reward.tolist() == [-0.1, -0.01, -0.01, 10.0]
    np.testing.assert_array_equal(episodes[0].view[3], [15, 16, 17])  # state 5
    np.testing.assert_array_equal(episodes[0].target, [27, 28, 29])


def test_scenes_without_features_are_refused():
    with pytest.raises(InputError, match="has no features"):
        observe(grid_scene(3, 1, features=np.zeros((12, 0), np.float32)), WALKS, REWARDS)


def test_what_a_minari_dataset_holds(episodes, tmp_path):
    write_minari(episodes, tmp_path / "walks-v0", "shortest paths")
    metadata = json.loads((tmp_path / "walks-v0" / "data" / "metadata.json").read_text())
    assert (metadata["dataset_id"], metadata["total_episodes"]) == ("walks-v0", 2)
    with h5py.File(tmp_path / "walks-v0" / "data" / "main_data.hdf5") as file:
        assert metadata["total_steps"] == sum(len(file[name]["actions"]) for name in file)
        first = file["episode_0"]
        assert first["observations/view"].shape == first["observations/target"].shape == (5, 3)
        assert first["actions"][:].tolist() == [0, 1, 0, 0]
        assert first["terminations"][:].tolist() == [False, False, False, True]
        assert not first["truncations"][:].any()
        assert first["infos/state"][:].tolist() == [0, 0, 1, 5, 9]


def test_minari_reads_its_dataset(episodes, tmp_path):
    minari = pytest.importorskip("minari", exc_type=ImportError)
    write_minari(episodes, tmp_path / "walks-v0", "shortest paths")
    dataset = minari.MinariDataset(str(tmp_path / "walks-v0" / "data"))
    assert (dataset.id, dataset.total_episodes) == ("walks-v0", 2)
    for ours, read in zip(episodes, dataset.iterate_episodes(), strict=True):
        np.testing.assert_array_equal(read.observations["view"], ours.view)
        np.testing.assert_array_equal(read.actions, ours.action)
        np.testing.assert_array_equal(read.rewards, ours.reward)
        assert dataset.observation_space.contains({name: of_all[0] for name, of_all in read.observations.items()})


def imitation_load(path):
    """What `imitation.data.serialize.load` does with such a file, without pickle."""
    data = np.load(path, allow_pickle=False)
    count = len(data["indices"])
    fields = [
        np.split(data["obs"], data["indices"] + np.arange(count) + 1),
        *(np.split(data[name], data["indices"]) for name in ("acts", "infos")),
        data["terminal"],
        np.split(data["rews"], data["indices"]),
    ]
    return [
        SimpleNamespace(**dict(zip(("obs", "acts", "infos", "terminal", "rews"), each, strict=True)))
        for each in zip(*fields, strict=True)
    ]


def test_imitation_trajectories_become_demonstrations_again(episodes, tmp_path):
    write_imitation(episodes, tmp_path / "walks.npz")
    loaded = imitation_load(tmp_path / "walks.npz")
    assert len(loaded) == len(WALKS)
    for walk, episode, read in zip(WALKS, episodes, loaded, strict=True):
        assert read.terminal
        assert read.obs.shape == (len(read.acts) + 1, 6)
        np.testing.assert_array_equal(read.obs[:, 3:], np.tile(episode.target, (len(read.obs), 1)))
        np.testing.assert_allclose(read.rews, episode.reward)
        again = from_imitation(read, ROOM)
        assert (again.states.tolist(), again.actions.tolist()) == (walk.states.tolist(), walk.actions.tolist())


def test_trajectories_that_name_no_states_are_refused():
    trajectory = SimpleNamespace(obs=np.zeros((2, 3)), acts=[0], infos=[{}])
    with pytest.raises(InputError, match="are no numbers of states"):
        from_imitation(trajectory, ROOM)


@pytest.mark.parametrize(
    ("write", "name"), [(write_imitation, "walks.pkl"), (lambda e, p: write_minari(e, p, "x"), "walks")]
)
def test_names_that_the_libraries_do_not_read(episodes, tmp_path, write, name):
    with pytest.raises(InputError, match=r"such as expert-v0|ends in \.npz"):
        write(episodes, tmp_path / name)
    assert not list(tmp_path.iterdir())
