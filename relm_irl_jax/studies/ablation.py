"""What one changed setting changes: a base, named variants of it, and a table of both on the same seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.config import Agent, Config, first_fault, overlay, read_record
from relm_irl_jax.errors import InputError
from relm_irl_jax.report.comparison import OURS, marked, paired
from relm_irl_jax.report.tables import METRIC_NAMES, Cell, by_seed, summarise
from relm_irl_jax.runs import RunFolder, read_all_results, read_table
from relm_irl_jax.studies.study import TASKS, complete, finished

BASE = "base"
"""Name of the runs that variants are compared with."""

METRICS = ("sr", "spl")

BySeed = dict[tuple[str, str], dict[int, float]]
"""Values of each task and metric, by seed."""


@settings_dataclass(frozen=True)
class Variant:
    """One change.

    Attributes:
        title: what is changed, for the table.
        set: the fields to change.
        agents: agents with which it is measured.
        quick: whether the quick run measures it.
    """

    title: str
    set: dict[str, Any] = field(default_factory=dict)
    agents: tuple[Agent, ...] = ("metric",)
    quick: bool = False


@settings_dataclass(frozen=True)
class Ablation:
    """A base configuration and named variants.

    Attributes:
        base: fields of the base that differ from the defaults.
        variants: changes by name.
        agents: further fields of the base for each agent, such as its frames.
    """

    base: dict[str, Any]
    variants: dict[str, Variant]
    agents: dict[Agent, dict[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Measured:
    """One line of the table.

    Attributes:
        agent: the agent.
        name: name of the variant, or `BASE`.
        title: what is changed.
        seeds: number of seeds.
        frames: training frames of each.
        value: mean and interval of each task and metric.
        change: the same, minus the base on the same seeds; empty for the base.
        rank: mean and interval of the median rank of a new target among its scene's states, by predicted reward.
    """

    agent: str
    name: str
    title: str
    seeds: int
    frames: int
    value: Mapping[tuple[str, str], Cell]
    change: Mapping[tuple[str, str], Cell]
    rank: Cell


def load_ablation(path: Path) -> Ablation:
    """Read a base and its variants.

    Args:
        path: a TOML file.

    Returns:
        The ablation, every variant of it checked against the configuration's fields.

    Raises:
        InputError: the file cannot be read, or a field in it is unknown or refused.
    """
    try:
        ablation = TypeAdapter(Ablation).validate_python(read_record(path))
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)}") from error
    for name in (BASE, *ablation.variants):
        for agent in get_args(Agent):
            configure(ablation, name, agent, {}, path)
    return ablation


def configure(ablation: Ablation, name: str, agent: Agent, changes: Mapping[str, Any], folder: Path) -> Config:
    """The configuration of one line of the table.

    Args:
        ablation: base and variants.
        name: name of the variant, or `BASE`.
        agent: the agent.
        changes: fields laid over the base before the variant, such as those of the quick run.
        folder: folder of all runs of the ablation.

    Returns:
        The configuration, with its run folder.

    Raises:
        InputError: there is no such variant, or it sets a field that is unknown or refused.
    """
    if name != BASE and name not in ablation.variants:
        raise InputError(f"variants: there is no {name}; known are {', '.join(ablation.variants)}.")
    config = overlay(Config(), ablation.base, "base")
    config = overlay(config, ablation.agents.get(agent, {}), f"agents.{agent}")
    config = overlay(config, changes, "changes of the base")
    if name != BASE:
        config = overlay(config, ablation.variants[name].set, f"variants.{name}.set")
    return replace(config, agent=agent, run=folder / f"{agent}-{name}")


def run_ablation(ablation: Ablation, names: Sequence[str], changes: Mapping[str, Any], folder: Path) -> None:
    """Run variants and the base of each agent that they are measured with; what is finished is kept.

    Args:
        ablation: base and variants.
        names: variants to run.
        changes: fields laid over the base before each variant.
        folder: folder of all runs of the ablation.
    """
    jobs = [(name, agent) for name in names for agent in ablation.variants[name].agents]
    bases = [(BASE, agent) for agent in dict.fromkeys(agent for _, agent in jobs)]
    for config in [configure(ablation, name, agent, changes, folder) for name, agent in (*bases, *jobs)]:
        complete(config, maps=False)


def measure(ablation: Ablation, changes: Mapping[str, Any], folder: Path) -> list[Measured]:
    """The lines of the table whose runs are finished.

    Args:
        ablation: base and variants.
        changes: fields laid over the base before each variant.
        folder: folder of all runs of the ablation.

    Returns:
        The lines, the base of each agent first.
    """
    lines = []
    for agent in get_args(Agent):
        base: BySeed = {}
        for name in (BASE, *ablation.variants):
            config = configure(ablation, name, agent, changes, folder)
            if not finished(config) or (name != BASE and not base):
                continue
            held = RunFolder(folder / f"{agent}-{name}")
            results = read_all_results(held)
            own: BySeed = {(t, m): by_seed(results[t]["rows"], OURS, m, "mean") for t in TASKS for m in METRICS}
            if name == BASE:
                base = own
            title = "base" if name == BASE else ablation.variants[name].title
            value: dict[tuple[str, str], Cell] = {key: summarise(list(seeds.values())) for key, seeds in own.items()}
            change: dict[tuple[str, str], Cell] = (
                {} if name == BASE else {key: paired(seeds, base[key])[0] for key, seeds in own.items()}
            )
            rank = summarise([_rank(held.rewards(seed, "quality.csv")) for seed in range(config.seeds)])
            lines.append(Measured(agent, name, title, config.seeds, config.frames, value, change, rank))
    return lines


def _rank(path: Path) -> float:
    """Median rank of new targets under our predicted rewards."""
    table = read_table(path)
    return next(
        float(rank)
        for method, targets, rank in zip(table["method"], table["targets"], table["median_rank"], strict=True)
        if (method, targets) == (OURS, "new")
    )


def ablation_columns(lines: Sequence[Measured]) -> dict[str, list]:
    """The table as columns, one row for each line, task and metric.

    Args:
        lines: the lines.

    Returns:
        Columns for `write_table`; the base's change is NaN.
    """
    nothing = Cell(float("nan"), float("nan"))
    rows = []
    for line in lines:
        for (task, metric), value in line.value.items():
            change = line.change.get((task, metric), nothing)
            key = (line.agent, line.name, task, metric)
            cells = (value, change, line.rank)
            spread = [number for cell in cells for number in (cell.mean, cell.half_width)]
            rows.append((*key, *spread, line.seeds, line.frames))
    names = (
        "agent",
        "variant",
        "task",
        "metric",
        "mean",
        "half_width",
        "change",
        "change_half_width",
        "rank",
        "rank_half_width",
        "seeds",
        "frames",
    )
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def ablation_table(lines: Sequence[Measured], metric: str) -> str:
    """The table of one agent and metric; changes whose interval excludes zero are bold.

    Args:
        lines: lines of one agent.
        metric: `sr` or `spl`.

    Returns:
        A Markdown table.
    """
    name = METRIC_NAMES[metric].split()[0]
    head = "| | rank | " + " | ".join(f"Task {task}: {name} | change" for task in TASKS) + " |"
    lines_ = [head, "|---|---:|" + "---:|---:|" * 3]
    for line in lines:
        cells = [line.title, f"{line.rank:.1f}"]
        for task in TASKS:
            cells.append(str(line.value[task, metric]))
            change = line.change.get((task, metric))
            cells.append("" if change is None else marked(change))
        lines_.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines_)
