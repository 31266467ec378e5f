"""The report of a run, made from its folder only: tables with the paper's numbers, figures, hardware, configuration."""

import json
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_bytes, write_table
from relm_irl_jax.hardware import load_stage_times
from relm_irl_jax.report.comparison import (
    difference_columns,
    difference_table,
    differences,
    statement,
)
from relm_irl_jax.report.figures import DrawnFigure
from relm_irl_jax.report.finding import finding
from relm_irl_jax.report.html import render_page
from relm_irl_jax.report.learning_curves import success_columns, success_table
from relm_irl_jax.report.map_curves import map_curve_figures
from relm_irl_jax.report.names import AGENT_NAMES, TASK_NAMES, as_code, as_message, as_text, listed
from relm_irl_jax.report.run_figures import (
    RunData,
    episode_figures,
    learning_curve_figure,
    map_figures,
    prediction_figure,
    press_curve_figure,
    search_figures,
)
from relm_irl_jax.report.run_settings import RunSettings, load_run_settings
from relm_irl_jax.report.tables import markdown_table, quality_table, table_columns
from relm_irl_jax.results import BESIDE_NAMES, OWN, Results, load_all_results
from relm_irl_jax.run_folder import RunFolder

BUILT_IN = "rooms"
"""Value of the setting `scenes` for the built-in rooms, repeated here so that the report imports no scene sources."""


IMAGINED = {
    "none": "",
    "told": ", which also trains on imagined targets and is told of arrivals there (IRL: on the given targets alone)",
    "reward-alone": ", which with ELM-IRL and RELM-IRL also trains on imagined targets, of which nothing but the "
    "predicted reward tells (RL and IRL: on the given targets alone, and told of arrivals)",
}
"""What a training on imagined targets is, as a part of a sentence."""


def write_report(folder: RunFolder) -> Path:
    """Write `report.md`, `report.html`, tables and figures from the files of a run folder.

    Args:
        folder: the run folder.

    Returns:
        The Markdown file.

    Raises:
        InputError: the folder contains no run or no results.
    """
    load_run_settings(folder)  # raises if the folder contains no run
    tasks = list(load_all_results(folder))
    title = (
        f"# Task {' and '.join(tasks)}"
        if len(tasks) < 3
        else f"# {as_text(folder.path.name)}: Tasks {', '.join(tasks)}"
    )
    text = [title, "", *run_sections(folder, folder.path, "##"), *circumstances(folder, "##")]
    return write_page(text, folder.path)


def write_page(text: Sequence[str], folder: Path) -> Path:
    """Write a report as Markdown and as a self-contained HTML page.

    Args:
        text: lines of Markdown; image paths are relative to the folder.
        folder: folder of `report.md` and `report.html`.

    Returns:
        The Markdown file.
    """
    path = folder / "report.md"
    write_bytes(path, "\n".join(text).encode(errors="replace"))
    write_bytes(RunFolder(folder).report, render_page("\n".join(text), folder).encode(errors="replace"))
    return path


def run_sections(folder: RunFolder, base: Path, heading: str, *, worded: bool = True) -> list[str]:
    """The results of a run: a table for each evaluated task, paired differences, quality of rewards, and figures.

    Args:
        folder: the run folder; tables and figures are written to it.
        base: folder to which image paths are relative.
        heading: Markdown prefix of the section headings.
        worded: whether to add sentences about what was found.

    Returns:
        Lines of Markdown.

    Raises:
        InputError: the folder contains no run or no results.
    """
    data = RunData(folder, load_all_results(folder))
    return [
        *(_found(data) if worded else []),
        *_summary(load_run_settings(folder), data),
        *_tasks(data, heading),
        *_differences(data, heading, worded=worded),
        *_reward_quality(data, heading),
        *_figures(data, base, heading),
    ]


