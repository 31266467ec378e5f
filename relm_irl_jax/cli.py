"""The command `relm-irl`."""

import sys
from pathlib import Path
from typing import Annotated

import tyro
from pydantic import ValidationError
from pydantic.dataclasses import dataclass
from rich.console import Console

from relm_irl_jax.config import Config, Task, first_fault, load_config
from relm_irl_jax.errors import InputError
from relm_irl_jax.pipeline import evaluate_run, run
from relm_irl_jax.report.tables import console_table
from relm_irl_jax.runs import find_run, open_run


@dataclass(frozen=True)
class Evaluate:
    """Evaluate the agents of a finished run on a task."""

    run: tyro.conf.Positional[Path]
    """Run folder."""
    task: Task = "II"
    """Task to evaluate."""


def main() -> None:
    """Run the command; exit with code 2 and one sentence where the input cannot be used."""
    try:
        _dispatch(sys.argv[1:])
    except InputError as error:
        _refuse(str(error))
    except ValidationError as error:
        _refuse(first_fault(error))


def _refuse(sentence: str) -> None:
    print(f"relm-irl: {sentence}", file=sys.stderr)
    sys.exit(2)


def _dispatch(arguments: list[str]) -> None:
    """Parse the sub-command and call it."""
    app = tyro.extras.SubcommandApp()
    default, arguments = _default_config(arguments)

    @app.command
    def train(config: Annotated[Config, tyro.conf.arg(name="")] = default) -> None:
        """Train and evaluate; `--config FILE` sets other defaults, and a finished stage is never run twice."""
        results = run(config)
        _show(results, open_run(config).path)

    @app.command
    def evaluate(command: Annotated[Evaluate, tyro.conf.arg(name="")]) -> None:
        """Evaluate the agents of a finished run on a task."""
        folder, config = find_run(command.run)
        _show(evaluate_run(config, folder, command.task), folder.path)

    app.cli(args=arguments, prog="relm-irl", description="Target-driven visual navigation with learned rewards.")


def _default_config(arguments: list[str]) -> tuple[Config, list[str]]:
    """Take `--config FILE` out of the arguments and read the defaults that the file sets."""
    if "--config" not in arguments:
        return Config(), arguments
    place = arguments.index("--config")
    if place + 1 == len(arguments):
        raise InputError("--config: the file is missing; give a TOML file.")
    return load_config(Path(arguments[place + 1])), arguments[:place] + arguments[place + 2 :]


def _show(results: dict, folder: Path) -> None:
    console = Console()
    console.print(console_table(results))
    console.print(f"Report: {folder / 'report.md'}", highlight=False)
