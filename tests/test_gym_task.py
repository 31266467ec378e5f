"""`RelmIrl/Task-v0`: the scenes and targets of the tables, and nothing of JAX in a step."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from command import EXPERIMENT
from gymnasium.utils.env_checker import check_env

import relm_irl_jax  # noqa: F401  registers the environments
from relm_irl_jax.config import load_config
from relm_irl_jax.errors import InputError
from relm_irl_jax.gym import TaskEnv, TaskVectorEnv
from relm_irl_jax.scenes.selection import training_scenes, unseen_scenes
from relm_irl_jax.tasks import draw_split

CONFIG = replace(load_config(EXPERIMENT), scene=replace(load_config(EXPERIMENT).scene, image_size=32))
NAME = "RelmIrl/Task-v0"


@pytest.fixture(scope="module")
def split():
    scenes = [[load() for load in choose(CONFIG.scenes, CONFIG.scene)] for choose in (training_scenes, unseen_scenes)]
    return scenes, draw_split(*scenes, CONFIG.tasks, 1)


@pytest.mark.parametrize("task", ["I", "II", "III"])
@pytest.mark.parametrize("part", ["train", "test"])
def test_targets_are_those_of_the_tables(split, task, part):
    (training, unseen), drawn = split
    problem = TaskEnv(task, 1, part, obs="frames", config=CONFIG).problem
    expected = drawn.training if part == "train" else drawn.of_task(task, CONFIG.evaluation)
    scenes = unseen if (part, task) == ("test", "III") else training
    named = {(problem.scenes[t.scene].name, t.state, t.category) for t in problem.targets}
    assert named == {(scenes[t.scene].name, t.state, t.category) for t in expected}


def test_training_meets_no_target_of_task_ii(split):
    _, drawn = split
    problem = TaskEnv("II", 1, "train", obs="frames", config=CONFIG).problem
    for target in problem.targets:
        assert target.state not in drawn.evaluation_only(target.scene)


def test_the_checker_is_content():
    environment = gymnasium.make(NAME, obs="frames", config=CONFIG, render_mode="rgb_array")
    check_env(environment.unwrapped)


def test_the_observation_is_the_view_of_the_state_in_its_scene(split):
    (training, _), _ = split
    environment = TaskVectorEnv(32, "II", 1, "test", obs="frames", config=CONFIG)
    environment.reset(seed=0)
    for _ in range(3):
        observation, *_ = environment.step(environment.action_space.sample())
        for view, state in zip(observation["view"], environment._states[:, 0], strict=True):
            scene, local = environment.problem.scene[state], environment.problem.local[state]
            name = environment.problem.scenes[scene].name
            np.testing.assert_array_equal(view, next(s for s in training if s.name == name).views[local])


def test_scenes_may_be_a_list(split):
    (training, unseen), _ = split
    options = {"scenes": training, "unseen": unseen, "obs": "frames", "config": CONFIG}
    for task, part in (("II", "train"), ("II", "test"), ("III", "test")):
        listed = TaskEnv(task, 1, part, **options).problem
        assert listed.targets == TaskEnv(task, 1, part, obs="frames", config=CONFIG).problem.targets
        assert listed.scenes[0] in (unseen if task == "III" else training)
    with pytest.raises(InputError, match="unseen: Task III needs scenes"):
        TaskEnv("III", 1, "test", **options | {"unseen": None})


def test_spaces_of_training_and_test_are_equal():
    spaces = [TaskEnv("III", 1, part, obs="frames", config=CONFIG).observation_space for part in ("train", "test")]
    assert spaces[0] == spaces[1]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"task": "IV"}, "task"),
        ({"split": "validation"}, "give train or test"),
        ({"cap": 0}, "cap"),
        ({"scenes": "/nowhere"}, "/nowhere"),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, sentence):
    with pytest.raises(InputError, match=sentence):
        TaskEnv(**{"obs": "frames", "config": CONFIG} | arguments)
