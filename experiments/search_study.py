"""The mapping agent in scenes it has never seen, beside what bounds it from above and below: pieces of `make paper`.

All seeds of a row run at once: the agent is deterministic, so that an episode which several seeds draw is run once.
Every row is a file, and finished rows are not measured again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from relm_irl_jax.agents.map.policy import MapPolicy
from relm_irl_jax.agents.map.rewarded import RewardedPolicy
from relm_irl_jax.agents.map.variants import MemorylessPolicy, explorer
from relm_irl_jax.agents.random_agent import RandomPolicy
from relm_irl_jax.config import Config, Method, Task
from relm_irl_jax.env import Episode, shortest_path
from relm_irl_jax.episode_runner import Outcome, run_episodes
from relm_irl_jax.evaluation import Episodes, draw_episodes, evaluation_key
from relm_irl_jax.files import checksum_of, columns_of_rows, write_table
from relm_irl_jax.progress import console, progress_bar
from relm_irl_jax.rewards.learned import predicted_observations
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import encode_training
from relm_irl_jax.stages.evaluation import result_rows
from relm_irl_jax.stages.make_agent import make_agent
from relm_irl_jax.stages.worlds import EvaluationTask, evaluation_task, standardised_world
from relm_irl_jax.studies.search_page import FAILURE_COLUMNS, METRIC_COLUMNS, SearchRow
from relm_irl_jax.studies.settings_file import check_settings
from relm_irl_jax.studies.study import complete_run, shared_rewards
from relm_irl_jax.tasks import Target
from relm_irl_jax.types import Policy
from relm_irl_jax.world import build_targets, scene_offsets

FURTHER_SETS = (20, 50, 70)
"""First rooms of the further sets of nine unseen rooms, which no choice of a setting has looked at."""

FEWER, FEWER_IN_MAPS = 20, 4
"""In rooms, rows that only bound the agent have a twentieth of the episodes, in recorded maps a quarter: their episodes
last until the cap."""

REWARDED: dict[str, tuple[Method, Literal["prices", "prior"]]] = {
    "rl-prices": ("rl", "prices"),
    "elm-irl-prices": ("elm-irl", "prices"),
    "relm-irl-prices": ("relm-irl", "prices"),
    "relm-irl-prior": ("relm-irl", "prior"),
}
"""Rows in which the agent has a method's reward, and what for. Under the hand-made reward every step costs the same, so
that its row is the agent as it is, in the same episodes."""


def rows(episodes: int) -> list[SearchRow]:
    """The rows of the study.

    Args:
        episodes: episodes of a scene and seed.

    Returns:
        The rows, those that matter most first.
    """
    few = -(-episodes // FEWER)
    return [
        SearchRow("map", "III", 0, "empty", episodes),
        *(SearchRow("map", "III", first, "empty", episodes) for first in FURTHER_SETS),
        SearchRow("map", "II", 0, "filled", episodes),
        SearchRow("oracle", "III", 0, "empty", episodes),
        SearchRow("explorer", "III", 0, "empty", few),
        SearchRow("memoryless", "III", 0, "empty", few),
        SearchRow("map", "II", 0, "empty", episodes),
        SearchRow("map", "I", 0, "filled", episodes),
        SearchRow("map", "I", 0, "empty", episodes),
        *(SearchRow(name, "III", 0, "empty", few) for name in REWARDED),
    ]


SETTINGS = ("scenes", "scene", "encoder", "tasks", "irl", "elm", "map", "evaluation", "seeds")
"""Fields of the configuration on which the rows depend."""

QUICK = (("map", 0), ("oracle", 0), ("memoryless", 0), ("relm-irl-prices", 0), ("relm-irl-prior", 0))
"""Agents and first rooms of the rows of the quick study."""


@dataclass(frozen=True)
class Pool:
    """The episodes of all seeds on a task.

    Attributes:
        seeds: the seeds.
        task: the scenes and targets of all seeds.
        drawn: the episodes of all seeds, one seed after the other; fields are [scenes, seeds · episodes].
        present: whether a seed has targets in a scene; where it has none, its episodes are copies of others.
    """

    seeds: Sequence[int]
    task: EvaluationTask
    drawn: Episode
    present: Bool[np.ndarray, "scenes seeds"]


def main(config: Config, out: Path, *, quick: bool = False) -> None:
    """Measure the rows that are missing.

    Args:
        config: scenes, agent, seeds and episodes.
        out: folder of the rows.
        quick: whether to measure only a few of them.

    Raises:
        InputError: the folder holds rows of other settings.
    """
    check_settings(out, config, SETTINGS)
    for row in rows(config.evaluation.episodes):
        if quick and (row.task != "III" or (row.agent, row.first_room) not in QUICK):
            continue
        if not row.path(out).exists():
            console.print(f"{row.path(out)}", highlight=False)
            measure(config, row, out)


def maps(config: Config, out: Path) -> None:
    """Train the mapping agent on recorded maps, and measure it in those that it never saw.

    Args:
        config: the maps, agent and episodes; one seed.
        out: folder of the run and of the rows.

    Raises:
        InputError: the folder holds rows of other settings, or of other weights.
    """
    folder = RunFolder(out / "run")
    complete_run(replace(config, run=folder.path), tasks=["III"], maps=False)
    check_settings(out, config, SETTINGS, weights=checksum_of(folder.agent("rl", 0)))
    few = -(-config.evaluation.episodes // FEWER_IN_MAPS)
    for agent in ("map", "package", "oracle", "random", "explorer", "memoryless"):
        weights = "package" if agent == "package" else str(folder.agent("rl", 0))
        episodes = few if agent in ("package", "explorer", "memoryless") else config.evaluation.episodes
        row = SearchRow(agent, "III", 0, "empty", episodes)
        if not row.path(out).exists():
            console.print(f"{row.path(out)}", highlight=False)
            measure(replace(config, seeds=1, map=replace(config.map, weights=weights)), row, out)


def measure(config: Config, row: SearchRow, out: Path) -> None:
    """Measure one row and write its metrics and failures.

    Args:
        config: scenes, agent and seeds.
        row: the row.
        out: folder of the rows.
    """
    config = replace(
        config, scene=replace(config.scene, first_room=row.first_room), map=replace(config.map, memory=row.memory)
    )
    seeds = list(range(config.seeds))
    # Every seed has a reward of its own; without one, all seeds share their episodes.
    groups = [[seed] for seed in seeds] if row.agent in REWARDED else [seeds]
    shown = with_features(config) if row.agent in REWARDED else config
    metrics, failures = [], []
    for group in groups:
        pool = pooled_tasks(shown, row.task, row.episodes, group)
        of_group = outcomes_of(pool, run_row(config, row, pool, out), row)
        metrics += of_group[0]
        failures += of_group[1]
    write_table(row.failures(out), columns_of_rows(FAILURE_COLUMNS, failures))
    write_table(row.path(out), columns_of_rows(METRIC_COLUMNS, metrics))


def run_row(config: Config, row: SearchRow, pool: Pool, out: Path) -> Outcome:
    """Run the episodes of a row.

    Args:
        config: scenes, agent and seeds.
        row: the row.
        pool: the episodes.
        out: folder of the rows.

    Returns:
        Their lengths and successes.
    """
    if row.agent == "oracle":
        length = np.asarray(shortest_path(pool.drawn, pool.task.world, pool.task.targets))
        return np.minimum(length, config.tasks.cap), length <= config.tasks.cap
    agent = make_agent(config, "rl")
    policy: Policy = agent.policy(agent.trained(), pool.task.world, pool.task.targets)
    policy = rewarded(config, row, pool, policy) if row.agent in REWARDED else VARIANTS[row.agent](policy)
    with progress_bar(row.path(out).stem, pool.drawn.target.size, "episodes") as advance:
        return run_episodes(
            jax.random.key(0),
            pool.drawn,
            policy,
            pool.task.world,
            pool.task.targets,
            cap=config.tasks.cap,
            advance=advance,
        )


def with_features(config: Config) -> Config:
    """The same scenes and tasks for an agent that is shown views' features, which predictions need."""
    return replace(config, agent="metric").resolved()


