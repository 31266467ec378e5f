"""One run on all three tasks, kept where it is finished."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import get_args

from relm_irl_jax.config import Config, Task, config_record, load_config, overlay, read_record
from relm_irl_jax.errors import InputError
from relm_irl_jax.pipeline import run
from relm_irl_jax.progress import console
from relm_irl_jax.runs import CONFIG_FILE, RunFolder, read_all_results
from relm_irl_jax.stages.encoding import EncodedScenes, encode_training

TASKS: tuple[Task, ...] = get_args(Task)


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
    return run(config, TASKS, _encoded(replace(Config(), **_scene_fields(config))), maps=maps)


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


def _scene_fields(config: Config) -> dict:
    return {"scenes": config.scenes, "scene": config.scene, "encoder": config.encoder}


@lru_cache(maxsize=1)
def _encoded(scenes: Config) -> EncodedScenes:
    """Training scenes, encoded once for all runs that share them."""
    return encode_training(scenes)
