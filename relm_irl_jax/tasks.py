"""Targets of the three tasks and the wall between training and evaluation (paper, section 5.2).

- Task I: the training targets themselves.
- Task II: new targets in the training scenes, half of them near a trained target, half the best view of an object
  that was not a target; a harder preset draws them uniformly from all untrained states.
- Task III: in unseen scenes, the best view of an object whose category was a training target's.

Scenes without object labels, such as the original dumps, have no best views: targets are then states drawn uniformly,
and Task II's new ones are all near a trained target.

A `TaskSplit` is drawn once for a seed, before any training, and holds the targets of all tasks, so that training can
be kept away from every one of them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveInt
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.scene import Scene

NEAR_DISTANCE = 4
"""Greatest distance in actions of a `near` target from a trained one."""


@settings_dataclass(frozen=True)
class TaskSettings:
    """Which targets are trained and which are kept for evaluation."""

    training_targets: PositiveInt = 20
    """Training targets, spread over the training scenes (the paper's 20)."""
    new_targets_per_scene: Annotated[int, Field(ge=2)] = 8
    """Task II targets in each training scene; half near a trained target, half best views of other objects."""
    cap: PositiveInt = 100
    """Steps after which an episode is cut. The paper's text says 5000, its tables fit 100."""


@settings_dataclass(frozen=True)
class EvaluationSettings:
    """How trained agents are judged."""

    episodes: PositiveInt = 1000
    """Episodes in each scene."""
    new_targets: Literal["paper", "uniform"] = "paper"
    """Task II targets: near a trained target or an object's best view (`paper`), or `uniform` over untrained states."""
    policy: Literal["sample", "greedy"] = "sample"
    """Draw actions from the policy, or take the most probable one."""


@dataclass(frozen=True)
class Target:
    """One place to find.

    Attributes:
        scene: number of the scene within its own group (training or unseen scenes).
        state: state of that scene whose view is the target image.
        category: category of the object that it shows best; empty for targets chosen by place.
    """

    scene: int
    state: int
    category: str = ""


@dataclass(frozen=True)
class TaskSplit:
    """The targets of all tasks for one seed, each group in the order of its scenes.

    Attributes:
        training: targets of Task I, the only ones that training may be sent to.
        new: targets of Task II, the paper's kind; in training scenes.
        uniform: targets of Task II, the uniform kind; in training scenes.
        similar: targets of Task III; in unseen scenes.
    """

    training: tuple[Target, ...]
    new: tuple[Target, ...]
    uniform: tuple[Target, ...]
    similar: tuple[Target, ...]

    def of_task(self, task: str, settings: EvaluationSettings) -> tuple[Target, ...]:
        """Targets on which a task is evaluated.

        Args:
            task: `I`, `II` or `III`.
            settings: tells which kind of new targets Task II means.

        Returns:
            The targets.
        """
        new = self.new if settings.new_targets == "paper" else self.uniform
        return {"I": self.training, "II": new, "III": self.similar}[task]

    def evaluation_only(self, scene: int) -> frozenset[int]:
        """States of a training scene that training must never use as targets.

        Args:
            scene: number of the training scene.

        Returns:
            The states of all Task II targets of both kinds.
        """
        return frozenset(target.state for target in (*self.new, *self.uniform) if target.scene == scene)


def draw_split(training: Sequence[Scene], unseen: Sequence[Scene], settings: TaskSettings, seed: int) -> TaskSplit:
    """Draw the targets of all tasks.

    Args:
        training: scenes that training sees.
        unseen: scenes kept for Task III; may be empty where Task III is not asked for.
        settings: how many targets of which kind.
        seed: the run's seed.

    Returns:
        The split; the targets of Tasks I and II do not depend on the unseen scenes.

    Raises:
        InputError: too few objects or states for the targets asked for.
    """
    generator = np.random.default_rng([seed, 0])
    dealt = _training_targets(training, settings.training_targets, generator)
    trained = tuple(sorted(dealt, key=lambda target: target.scene))
    new, uniform = [], []
    for number, scene in enumerate(training):
        own = [target for target in trained if target.scene == number]
        new += _new_targets(scene, number, own, settings.new_targets_per_scene, generator)
        taken = {target.state for target in own}
        free = np.setdiff1d(scene.reachable, list(taken))
        chosen = generator.choice(free, settings.new_targets_per_scene, replace=False)
        uniform += [Target(number, int(state)) for state in sorted(chosen)]
    similar = _similar_targets(training, unseen, trained, settings.new_targets_per_scene, generator)
    return TaskSplit(trained, tuple(new), tuple(uniform), tuple(similar))


def _training_targets(scenes: Sequence[Scene], count: int, generator: np.random.Generator) -> Iterator[Target]:
    """Best views of objects, or states where there are no labels, dealt to the scenes in turn."""
    piles = []
    for number, scene in enumerate(scenes):
        if scene.visible_object is None:
            piles.append([Target(number, int(state)) for state in generator.permutation(scene.reachable)])
            continue
        views = _distinct(best_views(scene))
        categories = generator.permutation(sorted(views))
        piles.append([Target(number, views[category], str(category)) for category in categories])
    if count > sum(map(len, piles)):
        raise InputError(
            f"tasks.training_targets: {count} asked for, but the training scenes show only "
            f"{sum(map(len, piles))} objects; ask for fewer or add scenes."
        )
    round_number = 0
    while count > 0:
        for pile in piles:
            if round_number < len(pile) and count > 0:
                yield pile[round_number]
                count -= 1
        round_number += 1


def _new_targets(
    scene: Scene, number: int, trained: Sequence[Target], count: int, generator: np.random.Generator
) -> Iterator[Target]:
    """Half best views of untrained objects (as far as there are any), the rest near a trained target."""
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
            f"{scene.name}: {missing} Task II targets near trained ones asked for, {len(near)} states are; "
            "lower tasks.new_targets_per_scene."
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

    Without labels, `count` states a scene. A scene that shows no such category gets no target.

    Raises:
        InputError: no scene shows one.
    """
    missed = 0
    for number, scene in enumerate(unseen):
        if scene.visible_object is None:
            drawn = min(count, len(scene.reachable))
            for state in sorted(generator.choice(scene.reachable, drawn, replace=False)):
                yield Target(number, int(state))
            continue
        known = {t.category for t in trained if training[t.scene].room_type == scene.room_type}
        views = {category: state for category, state in best_views(scene).items() if category in known}
        missed += not views
        for category, state in sorted(_distinct(views).items()):
            yield Target(number, state, category)
    if missed and missed == len(unseen):
        raise InputError(
            "Task III: no unseen scene shows an object of a trained category; raise tasks.training_targets or "
            "add scenes."
        )


def _distinct(views: dict[str, int]) -> dict[str, int]:
    """Keep the first category, in order of name, where two have the same best view."""
    by_state: dict[int, str] = {}
    for category in sorted(views):
        by_state.setdefault(views[category], category)
    return {category: state for state, category in by_state.items()}
