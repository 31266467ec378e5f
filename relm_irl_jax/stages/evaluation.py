"""Last stage: evaluation of all trained agents on one task."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np
from flax.errors import FlaxError
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agents.random_agent import RandomPolicy
from relm_irl_jax.config import METHODS, Config, Method, Task
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import Episodes, compute_metrics, evaluate, evaluation_key
from relm_irl_jax.parameters import load_parameters
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.results import ResultRow, Results, load_entries, save_results
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_maps import SHORTEST_PATH, StateMap, save_map
from relm_irl_jax.saved_poses import poses_of
from relm_irl_jax.scenes.scene import first_of_each_type
from relm_irl_jax.stages.agents_beside import rows_beside, runs_beside
from relm_irl_jax.stages.encoding import EncodedScenes
from relm_irl_jax.stages.make_agent import make_agent
from relm_irl_jax.stages.rewards import load_predictor
from relm_irl_jax.stages.worlds import EvaluationTask, evaluation_task, with_predicted_reward
from relm_irl_jax.types import Policy
from relm_irl_jax.world import scene_offsets


@runtime_checkable
class DistancePolicy(Policy, Protocol):
    """A policy with a learned distance, which the report can draw as a map."""

    def distance_to(self, target: Int32[Array, ""]) -> Float32[Array, "states"]:
        """Learned distance of every state of the world to a target, in steps."""
        ...


def load_policy(config: Config, folder: RunFolder, method: Method, seed: int, task: EvaluationTask) -> Policy:
    """Load the trained policy of a method and seed for a task.

    Args:
        config: the configuration as run.
        folder: the run folder.
        method: the method that trained it.
        seed: the seed that trained it.
        task: scenes and targets.

    Returns:
        The policy.

    Raises:
        InputError: a file is missing or damaged, or the agent cannot act in these scenes.
    """
    if method == "random":
        return RandomPolicy()
    targets = task.targets
    if config.siamese.observe_reward:
        predictor = load_predictor(config, folder, method, seed, task.scenes)
        targets = with_predicted_reward(targets, task.scenes, task.chosen, predictor)
    path = folder.agent(method, seed)
    parameters = load_parameters(path)
    try:
        return make_agent(config, method).policy(parameters, task.world, targets)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, FlaxError) as error:
        raise InputError(
            f"{path}: its tensors are not those of the run's agent; remove the file, and run `relm-irl train --resume "
            f"{folder.path}`."
        ) from error


def result_rows(method: str, agent: str, task: EvaluationTask, episodes: Episodes) -> list[ResultRow]:
    """The metrics of a policy's episodes, one row for each scene.

    Args:
        method: name of the policy's method.
        agent: kind of agent.
        task: scenes and targets.
        episodes: the finished episodes.

    Returns:
        The rows.
    """
    return [
        ResultRow(
            method=method,
            agent=agent,
            scene=scene.name,
            room_type=scene.room_type,
            seed=task.seed,
            episodes=metrics.episodes,
            sr=metrics.success_rate,
            ple=metrics.path_length_error,
            spl=metrics.spl,
        )
        for scene, metrics in ((scene, compute_metrics(episodes, n)) for n, scene in enumerate(task.scenes))
    ]


def evaluate_task(config: Config, folder: RunFolder, training: EncodedScenes, task: Task) -> Results:
    """Evaluate all trained agents of the run on a task, and save results and maps.

    Args:
        config: the configuration.
        folder: the run folder.
        training: the training scenes.
        task: `I`, `II` or `III`.

    Returns:
        The results, which are also saved.
    """
    tasks = [evaluation_task(config, training, task, seed) for seed in range(config.seeds)]
    rows: list[ResultRow] = []
    shown: dict[Method, Policy] = {}
    jobs = _evaluated(config, folder)
    total = sum(len(tasks[seed].scenes) for seed, _ in jobs) * config.evaluation.episodes
    with progress_bar(f"evaluating task {task}", total, "episodes") as advance:
        for seed, method in jobs:
            seed_task = tasks[seed]
            policy = load_policy(config, folder, method, seed, seed_task)
            if seed == 0:
                shown[method] = policy
            episodes = evaluate(
                evaluation_key(seed),
                policy,
                seed_task.world,
                seed_task.targets,
                config.tasks.cap,
                config.evaluation.episodes,
                advance=advance,
            )
            rows += result_rows(method, "random" if method == "random" else config.agent, seed_task, episodes)
    _save_distances(folder, tasks[0], {m: p for m, p in shown.items() if isinstance(p, DistancePolicy)})
    rows += rows_beside(config, folder, task)
    rows += load_entries(folder, task)
    results = Results(task, config.tasks.cap, training.encoder_name, tuple(rows))
    save_results(folder, results)
    return results


def check_agents(config: Config, folder: RunFolder, *, finished: bool) -> None:
    """Read the files of all agents, those beside the run's own too, before the work with them.

    Args:
        config: the configuration.
        folder: the run folder.
        finished: whether agents that are missing are an error; otherwise they are still to be trained.

    Raises:
        InputError: a file is damaged or missing.
    """
    for seed, method in _evaluated(config, folder):
        path = folder.agent(method, seed)
        if method != "random" and (finished or path.exists()):
            load_parameters(path)
    for beside in runs_beside(config, folder).values():
        assert beside.run is not None
        check_agents(beside, RunFolder(beside.run), finished=finished)


def _evaluated(config: Config, folder: RunFolder) -> list[tuple[int, Method]]:
    """Seeds and methods in the tables: those of the configuration, and others that were trained before."""
    return [
        (seed, method)
        for seed in range(config.seeds)
        for method in METHODS
        if method in config.chosen_methods() or folder.agent(method, seed).exists()
    ]


def _save_distances(folder: RunFolder, task: EvaluationTask, policies: Mapping[Method, DistancePolicy]) -> None:
    """Save true and learned distances to the first target in the first room of each type."""
    offsets = scene_offsets(task.scenes)
    for room_type, number in first_of_each_type(task.scenes).items() if policies else ():
        scene, first = task.scenes[number], offsets[number]
        row = next(row for row, target in enumerate(task.chosen) if target.scene == number)
        target = task.chosen[row]
        values = {SHORTEST_PATH: scene.shortest_path_distance[:, target.state].astype(float)}
        for method, policy in policies.items():
            learned = policy.distance_to(jnp.int32(row))[first : first + scene.n_states]
            values[method] = np.asarray(learned, float)
        state_map = StateMap(
            poses=poses_of(scene), seed=task.seed, target=target.state, category=target.category, values=values
        )
        save_map(folder.distance_map(task.name, room_type), state_map)
