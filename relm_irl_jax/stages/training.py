"""Third stage: one agent is trained for each method and seed."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from relm_irl_jax.config import Config, Method
from relm_irl_jax.files import write_table
from relm_irl_jax.parameters import save_parameters
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.demonstrated import demonstrate_targets
from relm_irl_jax.rewards.functions import ManualReward, RewardFunction, manual_reward
from relm_irl_jax.rewards.goals import Goals, RewardAlone, demonstrated_goals, manual_goals, predicted_goals
from relm_irl_jax.rewards.imagined import ImaginedTargets, constant_rewards, imagined_states, predicted_rewards
from relm_irl_jax.rewards.learned import LearnedRewards, demonstrated_reward, predicted_reward
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.make_agent import make_agent, trains
from relm_irl_jax.stages.rewards import announce_recorded, make_predictor
from relm_irl_jax.stages.training_log import RunFolderLog
from relm_irl_jax.stages.worlds import standardised_world, with_predicted_reward
from relm_irl_jax.tasks import TaskSplit
from relm_irl_jax.types import Agent, Demonstrations, MultiSeedAgent, Parameters, TrainingProblem
from relm_irl_jax.world import build_targets, scene_offsets


@dataclass(frozen=True)
class SeedInputs:
    """Inputs that all trainings of one seed share.

    Attributes:
        seed: the seed.
        scenes: encoded training scenes.
        split: the targets of all tasks; training uses `split.training` only.
        learned: the learned rewards; None if no method needs them.
    """

    seed: int
    scenes: Sequence[Scene]
    split: TaskSplit
    learned: LearnedRewards | None

    def rewards(self) -> LearnedRewards:
        """The learned rewards, for methods that need them."""
        assert self.learned is not None
        return self.learned


def training_problem(config: Config, method: Method, inputs: SeedInputs, agent: Agent) -> TrainingProblem:
    """The learning problem of a method.

    Args:
        config: the configuration.
        method: the method.
        inputs: scenes, targets and rewards of the seed.
        agent: the agent, which declares what it requires.

    Returns:
        The problem.
    """
    scenes, split = inputs.scenes, inputs.split
    targets = build_targets(scenes, split.training)
    predictor = None if inputs.learned is None else make_predictor(inputs.learned, method, scenes)
    if config.siamese.observe_reward:
        targets = with_predicted_reward(targets, scenes, split.training, predictor)
    # The hand-made reward needs no scale: an additional step changes its return by about as much as a learned reward's
    # scaled return, so that the entropy bonus has a similar effect in both.
    learned_scale = config.irl.max_margin.r_max * config.irl.cost_horizon
    imagined = imagined_of(config, method, inputs, predictor) if "imagined" in agent.requires else None
    return TrainingProblem(
        world=standardised_world(scenes, scenes),
        targets=targets,
        # Imagined targets have their own rewards; predicting those of all pairs of given targets would be in vain.
        reward=reward_of(config, method, inputs, predictor) if imagined is None else manual_reward(config.manual),
        cap=config.tasks.cap,
        frames=config.training_frames,
        return_scale=1.0 if method in ("rl", "bc") else learned_scale,
        imagined=imagined,
        goals=goals_of(config, method, inputs, predictor) if "goals" in agent.requires else None,
        demonstrations=demonstrations_of(config, inputs) if "demonstrations" in agent.requires else None,
    )


def reward_of(config: Config, method: Method, inputs: SeedInputs, predictor: RewardPredictor | None) -> RewardFunction:
    """The reward function of a method.

    Args:
        config: the configuration.
        method: the method.
        inputs: scenes, targets and rewards of the seed.
        predictor: predicts the method's rewards, if it predicts any.

    Returns:
        The reward function; behaviour cloning does not use it.
    """
    if method in ("rl", "bc"):
        return manual_reward(config.manual)
    if method == "constant":
        cost = jnp.float32(-config.irl.max_margin.r_max)
        return ManualReward(target=jnp.float32(0.0), collision=cost, step=cost)
    if method == "irl":
        return demonstrated_reward(inputs.scenes, inputs.split.training, inputs.rewards())
    assert predictor is not None
    from_current = config.elm.predict_from == "current"
    return predicted_reward(inputs.scenes, inputs.split.training, predictor, from_current_view=from_current)


def goals_of(config: Config, method: Method, inputs: SeedInputs, predictor: RewardPredictor | None) -> Goals:
    """The goals of hindsight relabelling under a method's reward.

    Args:
        config: the configuration.
        method: the method.
        inputs: scenes, targets and rewards of the seed.
        predictor: predicts the method's rewards, if it predicts any.

    Returns:
        The goals.
    """
    scenes, split, hindsight = inputs.scenes, inputs.split, config.goals.hindsight
    if hindsight == "none" and config.goals.imagine and method not in ("rl", "irl"):
        hindsight = "strict"
    if method in ("rl", "constant"):
        return manual_goals(scenes, split, hindsight, config.manual)
    if method == "irl":
        return demonstrated_goals(scenes, split, hindsight, inputs.rewards())
    generator = np.random.default_rng([inputs.seed, 5])
    assert predictor is not None
    from_current = config.elm.predict_from == "current"
    told = config.goals.arrival == "told"
    alone = None if told else RewardAlone(config.goals.cost_limit, config.goals.discount)
    return predicted_goals(scenes, split, hindsight, predictor, generator, from_current_view=from_current, alone=alone)


def imagined_of(
    config: Config, method: Method, inputs: SeedInputs, predictor: RewardPredictor | None
) -> ImaginedTargets | None:
    """The imagined targets of a method.

    Args:
        config: the configuration, in which the siamese agent imagines targets.
        method: the method.
        inputs: scenes, targets and rewards of the seed.
        predictor: predicts the method's rewards, if it predicts any.

    Returns:
        The targets; None for methods that train on the given targets alone.
    """
    scenes, split, settings = inputs.scenes, inputs.split, config.siamese
    told, r_max = settings.imagine == "told", config.irl.max_margin.r_max
    generator = np.random.default_rng([inputs.seed, 6])
    states = imagined_states(scenes, split, settings.imagined_targets, generator)
    if predictor is not None:
        return predicted_rewards(split, states, predictor, generator, None if told else settings.cost_limit)
    constant = partial(constant_rewards, scenes, split, states, told=told)
    if method == "rl" and told:
        manual = config.manual
        return constant(step=manual.step, target=manual.target, collision=manual.collision)
    if method == "constant" and told:
        return constant(step=-r_max, target=0.0, collision=np.inf)
    if method == "constant":  # the view that equals the target's is paid, which takes no learning of rewards
        return constant(step=0.0, target=r_max, collision=0.0)
    return None


def demonstrations_of(config: Config, inputs: SeedInputs) -> Demonstrations:
    """The demonstrations of inverse reinforcement learning, as decisions to imitate.

    Args:
        config: the configuration.
        inputs: scenes and targets of the seed.

    Returns:
        The decisions of all demonstrations of the training targets.
    """
    if inputs.learned is None:  # otherwise said when the rewards were learned
        announce_recorded(config, inputs.scenes, inputs.split, inputs.seed)
    demonstrated = demonstrate_targets(inputs.scenes, inputs.split, config.irl, inputs.seed)
    offsets = scene_offsets(inputs.scenes)
    state, target, action, step = [], [], [], []
    for row, (training_target, trajectories) in enumerate(zip(inputs.split.training, demonstrated, strict=True)):
        for trajectory in trajectories:
            state.append(offsets[training_target.scene] + trajectory.states[:-1])
            action.append(trajectory.actions)
            target.append(np.full(len(trajectory.actions), row))
            step.append(np.arange(len(trajectory.actions)))
    columns = (jnp.asarray(np.concatenate(parts), jnp.int32) for parts in (state, target, action, step))
    return Demonstrations(*columns)


def train_method(config: Config, method: Method, inputs: SeedInputs, folder: RunFolder) -> None:
    """Train one method, and save its network and learning curve; an interrupted training continues.

    All methods of a seed start with the same parameters and random numbers, so that they differ in their rewards only.

    Args:
        config: the configuration.
        method: the method.
        inputs: scenes, targets and rewards of the seed.
        folder: the run folder.
    """
    agent = make_agent(config, method)
    problem = training_problem(config, method, inputs, agent)
    title = f"training {method}, seed {inputs.seed}" if trains(config) else None
    with (
        progress_bar(title, config.training_frames, "frames") as advance,
        RunFolderLog(folder, config, method, inputs.seed, advance) as log,
    ):
        parameters, curve = agent.train(jax.random.key(inputs.seed), problem, log)
        _save(folder, method, inputs.seed, parameters, curve)
        log.remove_checkpoints()


def trains_jointly(config: Config, method: Method) -> bool:
    """Whether the seeds of a method train in one program.

    Args:
        config: the configuration.
        method: the method.

    Returns:
        Whether the seeds train in one program.
    """
    agent = make_agent(config, method)
    return config.seeds > 1 and isinstance(agent, MultiSeedAgent) and agent.prefers_joint_training()


def train_jointly(config: Config, method: Method, inputs: Sequence[SeedInputs], folder: RunFolder) -> None:
    """Train one method with several seeds in one program; the results are those of `train_method`.

    Args:
        config: the configuration.
        method: the method.
        inputs: scenes, targets and rewards of each seed.
        folder: the run folder. The progress of all seeds is logged under the first seed.
    """
    agent = make_agent(config, method)
    assert isinstance(agent, MultiSeedAgent)
    seeds = [each.seed for each in inputs]
    problems = [training_problem(config, method, each, agent) for each in inputs]
    title = f"training {method}, seeds {', '.join(map(str, seeds))}"
    with (
        progress_bar(title, config.training_frames, "frames") as advance,
        RunFolderLog(folder, config, method, seeds[0], advance) as log,
    ):
        trained = agent.train_jointly([jax.random.key(seed) for seed in seeds], problems, log)
        for seed, (parameters, curve) in zip(seeds, trained, strict=True):
            _save(folder, method, seed, parameters, curve)
        log.remove_checkpoints()


def _save(folder: RunFolder, method: Method, seed: int, parameters: Parameters, curve: Any) -> None:
    """Save a learning curve, then a network: the existence of the network's file marks the training as finished."""
    columns = {field.name: getattr(curve, field.name) for field in dataclasses.fields(curve)}
    if len(columns["frames"]):  # given weights have no curve
        write_table(folder.curve(method, seed), columns)
    save_parameters(folder.agent(method, seed), parameters)
