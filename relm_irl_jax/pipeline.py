"""The chain from scenes to the table: scenes → features → targets → demonstrations → rewards → agents → evaluation.

Each stage is a function of the stages before it. A stage whose result lies in the run folder is not run again.
"""

import dataclasses
import time
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import jax
import numpy as np

from relm_irl_jax.agent.train import LearningCurve, network_of, train
from relm_irl_jax.config import METHODS, Config, Method
from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import RandomPolicy, evaluate, metrics, network_policy
from relm_irl_jax.features.cache import encode_cached
from relm_irl_jax.features.encoder import Encoder, make_encoder
from relm_irl_jax.irl import reward
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.report.figures import reward_maps, save_figure
from relm_irl_jax.report.page import machine, write_report
from relm_irl_jax.report.tables import METHOD_NAMES
from relm_irl_jax.rewards.assemble import demonstrated_reward, manual_reward, predicted_reward
from relm_irl_jax.rewards.demonstrations import DemonstratedReward, RewardBasis, fit_basis, learn_rewards
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.rewards.prediction import fit_machine, pair_data, pair_inputs
from relm_irl_jax.rewards.quality import judge, judge_predictions
from relm_irl_jax.runs import (
    RunFolder,
    load_parameters,
    open_run,
    save_arrays,
    save_parameters,
    write_json,
    write_table,
)
from relm_irl_jax.scenes.catalog import ROOMS, cache_folder, check_source, training_scenes, unseen_scenes, without_views
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import TaskSplit, draw_split
from relm_irl_jax.world import World, build_targets, build_world

LEARNED: tuple[Method, ...] = ("irl", "elm-irl", "relm-irl")
"""Methods whose reward is learned from demonstrations."""


@dataclass(frozen=True)
class EncodedScenes:
    """Scenes with features, and what encoded them.

    Attributes:
        scenes: the scenes, without their views.
        encoder: the encoder; None where the scene files bring their own features.
        encoder_name: what results call it.
    """

    scenes: list[Scene]
    encoder: Encoder | None
    encoder_name: str


@dataclass(frozen=True)
class LearnedRewards:
    """What the demonstrations of one seed taught.

    Attributes:
        basis: φ.
        records: demonstrated rewards.
        machines: the fitted machine of each method that predicts rewards.
    """

    basis: RewardBasis
    records: list[DemonstratedReward]
    machines: dict[Method, ELMRegressor]


