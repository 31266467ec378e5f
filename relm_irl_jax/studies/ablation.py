"""Ablations: a base configuration, named variants of it, and tables of their differences on the same seeds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import isnan
from pathlib import Path
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.config import AgentName, Config, Method, overlay, read_fields, trained_part
from relm_irl_jax.errors import InputError, first_fault
from relm_irl_jax.files import columns_of_rows, write_bytes
from relm_irl_jax.report.comparison import markdown_difference
from relm_irl_jax.report.intervals import MeanInterval, mean_interval, paired_difference
from relm_irl_jax.report.names import metric_name
from relm_irl_jax.report.tables import MEAN, by_seed
from relm_irl_jax.results import TASKS, Task, load_all_results, load_reward_quality
from relm_irl_jax.run_config import opened_run
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.stages.make_agent import training_rooms_count
from relm_irl_jax.studies.study import complete_run, complete_runs, is_finished, mark_unfinished

BASE = "base"
"""Name of the runs with which variants are compared."""

COMPARED_METRICS = ("sr", "spl")
"""What the rows of a study are compared by: success rate, and success weighted by path length."""

BySeed = dict[tuple[str, str], dict[int, float]]
"""Values of each task and metric, by seed."""


@settings_dataclass(frozen=True)
class Variant:
    """A variant of the base.

    Attributes:
        title: description of the change, for the table.
        set: the fields to change.
        agents: agents with which the variant is run.
        quick: whether the quick study includes the variant.
        trained_by: name of the variant, or `BASE`, whose trained agents are evaluated instead of training others; empty
            to train. The two may differ in their evaluation alone.
        line: what its line adds to the agent's name in a figure over the number of training rooms.
        method: the method whose metrics the variant's row shows; the ablation's if none is given.
    """

    title: str
    set: dict[str, Any] = field(default_factory=dict)
    agents: tuple[AgentName, ...] = ("metric",)
    quick: bool = False
    trained_by: str = ""
    line: str = ""
    method: Method | None = None


@settings_dataclass(frozen=True)
class Ablation:
    """A base configuration and named variants.

    Attributes:
        base: fields of the base that differ from the defaults.
        variants: the variants by name.
        agents: further fields of the base for each agent, such as its frames.
        method: the method whose metrics are compared, where a variant does not name another.
        tasks: the tasks that are evaluated.
        title: description of the base, for the table.
    """

    base: dict[str, Any]
    variants: dict[str, Variant]
    agents: dict[AgentName, dict[str, Any]] = field(default_factory=dict)
    method: Method = "relm-irl"
    tasks: tuple[Task, ...] = TASKS
    title: str = "base"


@dataclass(frozen=True, kw_only=True)
class AblationRow:
    """One row of the table.

    Attributes:
        agent: the agent.
        name: name of the variant, or `BASE`.
        title: description of the change.
        seeds: number of seeds.
        frames: training frames of each seed.
        by_seed: values of each task and metric, by seed.
        change: paired difference from the base on the same seeds; empty for the base, and where the base is missing.
        rank: mean and interval of the median rank of a new target among its scene's states, by predicted reward.
        rooms: number of training rooms, if they are built-in ones.
        line: the row's name in a figure over the number of training rooms.
    """

    agent: str
    name: str
    title: str
    seeds: int
    frames: int
    by_seed: BySeed
    change: Mapping[tuple[str, str], MeanInterval]
    rank: MeanInterval
    rooms: int
    line: str

    @cached_property
    def value(self) -> dict[tuple[str, str], MeanInterval]:
        """Mean and interval of each task and metric."""
        return {key: mean_interval(list(seeds.values())) for key, seeds in self.by_seed.items()}


def load_ablation(path: Path) -> Ablation:
    """Read an ablation.

    Args:
        path: a TOML file.

    Returns:
        The ablation; all variants are checked.

    Raises:
        InputError: the file cannot be read, or a field in it is unknown or refused.
    """
    try:
        ablation = TypeAdapter(Ablation).validate_python(read_fields(path))
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)}") from error
    for name in (BASE, *ablation.variants):
        for agent in get_args(AgentName):
            variant_config(ablation, name, agent, {}, path)
    return ablation


def variant_config(ablation: Ablation, name: str, agent: AgentName, changes: Mapping[str, Any], folder: Path) -> Config:
    """The configuration of one row of the table.

    Args:
        ablation: base and variants.
        name: name of the variant, or `BASE`.
        agent: the agent.
        changes: changes of the base that are applied before the variant, such as those of the quick study.
        folder: folder of all runs of the ablation.

    Returns:
        The configuration, with its run folder.

    Raises:
        InputError: there is no such variant, or it sets a field that is unknown or refused.
    """
    if name != BASE and name not in ablation.variants:
        raise InputError(f"variants: there is no {name}; known variants: {', '.join(ablation.variants)}.")
    config = overlay(Config(), ablation.base, "base")
    config = overlay(config, ablation.agents.get(agent, {}), f"agents.{agent}")
    config = overlay(config, changes, "changes of the base")
    if name != BASE:
        config = overlay(config, ablation.variants[name].set, f"variants.{name}.set")
    return replace(config, agent=agent, run=folder / f"{agent}-{name}")


def run_ablation(ablation: Ablation, names: Sequence[str], changes: Mapping[str, Any], folder: Path) -> None:
    """Run variants and the base for each of their agents; finished runs are not repeated.

    Args:
        ablation: base and variants.
        names: variants to run.
        changes: changes of the base that are applied before each variant.
        folder: folder of all runs of the ablation.
    """
    variants = [(name, agent) for name in names for agent in ablation.variants[name].agents]
    bases = [(BASE, agent) for agent in dict.fromkeys(agent for _, agent in variants)]
    complete = partial(complete_run, tasks=ablation.tasks, maps=False)
    evaluated = [(name, agent) for name, agent in variants if ablation.variants[name].trained_by]
    sources = [(ablation.variants[name].trained_by, agent) for name, agent in evaluated]
    trained = dict.fromkeys((*bases, *sources, *(run for run in variants if run not in evaluated)))
    complete_runs([variant_config(ablation, name, agent, changes, folder) for name, agent in trained], complete)
    pairs = [
        tuple(variant_config(ablation, name, agent, changes, folder) for name in (source, variant))
        for (source, agent), (variant, _) in zip(sources, evaluated, strict=True)
    ]
    complete_runs(pairs, partial(_complete_with_agents, complete, ablation.tasks))


def _complete_with_agents(
    complete: Callable[[Config], None], tasks: Sequence[Task], pair: tuple[Config, Config]
) -> None:
    """Complete a run with the trained agents of another one."""
    source, config = pair
    if trained_part(source) != trained_part(config):
        raise InputError(f"{config.run}: differs from {source.run} in more than its evaluation; let it train agents.")
    assert source.run is not None
    if not is_finished(config, tasks):
        mark_unfinished(config)
        with opened_run(config.resolved()) as folder:
            for path in sorted((source.run / name) for name in ("agents", "curves")):
                for file in sorted(path.iterdir()):
                    write_bytes(folder.path / path.name / file.name, file.read_bytes())
    complete(config)


def ablation_rows(ablation: Ablation, changes: Mapping[str, Any], folder: Path) -> list[AblationRow]:
    """The rows of all finished runs, of each variant for its agents.

    Args:
        ablation: base and variants.
        changes: changes of the base that are applied before each variant.
        folder: folder of all runs of the ablation.

    Returns:
        The rows, the base of each agent first, if it is finished.
    """
    rows = []
    for agent in get_args(AgentName):
        base: BySeed = {}
        for name in (BASE, *ablation.variants):
            config = variant_config(ablation, name, agent, changes, folder)
            of_agent = name == BASE or agent in ablation.variants[name].agents
            if not (of_agent and is_finished(config, ablation.tasks)):
                continue
            run = RunFolder(folder / f"{agent}-{name}")
            method = (name != BASE and ablation.variants[name].method) or ablation.method
            results = load_all_results(run)
            values_by_seed: BySeed = {
                (task, metric): by_seed(results[task].rows, method, metric, MEAN)
                for task in ablation.tasks
                for metric in COMPARED_METRICS
            }
            if name == BASE:
                base = values_by_seed
            title = ablation.title if name == BASE else ablation.variants[name].title
            compared = base if name != BASE else {}
            change = {key: paired_difference(values_by_seed[key], seeds)[0] for key, seeds in compared.items()}
            rank = mean_interval([_rank_of_new_targets(run, method, seed) for seed in range(config.seeds)])
            rows.append(
                AblationRow(
                    agent=agent,
                    name=name,
                    title=title,
                    seeds=config.seeds,
                    frames=config.training_frames,
                    by_seed=values_by_seed,
                    change=change,
                    rank=rank,
                    rooms=training_rooms_count(config),
                    line=agent if name == BASE else agent + ablation.variants[name].line,
                )
            )
    return rows


def _rank_of_new_targets(run: RunFolder, method: str, seed: int) -> float:
    """Median rank of new targets under a method's predicted rewards; NaN if it predicts none."""
    path = run.rewards(seed, "quality.csv")
    quality = load_reward_quality(path) if path.exists() else []
    return next((row.median_rank for row in quality if (row.method, row.targets) == (method, "new")), float("nan"))


