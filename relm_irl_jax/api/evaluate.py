"""Evaluation of trained agents and of policies from anywhere, on the targets and episodes of the tables."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from relm_irl_jax.agents.map.agent import MapAgent
from relm_irl_jax.agents.map.network import VIEW
from relm_irl_jax.agents.random_agent import RandomPolicy
from relm_irl_jax.api.scenes import Scenes, config_of
from relm_irl_jax.api.setting import ListedViews, Setting, prepare
from relm_irl_jax.api.train import Trained, numbered
from relm_irl_jax.batch_policies import BatchPolicy, Protocol, evaluate_batch_policy
from relm_irl_jax.config import Config, overlay
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import Episodes, evaluation_key
from relm_irl_jax.evaluation import evaluate as evaluate_policy
from relm_irl_jax.features.settings import Observed
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.results import ResultRow, Results, Task
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.evaluation import result_rows
from relm_irl_jax.stages.worlds import EvaluationTask


def evaluate(
    agent: Trained | BatchPolicy | Literal["random"],
    task: Task = "II",
    seeds: int | Sequence[int] | None = None,
    *,
    scenes: Scenes | None = None,
    unseen: Sequence[Scene] | None = None,
    episodes: int | None = None,
    targets: int | None = None,
    obs: Observed = "features",
    history: int = 1,
    name: str | None = None,
    config: Config | None = None,
) -> Results:
    """Evaluate an agent or a policy on a task.

    A policy is any function from a batch of observations, `{"view": [agents, ...], "target": [agents, ...]}`, to the
    numbers of the actions; see `relm_irl_jax.batch_policies`. Its starts and targets are those of every other policy.

    Args:
        agent: a trained agent, a policy, or `random`.
        task: `I` for trained targets, `II` for new targets in the training scenes, `III` for similar targets in unseen
            scenes.
        seeds: seeds that draw targets and episodes. A trained agent is evaluated on its own seeds alone (by default all
            of them): a target that is new for one seed may have been trained in another. By default, 1 for policies.
        scenes: the training scenes; by default `rooms`. Those of a trained agent are its own.
        unseen: scenes of Task III; needed where the training scenes are a list.
        episodes: episodes in each scene; by default 1000.
        targets: number of training targets, see `train`; a trained agent's are its own.
        obs: what a policy observes: `features` or `frames`.
        history: number of last views that a policy observes.
        name: its name in tables.
        config: all other settings; a trained agent's are its own.

    Returns:
        One row for each seed and scene.

    Raises:
        InputError: an argument or the scenes cannot be used, or the policy returns something other than actions.
    """
    setting = _setting(agent, scenes, unseen, targets, config)
    if unseen is not None and isinstance(agent, Trained) and isinstance(agent.agent, MapAgent):
        listed = agent.agent.views.scenes if isinstance(agent.agent.views, ListedViews) else ()
        agent = replace(agent, agent=replace(agent.agent, views=ListedViews((*listed, *unseen), VIEW)))
    if task == "III" and setting.unseen is not None and not setting.unseen:
        raise InputError("unseen: Task III needs scenes that the agent was not trained in; give a list of them.")
    changes = {"task": task} | ({} if episodes is None else {"evaluation": {"episodes": episodes}})
    settings = overlay(setting.config, changes, "evaluate")
    label, rows = name or _name(agent), list[ResultRow]()
    for seed in _seeds(agent, seeds):
        of_seed = setting.task(task, seed)
        observed = [] if isinstance(agent, Trained) or agent == "random" else setting.observed(of_seed, obs)
        total = len(of_seed.scenes) * settings.evaluation.episodes
        with progress_bar(f"evaluating {label}, task {task}", total, "episodes") as advance:
            finished = _episodes(agent, of_seed, settings, observed, history=history, advance=advance)
        rows += result_rows(label, _kind(agent), of_seed, finished)
    return Results(task, settings.tasks.cap, setting.training.encoder_name, tuple(rows))


def _setting(
    agent: Trained | BatchPolicy | str,
    scenes: Scenes | None,
    unseen: Sequence[Scene] | None,
    targets: int | None,
    config: Config | None,
) -> Setting:
    """The scenes; those of a trained agent are its own."""
    if isinstance(agent, str) and agent != "random":
        raise InputError(f"agent: {agent!r} is none; give a trained agent, a function of observations, or random.")
    if not isinstance(agent, Trained):
        scenes = "rooms" if scenes is None else scenes
        return prepare(scenes, config_of(scenes, config, targets), unseen)
    given = {"scenes": scenes, "targets": targets, "config": config}
    for argument, value in given.items():
        if value is not None:
            raise InputError(f"{argument}: a trained agent is evaluated with its own; leave it out.")
    return agent.setting if unseen is None else replace(agent.setting, unseen=unseen)


def _episodes(
    agent: Trained | BatchPolicy | str,
    task: EvaluationTask,
    config: Config,
    observed: Sequence[np.ndarray],
    *,
    history: int,
    advance: Callable[[int], None],
) -> Episodes:
    key, cap, episodes = evaluation_key(task.seed), config.tasks.cap, config.evaluation.episodes
    if isinstance(agent, (Trained, str)):
        policy = agent.policy(task) if isinstance(agent, Trained) else RandomPolicy()
        return evaluate_policy(key, policy, task.world, task.targets, cap, episodes, advance=advance)
    return evaluate_batch_policy(
        key, agent, task.world, task.targets, observed, Protocol(cap, episodes, history), advance=advance
    )


def _seeds(agent: Trained | BatchPolicy | str, seeds: int | Sequence[int] | None) -> list[int]:
    if not isinstance(agent, Trained):
        return numbered(1 if seeds is None else seeds)
    chosen = list(agent.parameters) if seeds is None else numbered(seeds)
    if other := [seed for seed in chosen if seed not in agent.parameters]:
        raise InputError(
            f"seeds: {agent.name} was not trained with seed {other[0]}, whose new targets may have been trained in "
            f"another seed; give some of {sorted(agent.parameters)}."
        )
    return chosen


def _name(agent: Trained | BatchPolicy | str) -> str:
    if isinstance(agent, str):
        return agent
    return agent.name if isinstance(agent, Trained) else getattr(agent, "__name__", "own policy").strip("<>")


def _kind(agent: Trained | BatchPolicy | str) -> str:
    if isinstance(agent, str):
        return agent
    return agent.agent.name if isinstance(agent, Trained) else "own"