@dataclass
class Stopwatch:
    """Seconds that each stage took."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str):
        """Time a block under the name of a stage."""
        begun = time.perf_counter()
        yield
        self.seconds[stage] = round(self.seconds.get(stage, 0.0) + time.perf_counter() - begun, 2)


def run(config: Config) -> dict:
    """Train what is not yet trained, evaluate the configuration's task and write the report.

    Args:
        config: the configuration.

    Returns:
        The contents of `results.json`.

    Raises:
        InputError: the configuration, the scenes or the run folder cannot be used.
    """
    check_source(config.scenes)
    folder = open_run(config)
    stopwatch = Stopwatch()
    with stopwatch("scenes and features"):
        encoded = encode_training(config)
    for seed in range(config.seeds):
        split = draw_split(encoded.scenes, (), config.tasks, seed)
        missing = [m for m in config.chosen_methods() if m != "random" and not folder.agent(m, seed).exists()]
        learned = None
        if set(missing) & set(LEARNED):
            with stopwatch("inverse reinforcement learning and ELM"):
                learned = learn(config, encoded.scenes, split, seed, folder)
        for method in missing:
            with stopwatch(f"training {method}"):
                train_method(config, method, seed, encoded.scenes, split, learned, folder)
    with stopwatch("evaluation"):
        results = evaluate_task(config, folder, encoded, config.task)
    write_json(folder.file("machine.json"), machine() | {"seconds": stopwatch.seconds})
    write_report(folder, config, results)
    return results


def evaluate_run(config: Config, folder: RunFolder, task: str) -> dict:
    """Evaluate the agents of a run folder on a task and write the report.

    Args:
        config: the configuration as run.
        folder: the run folder.
        task: `I`, `II` or `III`.

    Returns:
        The contents of `results.json`.
    """
    results = evaluate_task(config, folder, encode_training(config), task)
    write_report(folder, config, results)
    return results


def encode_training(config: Config) -> EncodedScenes:
    """Prepare the training scenes.

    Args:
        config: the configuration.

    Returns:
        The training scenes with features.
    """
    scenes = training_scenes(config.scenes, config.scene)
    if config.scenes != ROOMS and all(scene.features is not None for scene in scenes):
        return EncodedScenes([without_views(scene) for scene in scenes], None, scenes[0].encoder)
    # Random weights take their statistics from training views only, so that unseen scenes stay unseen.
    share = -(-config.encoder.calibration_views // len(scenes))
    views = [scene.views[:: max(1, scene.n_states // share)][:share] for scene in scenes]
    encoder = make_encoder(config.encoder, np.concatenate(views))
    return EncodedScenes([_encoded(scene, encoder) for scene in scenes], encoder, encoder.name)


def encode_unseen(config: Config, training: EncodedScenes) -> list[Scene]:
    """Prepare the scenes of Task III with the encoder of the training scenes.

    Args:
        config: the configuration.
        training: the training scenes.

    Returns:
        The unseen scenes with features.
    """
    scenes = unseen_scenes(config.scenes, config.scene)
    if training.encoder is None:
        return [without_views(scene) for scene in scenes]
    return [_encoded(scene, training.encoder) for scene in scenes]


def _encoded(scene: Scene, encoder: Encoder) -> Scene:
    features = encode_cached(scene.views, encoder, cache_folder() / "features", f"encoding {scene.name}")
    return dataclasses.replace(without_views(scene), features=features, encoder=encoder.name)


def learn(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int, folder: RunFolder) -> LearnedRewards:
    """Learn rewards from demonstrations and fit the machines that predict them; keep both in the run folder.

    Args:
        config: the configuration.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        seed: the run's seed.
        folder: the run folder.

    Returns:
        The learned rewards.
    """
    basis = fit_basis(scenes, config.irl.dimension)
    records = learn_rewards(scenes, split, basis, config.irl, seed)
    data = pair_data(scenes, records, config.elm.pairs, np.random.default_rng([seed, 2]))
    machines: dict[Method, ELMRegressor] = {
        "elm-irl": fit_machine(data, config.elm, seed, regularised=False),
        "relm-irl": fit_machine(data, config.elm, seed, regularised=True),
    }
    learned = LearnedRewards(basis, records, machines)
    save_arrays(
        folder.rewards(seed, "demonstrated.safetensors"),
        {
            "mean": basis.mean,
            "components": basis.components,
            "weights": np.stack([record.solution.w for record in records]),
            "scene": np.asarray([record.target.scene for record in records]),
            "target": np.asarray([record.target.state for record in records]),
            "trained": np.asarray([record.trained for record in records]),
        },
    )
    regularised = machines["relm-irl"]
    if regularised.press_curve_ is not None:
        neurons = np.arange(1, len(regularised.press_curve_) + 1)
        curve = {"neurons": neurons, "mean_squared_error": regularised.press_curve_}
        write_table(folder.rewards(seed, "press.csv"), curve)
    _judge_rewards(scenes, split, learned, seed, folder)
    _map_rewards(scenes, split, learned, seed, folder)
    return learned


def _map_rewards(
    scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, seed: int, folder: RunFolder
) -> None:
    """Map r(s) of every learned reward over one room of each type, for a trained and for a new target."""
    demonstrated = {record.target: record.solution.w for record in learned.records if record.trained}
    first_scene = {scene.room_type: number for number, scene in reversed(list(enumerate(scenes)))}
    for room_type, number in first_scene.items():
        scene = scenes[number]
        for name, targets in (("trained", split.training), ("new", split.new)):
            target = next(target for target in targets if target.scene == number)
            start = int(scene.shortest_path_distance[:, target.state].argmax())
            pair = pair_inputs(scene.encoded[[start]], scene.encoded[[target.state]])
            weights = {"IRL": demonstrated[target]} if target in demonstrated else {}
            weights |= {METHOD_NAMES[m]: machine_.predict(pair)[0] for m, machine_ in learned.machines.items()}
            phi = learned.basis(scene.encoded)
            values = {title: reward(phi, target.state, w) for title, w in weights.items()}
            table = {"x": scene.location[:, 0], "z": scene.location[:, 1], "rotation": scene.rotation, **values}
            write_table(folder.rewards(seed, f"map-{name}-{room_type}.csv"), table)
            if seed == 0:
                figure = reward_maps(scene, target.state, start, values)
                save_figure(figure, folder.file("figures", f"reward-{name}-{room_type}.png"))


def _judge_rewards(
    scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, seed: int, folder: RunFolder
) -> None:
    """Write rank and order of every method's reward, on trained and on new targets."""
    judged = {
        ("irl", "trained"): [
            judge(scenes[record.target.scene], record.target.state, learned.basis, record.solution.w)
            for record in learned.records
            if record.trained
        ]
    }
    groups = {"trained": split.training, "new": split.new, "uniform": split.uniform}
    for method, machine_ in learned.machines.items():
        for name, targets in groups.items():
            generator = np.random.default_rng([seed, 3])
            predict = lambda first, wanted, m=machine_: m.predict(pair_inputs(first, wanted))  # noqa: E731
            judged[method, name] = judge_predictions(scenes, targets, learned.basis, predict, generator)
    table = {"method": [], "targets": [], "median_rank": [], "median_rank_share": [], "mean_order": []}
    for (method, name), judgements in judged.items():
        table["method"].append(method)
        table["targets"].append(name)
        table["median_rank"].append(np.median([j.rank for j in judgements]))
        table["median_rank_share"].append(round(np.median([j.rank / j.states for j in judgements]), 4))
        table["mean_order"].append(round(float(np.nanmean([j.order for j in judgements])), 4))
    write_table(folder.rewards(seed, "quality.csv"), table)


