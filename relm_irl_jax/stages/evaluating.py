"""Last stage: every trained agent on one task."""

from collections.abc import Mapping

import jax
import numpy as np

from relm_irl_jax.agent.metric.network import distance, metric_network
from relm_irl_jax.agent.siamese.train import network_of
from relm_irl_jax.config import METHODS, Config, Method, Task
from relm_irl_jax.elm import load_elm
from relm_irl_jax.evaluation import MetricPolicy, Policy, RandomPolicy, evaluate, metric_policy, metrics, network_policy
from relm_irl_jax.parameters import load_parameters
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.results import ResultRow, Results, save_results
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_maps import SHORTEST_PATH, StateMap, poses_of, save_map
from relm_irl_jax.scenes.scene import first_of_each_type
from relm_irl_jax.stages.encoding import EncodedScenes
from relm_irl_jax.stages.ground import Ground, ground_of, sighted
from relm_irl_jax.stages.learning import PREDICTED, load_basis
from relm_irl_jax.world import scene_offsets


def policy_of(config: Config, folder: RunFolder, method: Method, seed: int, ground: Ground) -> Policy:
    """The trained agent of a method and seed, ready for a task.

    Args:
        config: the configuration as run.
        folder: the run folder.
        method: whose agent.
        seed: which seed's agent.
        ground: scenes and targets.

    Returns:
        The policy.
    """
    world, targets = ground.world, ground.targets
    if method == "random":
        return RandomPolicy()
    parameters = load_parameters(folder.agent(method, seed))
    greedy = config.evaluation.policy == "greedy"
    if config.agent == "metric":
        return metric_policy(metric_network(config.metric), parameters, world, targets, config.metric, greedy=greedy)
    if config.siamese.sees_reward:
        machine_ = load_elm(folder.rewards(seed, f"{method}.safetensors")) if method in PREDICTED else None
        basis = load_basis(folder.rewards(seed, "demonstrated.safetensors")) if method in PREDICTED else None
        targets = sighted(config, targets, ground.scenes, ground.chosen, machine_, basis)
    return network_policy(network_of(config.siamese, ground.n_heads), parameters, world, targets, greedy=greedy)


def evaluate_task(config: Config, folder: RunFolder, training: EncodedScenes, task: Task) -> Results:
    """Evaluate every trained agent of the run on a task.

    Args:
        config: the configuration.
        folder: the run folder.
        training: the training scenes.
        task: `I`, `II` or `III`.

    Returns:
        The metrics, which are written to the run folder.
    """
    grounds = [ground_of(config, training, task, seed) for seed in range(config.seeds)]
    rows, learned = [], {}
    jobs = [
        (seed, method)
        for seed in range(config.seeds)
        for method in METHODS
        if method in config.chosen_methods() or folder.agent(method, seed).exists()
    ]
    with progress_bar(f"evaluating task {task}", len(jobs), "agents") as advance:
        for seed, method in jobs:
            ground = grounds[seed]
            policy = policy_of(config, folder, method, seed, ground)
            if seed == 0 and isinstance(policy, MetricPolicy):
                learned[method] = policy
            key = jax.random.fold_in(jax.random.key(seed), 1)
            episodes = evaluate(key, policy, ground.world, ground.targets, config.tasks.cap, config.evaluation.episodes)
            for number, scene in enumerate(ground.scenes):
                measured = metrics(episodes, number)
                rows.append(
                    ResultRow(
                        method=method,
                        agent=config.agent,
                        scene=scene.name,
                        room_type=scene.room_type,
                        seed=seed,
                        episodes=measured.episodes,
                        sr=measured.success_rate,
                        ple=measured.path_length_error,
                        spl=measured.spl,
                    )
                )
            advance(1)
    if learned:
        _save_distance_maps(folder, task, grounds[0], learned)
    results = Results(task, config.tasks.cap, training.encoder_name, tuple(rows))
    save_results(folder, results)
    return results


def _save_distance_maps(folder: RunFolder, task: str, ground: Ground, learned: Mapping[Method, MetricPolicy]) -> None:
    """Save true and learned distances to the first target of the first room of each type."""
    scenes, targets, offsets = ground.scenes, ground.targets, scene_offsets(ground.scenes)
    for number in first_of_each_type(scenes).values():
        scene, row = scenes[number], int(np.flatnonzero(np.asarray(targets.scene) == number)[0])
        target = int(targets.state[row]) - offsets[number]
        maps = {SHORTEST_PATH: scene.shortest_path_distance[:, target].astype(float)}
        own = slice(offsets[number], offsets[number] + scene.n_states)
        for method, policy in learned.items():
            maps[method] = np.asarray(distance(policy.places.here[own], policy.wanted[row], policy.settings), float)
        category = ground.chosen[row].category
        saved = StateMap(poses=poses_of(scene), seed=0, target=target, category=category, values=maps)
        save_map(folder.distance_map(task, scene.room_type), saved)
