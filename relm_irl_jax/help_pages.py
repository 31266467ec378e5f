"""Help of the command `relm-irl`: a page for an overview, and for `train` a page for each group of settings."""

import contextlib
import io
import re
from dataclasses import dataclass, fields, is_dataclass, make_dataclass
from typing import Annotated, Any

from relm_irl_jax.errors import InputError

COMMANDS = {
    "train": "Train agents and evaluate them on a task.",
    "evaluate": "Evaluate the agents of a run on a task, or add your own policy to its tables.",
    "report": "Write the report of a run again.",
    "play": "Save animations of an agent (GIF files in the run folder), or navigate by keyboard.",
    "demonstrations": "Write demonstrations of a run, the expert's or an agent's: JSON lines, Minari, imitation.",
    "scenes": "Generate built-in rooms as scene files, record scenes of other simulators, or check scene files.",
    "encoder": "Train the small encoder on generated rooms or your own scenes, or show how weights were trained.",
    "bench": "Measure speed on this computer.",
}
"""Every command, and what it does."""

HELP = ("-h", "--help")
"""Options that ask for help."""

TRAIN = """Train agents and evaluate them on a task.

`--config FILE` reads other defaults from a TOML file, or from a preset such as `metric`. `--resume RUN` continues a run
with the configuration in its folder. Agents that are already trained are not trained again, and an interrupted training
continues from its last checkpoint."""

TITLE = re.compile(r"^ (?:(?P<group>[\w.-]+) )?options *\n -+ *\n", re.MULTILINE)
"""First lines of a section in tyro's help, as it is written to text that is no terminal."""

OPTION = re.compile(r"^(?=  -)|\n(?=  -)")
"""Start of an option in a section."""

RULE = re.compile(r"^  -+ *\n", re.MULTILINE)
"""Line below the description of a section."""


def overview() -> str:
    """The commands.

    Returns:
        The text of `relm-irl --help`.
    """
    width = max(map(len, COMMANDS))
    lines = [f"  {name:{width}}  {text}" for name, text in COMMANDS.items()]
    return "\n".join(
        [
            "usage: relm-irl COMMAND [OPTIONS]",
            "",
            "Target-driven visual navigation with learned rewards.",
            "",
            *lines,
            "",
            "`relm-irl COMMAND --help` lists a command's options; `relm-irl --version` prints the version.",
        ]
    )


def train_help(config: type[Any], topic: str | None) -> str:
    """Help of `relm-irl train`: the general options and the groups of settings, or the options of one group.

    Args:
        config: the class of configurations.
        topic: a group, `all`, or None. Other options are no topic.

    Returns:
        The text.

    Raises:
        InputError: there is no such group.
    """
    groups = [field.name for field in fields(config) if is_dataclass(field.default)]
    if topic is None or topic.startswith("-"):
        general, descriptions = _overview_sections(config, groups)
        listed = [f"  {name:12} {text}" for name, text in descriptions.items()]
        return "\n".join(
            [
                "usage: relm-irl train [OPTIONS]",
                "",
                TRAIN,
                "",
                general,
                "",
                "Groups of settings, --GROUP.SETTING; `relm-irl train --help GROUP` describes one, `--help all` all:",
                "",
                *listed,
            ]
        )
    if topic != "all" and topic not in groups:
        raise InputError(f"help: there is no group {topic}; give all or one of {', '.join(groups)}.")
    sections = _sections(config if topic == "all" else _without(config, [name for name in groups if name != topic]))
    shown = [section for name, section in sections.items() if topic in ("all", name.split(".")[0])]
    return "\n\n".join(f"{section.description}\n\n{section.options}".lstrip("\n") for section in shown)


@dataclass(frozen=True)
class _Section:
    """A section of the parser's help.

    Attributes:
        description: what the group of settings is; empty for the general options.
        options: its options.
    """

    description: str
    options: str


def _without(config: type[Any], groups: list[str]) -> type[Any]:
    """The configuration with one option in place of each of some groups: reading their settings takes tyro longer than
    the rest of the help. The option is long, so that tyro writes descriptions below names, as in the help of all."""
    import tyro

    bare = Annotated[str, tyro.conf.arg(metavar="-" * 48, help_behavior_hint="")]
    return make_dataclass(config.__name__, [(name, bare, "") for name in groups], bases=(config,), frozen=True)


def _overview_sections(config: type[Any], groups: list[str]) -> tuple[str, dict[str, str]]:
    """The general options, and the description of each group."""
    _, *options = OPTION.split("\n" + _sections(_without(config, groups))[""].options)
    of_group = {option.split()[0].removeprefix("--"): option for option in options}
    general = [option for name, option in of_group.items() if name not in groups]
    return "\n".join(general), {name: _joined(of_group[name].split("\n", 1)[1]) for name in groups}


def _sections(config: type[Any]) -> dict[str, _Section]:
    """Sections of the parser's help by group; that of the general options is first and has no name."""
    import tyro

    text = io.StringIO()
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(text):
        tyro.cli(config, args=["--help"], prog="relm-irl train")
    _, *parts = TITLE.split(text.getvalue())
    sections = {}
    for group, body in zip(parts[::2], parts[1::2], strict=True):
        description, rule, options = RULE.split(body, 1)[0], RULE.search(body), RULE.split(body, 1)[-1]
        lines = [line.rstrip() for line in options.splitlines()]
        sections[group or ""] = _Section(_joined(description) if rule else "", "\n".join(lines).strip("\n"))
    return sections


def _joined(text: str) -> str:
    return " ".join(text.split())