def circumstances(folder: RunFolder, heading: str) -> list[str]:
    """Differences from the paper's experiments, hardware, duration, and the configuration as run.

    Args:
        folder: the run folder.
        heading: Markdown prefix of the section headings.

    Returns:
        Lines of Markdown.

    Raises:
        InputError: the folder contains no run or no results.
    """
    settings = load_run_settings(folder)
    cap = next(iter(load_all_results(folder).values())).cap
    scenes = "Procedural rooms" if settings.scenes == BUILT_IN else f"Scenes of {as_code(settings.scenes)}"
    replaced = ", instead of the paper's siamese actor-critic" if settings.agent in ("metric", "map") else ""
    return [
        f"{heading} Where this differs from the paper",
        "",
        f"{scenes} instead of AI2-THOR; an encoder with weights {as_code(settings.weights)} instead of ImageNet's; "
        f"{as_text(settings.training)} and {cap} steps per episode, where the paper's text says 5000 "
        f"and its tables fit 100; {AGENT_NAMES.get(settings.agent, f'agent {as_code(settings.agent)}')}{replaced}.",
        "",
        *_hardware(folder, heading),
        f"{heading} Configuration",
        "",
        "```json",
        json.dumps(json.loads(folder.config.read_bytes()), indent=1),
        "```",
        "",
    ]


def _found(data: RunData) -> list[str]:
    """What the intervals say about each task, before anything else."""
    text = []
    for task, results in data.results.items():
        found = [as_text(sentence) for sentence in finding(results)]
        if found:
            name = f"Task {task}: " if len(data.results) > 1 else ""
            text += [f"**{name}{found[0]}** {' '.join(found[1:])}", ""]
    return text


def _summary(settings: RunSettings, data: RunData) -> list[str]:
    """One paragraph about training and evaluation."""
    first = next(iter(data.results.values()))
    rows = [row for results in data.results.values() for row in results.rows]
    episodes = " or ".join(map(str, sorted({row.episodes for row in rows})))
    seeds = f"seed{'s' if len(data.seeds) > 1 else ''} {', '.join(map(str, data.seeds))}"
    detail = {
        "metric": f" (hindsight: {as_text(settings.hindsight)})",
        "map": f" (memory at the start: {as_text(settings.map_memory)})",
    }
    agent = f"{as_text(settings.agent)} agent{detail.get(settings.agent, '')}{IMAGINED[settings.imagined]}"
    actions = "drawn from the policy" if settings.policy == "sample" else "of highest probability"
    uniform = "" if settings.new_targets == "paper" else ", Task II's targets drawn uniformly"
    return [
        f"Scenes {as_code(settings.scenes)}, encoder {as_text(first.encoder)}, {agent}, cap {first.cap} steps, "
        f"{episodes} episodes for each scene, {as_text(settings.training)}, {seeds}, actions {actions}{uniform}.",
        "",
    ]


def _tasks(data: RunData, heading: str) -> list[str]:
    """A section for each task."""
    interval = ", ± half of its 95% interval over seeds (Student's t)" if len(data.seeds) > 1 else ""
    bold = (
        " Bold: the best method of the agent, if its interval does not overlap any other."
        if len(data.seeds) > 1
        else ""
    )
    text = []
    for number, (task, results) in enumerate(data.results.items()):
        write_table(data.folder.table(f"task-{task}"), table_columns(results))
        table = {"I": 1, "II": 2, "III": 3}[task]
        text += [f"{heading} Task {task}: {TASK_NAMES[task]} (the paper's Table {table})", ""]
        text += [markdown_table(results), ""]
        text += _agents_beside(results, data)
        own = sorted({row.method for row in results.rows if row.agent == OWN})
        if own:
            verb = "is" if len(own) == 1 else "are"
            text += [
                f"{as_text(listed(own))} {verb} not of this package: evaluated on the same targets and starts.",
                "",
            ]
        if number == 0:
            text += [
                f"Each value is the mean over the scenes of a room type{interval}; the last column is the mean over "
                f"room types.{bold} In brackets: the paper's number, measured in another environment (AI2-THOR, an "
                "encoder trained on ImageNet) and therefore not directly comparable.",
                "",
            ]
    return text