def ablation_columns(rows: Sequence[AblationRow]) -> dict[str, list]:
    """The table as columns, one row for each run, task and metric.

    Args:
        rows: the rows.

    Returns:
        Columns for `write_table`; a change is NaN where there is none.
    """
    undefined = MeanInterval(float("nan"), float("nan"))
    table = []
    for row in rows:
        for (task, metric), value in row.value.items():
            intervals = (value, row.change.get((task, metric), undefined), row.rank)
            numbers = [number for interval in intervals for number in (interval.mean, interval.half_width)]
            table.append((row.agent, row.name, task, metric, *numbers, row.seeds, row.frames, row.rooms, row.line))
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
        "rooms",
        "line",
    )
    return columns_of_rows(names, table)


def ablation_table(rows: Sequence[AblationRow], metric: str) -> str:
    """The table of one agent and metric; significant changes are bold.

    Args:
        rows: rows of one agent.
        metric: `sr` or `spl`.

    Returns:
        A Markdown table.
    """
    tasks = [task for task in TASKS if (task, metric) in rows[0].value]
    head = "| | rank | " + " | ".join(f"Task {task}: {metric_name(metric)} | change" for task in tasks) + " |"
    lines = [head, "|---|---:|" + "---:|---:|" * len(tasks)]
    for row in rows:
        texts = [row.title, "" if isnan(row.rank.mean) else f"{row.rank:.1f}"]
        for task in tasks:
            change = row.change.get((task, metric))
            texts += [str(row.value[task, metric]), "" if change is None else markdown_difference(change)]
        lines.append("| " + " | ".join(texts) + " |")
    return "\n".join(lines)
