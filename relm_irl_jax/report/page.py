"""The report of a run: the task's table beside the paper's numbers, the figures, where and how it ran."""

import importlib.metadata
import json
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

import jax
import numpy as np

from relm_irl_jax.config import Config, config_record
from relm_irl_jax.files import write_bytes
from relm_irl_jax.report.comparison import difference_columns, difference_table, differences, statement
from relm_irl_jax.report.curves import band_columns, speed_columns, speed_table
from relm_irl_jax.report.figures import (
    CURVE_METRICS,
    bar_figure,
    learning_curves,
    press_columns,
    press_figure,
    save_figure,
)
from relm_irl_jax.report.html import render_page
from relm_irl_jax.report.tables import cell, columns_of, markdown_table, methods_of, readable, table_columns
from relm_irl_jax.runs import RunFolder, read_all_results, read_table, write_table
from relm_irl_jax.scenes.selection import ROOMS

TASK_NAMES = {
    "I": "trained targets",
    "II": "new targets in the trained scenes",
    "III": "similar targets in unseen scenes",
}
"""What is asked of an agent in each task."""

PACKAGES = ("jax", "flax", "optax", "numpy", "cvxpy", "clarabel")


def machine() -> dict:
    """The machine and the versions of the packages that compute.

    Returns:
        Plain values for `machine.json`.
    """
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "devices": [device.device_kind for device in jax.devices()],
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
        "packages": {name: importlib.metadata.version(name) for name in PACKAGES},
    }


def write_report(folder: RunFolder, config: Config) -> Path:
    """Write `report.md`, the same as one page, `report.html`, tables and figures from what the run folder holds.

    Args:
        folder: the run folder.
        config: the configuration as run.

    Returns:
        The report.
    """
    results = read_all_results(folder)
    title = (
        f"# Task {' and '.join(results)}" if len(results) < 3 else f"# {folder.path.name}: Tasks {', '.join(results)}"
    )
    text = [title, "", *run_sections(folder, config, folder.path, "##"), *circumstances(folder, config, "##")]
    return write_page(text, folder.path)


def write_page(text: Sequence[str], folder: Path) -> Path:
    """Write a report as Markdown and as one page that needs no other file.

    Args:
        text: lines of Markdown; pictures are named relative to the folder.
        folder: where `report.md` and `report.html` go.

    Returns:
        The Markdown file.
    """
    path = folder / "report.md"
    write_bytes(path, "\n".join(text).encode())
    write_bytes(folder / "report.html", render_page("\n".join(text), folder).encode())
    return path


def run_sections(folder: RunFolder, config: Config, base: Path, heading: str, *, worded: bool = True) -> list[str]:
    """What a run measured: a table for each task evaluated, paired differences, and the figures.

    Args:
        folder: the run folder; tables are written into it as CSV, too.
        config: the configuration as run.
        base: folder to which the names of pictures are relative.
        heading: Markdown's mark of a heading of the sections.
        worded: whether to say in words what the differences allow.

    Returns:
        Lines of Markdown.
    """
    results = read_all_results(folder)
    first = next(iter(results.values()))
    seeds = f"seeds 0 to {config.seeds - 1}" if config.seeds > 1 else "seed 0"
    interval = ", ± half of its 95% interval over seeds (Student's t)" if config.seeds > 1 else ""
    text = [
        f"Scenes `{config.scenes}`, encoder {first['encoder']}, {_agent(config)}, cap {first['cap']} steps, "
        f"{config.evaluation.episodes} episodes for each scene, {config.frames:,} training frames a method, {seeds}, "
        f"actions {'drawn from the policy' if config.evaluation.policy == 'sample' else 'of highest probability'}"
        + ("." if config.evaluation.new_targets == "paper" else ", Task II's targets drawn uniformly."),
        "",
    ]
    for number, (task, record) in enumerate(results.items()):
        write_table(folder.file("tables", f"task-{task}.csv"), table_columns(record))
        table = {"I": 1, "II": 2, "III": 3}[task]
        text += [
            f"{heading} Task {task}: {TASK_NAMES[task]} (the paper's Table {table})",
            "",
            markdown_table(record),
            "",
        ]
        if number == 0:
            text += [
                f"Each value is the mean over the scenes of a room type{interval}; the last column the mean over room "
                "types. Bold: best by intervals that lie apart. In brackets: the paper's own number for another "
                "environment (AI2-THOR, an encoder trained on ImageNet), not a like-for-like comparison.",
                "",
            ]
    found = differences(results)
    if found:
        write_table(folder.file("tables", "differences.csv"), difference_columns(found))
        text += [
            f"{heading} Differences on the same seeds",
            "",
            *(f"- {sentence}" for sentence in statement(found) if worded),
            "",
            difference_table(found),
            "",
            f"Means over {found[0].seeds} paired seeds and room types, ± half of the 95% interval (Student's t), each "
            "on its own; bold where it excludes zero.",
            "",
        ]
    text += [f"{heading} Figures", ""]
    for title, path in _figures(folder, config, results):
        text += [f"![{title}]({path.relative_to(base)})", "", f"*{title}*", ""]
        if path.stem == "learning":
            curves = _curves(folder, config, results)
            write_table(folder.file("tables", "frames-to-success.csv"), speed_columns(curves))
            text += [speed_table(curves), ""]
    return text


