"""The wall between training and evaluation."""

from dataclasses import replace

import numpy as np
import pytest
from builders import grid_scene, labelled

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.task_settings import EvaluationSettings, TaskSettings
from relm_irl_jax.tasks import NEAR_DISTANCE, draw_split

SETTINGS = TaskSettings(training_targets=7, new_targets_per_scene=4)


def scenes(first: int, count: int):
    return [
        labelled(grid_scene(4, 5, name=f"bathroom-{number}"), 6, np.random.default_rng(number))
        for number in range(first, first + count)
    ]


@pytest.mark.parametrize("seed", range(8))
def test_no_evaluation_target_is_trained(seed):
    training, unseen = scenes(0, 3), scenes(10, 2)
    split = draw_split(training, unseen, SETTINGS, seed)
    trained = {(t.scene, t.state) for t in split.training}
    assert len(split.training) == len(trained) == 7
    for group in (split.new, split.uniform):
        chosen = {(t.scene, t.state) for t in group}
        assert len(chosen) == len(group) == 12
        assert not chosen & trained
    for number in range(3):
        held_out = split.evaluation_only(number)
        assert held_out == {t.state for t in (*split.new, *split.uniform) if t.scene == number}
        assert not held_out & {state for scene, state in trained if scene == number}


def test_targets_are_spread_over_the_scenes():
    split = draw_split(scenes(0, 3), (), SETTINGS, 0)
    assert sorted(np.bincount([t.scene for t in split.training])) == [2, 2, 3]
    assert [t.scene for t in split.training] == sorted(t.scene for t in split.training)


def test_new_targets_are_half_objects_and_half_near():
    training = scenes(0, 3)
    split = draw_split(training, (), SETTINGS, 3)
    for number, scene in enumerate(training):
        own = [t for t in split.new if t.scene == number]
        trained = [t for t in split.training if t.scene == number]
        objects = [t for t in own if t.category]
        assert len(objects) == 2
        for target in objects:
            assert target.state == best_views(scene)[target.category]
            assert target.category not in {t.category for t in trained}
        for target in own:
            if not target.category:
                nearest = scene.shortest_path_distance[target.state, [t.state for t in trained]].min()
                assert 1 <= nearest <= NEAR_DISTANCE


def test_similar_targets_are_of_trained_categories_in_unseen_scenes():
    training, unseen = scenes(0, 3), scenes(10, 2)
    split = draw_split(training, unseen, SETTINGS, 1)
    known = {t.category for t in split.training}
    assert {t.scene for t in split.similar} == {0, 1}
    for target in split.similar:
        assert target.category in known
        assert target.state == best_views(unseen[target.scene])[target.category]


def test_unseen_scenes_that_show_nothing_trained_get_no_target():
    training, (shown, other) = scenes(0, 3), scenes(10, 2)
    hidden = replace(other, categories=tuple(f"strange {name}" for name in other.categories))
    split = draw_split(training, [hidden, shown], SETTINGS, 1)
    assert {t.scene for t in split.similar} == {1}
    with pytest.raises(InputError, match="Task III: no unseen scene shows an object of a trained category"):
        draw_split(training, [hidden], SETTINGS, 1)


def test_unseen_scenes_do_not_change_the_other_targets():
    training = scenes(0, 3)
    with_unseen, without = draw_split(training, scenes(10, 2), SETTINGS, 5), draw_split(training, (), SETTINGS, 5)
    assert (with_unseen.training, with_unseen.new, with_unseen.uniform) == (
        without.training,
        without.new,
        without.uniform,
    )


def test_tasks_name_their_targets():
    split = draw_split(scenes(0, 3), scenes(10, 2), SETTINGS, 5)
    assert split.of_task("I", EvaluationSettings()) == split.training
    assert split.of_task("II", EvaluationSettings()) == split.new
    assert split.of_task("II", EvaluationSettings(new_targets="uniform")) == split.uniform
    assert split.of_task("III", EvaluationSettings()) == split.similar


def test_too_many_targets_are_refused():
    with pytest.raises(InputError, match=r"tasks\.training_targets: 99 is too large"):
        draw_split(scenes(0, 3), (), TaskSettings(training_targets=99), 0)


def test_scenes_without_labels_get_targets_that_can_be_reached():
    def dump(number):
        """A room of which the last place cannot be reached, as in the original dumps."""
        scene = grid_scene(4, 4, name=f"bathroom-{number}")
        distance = scene.shortest_path_distance.copy()
        distance[:, 60:] = distance[60:, :] = -1
        np.fill_diagonal(distance, 0)
        return replace(scene, shortest_path_distance=distance)

    split = draw_split([dump(0), dump(1)], [dump(2)], SETTINGS, 0)
    assert len(split.training) == SETTINGS.training_targets
    assert len(split.new) == len(split.uniform) == 2 * SETTINGS.new_targets_per_scene
    assert len(split.similar) == SETTINGS.new_targets_per_scene
    for target in (*split.training, *split.new, *split.uniform, *split.similar):
        assert target.state < 60
        assert target.category == ""
    for scene in range(2):
        assert not split.evaluation_only(scene) & {t.state for t in split.training if t.scene == scene}
