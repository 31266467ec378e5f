"""One run on all three tasks, kept where it is finished; runs of a study share what they can."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import get_args

from relm_irl_jax.config import Config, Method, Task, config_record, load_config, overlay, read_record
from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.errors import InputError
from relm_irl_jax.pipeline import run
from relm_irl_jax.progress import console
from relm_irl_jax.rewards.demonstrations import DemonstratedReward, RewardBasis
from relm_irl_jax.runs import CONFIG_FILE, RunFolder, read_all_results
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import EncodedScenes, encode_training
from relm_irl_jax.stages.learning import LearnedRewards, fit_machines, learn_demonstrated
from relm_irl_jax.tasks import TaskSplit, draw_split

TASKS: tuple[Task, ...] = get_args(Task)

SEEN = ("scenes", "scene", "encoder")
"""Fields on which encoded scenes depend."""
DEMONSTRATED = (*SEEN, "tasks", "irl")
"""Fields on which demonstrated rewards depend."""
FITTED = (*DEMONSTRATED, "elm")
"""Fields on which the machines depend."""


def preset(path: Path, overlays: Sequence[Path] = ()) -> Config:
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
        config = overlay(config, read_record(over), str(over))
    return config


def complete(config: Config, *, maps: bool = True) -> RunFolder:
    """Train and evaluate on all tasks what the run folder does not hold yet.

    Args:
        config: the configuration; `run` names the folder.
        maps: whether to draw episodes and rewards from above.

    Returns:
        The run folder, its report written.
    """
    assert config.run is not None
    folder = RunFolder(config.run)
    if finished(config):
        console.print(f"{config.run}: is finished", highlight=False)
        return folder
    console.print(f"{config.run}", highlight=False)
    return run(config, TASKS, _encoded(_only(config, SEEN)), remembered, maps=maps)


def remembered(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int) -> LearnedRewards:
    """Learn rewards as `learn` does, once for all runs of a study that share them.

    Args:
        config: the configuration.
        scenes: encoded training scenes, those of the configuration.
        split: the targets of all tasks, drawn from the configuration and the seed.
        seed: the run's seed.

    Returns:
        The learned rewards.
    """
    del scenes, split  # they follow from the rest
    fitted = replace(_only(config, FITTED), elm=replace(config.elm, follow=False))
    return LearnedRewards(*_demonstrated(_only(config, DEMONSTRATED), seed), _machines(fitted, seed))


def forget() -> None:
    """Forget scenes and rewards of earlier runs."""
    for memory in (_encoded, _demonstrated, _machines):
        memory.cache_clear()


def finished(config: Config) -> bool:
    """Whether a run folder holds all results of a configuration, in the settings that it asks for.

    Args:
        config: the configuration; `run` names the folder.

    Returns:
        True where nothing is left to do.
    """
    assert config.run is not None
    if not (config.run / CONFIG_FILE).exists():
        return False
    wanted = {k: v for k, v in config_record(config).items() if k not in ("run", "task")}
    held = {k: v for k, v in config_record(load_config(config.run / CONFIG_FILE)).items() if k not in ("run", "task")}
    try:
        results = read_all_results(RunFolder(config.run))
    except InputError:
        return False
    jobs = {(method, seed) for method in config.chosen_methods() for seed in range(config.seeds)}
    return (
        held == wanted
        and set(results) == set(TASKS)
        and (config.run / "report.html").exists()
        and all(
            jobs <= {(row["method"], row["seed"]) for row in record["rows"] if row["episodes"] == wanted_episodes}
            for record in results.values()
            for wanted_episodes in [config.evaluation.episodes]
        )
    )


def _only(config: Config, fields: Sequence[str]) -> Config:
    """The defaults but for some fields, so that configurations which share these are equal."""
    return replace(Config(), **{name: getattr(config, name) for name in fields})


@lru_cache(maxsize=1)
def _encoded(config: Config) -> EncodedScenes:
    return encode_training(config)


@lru_cache(maxsize=8)
def _demonstrated(config: Config, seed: int) -> tuple[RewardBasis, list[DemonstratedReward]]:
    scenes = _encoded(_only(config, SEEN)).scenes
    return learn_demonstrated(config, scenes, draw_split(scenes, (), config.tasks, seed), seed)


@lru_cache(maxsize=8)
def _machines(config: Config, seed: int) -> dict[Method, ELMRegressor]:
    _, records = _demonstrated(_only(config, DEMONSTRATED), seed)
    return fit_machines(config, _encoded(_only(config, SEEN)).scenes, records, seed)