def circumstances(folder: RunFolder, config: Config, heading: str) -> list[str]:
    """What differs from the paper's setting, the machine, the time, and the configuration as run.

    Args:
        folder: the run folder.
        config: the configuration as run.
        heading: Markdown's mark of a heading of the sections.

    Returns:
        Lines of Markdown.
    """
    own = "Procedural rooms" if config.scenes == ROOMS else f"Scenes of `{config.scenes}`"
    lines = [
        f"{heading} Where this differs from the paper",
        "",
        f"{own} instead of AI2-THOR; an encoder with weights `{config.encoder.weights}` instead of ImageNet's; "
        f"{config.frames:,} training frames a method and {config.tasks.cap} steps an episode, where the paper's text "
        "says 5000 and its tables fit 100; "
        + (
            "an agent that learns distances between views instead of the siamese actor-critic."
            if config.agent == "metric"
            else "workers in lockstep, the synchronous limit of A3C."
        ),
        "",
    ]
    machine_file = folder.path / "machine.json"
    if machine_file.exists():
        record = json.loads(machine_file.read_text())
        packages = ", ".join(f"{name} {version}" for name, version in record["packages"].items())
        lines += [
            f"{heading} Machine and time",
            "",
            f"{record['processor']}, {record['cores']} cores, {', '.join(record['devices'])}; {record['system']}, "
            f"Python {record['python']}, {packages}.",
            "",
            "| Stage, all calls and seeds together | Seconds |",
            "|---|---:|",
            *(f"| {stage} | {seconds:.1f} |" for stage, seconds in record["seconds"].items()),
            "",
        ]
    return [*lines, f"{heading} Configuration", "", "```json", json.dumps(config_record(config), indent=1), "```", ""]


def _curves(folder: RunFolder, config: Config, results: Mapping[str, dict]) -> dict[str, list[dict[str, list[str]]]]:
    """The learning curves of every method, in the order of the seeds."""
    methods = methods_of([row for record in results.values() for row in record["rows"]])
    found = {
        method: [read_table(path) for seed in range(config.seeds) if (path := folder.curve(method, seed)).exists()]
        for method in methods
    }
    return {method: curves for method, curves in found.items() if curves and "path_length_error" in curves[0]}


def _figures(folder: RunFolder, config: Config, results: Mapping[str, dict]) -> list[tuple[str, Path]]:
    """Draw what there is data for; maps were drawn when rewards were learned and agents evaluated."""
    drawn = []
    curves = _curves(folder, config, results)
    if curves:
        compared = {method: own for method, own in curves.items() if method in ("rl", "irl", "relm-irl")}
        if compared:
            path = folder.file("figures", "figure-6.png")
            save_figure(
                learning_curves(compared, ["path_length_error"]), path, band_columns(compared, ["path_length_error"])
            )
            drawn.append(("Path length error during training (the paper's Figure 6)", path))
        path = folder.file("figures", "learning.png")
        save_figure(learning_curves(curves), path, band_columns(curves, tuple(CURVE_METRICS)))
        drawn.append(("Learning curves of all methods", path))
    tables = [path for seed in range(config.seeds) if (path := folder.rewards(seed, "press.csv")).exists()]
    if tables:
        errors = [np.asarray(read_table(table)["mean_squared_error"], float) for table in tables]
        path = folder.file("figures", "press.png")
        save_figure(press_figure(errors), path, press_columns(errors))
        drawn.append(("Leave-one-out error of the machine that this run trained with", path))
    rows = results["III"]["rows"] if "III" in results else []
    if {"elm-irl", "relm-irl"} <= set(methods_of(rows)):
        columns = columns_of(rows)
        bars = {m: [cell(rows, m, "spl", column) for column in columns] for m in ("elm-irl", "relm-irl")}
        table = [
            (m, c, value.mean, value.half_width)
            for m, own in bars.items()
            for c, value in zip(columns, own, strict=True)
        ]
        path = folder.file("figures", "figure-11.png")
        names = ("method", "column", "spl", "half_width")
        figure = bar_figure(bars, [readable(column) for column in columns], "SPL on Task III")
        save_figure(figure, path, dict(zip(names, zip(*table, strict=True), strict=True)))
        drawn.append(("ELM-IRL and RELM-IRL on Task III (the paper's Figure 11)", path))
    for task in results:
        episodes = folder.file("figures", f"episodes-{task}.png")
        if episodes.exists():
            drawn.append((f"Episodes of Task {task} from above", episodes))
        maps = sorted(folder.file("figures", ".").glob(f"distance-{task}-*.png"))
        drawn += [(f"Learned distance to a target of Task {task}", path) for path in maps]
    drawn += [("Rewards over a room", path) for path in sorted(folder.file("figures", ".").glob("reward-*.png"))]
    return drawn


def _agent(config: Config) -> str:
    return f"metric agent (hindsight: {config.metric.hindsight})" if config.agent == "metric" else "siamese agent"


def _processor() -> str:
    """Name of the processor, where the system tells."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
