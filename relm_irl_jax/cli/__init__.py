"""The command `relm-irl`: what it reads, and how it ends. Each of its commands has a module of its name."""

import difflib
import sys
from importlib import import_module
from typing import Annotated, Any

from relm_irl_jax.errors import InputError
from relm_irl_jax.exits import errors_as_sentences
from relm_irl_jax.help_pages import COMMANDS, HELP, overview


def main() -> None:
    """Run the command; for unusable input, print one sentence and exit with code 2."""
    if sys.argv[1:] == ["--version"]:
        from relm_irl_jax import __version__

        print(f"relm-irl-jax {__version__}")
        return
    with errors_as_sentences("relm-irl"):
        _dispatch(sys.argv[1:])


def _dispatch(arguments: list[str]) -> None:
    """Parse and run the command."""
    if not arguments or arguments[0] in HELP:
        print(overview())
        sys.exit(0 if arguments else 2)
    name, rest = arguments[0], arguments[1:]
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, 1)
        meant = f"did you mean {near[0]}? " if near else ""
        raise InputError(f"there is no command {name}; {meant}`relm-irl --help` lists the commands.")
    if name == "train":  # it reads files before its arguments, and has its own help
        from relm_irl_jax.cli.train import execute

        execute(rest)
        return
    import tyro

    kind = _arguments_of(name)

    # A function, so that refused values raise here instead of ending the process within the parser.
    def parsed(command: Annotated[kind, tyro.conf.arg(name="")]) -> Any:  # pyrefly: ignore
        return command

    command = tyro.cli(parsed, args=rest, prog=f"relm-irl {name}", description=COMMANDS[name])
    # What a command does is imported when it does it, so that help is quick.
    from relm_irl_jax.registration import register_environments

    register_environments()
    import_module(f"relm_irl_jax.cli.{name}").execute(command)


def _arguments_of(name: str) -> Any:
    """The type that holds a command's arguments; those of scenes and encoders load more."""
    if name in ("scenes", "encoder"):
        from relm_irl_jax.commands_of_scenes import Checked, Exported, Generated, ShownEncoder, TrainedEncoder

        return {"scenes": Generated | Checked | Exported, "encoder": TrainedEncoder | ShownEncoder}[name]
    from relm_irl_jax.commands import Bench, Evaluate, Play, Record, Report

    return {"evaluate": Evaluate, "report": Report, "play": Play, "demonstrations": Record, "bench": Bench}[name]