def head_numbers(config: Config, scenes: Sequence[Scene], training: Sequence[Scene]) -> tuple[list[int], int]:
    """Number the heads of the network.

    Args:
        config: the configuration.
        scenes: scenes to number.
        training: training scenes, whose room types own the heads.

    Returns:
        The head of each scene, and the number of heads.

    Raises:
        InputError: a scene's room type was never trained.
    """
    if config.agent.heads == "shared":
        return [0] * len(scenes), 1
    room_types = list(dict.fromkeys(scene.room_type for scene in training))
    for scene in scenes:
        if scene.room_type not in room_types:
            raise InputError(f"{scene.name}: no scene of type {scene.room_type} is trained; use agent.heads = shared.")
    return [room_types.index(scene.room_type) for scene in scenes], len(room_types)


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
    standardised = [
        dataclasses.replace(scene, features=((scene.encoded - mean) / spread).astype(np.float32)) for scene in scenes
    ]
    return build_world(standardised, head_numbers(config, scenes, training)[0])


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
        return manual_reward(config.manual), abs(config.manual.target) or 1.0
    assert learned is not None
    scale = config.irl.program.r_max * config.agent.cost_horizon
    if method == "irl":
        model = demonstrated_reward(scenes, split.training, learned.records, learned.basis, config.irl)
    else:
        machine_ = learned.machines[method]
        model = predicted_reward(scenes, split.training, machine_, learned.basis, config.irl, config.elm)
    return model, scale


def train_method(
    config: Config,
    method: Method,
    seed: int,
    scenes: Sequence[Scene],
    split: TaskSplit,
    learned: LearnedRewards | None,
    folder: RunFolder,
) -> None:
    """Train one method and keep its network and learning curve.

    All methods of a seed begin with the same parameters and random numbers, so that they differ by reward alone.

    Args:
        config: the configuration.
        method: the method.
        seed: the run's seed.
        scenes: encoded training scenes.
        split: the targets; training sees no others than `split.training`.
        learned: the learned rewards; not needed by RL.
        folder: the run folder.
    """
    reward_model, scale = reward_of(config, method, scenes, split, learned)
    world = world_of(config, scenes, scenes)
    targets = build_targets(scenes, split.training)
    n_heads = head_numbers(config, scenes, scenes)[1]
    with progress_bar(f"training {method}, seed {seed}", config.frames, "frames") as advance:
        parameters, curve = train(
            jax.random.key(seed),
            world,
            targets,
            reward_model,
            scale,
            n_heads,
            config.agent,
            config.tasks.cap,
            config.frames,
            advance,
        )
    write_table(folder.curve(method, seed), {f.name: getattr(curve, f.name) for f in dataclasses.fields(LearningCurve)})
    save_parameters(folder.agent(method, seed), parameters)


def evaluate_task(config: Config, folder: RunFolder, training: EncodedScenes, task: str) -> dict:
    """Evaluate every trained agent of the run on a task.

    Args:
        config: the configuration.
        folder: the run folder.
        training: the training scenes.
        task: `I`, `II` or `III`.

    Returns:
        The contents of `results.json`, which is written.
    """
    unseen = encode_unseen(config, training) if task == "III" else []
    scenes = unseen if task == "III" else training.scenes
    world = world_of(config, scenes, training.scenes)
    rows = []
    jobs = [
        (seed, method)
        for seed in range(config.seeds)
        for method in METHODS
        if method in config.chosen_methods() or folder.agent(method, seed).exists()
    ]
    with progress_bar(f"evaluating task {task}", len(jobs), "agents") as advance:
        for seed, method in jobs:
            split = draw_split(training.scenes, unseen, config.tasks, seed)
            targets = build_targets(scenes, split.of_task(task, config.evaluation))
            if method == "random":
                policy = RandomPolicy()
            else:
                network = network_of(config.agent, head_numbers(config, scenes, training.scenes)[1])
                parameters = load_parameters(folder.agent(method, seed))
                greedy = config.evaluation.policy == "greedy"
                policy = network_policy(network, parameters, world, targets, greedy=greedy)
            key = jax.random.fold_in(jax.random.key(seed), 1)
            episodes = evaluate(key, policy, world, targets, config.tasks.cap, config.evaluation.episodes)
            for number, scene in enumerate(scenes):
                measured = metrics(episodes, number)
                rows.append(
                    {
                        "method": method,
                        "scene": scene.name,
                        "room_type": scene.room_type,
                        "seed": seed,
                        "episodes": measured.episodes,
                        "sr": measured.success_rate,
                        "ple": measured.path_length_error,
                        "spl": measured.spl,
                    }
                )
            advance(1)
    results = {"task": task, "cap": config.tasks.cap, "encoder": training.encoder_name, "rows": rows}
    write_json(folder.file(f"results-{task}.json"), results)
    write_json(folder.file("results.json"), results)
    return results
