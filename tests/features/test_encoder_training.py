"""Training of the small encoder: labels, groups of views, and whole trainings of a few updates."""

from dataclasses import replace
from functools import partial

import jax
import numpy as np
import pytest
from builders import grid_scene, labelled

from relm_irl_jax.errors import InputError
from relm_irl_jax.features.convnet import VIEW
from relm_irl_jax.features.convnet_weights import load_convnet, trained_scenes
from relm_irl_jax.features.training import command
from relm_irl_jax.features.training.command import rooms_material, train_encoder
from relm_irl_jax.features.training.heads import HeadSettings, Readings, losses
from relm_irl_jax.features.training.labels import draw_groups, free_steps, group_of, label_scene
from relm_irl_jax.features.training.quality import measure_quality
from relm_irl_jax.features.training.settings import EncoderTraining, TrainingSettings
from relm_irl_jax.features.training.train import batches, initial_state, scenes_met, update
from relm_irl_jax.scenes.rooms.training_rooms import check_training_rooms
from relm_irl_jax.scenes.scene_file import save_scene

SETTINGS = TrainingSettings(steps=12, groups=4, members=4, pool=2, turn=1)
CATEGORIES = ("thing-0", "thing-1", "thing-2")


def seen_scene(name="bathroom-0", columns=4, rows=3):
    """A small room whose views show each state in a colour of its own."""
    generator = np.random.default_rng(0)
    bare = labelled(grid_scene(columns, rows, name=name), 3, generator)
    colour = generator.integers(0, 255, (bare.n_states, 1, 1, 3))
    noise = generator.integers(-40, 40, (bare.n_states, VIEW, VIEW, 3))
    return replace(bare, observation=np.clip(colour + noise, 0, 255).astype(np.uint8), features=None)


@pytest.fixture(scope="module")
def scene():
    return label_scene(seen_scene(), CATEGORIES)


def state_at(scene, heading, z, x):
    return int(np.flatnonzero((scene.pose == (heading, z, x)).all(1))[0])


def test_rooms_that_judge_the_features_are_not_trained_on():
    material = rooms_material(31)
    held_out = {f"{load.args[0]}-{load.args[1]}" for load in material.held_out}
    assert len(held_out) == 15
    assert not held_out & set(material.names)
    check_training_rooms([load.args[1] for load in material.held_out])


def test_free_steps_are_counted_to_the_wall(scene):
    free = free_steps(seen_scene())
    # The room has x from 0 to 3 and z from 0 to 2. Heading 0 faces +z, 1 faces +x.
    assert free[state_at(scene, 0, 0, 1)].tolist() == [2, 2, 1]
    assert free[state_at(scene, 1, 0, 1)].tolist() == [2, 0, 2]
    assert free[state_at(scene, 2, 2, 3)].tolist() == [2, 3, 0]


def test_pairs_are_seen_from_the_first_view(scene):
    states = np.array([state_at(scene, 1, 1, 1), state_at(scene, 0, 0, 3), state_at(scene, 1, 1, 1)])
    group = group_of(scene, states)
    # From (x 1, z 1) facing +x: x 3 is two ahead, z 0 is one to the right; heading 0 is a turn to the left.
    assert group.displacement[0, 1].tolist() == [2.0, 1.0]
    assert group.heading[0, 1] == 3
    assert group.displacement[1, 0].tolist() == [1.0, -2.0]
    assert group.heading[1, 0] == 1
    assert group.distance[0, 2] == 0
    assert not group.best[0, 2].any()
    # Two steps ahead, the turn to +z, a step back: in this order alone.
    assert group.distance[0, 1] == 4
    assert group.best[0, 1].tolist() == [True, False, False, False]


def test_groups_are_drawn_from_their_scene(scene):
    groups = draw_groups([scene, scene], np.random.default_rng(0), groups=3, members=6)
    assert groups.views.shape == (3, 6, VIEW, VIEW, 3)
    flat = {view.tobytes() for view in scene.views}
    assert all(view.tobytes() in flat for view in groups.views.reshape(-1, VIEW, VIEW, 3))


