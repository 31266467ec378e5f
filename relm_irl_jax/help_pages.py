"""Help of the command `relm-irl`: a page for an overview, and for `train` a page for each group of settings."""

import contextlib
import io
import re
from dataclasses import dataclass
from typing import Any

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

TRAIN = """Train agents and evaluate them on a task.

`--config FILE` reads other defaults from a TOML file, or from a preset such as `metric`. `--resume RUN` continues a run
with the configuration in its folder. Agents that are already trained are not trained again, and an interrupted training
continues from its last checkpoint."""

TITLE = re.compile(r"^ (?:(?P<group>[\w.-]+) )?options *\n -+ *\n", re.MULTILINE)
"""First lines of a section in tyro's help, as it is written to text that is no terminal."""

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
    sections = _sections(config)
    groups = list(dict.fromkeys(name.split(".")[0] for name in sections if name))
    if topic is None or topic.startswith("-"):
        listed = [f"  {name:12} {sections[name].description}" for name in groups]
        return "\n".join(
            [
                "usage: relm-irl train [OPTIONS]",
                "",
                TRAIN,
                "",
                sections[""].options,
                "",
                "Groups of settings, --GROUP.SETTING; `relm-irl train --help GROUP` describes one, `--help all` all:",
                "",
                *listed,
            ]
        )
    if topic != "all" and topic not in groups:
        raise InputError(f"help: there is no group {topic}; give all or one of {', '.join(groups)}.")
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
