"""Third stage: one agent a method and seed."""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np

from relm_irl_jax.agent.learning import LearningCurve, Parameters
from relm_irl_jax.agent.metric.costs import Goals
from relm_irl_jax.agent.metric.train import train_metric
from relm_irl_jax.agent.siamese.cloning import CloningCurve, Decisions, clone, decisions_of, views_along
from relm_irl_jax.agent.siamese.seeds import train_seeds
from relm_irl_jax.agent.siamese.train import train
from relm_irl_jax.config import Config, Method
from relm_irl_jax.files import write_table
from relm_irl_jax.parameters import save_parameters
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.assemble import demonstrated_reward, manual_reward, predicted_reward
from relm_irl_jax.rewards.demonstrations import demonstrations_of
from relm_irl_jax.rewards.goals import demonstrated_goals, manual_goals, predicted_goals
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.ground import head_numbers, sighted, world_of
from relm_irl_jax.stages.learning import LearnedRewards
from relm_irl_jax.stages.recording import FolderRecord
from relm_irl_jax.tasks import TaskSplit
from relm_irl_jax.world import Targets, World, build_targets, scene_offsets


def reward_of(
    config: Config, method: Method, scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards | None
) -> tuple[RewardModel, float]:
    """The reward that a method trains on, and the size of a typical return.

    Args:
        config: the configuration.
        method: the method.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        learned: the learned rewards; not needed by RL.

    Returns:
        The reward model, and the divisor of its returns.
    """
    if method == "rl":
        # Unscaled, one step more or less changes its return about as much as it does a learned reward's scaled return,
        # so that the entropy weighs alike in both.
        return manual_reward(config.manual), 1.0
    assert learned is not None
    scale = config.irl.program.r_max * config.siamese.cost_horizon
    if method == "irl":
        model = demonstrated_reward(scenes, split.training, learned.records, learned.basis, config.irl)
    else:
        machine_ = learned.machines[method]
        model = predicted_reward(scenes, split.training, machine_, learned.basis, config.irl, config.elm)
    return model, scale


def training_targets(
    config: Config, method: Method, scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards | None
) -> Targets:
    """The targets that a method trains on.

    Args:
        config: the configuration.
        method: the method.
        scenes: encoded training scenes.
        split: the targets of all tasks; training sees no others than `split.training`.
        learned: the learned rewards; not needed by RL and behaviour cloning.

    Returns:
        The targets.
    """
    machine_ = None if learned is None else learned.machines.get(method)
    basis = None if learned is None else learned.basis
    return sighted(config, build_targets(scenes, split.training), scenes, split.training, machine_, basis)


def train_method(
    config: Config,
    method: Method,
    seed: int,
    scenes: Sequence[Scene],
    split: TaskSplit,
    learned: LearnedRewards | None,
    folder: RunFolder,
) -> None:
    """Train one method and keep its network and the course of its training.

    A training that was cut off goes on from its last checkpoint.

    All methods of a seed begin with the same parameters and random numbers, so that they differ by reward alone.

    Args:
        config: the configuration.
        method: the method.
        seed: the run's seed.
        scenes: encoded training scenes.
        split: the targets; training sees no others than `split.training`.
        learned: the learned rewards; not needed by RL and behaviour cloning.
        folder: the run folder.
    """
    key = jax.random.key(seed)
    world = world_of(config, scenes, scenes)
    targets = training_targets(config, method, scenes, split, learned)
    n_heads = head_numbers(config, scenes, scenes)[1]
    with (
        progress_bar(f"training {method}, seed {seed}", config.frames, "frames") as advance,
        FolderRecord(folder, config, method, seed, advance) as record,
    ):
        if method == "bc":
            decisions = cloned_decisions(config, scenes, split, seed, world, n_heads)
            parameters, curve = clone(key, world, targets, decisions, n_heads, config.siamese, config.frames, record)
        else:
            reward_model, scale = reward_of(config, method, scenes, split, learned)
            if config.agent == "metric":
                goals = goals_of(config, method, scenes, split, learned, seed)
                parameters, curve = train_metric(
                    key,
                    world,
                    targets,
                    reward_model,
                    goals,
                    config.metric,
                    config.tasks.cap,
                    config.frames,
                    record,
                )
            else:
                parameters, curve = train(
                    key,
                    world,
                    targets,
                    reward_model,
                    scale,
                    n_heads,
                    config.siamese,
                    config.tasks.cap,
                    config.frames,
                    record,
                )
        _keep(folder, method, seed, parameters, curve)
        record.forget()