def test_scenes_take_turns(scene):
    entered = []
    loaders = [lambda number=number: entered.append(number) or scene for number in range(5)]
    stream = batches(loaders, SETTINGS, seed=0)
    for _ in range(4):
        next(stream)
    assert entered == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(("steps", "turn", "count"), [(1, 1, 9), (4, 1, 9), (7, 3, 9), (7, 3, 3), (7, 3, 2)])
def test_scenes_met_are_those_loaded_for_an_update(scene, steps, turn, count):
    settings, entered = replace(SETTINGS, steps=steps, turn=turn), []
    loaders = [lambda number=number: entered.append(number) or scene for number in range(count)]
    stream = batches(loaders, settings, seed=0)
    for _ in range(steps):
        next(stream)
    assert len(set(entered)) == scenes_met(count, settings)


def test_the_loss_is_least_at_the_truth(scene):
    groups = draw_groups([scene], np.random.default_rng(0), groups=2, members=4)
    settings = HeadSettings(3, paths=True)
    sure = 30.0
    truth = Readings(
        shown=np.where(groups.share >= 0.01, sure, -sure).astype(np.float32),
        share=np.sqrt(groups.share),
        free=sure * np.eye(9, dtype=np.float32)[groups.free],
        heading=sure * np.eye(4, dtype=np.float32)[groups.heading],
        displacement=groups.displacement,
        action=np.where(groups.best, sure, -sure).astype(np.float32),
        log_distance=np.log1p(groups.distance).astype(np.float32),
    )
    judged = jax.jit(lambda readings: losses(readings, groups, settings))
    assert max(float(part) for part in judged(truth)) < 1e-4
    wrong = truth._replace(
        shown=-truth.shown,
        share=truth.share + np.float32(0.5),
        free=np.roll(truth.free, 1, -1),
        heading=np.roll(truth.heading, 1, -1),
        displacement=truth.displacement + np.float32(2),
        action=-truth.action,
        log_distance=truth.log_distance + np.float32(0.5),
    )
    for name in Readings._fields:
        changed = truth._replace(**{name: getattr(wrong, name)})
        assert float(getattr(judged(changed), name)) > 1e-3, name
    perception = losses(truth._replace(action=-truth.action), groups, replace(settings, paths=False))
    assert float(perception.action) == float(perception.log_distance) == 0


def test_updates_lower_the_loss_and_depend_on_the_seed_alone(scene):
    heads = HeadSettings(3, paths=True)

    def run(seed, steps):
        """Heads after the first two updates, and all losses."""
        state, totals, early = initial_state(SETTINGS, heads, seed), [], None
        stream = batches([lambda: scene], SETTINGS, seed)
        for number in range(steps):
            state, parts = update(state, next(stream), SETTINGS, heads)
            totals.append(sum(float(part) for part in parts))
            if number == 1:
                early = jax.tree.leaves(jax.device_get(state.parameters["heads"]))
        return early, totals

    early, totals = run(0, SETTINGS.steps)
    assert np.mean(totals[-3:]) < 0.9 * np.mean(totals[:3])
    again, other = run(0, 2)[0], run(1, 2)[0]
    for first, second, third in zip(early, again, other, strict=True):
        np.testing.assert_array_equal(first, second)
        assert np.abs(np.asarray(first) - np.asarray(third)).max() > 0


def test_an_encoder_is_trained_on_the_training_scenes_of_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "measure_quality", partial(measure_quality, batches=1))
    for number in range(3):
        save_scene(seen_scene(f"bathroom-{number}"), tmp_path / "scenes" / f"bathroom-{number}.h5")
    output = tmp_path / "mine.safetensors"
    settings = EncoderTraining(output=output, scenes=str(tmp_path / "scenes"), paths=True, training=SETTINGS)
    quality, judged_on = train_encoder(settings)
    assert 0 <= quality.free <= 1
    assert 0 <= quality.action <= 1
    assert judged_on == "the scenes trained on"
    # bathroom-2 is what Task III keeps unseen.
    assert trained_scenes(load_convnet(output)[1]) == {"bathroom-0", "bathroom-1"}
    with pytest.raises(InputError, match="is a folder"):
        train_encoder(replace(settings, output=tmp_path))
