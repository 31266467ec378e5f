"""Scenes and targets laid out for agents, in training and in evaluation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from relm_irl_jax.config import Config
from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.assemble import predicted_inputs
from relm_irl_jax.rewards.demonstrations import RewardBasis
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import EncodedScenes, encode_unseen
from relm_irl_jax.tasks import Target, draw_split
from relm_irl_jax.world import Targets, World, build_targets, build_world


def head_numbers(config: Config, scenes: Sequence[Scene], training: Sequence[Scene]) -> tuple[list[int], int]:
    """Number the heads of the network.

    Args:
        config: the configuration.
        scenes: scenes to number.
        training: training scenes, which or whose room types own the heads.

    Returns:
        The head of each scene, and the number of heads.

    Raises:
        InputError: a scene, or its room type, was never trained.
    """
    if config.siamese.heads == "shared" or config.agent == "metric":
        return [0] * len(scenes), 1
    owner = (lambda scene: scene.name) if config.siamese.heads == "scene" else (lambda scene: scene.room_type)
    owners = list(dict.fromkeys(map(owner, training)))
    for scene in scenes:
        if owner(scene) not in owners:
            raise InputError(
                f"{scene.name}: siamese.heads = {config.siamese.heads} gives {owner(scene)} no head, since it is not "
                "trained; use siamese.heads = shared."
            )
    return [owners.index(owner(scene)) for scene in scenes], len(owners)


def world_of(config: Config, scenes: Sequence[Scene], training: Sequence[Scene]) -> World:
    """Lay scenes end to end, their features standardised by the training scenes' mean and deviation.

    Args:
        config: the configuration.
        scenes: encoded scenes.
        training: encoded training scenes.

    Returns:
        The world.
    """
    views = np.concatenate([scene.encoded for scene in training])
    mean, deviation = views.mean(0), views.std(0)
    spread = np.where(deviation > 1e-6 * deviation.max(), deviation, np.inf)
    standardised = [replace(scene, features=((scene.encoded - mean) / spread).astype(np.float32)) for scene in scenes]
    return build_world(standardised, head_numbers(config, scenes, training)[0])


def sighted(
    config: Config,
    targets: Targets,
    scenes: Sequence[Scene],
    chosen: Sequence[Target],
    machine: ELMRegressor | None,
    basis: RewardBasis | None,
) -> Targets:
    """Targets with the predicted reward of every view on the way, where the agent sees it.

    Args:
        config: the configuration.
        targets: the targets.
        scenes: encoded scenes of the world.
        chosen: the same targets, as drawn.
        machine: the method's fitted machine; None for methods that predict no reward, whose agents see 0.
        basis: φ, where there is a machine.

    Returns:
        The targets.
    """
    if config.agent != "siamese" or not config.siamese.sees_reward:
        return targets
    if machine is None or basis is None:
        seen = np.zeros((len(chosen), sum(scene.n_states for scene in scenes)), np.float32)
    else:
        seen = predicted_inputs(scenes, chosen, machine, basis, config.irl)
    return replace(targets, predicted=jnp.asarray(seen))


@dataclass(frozen=True, eq=False)
class Ground:
    """Scenes and targets on which a task is evaluated.

    Attributes:
        scenes: the scenes that have a target, without their views.
        world: the same, laid end to end.
        targets: the targets.
        chosen: the same targets as drawn; `Target.scene` numbers `scenes`.
        n_heads: number of the network's heads.
    """

    scenes: list[Scene]
    world: World
    targets: Targets
    chosen: list[Target]
    n_heads: int


def ground_of(config: Config, training: EncodedScenes, task: str, seed: int) -> Ground:
    """Lay out a task as one seed drew it.

    Args:
        config: the configuration.
        training: the training scenes.
        task: `I`, `II` or `III`.
        seed: the run's seed.

    Returns:
        Scenes and targets. Unseen scenes that show nothing of what this seed trained are left out.

    Raises:
        InputError: no unseen scene shows anything of it.
    """
    unseen = encode_unseen(config, training) if task == "III" else []
    scenes = unseen if task == "III" else training.scenes
    drawn = draw_split(training.scenes, unseen, config.tasks, seed).of_task(task, config.evaluation)
    numbers = {number: place for place, number in enumerate(sorted({target.scene for target in drawn}))}
    scenes = [scenes[number] for number in numbers]
    chosen = [replace(target, scene=numbers[target.scene]) for target in drawn]
    return Ground(
        scenes=scenes,
        world=world_of(config, scenes, training.scenes),
        targets=build_targets(scenes, chosen),
        chosen=chosen,
        n_heads=head_numbers(config, scenes, training.scenes)[1],
    )
