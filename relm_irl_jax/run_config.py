"""The configuration of a run folder: the first run writes it, and later runs must agree with it."""

from pathlib import Path

from relm_irl_jax.config import Config, config_to_dict, fingerprint, load_config, trained_part
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_json
from relm_irl_jax.run_folder import RunFolder


def open_run(config: Config) -> RunFolder:
    """Create the run folder of a configuration, or open the existing one.

    Args:
        config: the configuration.

    Returns:
        The folder, with its `config.json`.

    Raises:
        InputError: the folder contains a run of another configuration, or something other than a run.
    """
    path = config.run or Path("runs") / f"{Path(config.scenes).name}-{fingerprint(config)}"
    folder = RunFolder(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"run: {path} is a file; give a folder.")
    if folder.config.exists():
        old, new = trained_part(load_config(folder.config)), trained_part(config)
        changed = [key for key in new if new[key] != old.get(key)]
        if changed:
            key = changed[0]
            raise InputError(
                f"run: {path} contains agents trained with {key} = {old.get(key)}, not {new[key]}; "
                "give another run folder, or the same configuration."
            )
    elif path.exists() and any(path.iterdir()):
        raise InputError(f"run: {path} is not empty and contains no {folder.config.name}; give a new or empty folder.")
    write_json(folder.config, config_to_dict(config))
    return folder


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
    return folder, load_config(folder.config)
