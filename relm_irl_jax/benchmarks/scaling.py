"""Weak scaling: the duration of an update for several numbers of devices, each with a fixed number of workers.

Writes `scaling.csv` and prints the table. The devices are virtual devices of the host's processor, which share its
cores: n devices have n times the computation of one device, but the same hardware. The table shows the overhead of
distribution, not the speed of n processors. Every number of devices is measured in a separate process, since it is
fixed when JAX starts.
"""

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax
from rich.console import Console
from rich.table import Table

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.sharding import shard_workers
from relm_irl_jax.agents.siamese.training import prepare_training, run_updates
from relm_irl_jax.benchmarks.agent import UPDATES, benchmark_problem
from relm_irl_jax.benchmarks.rows import write_rows
from relm_irl_jax.benchmarks.timing import describe_computer, time_calls
from relm_irl_jax.progress import progress_bar

DEVICES = (1, 2, 4, 8)


@dataclass(frozen=True)
class Scaling:
    """Measurements with one number of devices.

    Attributes:
        devices: number of devices.
        workers: total number of workers.
        first_seconds: duration of the first call, including compilation.
        update_seconds: median duration of an update in the other calls.
        frames_per_second: frames of all workers per second.
        exchanged_megabytes: size of the gradient that devices exchange in each update.
    """

    devices: int
    workers: int
    first_seconds: float
    update_seconds: float
    frames_per_second: float
    exchanged_megabytes: float


def measure(settings: SiameseSettings, workers: int, repeats: int) -> Scaling:
    """Time training on all devices of this process.

    Args:
        settings: the agent's settings; the number of workers is ignored.
        workers: workers of each device.
        repeats: timed calls after the first.

    Returns:
        The measurements.
    """
    devices = jax.device_count()
    settings = replace(settings, workers=workers * devices)
    state, inputs, form = prepare_training(jax.random.key(0), benchmark_problem(), settings, devices)
    state, inputs = shard_workers(state, inputs, jax.devices())
    timing = time_calls(lambda: run_updates(state, inputs, form=form, updates=UPDATES), repeats)
    target_range = inputs.task.target_range
    frames = target_range.first.size * settings.t_max * UPDATES
    # The exchanged gradient is that of θ, or that of the four logits and the value of every pair.
    exchanged = (
        sum(x.nbytes for x in jax.tree.leaves(state.parameters)) if inputs.pairs is None else 5 * 4 * inputs.pairs.count
    )
    return Scaling(
        devices=len(target_range.first.sharding.device_set),
        workers=target_range.first.size,
        first_seconds=round(timing.first, 3),
        update_seconds=round(timing.median / UPDATES, 5),
        frames_per_second=round(frames / timing.median),
        exchanged_megabytes=round(exchanged / 1e6, 2),
    )


def main(
    folder: Path = Path("runs/bench/scaling"),
    repeats: int = 10,
    workers: int = 96,
    settings: SiameseSettings = SiameseSettings(),  # noqa: B008  it is frozen
    counts: tuple[int, ...] = DEVICES,
) -> tuple[Scaling, ...]:
    """Run the benchmark.

    Args:
        folder: output folder of the table.
        repeats: timed calls of each case after the first.
        workers: workers of each device, a multiple of the number of heads, 3.
        settings: the agent's settings; the number of workers is ignored.
        counts: numbers of devices.

    Returns:
        The rows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    with progress_bar("scaling benchmark", len(counts), "cases") as advance:
        for count in counts:
            rows.append(_measure_in_subprocess(count, settings, workers, repeats))
            advance(1)
    write_rows(folder / "scaling.csv", rows)
    caption = (
        "Virtual devices share this computer's cores: n devices have n times the computation of one. Ratio: duration "
        "of an update divided by n times that of the first row; 1 without overhead."
    )
    table = Table(title=describe_computer(), caption=caption, padding=(0, 0))
    for heading in (
        "devices",
        "workers",
        "first s",
        "update ms",
        "frames/s",
        "ratio",
        "exchanged MB",
    ):
        table.add_column(heading, justify="right")
    for row in rows:
        expected_seconds = rows[0].update_seconds * row.devices / rows[0].devices
        table.add_row(
            f"{row.devices}",
            f"{row.workers}",
            f"{row.first_seconds:.1f}",
            f"{1e3 * row.update_seconds:.1f}",
            f"{row.frames_per_second:,.0f}",
            f"{row.update_seconds / expected_seconds:.2f}",
            f"{row.exchanged_megabytes:.1f}" if row.devices > 1 else "",
        )
    Console().print(table)
    return tuple(rows)


def _measure_in_subprocess(devices: int, settings: SiameseSettings, workers: int, repeats: int) -> Scaling:
    flag = f"--xla_force_host_platform_device_count={devices}"
    environment = os.environ | {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": f"{os.environ.get('XLA_FLAGS', '')} {flag}"}
    task = json.dumps({"settings": asdict(settings), "workers": workers, "repeats": repeats})
    completed = subprocess.run(
        [sys.executable, "-m", __name__, task], env=environment, stdout=subprocess.PIPE, text=True, check=True
    )
    return Scaling(**json.loads(completed.stdout))


if __name__ == "__main__":
    arguments = json.loads(sys.argv[1])
    measured = measure(SiameseSettings(**arguments["settings"]), arguments["workers"], arguments["repeats"])
    print(json.dumps(asdict(measured)))