def rewarded(config: Config, row: SearchRow, pool: Pool, policy: MapPolicy) -> RewardedPolicy:
    """Give the agent the reward that a method learned from the demonstrations of one seed.

    Args:
        config: scenes, inverse reinforcement learning and regressor.
        row: a row of `REWARDED`.
        pool: the episodes of the seed.
        policy: the mapping agent's policy.

    Returns:
        The policy.
    """
    (method, use), task = REWARDED[row.agent], pool.task
    if method == "rl":
        return RewardedPolicy(policy, jnp.ones((len(task.chosen), len(task.world.scene)), jnp.float32), use)
    learned = shared_rewards(with_features(config), pool.seeds[0])
    phi = [learned.basis.phi(scene) for scene in task.scenes]
    predictor = RewardPredictor(task.scenes, phi, learned.regressors[method], learned.form)
    cost = -predicted_observations(task.scenes, task.chosen, predictor)
    return RewardedPolicy(policy, jnp.asarray(cost), use)


VARIANTS: dict[str, Callable[[MapPolicy], Policy]] = {
    "map": lambda policy: policy,
    "package": lambda policy: policy,
    "random": lambda policy: RandomPolicy(),
    "explorer": explorer,
    "memoryless": MemorylessPolicy,
}


def pooled_tasks(config: Config, name: Task, episodes: int, seeds: Sequence[int]) -> Pool:
    """Draw the episodes of several seeds, as an evaluation of each seed does, and put them into one world.

    Args:
        config: scenes.
        name: the task.
        episodes: episodes of a scene and seed.
        seeds: the seeds.

    Returns:
        The pool.
    """
    training = encode_training(config)
    tasks = [evaluation_task(config, training, name, seed) for seed in seeds]
    scenes: dict[str, Scene] = {scene.name: scene for task in tasks for scene in task.scenes}
    number = {scene: n for n, scene in enumerate(scenes)}
    chosen = sorted({(number[task.scenes[t.scene].name], t.state, t.category) for task in tasks for t in task.chosen})
    row_of = {(scene, state): row for row, (scene, state, _) in enumerate(chosen)}
    everything = EvaluationTask(
        name=name,
        seed=0,
        scenes=list(scenes.values()),
        world=standardised_world(list(scenes.values()), training.scenes),
        targets=build_targets(list(scenes.values()), targets := [Target(*row) for row in chosen]),
        chosen=targets,
    )
    offsets = scene_offsets(everything.scenes)
    start, target = (np.full((len(scenes), len(seeds), episodes), -1, np.int32) for _ in range(2))
    for column, (seed, task) in enumerate(zip(seeds, tasks, strict=True)):
        drawn, _ = draw_episodes(evaluation_key(seed), task.targets, len(task.scenes), episodes)
        local = np.asarray(task.world.local)
        for n, scene in enumerate(task.scenes):
            into = number[scene.name]
            start[into, column] = local[np.asarray(drawn.start)[n]] + offsets[into]
            target[into, column] = [
                row_of[into, task.chosen[row].state] for row in np.asarray(drawn.target)[n].tolist()
            ]
    present = (target >= 0).all(-1)
    for scene, column in zip(*np.nonzero(~present), strict=True):
        other = int(np.flatnonzero(present[scene])[0])
        start[scene, column], target[scene, column] = start[scene, other], target[scene, other]
    first, goal = (jnp.asarray(x.reshape(len(scenes), -1)) for x in (start, target))
    return Pool(seeds, everything, Episode(state=first, target=goal, start=first, steps=jnp.zeros_like(first)), present)


