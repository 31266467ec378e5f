"""Runs of a study share rewards as far as they agree."""

from dataclasses import replace

import numpy as np
import pytest
from builders import grid_scene, labelled
from relm_irl_jax.rewards.prediction import pair_inputs
from relm_irl_jax.stages.learning import learn

from relm_irl_jax.config import Config, overlay
from relm_irl_jax.stages.encoding import EncodedScenes
from relm_irl_jax.studies import study
from relm_irl_jax.tasks import draw_split

SMALL = overlay(
    Config(),
    {
        "tasks": {"training_targets": 3, "new_targets_per_scene": 2},
        "irl": {"trajectories": 2, "dimension": 6, "processes": 1},
        "elm": {"hidden": 16, "pairs": 40},
    },
    "small",
)


@pytest.fixture
def scenes(monkeypatch):
    generator = np.random.default_rng(0)
    room = labelled(grid_scene(3, 3), 5, generator)
    encoded = EncodedScenes([replace(room, features=generator.normal(size=(room.n_states, 10)))], None, "none")
    monkeypatch.setattr(study, "encode_training", lambda config: encoded)
    study.forget()
    yield encoded.scenes
    study.forget()


def test_remembered_rewards_are_those_learned_and_shared_as_far_as_they_agree(scenes):
    def remembered(seed: int = 1, **changes):
        config = overlay(SMALL, changes, "changes")
        return study.remembered(config, scenes, draw_split(scenes, (), config.tasks, seed), seed)

    own, first = learn(SMALL, scenes, draw_split(scenes, (), SMALL.tasks, 1), 1), remembered()
    pair = pair_inputs(scenes[0].encoded[:3], scenes[0].encoded[5:8])
    np.testing.assert_array_equal(own.basis.components, first.basis.components)
    for learned, held in zip(own.records, first.records, strict=True):
        assert learned.target == held.target
        np.testing.assert_array_equal(learned.solution.w, held.solution.w)
    for method, machine in own.machines.items():
        np.testing.assert_array_equal(machine.predict(pair), first.machines[method].predict(pair))

    assert remembered(metric={"width": 8}, elm={"follow": True}).machines is first.machines
    smaller = remembered(elm={"hidden": 8})
    assert smaller.records is first.records
    assert smaller.machines["elm-irl"].n_hidden == 8
    assert remembered(irl={"dimension": 4}).records is not first.records
    assert remembered(seed=2).records is not first.records
