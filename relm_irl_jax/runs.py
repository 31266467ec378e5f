"""The run folder: everything a run leaves behind, and what lets it go on where it stopped.

    config.json                      the configuration as run
    machine.json                     where and when it ran, and how long each stage took
    agents/METHOD-seed-S.safetensors network weights
    curves/METHOD-seed-S.csv         the learning curve
    checkpoints/METHOD-seed-S/       state of a training that is under way (Orbax); gone when it is done
    tensorboard/METHOD-seed-S/       the learning curve for TensorBoard
    rewards/seed-S/                  basis, demonstrated weights, fitted machines, quality of the rewards
    results-TASK.json, results.json  metrics for each task, and of the task evaluated last
    tables/                          the report's tables as CSV
    figures/                         its figures, and what each shows as CSV beside it
    report.html, report.md           all of it for people

Every file appears whole or not at all.
"""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from flax.traverse_util import flatten_dict, unflatten_dict
from safetensors import SafetensorError
from safetensors.numpy import load, save

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.config import Config, Task, config_record, fingerprint, load_config, trained_part
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_bytes

CONFIG_FILE = "config.json"


@dataclass(frozen=True)
class RunFolder:
    """A run folder.

    Attributes:
        path: the folder.
    """

    path: Path

    def file(self, *parts: str) -> Path:
        """Path of a file in the folder; its parent folders are created."""
        path = self.path.joinpath(*parts)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def agent(self, method: str, seed: int) -> Path:
        """Path of a trained network."""
        return self.file("agents", f"{method}-seed-{seed}.safetensors")

    def curve(self, method: str, seed: int) -> Path:
        """Path of a learning curve."""
        return self.file("curves", f"{method}-seed-{seed}.csv")

    def checkpoints(self, method: str, seed: int) -> Path:
        """Folder of a training's checkpoints."""
        return self.path / "checkpoints" / f"{method}-seed-{seed}"

    def scalars(self, method: str, seed: int) -> Path:
        """Folder of a training's scalars for TensorBoard."""
        return self.path / "tensorboard" / f"{method}-seed-{seed}"

    def rewards(self, seed: int, name: str) -> Path:
        """Path of a file on learned rewards."""
        return self.file("rewards", f"seed-{seed}", name)


def open_run(config: Config) -> RunFolder:
    """Create the run folder of a configuration, or find it again.

    Args:
        config: the configuration.

    Returns:
        The folder, with its `config.json`.

    Raises:
        InputError: the folder holds a run of another configuration, or something that is no run.
    """
    source = Path(config.scenes).name
    path = config.run or Path("runs") / f"{source}-{fingerprint(config)}"
    folder = RunFolder(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"run: {path} is a file; give a folder.")
    if (path / CONFIG_FILE).exists():
        before, now = trained_part(load_config(path / CONFIG_FILE)), trained_part(config)
        changed = [key for key in now if now[key] != before.get(key)]
        if changed:
            key = changed[0]
            raise InputError(
                f"run: {path} holds agents trained with {key} = {before.get(key)}, not {now[key]}; "
                "give another run folder, or the same configuration."
            )
    elif path.exists() and any(path.iterdir()):
        raise InputError(f"run: {path} is not empty and holds no {CONFIG_FILE}; give a new or empty folder.")
    write_json(folder.file(CONFIG_FILE), config_record(config))
    return folder


def find_run(path: Path) -> tuple[RunFolder, Config]:
    """Open a finished run.

    Args:
        path: the folder.

    Returns:
        The folder and the configuration as run.

    Raises:
        InputError: there is no run in the folder.
    """
    if not (path / CONFIG_FILE).is_file():
        raise InputError(f"run: {path} holds no {CONFIG_FILE}; give the folder of a run made by `relm-irl train`.")
    return RunFolder(path), load_config(path / CONFIG_FILE)


def read_results(folder: RunFolder) -> dict[str, Any]:
    """Read the metrics of the task evaluated last.

    Args:
        folder: the run folder.

    Returns:
        Contents of `results.json`.

    Raises:
        InputError: nothing was evaluated yet, or the file is damaged.
    """
    path = folder.path / "results.json"
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); run `relm-irl evaluate {folder.path}`.") from error


def read_all_results(folder: RunFolder) -> dict[str, dict[str, Any]]:
    """Read the metrics of every task evaluated.

    Args:
        folder: the run folder.

    Returns:
        Contents of each `results-TASK.json`, by task.

    Raises:
        InputError: nothing was evaluated yet, or a file is damaged.
    """
    found = {}
    for task in get_args(Task):
        path = folder.path / f"results-{task}.json"
        if path.exists():
            try:
                found[task] = json.loads(path.read_text())
            except ValueError as error:
                raise InputError(f"{path}: cannot be read ({error}); remove it and evaluate again.") from error
    if not found:
        raise InputError(f"{folder.path}: holds no results; run `relm-irl evaluate {folder.path}`.")
    return found


def write_json(path: Path, value: Any) -> None:
    """Write plain values as JSON.

    Args:
        path: the file.
        value: what it shall hold.
    """
    write_bytes(path, (json.dumps(value, indent=1) + "\n").encode())


def write_table(path: Path, columns: Mapping[str, Sequence | np.ndarray]) -> None:
    """Write named columns of equal length as CSV.

    Args:
        path: the file.
        columns: values by name.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([str(value) for value in row] for row in zip(*columns.values(), strict=True))
    write_bytes(path, text.getvalue().encode())


def read_table(path: Path) -> dict[str, list[str]]:
    """Read the columns of a CSV file.

    Args:
        path: the file.

    Returns:
        Texts by column name.
    """
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: [row[key] for row in rows] for key in rows[0]} if rows else {}


def save_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays as safetensors.

    Args:
        path: the file.
        arrays: arrays by name.
    """
    write_bytes(path, save({key: np.ascontiguousarray(value) for key, value in arrays.items()}))


def save_parameters(path: Path, parameters: Parameters) -> None:
    """Write a network's parameters as safetensors.

    Args:
        path: the file.
        parameters: nested dictionaries of arrays.
    """
    save_arrays(path, {key: np.asarray(value) for key, value in flatten_dict(parameters, sep="/").items()})


def load_parameters(path: Path) -> Parameters:
    """Read a network's parameters.

    Args:
        path: the file.

    Returns:
        Nested dictionaries of arrays.

    Raises:
        InputError: the file is damaged.
    """
    return unflatten_dict(load_arrays(path), sep="/")


def load_arrays(path: Path) -> dict[str, np.ndarray]:
    """Read arrays.

    Args:
        path: the file.

    Returns:
        Arrays by name.

    Raises:
        InputError: the file is damaged.
    """
    try:
        return load(path.read_bytes())
    except (SafetensorError, OSError) as error:
        raise InputError(f"{path}: cannot be read ({error}); remove it to train the agent again.") from error
