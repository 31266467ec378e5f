"""The command `relm-irl train`."""

import gc
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from relm_irl_jax.errors import InputError
from relm_irl_jax.help_pages import COMMANDS, HELP, train_help
from relm_irl_jax.interruption import Resume

if TYPE_CHECKING:
    from relm_irl_jax.config import Config


def execute(arguments: list[str]) -> None:
    """Train agents and evaluate them on a task.

    Args:
        arguments: those of the command line after `train`.
    """
    for option in HELP:
        if option in arguments:
            position = arguments.index(option)
            _help(arguments[position + 1] if position + 1 < len(arguments) else None)
            return
    import tyro

    from relm_irl_jax.config import Config

    default, arguments = default_config(arguments)

    def parsed(config: Annotated[Config, tyro.conf.arg(name="")] = default) -> Config:
        return config

    config = tyro.cli(parsed, args=arguments, prog="relm-irl train", description=COMMANDS["train"])
    # What trains is imported after the arguments are read, since it takes seconds.
    from relm_irl_jax.run_config import run_path

    Resume.run = run_path(config.resolved())
    from relm_irl_jax.cli.output import show_results
    from relm_irl_jax.pipeline import run
    from relm_irl_jax.registration import register_environments
    from relm_irl_jax.results import load_results

    register_environments()
    folder = run(config)
    show_results(load_results(folder), folder.path)


def _help(topic: str | None) -> None:
    gc.disable()  # collecting garbage, above all while settings are imported, takes an eighth of the time of help
    try:
        from relm_irl_jax.config import Config

        print(train_help(Config, topic))
    finally:
        gc.enable()


def default_config(arguments: list[str]) -> "tuple[Config, list[str]]":
    """Remove `--config FILE` or `--resume RUN` from the arguments of `train`, and read the configuration."""
    from relm_irl_jax.config import Config, load_config

    file, arguments = _pop_option(arguments, "--config", "file", "a TOML file")
    run, arguments = _pop_option(arguments, "--resume", "folder", "the folder of a run made by `relm-irl train`")
    if file and run:
        raise InputError("--resume: the run already has a configuration; leave out --config.")
    if run:
        from relm_irl_jax.run_config import find_run

        folder, config = find_run(Path(run))
        return replace(config, run=folder.path), arguments
    return load_config(_preset(file)) if file else Config(), arguments


def _preset(name: str) -> Path:
    """The file of a preset that is given by its name, such as `metric`; any other name is that of a file."""
    package = Path(__file__).parents[1]
    for folder in (package / "presets", package.parent / "experiments"):
        if not Path(name).exists() and (folder / f"{name}.toml").is_file():
            return folder / f"{name}.toml"
    return Path(name)


def _pop_option(arguments: list[str], option: str, kind: str, remedy: str) -> tuple[str | None, list[str]]:
    """Remove an option and its value from the arguments."""
    if option not in arguments:
        return None, arguments
    position = arguments.index(option)
    if position + 1 == len(arguments):
        raise InputError(f"{option}: the {kind} is missing; give {remedy}.")
    return arguments[position + 1], arguments[:position] + arguments[position + 2 :]
