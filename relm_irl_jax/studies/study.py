"""Runs of a study: each on all three tasks and kept where it is finished, one after the other or side by side.

Runs go through `joblib.Parallel`, by default one after the other in this process. Its context sends them elsewhere:

    with joblib.parallel_config(backend="loky", n_jobs=4):   # or "dask", "ray", ...
        complete_runs(configs, complete_run)

Runs that follow each other in one process share encoded scenes and learned rewards as far as their configurations
agree; other processes learn them again. A run writes to its own folder alone, which all processes must see.
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
from relm_irl_jax.tasks import TaskSplit, draw_split

SCENE_FIELDS = ("scenes", "scene", "encoder")
"""Fields on which encoded scenes depend."""
DEMONSTRATION_FIELDS = (*SCENE_FIELDS, "tasks", "irl")
"""Fields on which demonstrated rewards depend."""
PREDICTION_FIELDS = (*DEMONSTRATION_FIELDS, "elm")
"""Fields on which the regressors depend."""

Run = TypeVar("Run")


def load_preset(path: Path, overlays: Sequence[Path] = ()) -> Config:
    """Read a configuration, and lay others over it.

    Args:
        path: the first file.
        overlays: files whose fields replace those before.

    Returns:
        The configuration.

    Raises:
        InputError: a file cannot be read, or a field in it is unknown or refused.
    """
    config = load_config(path)
    for over in overlays:
        config = overlay(config, read_fields(over), str(over))
    return config


def complete_runs(runs: Sequence[Run], complete: Callable[[Run], object]) -> None:
    """Complete runs as joblib's context says, by default one after the other in this process.

    Args:
        runs: the runs, such as their configurations.
        complete: completes one, such as `complete_run`.
    """
    Parallel()(delayed(complete)(run) for run in runs)


def complete_run(config: Config, *, tasks: Sequence[Task] = TASKS, maps: bool = True) -> None:
    """Train and evaluate on all tasks what the run folder does not hold yet, and write its report.

    Args:
        config: the configuration; `run` names the folder.
        maps: whether to save maps of episodes and rewards.
    """
    if is_finished(config, tasks):
        console.print(f"{config.run}: is finished", highlight=False)
        return
    console.print(f"{config.run}", highlight=False)
    run(config, tasks, _encoded(_only(config, SCENE_FIELDS)), learn_shared, maps=maps)


def learn_shared(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int) -> LearnedRewards:
    """Learn rewards as `learn` does, once for all runs of this process that share them.

    Args:
        config: the configuration.
        scenes: encoded training scenes, as the configuration gives them.
        split: the targets of all tasks, drawn from the configuration and the seed.
        seed: the run's seed.

    Returns:
        The learned rewards.
    """
    del scenes, split  # they follow from the rest
    fitted = replace(_only(config, PREDICTION_FIELDS), elm=replace(config.elm, predict_from="start"))
    demonstrated = _demonstrated(_only(config, DEMONSTRATION_FIELDS), seed)
    return replace(demonstrated, regressors=_regressors(fitted, seed))


def forget_shared() -> None:
    """Forget scenes and rewards of earlier runs."""
    for cached in (_encoded, _demonstrated, _regressors):
        cached.cache_clear()


def is_finished(config: Config, tasks: Sequence[Task] = TASKS) -> bool:
    """Whether a run folder holds all results of a configuration, in the settings that it asks for.

    Args:
        config: the configuration; `run` names the folder.

    Returns:
        True where nothing is left to do.
    """
    if config.run is None:
        raise InputError("run: a study needs the folder of each of its runs; give one.")
    folder = RunFolder(config.run)
    if not folder.config.exists() or not (folder.path / "report.html").exists():
        return False
    if _compared(load_config(folder.config)) != _compared(config):
        return False
    try:
        results = load_all_results(folder)
    except InputError:
        return False
    asked = {(method, seed) for method in config.chosen_methods() for seed in range(config.seeds)}
    episodes = config.evaluation.episodes
    measured = [{(row.method, row.seed) for row in r.rows if row.episodes == episodes} for r in results.values()]
    return set(results) >= set(tasks) and all(asked <= found for found in measured)


def _compared(config: Config) -> dict:
    """The fields on which the results of all tasks depend."""
    return {name: value for name, value in config_to_dict(config).items() if name not in ("run", "task")}


def _only(config: Config, fields: Sequence[str]) -> Config:
    """The defaults but for some fields, so that configurations which share these are equal."""
    return replace(Config(), **{name: getattr(config, name) for name in fields})


@lru_cache(maxsize=1)
def _encoded(config: Config) -> EncodedScenes:
    return encode_training(config)


@lru_cache(maxsize=8)
def _demonstrated(config: Config, seed: int) -> LearnedRewards:
    scenes = _encoded(_only(config, SCENE_FIELDS)).scenes
    return learn_demonstrated(scenes, draw_split(scenes, (), config.tasks, seed), config.irl, seed)


@lru_cache(maxsize=8)
def _regressors(config: Config, seed: int) -> dict[str, ELMRegressor]:
    demonstrated = _demonstrated(_only(config, DEMONSTRATION_FIELDS), seed).demonstrated
    return fit_regressors(_encoded(_only(config, SCENE_FIELDS)).scenes, demonstrated, config.elm, seed)
