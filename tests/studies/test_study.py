"""Runs of a study share rewards as far as they agree, and go where joblib's context sends them."""

import os
import pickle
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

import joblib
import numpy as np
import pytest
from builders import grid_scene, labelled

from relm_irl_jax.config import Config, overlay
from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.rewards.basis import RewardBasis
from relm_irl_jax.rewards.equation import form_of
from relm_irl_jax.rewards.learned import LearnedRewards
from relm_irl_jax.rewards.predicted import pair_inputs
from relm_irl_jax.stages.encoding import EncodedScenes
from relm_irl_jax.stages.rewards import learn
from relm_irl_jax.studies import study
from relm_irl_jax.tasks import draw_split

SMALL = overlay(
    Config(),
    {
        "tasks": {"training_targets": 3, "new_targets_per_scene": 2},
        "irl": {"trajectories": 2, "dimension": 6, "processes": 1},
        "elm": {"hidden": 16, "pairs": 40, "ordering": "none", "selection": "none"},
    },
    "small",
)


def forget_shared():
    for cached in (study._encoded, study._demonstrated, study._regressors):
        cached.cache_clear()


@pytest.fixture
def scenes(monkeypatch):
    generator = np.random.default_rng(0)
    room = labelled(grid_scene(3, 3), 5, generator)
    features = generator.normal(size=(room.n_states, 10)).astype(np.float32)
    encoded = EncodedScenes([replace(room, features=features)], None, "none")
    monkeypatch.setattr(study, "encode_training", lambda config: encoded)
    forget_shared()
    yield encoded.scenes
    forget_shared()


def shared(scenes, seed: int = 1, **changes):
    config = overlay(SMALL, changes, "changes")
    return study.learn_shared(config, scenes, draw_split(scenes, (), config.tasks, seed), seed)


def test_shared_rewards_are_those_learned(scenes):
    own = learn(SMALL, scenes, draw_split(scenes, (), SMALL.tasks, 1), 1)
    held = shared(scenes, metric={"width": 8})
    pair = pair_inputs(scenes[0].encoded[:3], scenes[0].encoded[5:8])
    np.testing.assert_array_equal(own.basis.components, held.basis.components)
    for one, other in zip(own.demonstrated, held.demonstrated, strict=True):
        assert one.target == other.target
        np.testing.assert_array_equal(one.weights, other.weights)
    for method, regressor in own.regressors.items():
        np.testing.assert_array_equal(regressor.predict(pair), held.regressors[method].predict(pair))


def test_rewards_are_shared_as_far_as_configurations_agree(scenes, monkeypatch):
    """Learning is a stub that counts; what it would depend on is what it is called with."""
    calls = Counter()

    def learn_demonstrated(scenes, split, settings, seed):
        assert split == draw_split(scenes, (), SMALL.tasks, seed)
        calls[settings.dimension, seed] += 1
        basis = RewardBasis(np.zeros(10), np.zeros((10, settings.dimension)))
        return LearnedRewards(basis, (), (), {}, form_of(settings))

    def fit_regressors(scenes, demonstrated, settings, seed):
        calls["fitted", settings.hidden, seed] += 1
        return {"relm-irl": ELMRegressor(settings.hidden)}

    monkeypatch.setattr(study, "learn_demonstrated", learn_demonstrated)
    monkeypatch.setattr(study, "fit_regressors", fit_regressors)
    first = shared(scenes)
    current = {"predict_from": "current"}
    assert shared(scenes, metric={"width": 8}, frames=7, elm=current).regressors is first.regressors
    smaller = shared(scenes, elm={"hidden": 8})
    assert smaller.basis is first.basis
    assert smaller.regressors["relm-irl"].n_hidden == 8
    assert shared(scenes, irl={"dimension": 4}).basis.components.shape == (10, 4)
    assert shared(scenes, seed=2).basis is not first.basis
    learned = {(6, 1): 1, (4, 1): 1, (6, 2): 1}
    assert calls == learned | {("fitted", 16, 1): 2, ("fitted", 8, 1): 1, ("fitted", 16, 2): 1}


def stub():
    """Completes a run by noting the process in its folder. A function of a function, so that workers need no test."""

    def complete(run: tuple[Path, int]) -> None:
        folder, number = run
        (folder / str(number)).write_text(str(os.getpid()))

    return complete


def processes(folder: Path) -> list[int]:
    """The process that completed each of three runs."""
    assert sorted(path.name for path in folder.iterdir()) == ["0", "1", "2"]
    return [int(path.read_text()) for path in folder.iterdir()]


def test_runs_follow_each_other_in_this_process_by_default(tmp_path):
    study.complete_runs([(tmp_path, number) for number in range(3)], stub())
    assert processes(tmp_path) == [os.getpid()] * 3


def test_runs_go_to_other_processes_where_the_context_says_so(tmp_path):
    with joblib.parallel_config(backend="loky", n_jobs=2):
        study.complete_runs([(tmp_path, number) for number in range(3)], stub())
    assert os.getpid() not in processes(tmp_path)


def test_runs_go_to_a_dask_cluster(tmp_path):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "processes": True, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(**options) as cluster,
        distributed.Client(cluster),
        joblib.parallel_config(backend="dask"),
    ):
        study.complete_runs([(tmp_path, number) for number in range(3)], stub())
    assert os.getpid() not in processes(tmp_path)


def test_a_run_can_be_sent_to_another_process():
    """Both what completes it and its configuration."""
    complete, config = partial(study.complete_run, maps=False), replace(SMALL, run=Path("somewhere"))
    sent = pickle.loads(pickle.dumps((complete, config)))
    assert sent[0].func is study.complete_run
    assert sent[1] == config