def trains_together(config: Config, method: Method) -> bool:
    """Whether the seeds of a method train in one program.

    Args:
        config: the configuration.
        method: the method.

    Returns:
        Whether they do; see `SiameseSettings.seeds_at_once`.
    """
    choice = config.siamese.seeds_at_once
    possible = config.agent == "siamese" and method != "bc" and jax.device_count() == 1
    return possible and (choice == "always" or (choice == "auto" and jax.default_backend() != "cpu"))


def train_together(
    config: Config,
    method: Method,
    prepared: Sequence[tuple[int, TaskSplit, LearnedRewards | None]],
    scenes: Sequence[Scene],
    folder: RunFolder,
) -> None:
    """Train one method with several seeds at once, as `train_method` does one by one.

    Args:
        config: the configuration; the agent is `siamese`.
        method: the method, none but those of a reward.
        prepared: seeds, their targets and, but for RL, their learned rewards.
        scenes: encoded training scenes.
        folder: the run folder. The course of all is recorded under the first seed until they are done.
    """
    seeds = [seed for seed, _, _ in prepared]
    rewards = [reward_of(config, method, scenes, split, learned) for _, split, learned in prepared]
    title = f"training {method}, seeds {', '.join(map(str, seeds))}"
    with (
        progress_bar(title, config.frames, "frames") as advance,
        FolderRecord(folder, config, method, seeds[0], advance) as record,
    ):
        trained = train_seeds(
            [jax.random.key(seed) for seed in seeds],
            world_of(config, scenes, scenes),
            [training_targets(config, method, scenes, split, learned) for _, split, learned in prepared],
            [model for model, _ in rewards],
            rewards[0][1],
            head_numbers(config, scenes, scenes)[1],
            config.siamese,
            config.tasks.cap,
            config.frames,
            record,
        )
        for seed, (parameters, curve) in zip(seeds, trained, strict=True):
            _keep(folder, method, seed, parameters, curve)
        record.forget()


def _keep(
    folder: RunFolder, method: Method, seed: int, parameters: Parameters, curve: LearningCurve | CloningCurve
) -> None:
    """Keep the course of a training and its network, in this order: a network says that the training is done."""
    write_table(folder.curve(method, seed), {f.name: getattr(curve, f.name) for f in dataclasses.fields(curve)})
    save_parameters(folder.agent(method, seed), parameters)


def goals_of(
    config: Config,
    method: Method,
    scenes: Sequence[Scene],
    split: TaskSplit,
    learned: LearnedRewards | None,
    seed: int,
) -> Goals:
    """Views that the metric agent sets itself as targets under a method's reward.

    Args:
        config: the configuration.
        method: the method.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        learned: the learned rewards; not needed by RL.
        seed: the run's seed.

    Returns:
        The goals.
    """
    hindsight = config.metric.hindsight
    if method == "rl":
        return manual_goals(scenes, split, hindsight, config.manual)
    assert learned is not None
    if method == "irl":
        return demonstrated_goals(scenes, split, hindsight, learned.records, learned.basis, config.irl)
    if hindsight == "none" and config.metric.imagine:
        hindsight = "strict"
    generator = np.random.default_rng([seed, 5])
    machine = learned.machines[method]
    return predicted_goals(
        scenes, split, hindsight, machine, learned.basis, config.irl, generator, follow=config.elm.follow
    )


def cloned_decisions(
    config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int, world: World, n_heads: int
) -> Decisions:
    """The demonstrations that inverse reinforcement learning gets, as decisions to clone.

    Args:
        config: the configuration.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        seed: the run's seed.
        world: the training scenes.
        n_heads: number of heads.

    Returns:
        The decisions along all demonstrations of the training targets.
    """
    walks = demonstrations_of(scenes, split, config.irl, seed)
    offsets = scene_offsets(scenes)
    views = [
        offsets[t.scene] + views_along(walk.states[:-1], config.siamese.history)
        for t, own in zip(split.training, walks, strict=True)
        for walk in own
    ]
    action = [walk.actions for own in walks for walk in own]
    target = [np.full(len(walk.actions), row) for row, own in enumerate(walks) for walk in own]
    return decisions_of(np.concatenate(views), np.concatenate(target), np.concatenate(action), world, n_heads)
