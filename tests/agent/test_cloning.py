"""Behaviour cloning: whose decisions it sees, and that it takes them over."""

import jax
import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.cloning import clone, decisions_of, views_along
from relm_irl_jax.agent.siamese.frames import forward, tabulate
from relm_irl_jax.agent.siamese.train import network_of
from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import shortest_path_trajectories
from relm_irl_jax.tasks import Target
from relm_irl_jax.world import build_targets, build_world


def two_rooms():
    generator = np.random.default_rng(0)
    scenes = [
        grid_scene(2, 2, name="bathroom-0", features=generator.normal(size=(16, 20)).astype(np.float32)),
        grid_scene(3, 2, name="bedroom-0", features=generator.normal(size=(24, 20)).astype(np.float32)),
    ]
    targets = [Target(0, 3), Target(1, 20)]
    starts = [[(t.state + 9) % 16, (t.state + 2) % 16] for t in targets]
    walks = [shortest_path_trajectories(scenes[t.scene], t.state, own) for t, own in zip(targets, starts, strict=True)]
    views = np.concatenate([views_along(w.states[:-1] + 16 * row, 1) for row, own in enumerate(walks) for w in own])
    target = np.concatenate([np.full(len(w.actions), row) for row, own in enumerate(walks) for w in own])
    action = np.concatenate([w.actions for own in walks for w in own])
    return build_world(scenes, [0, 1]), build_targets(scenes, targets), views, target, action


def test_views_along_a_walk():
    assert views_along(np.asarray([7, 8, 3]), 3).tolist() == [[7, 7, 7], [8, 7, 7], [3, 8, 7]]


def test_decisions_are_sorted_by_head():
    world, _, views, target, action = two_rooms()
    decisions = decisions_of(views, target, action, world, 2)
    for head in range(2):
        own = target == head  # each room has one target here
        count = int(decisions.count[head])
        assert count == own.sum()
        np.testing.assert_array_equal(decisions.views[head, :count], views[own])
        np.testing.assert_array_equal(decisions.action[head, :count], action[own])


def test_demonstrated_decisions_are_taken_over():
    world, targets, views, target, action = two_rooms()
    settings = SiameseSettings(workers=16, t_max=4, width=32, learning_rate=1e-2)
    decisions = decisions_of(views, target, action, world, 2)
    parameters, curve = clone(jax.random.key(0), world, targets, decisions, 2, settings, 8_000)
    assert curve.accuracy[-1] == 1.0
    assert curve.loss[-1] < 0.1 < curve.loss[0]
    assert curve.frames[-1] >= 8_000
    network = network_of(settings, 2)
    tables = tabulate(network, parameters, world.features, targets.state)
    for head in range(2):
        own = target == head
        chosen = forward(
            network, parameters, tables, views[own][None], target[own][None], np.asarray([head])
        ).logits.argmax(-1)
        np.testing.assert_array_equal(chosen[0], action[own])


def test_a_head_without_demonstrations_is_refused():
    world, _, views, target, action = two_rooms()
    with pytest.raises(InputError, match="no demonstration to clone"):
        decisions_of(views[target == 0], target[target == 0], action[target == 0], world, 2)
