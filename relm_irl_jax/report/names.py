"""What the report calls methods, agents, metrics, tasks and room types."""

from collections.abc import Collection, Sequence

METHOD_NAMES = {"random": "Random", "bc": "BC", "rl": "RL", "irl": "IRL", "elm-irl": "ELM-IRL", "relm-irl": "RELM-IRL"}
"""Methods in the order of the tables."""

METRIC_NAMES = {"ple": "PLE ↓", "sr": "SR ↑", "spl": "SPL ↑"}
"""Metrics in the order of the tables, and whether more or less of them is better."""

AGENT_NAMES = {
    "siamese": "the paper's siamese actor-critic, many workers in lockstep, the synchronous limit of A3C",
    "metric": "an agent that learns distances between views, instead of the paper's siamese actor-critic",
}
"""Agents that the report describes; others by their name alone."""

TASK_NAMES = {
    "I": "trained targets",
    "II": "new targets in the trained scenes",
    "III": "similar targets in unseen scenes",
}
"""What is asked of an agent in each task."""


def in_order(methods: Collection[str]) -> list[str]:
    """Methods in the order of the tables, those that the paper does not know last."""
    return [name for name in METHOD_NAMES if name in methods] + sorted(set(methods) - set(METHOD_NAMES))


def method_name(method: str) -> str:
    """A method's name; of methods that the paper does not know, as it is."""
    return METHOD_NAMES.get(method, method)


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: `a`, `a and b`, `a, b and c`."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def metric_name(metric: str) -> str:
    """A metric's name without its arrow."""
    return METRIC_NAMES[metric].split()[0]


def heading(column: str) -> str:
    """A room type, or `mean`, as the heading of a column."""
    return column.replace("_", " ").capitalize()


def target_name(target: int, category: str) -> str:
    """A target by its category, where it has one, and its state."""
    return f"{category} (state {target})" if category else f"state {target}"