def _agents_beside(results: Results, data: RunData) -> list[str]:
    """What the agents beside the run's own are, and the files of their reports."""
    agents = [agent for name, agent in BESIDE_NAMES.items() if any(row.method == name for row in results.rows)]
    pages = [data.folder.beside(agent).report for agent in agents]
    files = [as_code(page.relative_to(data.folder.path).as_posix()) for page in pages]
    described = [f"{agent} is {AGENT_NAMES[agent]}" for agent in agents]
    return [f"Agents beside the paper's: {'; '.join(described)}. Their reports: {listed(files)}.", ""] if agents else []


def _differences(data: RunData, heading: str, *, worded: bool) -> list[str]:
    """Paired differences between methods; nothing if there is only one seed."""
    paired = differences(data.results)
    if not paired:
        return []
    write_table(data.folder.table("differences"), difference_columns(paired))
    return [
        f"{heading} Differences on the same seeds",
        "",
        *(f"- {sentence}" for sentence in statement(paired) if worded),
        "",
        difference_table(paired),
        "",
        f"Means over {paired[0].seeds} paired seeds and room types, ± half of the 95% interval (Student's t, without "
        "correction for multiple comparisons); bold if the interval excludes zero.",
        "",
    ]


def _reward_quality(data: RunData, heading: str) -> list[str]:
    """Quality of the learned rewards, independent of agents."""
    quality = data.reward_quality()
    if not quality:
        return []
    return [
        f"{heading} Quality of the learned rewards",
        "",
        quality_table(quality),
        "",
        "Rank: rank of the target by reward among the states of its scene, median over targets and starts; 1 is best. "
        "Order: mean Spearman correlation between reward and closeness to the target. IRL's reward is learned from "
        "demonstrations of the target; ELM-IRL's and RELM-IRL's are predicted from the views of start and target.",
        "",
    ]


def _figures(data: RunData, base: Path, heading: str) -> list[str]:
    """The figures with captions, and a list of files that could not be read."""
    text = [f"{heading} Figures", ""]
    curves = data.curves()
    if curves:
        write_table(data.folder.table("frames-to-success"), success_columns(curves))
        for figure in data.drawn("learning", lambda: [learning_curve_figure(data, curves)]):
            text += _shown(figure, base)
        text += [success_table(curves), ""]
    for draw in (
        press_curve_figure,
        prediction_figure,
        map_curve_figures,
        search_figures,
        episode_figures,
        map_figures,
    ):
        for figure in draw(data):
            text += _shown(figure, base)
    if data.faults:
        text += [
            "Not shown, since the data cannot be read:",
            "",
            *(f"- {as_message(fault)}" for fault in data.faults),
            "",
        ]
    return text


def _shown(figure: DrawnFigure, base: Path) -> list[str]:
    # Scenes and room types are part of some names of files.
    link = quote(figure.path.relative_to(base).as_posix())
    return [f"![{as_text(figure.title)}]({link})", "", f"*{as_text(figure.caption)}.*", ""]


def _hardware(folder: RunFolder, heading: str) -> list[str]:
    """The computers and the duration of stages; one line if they cannot be read."""
    try:
        times = load_stage_times(folder.hardware)
    except InputError as error:
        return [f"{heading} Hardware and time", "", f"Not shown: {as_message(str(error))}", ""]
    last, *others = (as_text(str(computer)) for computer in times.computers)
    return [
        f"{heading} Hardware and time",
        "",
        f"{last}.",
        *(f"Stages before the last one also ran on: {other}." for other in others),
        "",
        "| Stage (total over calls and seeds) | Seconds |",
        "|---|---:|",
        *(f"| {as_text(stage)} | {seconds:.1f} |" for stage, seconds in times.seconds.items()),
        "",
    ]
