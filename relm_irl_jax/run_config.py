"""The configuration of a run folder: the first run writes it, and later runs must agree with it.

One process at a time writes to a run folder.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree

from filelock import FileLock, Timeout

from relm_irl_jax.config import Config, config_from_dict, config_to_dict, fingerprint, read_fields, trained_part
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import checksum_of, remove_partial_files, write_json
from relm_irl_jax.inputs import refuse_device
from relm_irl_jax.run_folder import RunFolder

NEEDED = ("methods", "scenes", "seeds", "frames", "agent")
"""Fields that the configuration of a run always has; without them, the file is not one that a run wrote."""


@contextmanager
def locked(folder: RunFolder) -> Iterator[None]:
    """Keep other processes from writing to a run folder while a block runs.

    Args:
        folder: the run folder; created if missing.

    Yields:
        Nothing.

    Raises:
        InputError: another process writes to the folder.
    """
    if folder.path.exists() and not folder.path.is_dir():
        raise InputError(f"run: {folder.path} is a file; give a folder.")
    folder.path.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder.lock.absolute(), timeout=0, is_singleton=True)
    try:
        lock.acquire()
    except Timeout as error:
        raise InputError(
            f"run: another process is writing to {folder.path}; wait until it ends, or give another run folder."
        ) from error
    try:
        yield
    finally:
        lock.release()


@contextmanager
def opened_run(config: Config) -> Iterator[RunFolder]:
    """Open the run folder of a configuration for writing; no other process can write to it while a block runs.

    The processes of a cluster may share the folder.

    Args:
        config: the configuration.

    Yields:
        The folder.

    Raises:
        InputError: see `locked` and `open_run`.
    """
    if config.cluster.processes > 1:
        yield open_run(config)
        return
    folder = RunFolder(run_path(config))
    with locked(folder):
        open_run(config)
        remove_partial_files(folder.path)
        for checkpoints in folder.finished_checkpoints():
            rmtree(checkpoints, ignore_errors=True)
        yield folder


def run_path(config: Config) -> Path:
    """Path of the run folder of a configuration.

    Args:
        config: the configuration.

    Returns:
        The path.
    """
    if config.run:
        return config.run
    recorded = _recorded(config)
    return Path("runs") / f"{Path(config.scenes).name}-{fingerprint(config, recorded.get('sha256', ''))}"


def open_run(config: Config) -> RunFolder:
    """Create the run folder of a configuration, or open the existing one.

    Args:
        config: the configuration.

    Returns:
        The folder, with its `config.json`.

    Raises:
        InputError: the folder contains a run of another configuration, or something other than a run; or the file of
            recorded demonstrations is not the one of its first training.
    """
    folder = RunFolder(run_path(config))
    path = folder.path
    if path.exists() and not path.is_dir():
        raise InputError(f"run: {path} is a file; give a folder.")
    if folder.config.exists():
        old, new = trained_part(load_run_config(folder)), trained_part(config)
        changed = [key for key in new if new[key] != old.get(key)]
        if changed:
            key = changed[0]
            raise InputError(
                f"run: {path} contains agents trained with {key} = {old.get(key)}, not {new[key]}; "
                "give another run folder, or the same configuration."
            )
    elif path.exists() and any(not file.name.startswith(".") for file in path.iterdir()):
        raise InputError(f"run: {path} is not empty and contains no {folder.config.name}; give a new or empty folder.")
    check_demonstrations(config, folder)
    write_json(folder.config, config_to_dict(config))
    if recorded := _recorded(config):
        write_json(folder.demonstrations, recorded)
    return folder


def check_demonstrations(config: Config, folder: RunFolder) -> None:
    """Refuse a file of recorded demonstrations that has changed since the run's first training.

    Args:
        config: the configuration.
        folder: the run folder.

    Raises:
        InputError: the file has other contents than it had, or is missing.
    """
    recorded = _recorded(config)
    if not recorded or not folder.demonstrations.exists():
        return
    if read_fields(folder.demonstrations).get("sha256") != recorded["sha256"]:
        raise InputError(
            f"irl.demonstrations: {config.irl.demonstrations} is not the file that the rewards in {folder.path} were "
            "learned from; restore that file, or give another run folder."
        )


def _recorded(config: Config) -> dict[str, str]:
    """Name and checksum of the file of recorded demonstrations; empty without one."""
    path = config.irl.demonstrations
    if path is None:
        return {}
    refuse_device(path)
    try:
        return {"file": str(path), "sha256": checksum_of(path)}
    except FileNotFoundError as error:
        raise InputError(f"irl.demonstrations: {path}: no such file; give a file of demonstrations.") from error


def find_run(path: Path) -> tuple[RunFolder, Config]:
    """Open the folder of a run.

    Args:
        path: the folder.

    Returns:
        The folder and the configuration as run.

    Raises:
        InputError: the folder contains no run.
    """
    folder = RunFolder(path)
    if not folder.config.is_file():
        raise InputError(
            f"run: {path} contains no {folder.config.name}; give the folder of a run made by `relm-irl train`."
        )
    return folder, load_run_config(folder)


def load_run_config(folder: RunFolder) -> Config:
    """Read the configuration of a run.

    Args:
        folder: the run folder.

    Returns:
        The configuration as run.

    Raises:
        InputError: the file is not one that a run wrote.
    """
    fields = read_fields(folder.config)
    missing = [name for name in NEEDED if name not in fields]
    if missing:
        raise InputError(f"{folder.config}: `{missing[0]}` is missing; restore the file, or give another run folder.")
    return config_from_dict(fields, str(folder.config))
