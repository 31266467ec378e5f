"""The report of a run: the task's table beside the paper's numbers, the figures, where and how it ran."""

import importlib.metadata
import os
import platform
from pathlib import Path

import jax
import numpy as np

from relm_irl_jax.config import Config
from relm_irl_jax.files import write_bytes
from relm_irl_jax.report.figures import learning_curves, press_figure, save_figure
from relm_irl_jax.report.tables import markdown_table, methods_of
from relm_irl_jax.runs import RunFolder, read_table

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
    """Write `report.md` and the figures from what the run folder holds.

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
    ]
    path = folder.file("report.md")
    write_bytes(path, "\n".join(text).encode())
    return path


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