def outcomes_of(pool: Pool, outcome: Outcome, row: SearchRow) -> tuple[list[list], list[list]]:
    """The metrics of each scene and seed, and the failed episodes.

    Args:
        pool: the episodes.
        outcome: their lengths and successes.
        row: the row.

    Returns:
        Lines of `METRIC_COLUMNS` and of `FAILURE_COLUMNS`.
    """
    task = pool.task
    shortest = np.asarray(shortest_path(pool.drawn, task.world, task.targets))
    fields = (*(np.asarray(x) for x in (pool.drawn.target, pool.drawn.start)), outcome[0], shortest, outcome[1])
    metrics, failures = [], []
    for column, seed in enumerate(pool.seeds):
        part = slice(column * row.episodes, (column + 1) * row.episodes)
        episodes = Episodes(*(field[:, part].astype(bool if n == 4 else np.int32) for n, field in enumerate(fields)))
        for n, measured in enumerate(result_rows("rl", row.agent, replace(task, seed=seed), episodes)):
            if pool.present[n, column]:
                metrics.append([getattr(measured, name) for name in METRIC_COLUMNS])
                failures += _failures(task, episodes, n, seed)
    return metrics, failures


def _failures(task: EvaluationTask, episodes: Episodes, scene: int, seed: int) -> list[list]:
    offset = scene_offsets(task.scenes)[scene]
    return [
        [
            seed,
            task.scenes[scene].name,
            task.chosen[episodes.target[scene, n]].category,
            task.chosen[episodes.target[scene, n]].state,
            int(episodes.start[scene, n]) - offset,
            int(episodes.shortest[scene, n]),
        ]
        for n in np.flatnonzero(~episodes.success[scene]).tolist()
    ]
