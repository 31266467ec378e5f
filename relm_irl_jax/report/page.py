"""The report of a run: the task's table beside the paper's numbers, the figures, where and how it ran."""

import importlib.metadata
import json
import os
import platform
from pathlib import Path

import jax
import numpy as np

from relm_irl_jax.config import Config, config_record
from relm_irl_jax.files import write_bytes
from relm_irl_jax.report.figures import learning_curves, press_figure, save_figure
from relm_irl_jax.report.html import render_page
from relm_irl_jax.report.tables import markdown_table, methods_of
from relm_irl_jax.runs import RunFolder, read_table
from relm_irl_jax.scenes.catalog import ROOMS

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


def write_report(folder: RunFolder, config: Config, results: dict) -> Path:
    """Write `report.md`, the same as one page, `report.html`, and the figures from what the run folder holds.

    Args:
        folder: the run folder.
        config: the configuration as run.
        results: contents of `results.json`.

    Returns:
        The report.
    """
    figures = _figures(folder, config, results)
    interval = ", ± a 95% interval over seeds" if config.seeds > 1 else ""
    text = [
        f"# Task {results['task']}",
        "",
        f"Scenes `{config.scenes}`, encoder {results['encoder']}, {_agent(config)}, cap {results['cap']} steps, "
        f"{config.evaluation.episodes} episodes for each scene, {config.frames:,} training frames a method, "
        f"{config.seeds} seed{'s' if config.seeds > 1 else ''}, "
        f"actions {'drawn from the policy' if config.evaluation.policy == 'sample' else 'of highest probability'}.",
        "",
        markdown_table(results),
        "",
        f"Each value is the mean over the scenes of a room type{interval}; the last column the mean over room types. "
        "In brackets: the paper's own number for another environment (AI2-THOR, an encoder trained on ImageNet), not a "
        "like-for-like comparison.",
        "",
        *(f"![{title}]({path.relative_to(folder.path)})\n" for title, path in figures),
        *_circumstances(folder, config),
    ]
    path = folder.file("report.md")
    write_bytes(path, "\n".join(text).encode())
    write_bytes(folder.file("report.html"), render_page("\n".join(text), folder.path).encode())
    return path


def _circumstances(folder: RunFolder, config: Config) -> list[str]:
    """What differs from the paper's setting, the machine, the time, and the configuration as run."""
    own = "Procedural rooms" if config.scenes == ROOMS else f"Scenes of `{config.scenes}`"
    lines = [
        "## Where this differs from the paper",
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
            "## Machine and time",
            "",
            f"{record['processor']}, {record['cores']} cores, {', '.join(record['devices'])}; {record['system']}, "
            f"Python {record['python']}, {packages}.",
            "",
            "| Stage, in the last call | Seconds |",
            "|---|---:|",
            *(f"| {stage} | {seconds:.1f} |" for stage, seconds in record["seconds"].items()),
            "",
        ]
    return [*lines, "## Configuration", "", "```json", json.dumps(config_record(config), indent=1), "```", ""]


def _figures(folder: RunFolder, config: Config, results: dict) -> list[tuple[str, Path]]:
    """Draw what there is data for; maps of rewards were drawn when the rewards were learned."""
    drawn = []
    curves = {
        method: [read_table(path) for seed in range(config.seeds) if (path := folder.curve(method, seed)).exists()]
        for method in methods_of(results["rows"])
    }
    curves = {method: columns for method, columns in curves.items() if columns and "path_length_error" in columns[0]}
    if curves:
        path = folder.file("figures", "learning.png")
        save_figure(learning_curves(curves), path)
        drawn.append(("Learning curves", path))
    press = folder.rewards(0, "press.csv")
    if press.exists():
        curve = np.asarray(read_table(press)["mean_squared_error"], float)
        path = folder.file("figures", "press.png")
        save_figure(press_figure(curve, int(np.nanargmin(curve)) + 1), path)
        drawn.append(("Leave-one-out error", path))
    episodes = folder.file("figures", f"episodes-{results['task']}.png")
    if episodes.exists():
        drawn.append(("Episodes from above", episodes))
    maps = sorted(folder.file("figures", ".").glob(f"distance-{results['task']}-*.png"))
    drawn += [("Learned distance to a target", path) for path in maps]
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
