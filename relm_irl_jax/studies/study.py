"""Runs of a study: each run covers all three tasks, and finished runs are not repeated.

Runs are executed by `joblib.Parallel`, by default one after the other in this process. joblib's context can select
other workers:

    with joblib.parallel_config(backend="loky", n_jobs=4):   # or "dask", "ray", ...
        complete_runs(configs, complete_run)

Runs in the same process share encoded scenes and learned rewards if their configurations agree; other processes compute
them again. A run only writes to its own folder, which must be visible to all processes.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from joblib import Parallel, delayed

from relm_irl_jax.config import Config, config_to_dict, load_config, overlay, read_fields
from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.errors import InputError
from relm_irl_jax.pipeline import run
from relm_irl_jax.progress import console
from relm_irl_jax.results import TASKS, Task, load_all_results
from relm_irl_jax.rewards.learned import LearnedRewards, fit_regressors, learn_demonstrated
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import EncodedScenes, encode_training
from relm_irl_jax.stages.make_agent import needs_features
from relm_irl_jax.studies.settings_file import with_fields_of
from relm_irl_jax.tasks import TaskSplit, draw_split

SCENE_FIELDS = ("scenes", "scene", "encoder")
"""Fields on which encoded scenes depend."""
DEMONSTRATION_FIELDS = (*SCENE_FIELDS, "tasks", "irl")
"""Fields on which demonstrated rewards depend."""
PREDICTION_FIELDS = (*DEMONSTRATION_FIELDS, "elm")
"""Fields on which the regressors depend."""

Run = TypeVar("Run")


def load_preset(path: Path, overlays: Sequence[Path] = ()) -> Config:
    """Read a configuration, and apply changes from other files.

    Args:
        path: the configuration.
        overlays: files with changes, which are applied in order.

    Returns:
        The configuration.

    Raises:
        InputError: a file cannot be read, or a field in it is unknown or refused.
    """
    config = load_config(path)
    for changes in overlays:
        config = overlay(config, read_fields(changes), str(changes))
    return config


def complete_runs(runs: Sequence[Run], complete: Callable[[Run], object]) -> None:
    """Complete runs in joblib's workers, by default one after the other in this process.

    Args:
        runs: the runs, such as their configurations.
        complete: function that completes a run, such as `complete_run`.
    """
    Parallel()(delayed(complete)(run) for run in runs)


def complete_run(config: Config, *, tasks: Sequence[Task] = TASKS, maps: bool = True) -> None:
    """Train missing agents, evaluate all agents on the tasks, and write the run's report.

    Args:
        config: the configuration; `run` names the folder.
        tasks: the tasks that are evaluated.
        maps: whether to save maps of episodes and rewards.
    """
    if is_finished(config, tasks):
        console.print(f"{config.run}: finished", highlight=False)
        return
    console.print(f"{config.run}", highlight=False)
    mark_unfinished(config)
    encoded = _encoded(with_fields_of(config, SCENE_FIELDS)) if needs_features(config) else None
    run(config, tasks, encoded, learn_shared, maps=maps)


def learn_shared(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int) -> LearnedRewards:
    """Learn rewards like `learn`, but only once for all runs of this process that share them.

    Args:
        config: the configuration.
        scenes: encoded training scenes; ignored, since they follow from the configuration.
        split: the targets of all tasks; ignored, since they follow from the configuration and the seed.
        seed: the run's seed.

    Returns:
        The learned rewards.
    """
    del scenes, split
    return shared_rewards(config, seed)


def shared_rewards(config: Config, seed: int) -> LearnedRewards:
    """The rewards of a seed, learned once for all runs of this process that share them.

    Args:
        config: the configuration.
        seed: the seed.

    Returns:
        The learned rewards.
    """
    fitted = replace(with_fields_of(config, PREDICTION_FIELDS), elm=replace(config.elm, predict_from="start"))
    demonstrated = _demonstrated(with_fields_of(config, DEMONSTRATION_FIELDS), seed)
    return replace(demonstrated, regressors=_regressors(fitted, seed))


def is_finished(config: Config, tasks: Sequence[Task] = TASKS) -> bool:
    """Whether a run folder contains all results of a configuration.

    Args:
        config: the configuration; `run` names the folder.
        tasks: the tasks that must be evaluated.

    Returns:
        True if nothing is left to do.
    """
    if config.run is None:
        raise InputError("run: the runs of a study need a run folder; give one.")
    folder = RunFolder(config.run)
    if not folder.config.exists() or not folder.report.exists():
        return False
    if _compared(load_config(folder.config)) != _compared(config):
        return False
    try:
        results = load_all_results(folder)
    except InputError:
        return False
    required = {(method, seed) for method in config.chosen_methods() for seed in range(config.seeds)}
    episodes = config.evaluation.episodes
    measured = [{(row.method, row.seed) for row in r.rows if row.episodes == episodes} for r in results.values()]
    return set(results) >= set(tasks) and all(required <= of_task for of_task in measured)


def mark_unfinished(config: Config) -> None:
    """Remove a run's report before its folder names other settings than those that its results are of.

    A run that is ended before its new results are there is then not taken for a finished one.

    Args:
        config: the configuration; `run` names the folder.
    """
    assert config.run is not None
    RunFolder(config.run).report.unlink(missing_ok=True)


def _compared(config: Config) -> dict:
    """The fields on which the results of all tasks depend."""
    resolved = config_to_dict(config.resolved())
    return {name: value for name, value in resolved.items() if name not in ("run", "task")}


@lru_cache(maxsize=1)
def _encoded(config: Config) -> EncodedScenes:
    return encode_training(config)


@lru_cache(maxsize=8)
def _demonstrated(config: Config, seed: int) -> LearnedRewards:
    scenes = _encoded(with_fields_of(config, SCENE_FIELDS)).scenes
    return learn_demonstrated(scenes, draw_split(scenes, (), config.tasks, seed), config.irl, seed)


@lru_cache(maxsize=8)
def _regressors(config: Config, seed: int) -> dict[str, ELMRegressor]:
    demonstrated = _demonstrated(with_fields_of(config, DEMONSTRATION_FIELDS), seed).demonstrated
    return fit_regressors(_encoded(with_fields_of(config, SCENE_FIELDS)).scenes, demonstrated, config.elm, seed)
