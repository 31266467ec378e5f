"""Programs that benchmarks time do what they are said to do."""

from types import SimpleNamespace

import jax
import numpy as np
import pytest
from command import EXPERIMENT
from tiny import problem

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.benchmarks import commands, gym, trainings
from relm_irl_jax.benchmarks.environment import STEPS, environment_program
from relm_irl_jax.benchmarks.peers import compare
from relm_irl_jax.benchmarks.plain_a2c import plain_program
from relm_irl_jax.config import Config, load_config
from relm_irl_jax.stages.training import SeedInputs
from relm_irl_jax.tasks import TaskSplit


def test_the_environment_alone_ends_and_starts_episodes():
    episode, (terminated, truncated) = environment_program(problem(cap=20), 6)()
    assert terminated.shape == truncated.shape == (STEPS, 1, 6)
    assert terminated.any()
    assert truncated.any()
    assert not (terminated & truncated).any()
    # Steps since the last end of each worker's episodes.
    ended = np.asarray(terminated | truncated)[:, 0]
    np.testing.assert_array_equal(episode.steps[0], ended[::-1].argmax(0))


def test_the_plain_actor_critic_learns():
    with jax.numpy_dtype_promotion("standard"):  # optax raises numbers to the power of its integer count
        parameters, reward = plain_program(problem(), SiameseSettings(workers=8, t_max=4, width=8), updates=60)()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(parameters))
    assert reward.shape == (60,)
    assert reward[-20:].mean() > reward[:20].mean()


def test_a_ratio_is_ours_divided_by_theirs():
    row = compare("part", "peer", "steps", 30.0, 10.0)
    assert row.ratio == 3.0
    assert "cores" in row.computer


def test_the_rate_of_a_training_leaves_out_the_first_chunk(monkeypatch):
    """Chunks of 40 frames that end after 5, 7 and 8 seconds."""

    def train(key, problem, log):
        assert problem == (600, "rl")
        for chunk in (1, 2, 3):
            log.add({}, [{"frames": 40.0 * number} for number in range(1, chunk + 1)])

    ends = iter((100.0, 105.0, 107.0, 108.0))
    monkeypatch.setattr(trainings, "time", SimpleNamespace(perf_counter=lambda: next(ends)))
    monkeypatch.setattr(trainings, "make_agent", lambda config, method: SimpleNamespace(train=train))
    monkeypatch.setattr(trainings, "training_problem", lambda config, method, *_: (config.training_frames, method))
    case = trainings.Case("siamese", "rl", 600, 600, {"siamese": {"workers": 8}})
    row = trainings.measure(case, Config(), SeedInputs(0, (), TaskSplit((), (), (), ()), None))
    assert (row.agent, row.workers, row.frames) == ("siamese", 8, 120)
    assert (row.first_chunk_seconds, row.other_chunks_seconds) == (5.0, 3.0)
    assert row.frames_per_second == round(80 / 3)


def test_commands_find_nothing_of_what_others_computed(monkeypatch):
    asked = []

    def run(words, **options):
        asked.append((words, options["env"]))

    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "kept")
    monkeypatch.setattr(commands.subprocess, "run", run)
    row = commands.measure(("train", "--task", "II"))
    (words, environment), cache = asked[0], asked[0][1]["XDG_CACHE_HOME"]
    assert words[2:6] == ["relm_irl_jax", "train", "--task", "II"]
    assert words[-1] == cache.replace("/cache", "/run")
    assert "JAX_COMPILATION_CACHE_DIR" not in environment
    assert row.command == "relm-irl train --task II"


@pytest.mark.parametrize("agents", [1, 3])
def test_environments_are_stepped_from_one_episode_to_the_next(agents):
    row = gym.measure(agents, "frames", seconds=0.1, config=load_config(EXPERIMENT))
    assert (row.agents, row.observation) == (agents, "frames")
    assert row.steps_per_second > 0
    assert row.shape.endswith(" × 3")
