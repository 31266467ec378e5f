"""Scenes and targets as device arrays, for training and evaluation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from relm_irl_jax.config import Config
from relm_irl_jax.rewards.learned import predicted_observations
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import EncodedScenes, encode_unseen
from relm_irl_jax.tasks import Target, draw_split
from relm_irl_jax.world import Targets, World, build_targets, build_world


def standardised_world(scenes: Sequence[Scene], training: Sequence[Scene]) -> World:
    """Build a world whose features are standardised by the training scenes' mean and standard deviation.

    Args:
        scenes: encoded scenes.
        training: encoded training scenes.

    Returns:
        The world.
    """
    views = np.concatenate([scene.encoded for scene in training])
    mean, deviation = views.mean(0), views.std(0)
    divisor = np.where(deviation > 1e-6 * deviation.max(initial=0.0), deviation, np.inf)
    standardised = [replace(scene, features=((scene.encoded - mean) / divisor).astype(np.float32)) for scene in scenes]
    return build_world(standardised, training)


def with_predicted_reward(
    targets: Targets, scenes: Sequence[Scene], chosen: Sequence[Target], predictor: RewardPredictor | None
) -> Targets:
    """Add the predicted reward of every state to targets, for agents that observe it.

    Args:
        targets: the targets.
        scenes: encoded scenes of the world.
        chosen: the same targets, as drawn.
        predictor: predicts the method's rewards in these scenes; None for methods without predictions, whose agents
            observe 0.

    Returns:
        The targets.
    """
    if predictor is None:
        observed = np.zeros((len(chosen), sum(scene.n_states for scene in scenes)), np.float32)
    else:
        observed = predicted_observations(scenes, chosen, predictor)
    return replace(targets, predicted_reward=jnp.asarray(observed))


@dataclass(frozen=True, eq=False)
class EvaluationTask:
    """Scenes and targets on which agents are evaluated.

    Attributes:
        name: `I`, `II` or `III`.
        seed: the seed that drew the targets.
        scenes: the scenes that have a target, without their views.
        world: the same scenes as arrays.
        targets: the targets.
        chosen: the same targets as drawn; `Target.scene` is an index into `scenes`.
    """

    name: str
    seed: int
    scenes: list[Scene]
    world: World
    targets: Targets
    chosen: list[Target]


def evaluation_task(config: Config, training: EncodedScenes, task: str, seed: int) -> EvaluationTask:
    """The scenes and targets of a task for one seed.

    Args:
        config: the configuration.
        training: the training scenes.
        task: `I`, `II` or `III`.
        seed: the run's seed.

    Returns:
        The scenes and targets. Unseen scenes that show no object of a trained category are left out.

    Raises:
        InputError: no unseen scene shows an object of a trained category.
    """
    unseen = encode_unseen(config, training) if task == "III" else []
    scenes = unseen if task == "III" else training.scenes
    drawn = draw_split(training.scenes, unseen, config.tasks, seed).of_task(task, config.evaluation)
    number = {old: new for new, old in enumerate(sorted({target.scene for target in drawn}))}
    scenes = [scenes[old] for old in number]
    chosen = [replace(target, scene=number[target.scene]) for target in drawn]
    return EvaluationTask(
        name=task,
        seed=seed,
        scenes=scenes,
        world=standardised_world(scenes, training.scenes),
        targets=build_targets(scenes, chosen),
        chosen=chosen,
    )
