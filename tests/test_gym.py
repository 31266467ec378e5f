"""The Gymnasium environments: the checker, the rules of the task, seeding and autoreset."""

import warnings

import gymnasium
import numpy as np
import pytest
from builders import grid_scene, labelled
from gymnasium.utils.env_checker import check_env

import relm_irl_jax  # noqa: F401  registers the environments
from relm_irl_jax.errors import InputError
from relm_irl_jax.gym import NavigationEnv, NavigationVectorEnv
from relm_irl_jax.scenes.rooms import generate_room
from relm_irl_jax.scenes.scene_file import save_scene

NAME = "RelmIrl/Navigation-v0"


@pytest.fixture(scope="module")
def room():
    return labelled(grid_scene(3, 3), 4, np.random.default_rng(0))


@pytest.fixture(scope="module")
def pictured(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "bathroom-0.h5"
    save_scene(generate_room("bathroom", 0, size="tiny", image_size=32), path)
    return path


@pytest.mark.parametrize("obs", ["features", "frames"])
def test_the_checker_has_nothing_to_say(room, pictured, obs):
    options = {"scene": room, "history": 2} if obs == "features" else {"scene": pictured, "render_mode": "rgb_array"}
    environment = gymnasium.make(NAME, obs=obs, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(environment.unwrapped, skip_render_check=obs == "features")


def test_a_shortest_path_ends_at_the_target(room):
    environment = NavigationEnv(room, target=7, cap=50)
    observation, facts = environment.reset(seed=4)
    assert np.array_equal(observation["target"], room.features[7])
    shortest = facts["shortest"]
    assert facts == {"distance": shortest, "shortest": shortest, "steps": 0, "success": False}
    state = int(np.argmax(observation["view"]))  # features are one-hot
    for step in range(1, shortest + 1):
        distances = room.shortest_path_distance[np.where(room.graph[state] < 0, state, room.graph[state]), 7]
        observation, reward, terminated, truncated, facts = environment.step(int(distances.argmin()))
        state = int(np.argmax(observation["view"]))
        assert facts["distance"] == shortest - step
        assert (terminated, truncated) == (step == shortest, False)
    assert facts["success"]
    assert reward == 10.0


def test_the_cap_truncates(room):
    environment = NavigationEnv(room, target=0, cap=3)
    environment.reset(seed=0)
    ends = [environment.step(1)[2:4] for _ in range(3)]  # turning in place
    if not any(terminated for terminated, _ in ends):
        assert [truncated for _, truncated in ends] == [False, False, True]


def test_one_seed_one_course(room):
    courses = []
    for _ in range(2):
        environment = gymnasium.make_vec(NAME, num_envs=5, scene=room, cap=20)
        assert isinstance(environment, NavigationVectorEnv)
        observation, _ = environment.reset(seed=3)
        environment.action_space.seed(3)
        states = [observation["view"]]
        for _ in range(30):
            states.append(environment.step(environment.action_space.sample())[0]["view"])
        courses.append(np.stack(states))
    np.testing.assert_array_equal(courses[0], courses[1])
    assert len({tuple(np.argmax(x, -1)) for x in courses[0]}) > 5


def test_the_last_views_are_observed(room):
    environment = NavigationEnv(room, target=7, cap=50, history=3)
    seen = [environment.reset(seed=4)[0]] + [environment.step(1)[0] for _ in range(2)]
    start, turned, again = (int(np.argmax(observation["view"][0])) for observation in seen)
    assert len({start, turned, again}) == 3
    states = [np.argmax(observation["view"], axis=1).tolist() for observation in seen]
    assert states == [[start] * 3, [turned, start, start], [again, turned, start]]
    assert seen[0]["target"].shape == (36,)


def test_an_agent_that_is_done_begins_again_on_its_next_step(room):
    environment = NavigationVectorEnv(64, room, cap=4)
    observation, _ = environment.reset(seed=0)
    over = np.zeros(64, bool)
    targets = [observation["target"]]
    for _ in range(12):
        observation, reward, terminated, truncated, facts = environment.step(environment.action_space.sample())
        assert not (terminated & truncated).any()
        assert (facts["steps"][over] == 0).all()
        assert (reward[over] == 0).all()
        assert (facts["distance"][over] == facts["shortest"][over]).all()
        assert (facts["success"] >= terminated).all()
        assert not (terminated | truncated)[over].any()
        targets.append(observation["target"])
        over = terminated | truncated
    assert len({row.tobytes() for row in np.concatenate(targets)}) == 4  # targets are redrawn, among four best views


def test_stable_baselines3_trains_on_it_as_it_is(room):
    peer = pytest.importorskip("stable_baselines3", reason="stable-baselines3 (extra `peers`) is not installed")
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        environment = gymnasium.make(NAME, scene=room, target=[0, 7], cap=20)
        checker.check_env(environment.unwrapped)
        learner = peer.A2C("MultiInputPolicy", environment, n_steps=8, policy_kwargs={"net_arch": [16]}, seed=0)
        before = {name: value.clone() for name, value in learner.policy.state_dict().items()}
        learner.learn(160)
    after = learner.policy.state_dict()
    assert all(value.isfinite().all() for value in after.values())
    assert all((after[name] != before[name]).any() for name in ("action_net.weight", "value_net.weight"))
    assert {episode["l"] <= 20 for episode in learner.ep_info_buffer} == {True}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"scene": "attic-0"}, "neither a scene file nor a built-in room"),
        ({"target": "piano"}, "shows no piano"),
        ({"target": 99}, "give states from 0 to 35"),
        ({"cap": 0}, "cap = 0 is refused"),
        ({"obs": "sound"}, "give features or frames"),
    ],
)
def test_bad_options_are_one_sentence(room, options, sentence):
    with pytest.raises(InputError, match=sentence):
        NavigationEnv(**{"scene": room} | options)
