"""Targets of the three tasks, and their separation into training and evaluation targets (paper, section 5.2).

- Task I: the training targets themselves.
- Task II: new targets in the training scenes. Half of them are near a training target, half are the best view of an
  object that is not a training target. A harder preset draws them uniformly from all other states.
- Task III: in unseen scenes, the best view of an object of a category that a training target has.

Scenes without object labels, such as the original dumps, have no best views. Their targets are drawn uniformly from all
states, and all their Task II targets are near a training target.

A `TaskSplit` is drawn once for each seed, before any training, and contains the targets of all tasks. Training uses it
to leave out the evaluation targets.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.task_settings import EvaluationSettings, TaskSettings

NEAR_DISTANCE = 4
"""Largest distance, in actions, of a near target from a training target."""


@dataclass(frozen=True)
class Target:
    """A navigation target.

    Attributes:
        scene: index of the scene among the training scenes, or among the unseen ones.
        state: state of that scene whose view is the target image.
        category: category of the object of which it is the best view; empty for targets chosen by position.
    """

    scene: int
    state: int
    category: str = ""


@dataclass(frozen=True)
class TaskSplit:
    """The targets of all tasks for one seed, each group in the order of its scenes.

    Attributes:
        training: targets of Task I, the only targets of training episodes.
        new: targets of Task II as in the paper, in training scenes.
        uniform: targets of Task II drawn uniformly, in training scenes.
        similar: targets of Task III, in unseen scenes.
    """

    training: tuple[Target, ...]
    new: tuple[Target, ...]
    uniform: tuple[Target, ...]
    similar: tuple[Target, ...]

    def of_task(self, task: str, settings: EvaluationSettings) -> tuple[Target, ...]:
        """Targets on which a task is evaluated.

        Args:
            task: `I`, `II` or `III`.
            settings: says which kind of new targets Task II uses.

        Returns:
            The targets.
        """
        new = self.new if settings.new_targets == "paper" else self.uniform
        return {"I": self.training, "II": new, "III": self.similar}[task]

    def evaluation_only(self, scene: int) -> frozenset[int]:
        """States of a training scene that training must not use as targets.

        Args:
            scene: number of the training scene.

        Returns:
            The states of all Task II targets of both kinds.
        """
        return frozenset(target.state for target in (*self.new, *self.uniform) if target.scene == scene)


def draw_split(training: Sequence[Scene], unseen: Sequence[Scene], settings: TaskSettings, seed: int) -> TaskSplit:
    """Draw the targets of all tasks.

    Args:
        training: the training scenes.
        unseen: the scenes of Task III; may be empty if Task III is not evaluated.
        settings: numbers of targets.
        seed: the run's seed.

    Returns:
        The split; the targets of Tasks I and II do not depend on the unseen scenes.

    Raises:
        InputError: there are too few objects or states for the numbers of targets.
    """
    generator = np.random.default_rng([seed, 0])
    drawn = _training_targets(training, settings.training_targets, generator)
    trained = tuple(sorted(drawn, key=lambda target: target.scene))
    new, uniform = [], []
    for number, scene in enumerate(training):
        in_scene = [target for target in trained if target.scene == number]
        new += _new_targets(scene, number, in_scene, settings.new_targets_per_scene, generator)
        untrained = np.setdiff1d(scene.reachable, [target.state for target in in_scene])
        chosen = generator.choice(untrained, settings.new_targets_per_scene, replace=False)
        uniform += [Target(number, int(state)) for state in sorted(chosen)]
    similar = _similar_targets(training, unseen, trained, settings.new_targets_per_scene, generator)
    return TaskSplit(trained, tuple(new), tuple(uniform), tuple(similar))


def _training_targets(scenes: Sequence[Scene], count: int, generator: np.random.Generator) -> Iterator[Target]:
    """Best views of objects, or random states without labels; taken from the scenes in turn."""
    candidates = []
    for number, scene in enumerate(scenes):
        if scene.visible_object is None:
            candidates.append([Target(number, int(state)) for state in generator.permutation(scene.reachable)])
            continue
        views = _distinct(best_views(scene))
        categories = generator.permutation(sorted(views))
        candidates.append([Target(number, views[category], str(category)) for category in categories])
    if count > sum(map(len, candidates)):
        raise InputError(
            f"tasks.training_targets: {count} is too large, since the training scenes show only "
            f"{sum(map(len, candidates))} objects; give a smaller number or add scenes."
        )
    round_number = 0
    while count > 0:
        for of_scene in candidates:
            if round_number < len(of_scene) and count > 0:
                yield of_scene[round_number]
                count -= 1
        round_number += 1


def _new_targets(
    scene: Scene, number: int, trained: Sequence[Target], count: int, generator: np.random.Generator
) -> Iterator[Target]:
    """Best views of untrained objects for up to half of the targets; the rest are near a training target."""
    taken = {target.state for target in trained}
    untrained = {
        category: state
        for category, state in _distinct(best_views(scene)).items()
        if category not in {target.category for target in trained} and state not in taken
    }
    categories = generator.permutation(sorted(untrained))[: count // 2]
    for category in categories:
        taken.add(untrained[category])
        yield Target(number, untrained[category], str(category))
    to_trained = scene.shortest_path_distance[:, [target.state for target in trained]]
    is_near = ((to_trained >= 1) & (to_trained <= NEAR_DISTANCE)).any(1)
    near = np.setdiff1d(np.flatnonzero(is_near), list(taken))
    missing = count - len(categories)
    if len(near) < missing:
        raise InputError(
            f"{scene.name}: {missing} Task II targets near training targets are needed, but only {len(near)} states "
            "are near one; lower tasks.new_targets_per_scene."
        )
    for state in sorted(generator.choice(near, missing, replace=False)):
        yield Target(number, int(state))


def _similar_targets(
    training: Sequence[Scene],
    unseen: Sequence[Scene],
    trained: Sequence[Target],
    count: int,
    generator: np.random.Generator,
) -> Iterator[Target]:
    """Best views, in unseen scenes, of categories that were trained in scenes of the same room type.

    Scenes without labels get `count` random states. A scene that shows no such category gets no target.

    Raises:
        InputError: no scene shows such a category.
    """
    without_target = 0
    for number, scene in enumerate(unseen):
        if scene.visible_object is None:
            drawn = min(count, len(scene.reachable))
            for state in sorted(generator.choice(scene.reachable, drawn, replace=False)):
                yield Target(number, int(state))
            continue
        known = {t.category for t in trained if training[t.scene].room_type == scene.room_type}
        views = {category: state for category, state in best_views(scene).items() if category in known}
        without_target += not views
        for category, state in sorted(_distinct(views).items()):
            yield Target(number, state, category)
    if without_target and without_target == len(unseen):
        raise InputError(
            "Task III: no unseen scene shows an object of a trained category; raise tasks.training_targets or "
            "add scenes."
        )


def _distinct(views: dict[str, int]) -> dict[str, int]:
    """Keep the alphabetically first category if several have the same best view."""
    by_state: dict[int, str] = {}
    for category in sorted(views):
        by_state.setdefault(views[category], category)
    return {category: state for state, category in by_state.items()}
