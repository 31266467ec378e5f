"""The configuration of a run folder: its first run writes it, and later ones must agree with it."""

from pathlib import Path

from relm_irl_jax.config import Config, config_to_dict, fingerprint, load_config, trained_part
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_json
from relm_irl_jax.run_folder import RunFolder


def open_run(config: Config) -> RunFolder:
    """Create the run folder of a configuration, or find it again.

    Args:
        config: the configuration.

    Returns:
        The folder, with its `config.json`.

    Raises:
        InputError: the folder holds a run of another configuration, or something that is no run.
    """
    path = config.run or Path("runs") / f"{Path(config.scenes).name}-{fingerprint(config)}"
    folder = RunFolder(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"run: {path} is a file; give a folder.")
    if folder.config.exists():
        before, now = trained_part(load_config(folder.config)), trained_part(config)
        changed = [key for key in now if now[key] != before.get(key)]
        if changed:
            key = changed[0]
            raise InputError(
                f"run: {path} holds agents trained with {key} = {before.get(key)}, not {now[key]}; "
                "give another run folder, or the same configuration."
            )
    elif path.exists() and any(path.iterdir()):
        raise InputError(f"run: {path} is not empty and holds no {folder.config.name}; give a new or empty folder.")
    write_json(folder.config, config_to_dict(config))
    return folder


def find_run(path: Path) -> tuple[RunFolder, Config]:
    """Open the folder of a run.

    Args:
        path: the folder.

    Returns:
        The folder and the configuration as run.

    Raises:
        InputError: there is no run in the folder.
    """
    folder = RunFolder(path)
    if not folder.config.is_file():
        raise InputError(
            f"run: {path} holds no {folder.config.name}; give the folder of a run made by `relm-irl train`."
        )
    return folder, load_config(folder.config)
