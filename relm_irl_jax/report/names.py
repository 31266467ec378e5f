"""Names of methods, agents, metrics, tasks and room types in the report."""

import re
from collections.abc import Collection, Sequence

from relm_irl_jax.results import beside_name

METHOD_NAMES = {
    "random": "Random",
    "bc": "BC",
    "rl": "RL",
    "constant": "Control",
    "irl": "IRL",
    "elm-irl": "ELM-IRL",
    "relm-irl": "RELM-IRL",
    beside_name("metric"): "RELM-IRL, metric agent",
    beside_name("map"): "Mapping agent, no learned reward",
}
"""Methods in the order of the tables, then the names of agents beside the run's own."""

METRIC_NAMES = {"ple": "PLE ↓", "sr": "SR ↑", "spl": "SPL ↑"}
"""Metrics in the order of the tables; the arrow shows whether larger or smaller is better."""

AGENT_NAMES = {
    "siamese": "the paper's siamese actor-critic, many workers in lockstep, the synchronous limit of A3C",
    "metric": "an agent that learns distances between views",
    "map": "an agent that draws a map while it searches, at equal costs of all steps and without a learned reward",
    "recurrent": "the paper's siamese actor-critic with a recurrent memory of the episode",
    "savn": "the paper's siamese actor-critic with recurrent memory, which learns to change its weights in an episode",
}
"""Descriptions of agents; for other agents, the report uses their name."""

TASK_NAMES = {
    "I": "trained targets",
    "II": "new targets in the trained scenes",
    "III": "similar targets in unseen scenes",
}
"""Descriptions of the tasks."""

TARGETS_OF_TASK = {"I": "the trained targets", "II": "the new targets", "III": "the targets in unseen scenes"}
"""Targets of the tasks, for sentences."""


MARKUP = re.compile(r"[\\`*\[\]<>|&~$]|(?<!\w)_|_(?!\w)|:(?=//)|@|(?<=www)\.|(?<=^)[#+=-]|!(?=\[)", re.IGNORECASE)
"""Characters that are markup in Markdown, with those that GitHub makes links of."""


def as_text(value: str) -> str:
    """Text of a file (a name, a category, a message) as Markdown that shows the same text and nothing else.

    Args:
        value: the text.

    Returns:
        One line of Markdown.
    """
    return MARKUP.sub(lambda match: f"\\{match[0]}", _one_line(value))


def as_code(value: str) -> str:
    """Text of a file as code, for paths.

    Args:
        value: the text.

    Returns:
        One line of Markdown.
    """
    line = _one_line(value)
    fence = "`" * (1 + max(map(len, re.findall("`+", line)), default=0))
    return f"{fence} {line} {fence}" if "`" in line or not line.strip() else f"{fence}{line}{fence}"


def as_message(value: str) -> str:
    """A message of an error as Markdown: words in single backticks stay code.

    Args:
        value: the message.

    Returns:
        One line of Markdown.
    """
    parts = re.split(r"(`[\w.=/ -]+`)", _one_line(value))
    return "".join(part if number % 2 else as_text(part) for number, part in enumerate(parts))


def _one_line(value: str) -> str:
    """Replace line breaks, other control characters and characters that cannot be encoded by blanks."""
    return "".join(c if c.isprintable() else " " for c in value)


def in_order(methods: Collection[str]) -> list[str]:
    """Methods in the order of the tables; other methods come last."""
    return [name for name in METHOD_NAMES if name in methods] + sorted(set(methods) - set(METHOD_NAMES))


def method_name(method: str) -> str:
    """A method's name in the report; other methods keep their name."""
    return METHOD_NAMES.get(method, method)


def listed(names: Sequence[str]) -> str:
    """Join names for a sentence: `a`, `a and b`, `a, b and c`."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def metric_name(metric: str) -> str:
    """A metric's name without its arrow."""
    return METRIC_NAMES[metric].split()[0]


def heading(column: str) -> str:
    """A room type, or `mean`, as the heading of a column."""
    return column.replace("_", " ").capitalize()


def target_name(target: int, category: str) -> str:
    """A target's state, with its category if it has one."""
    return f"{category} (state {target})" if category else f"state {target}"
