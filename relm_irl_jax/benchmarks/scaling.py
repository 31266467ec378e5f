"""Weak scaling: one update's time as devices are added, each with its own fixed number of workers.

Writes `scaling.csv` and prints the table. The devices are virtual ones of the host's processor and share its cores: n
of them have n times the work of one and no more to do it with. The table shows what working together costs beside
that, not how fast n processors would be. Every number of devices is measured in a process of its own, since it is
fixed when JAX starts.
"""

import csv
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
from relm_irl_jax.benchmarks.timing import describe_machine, time_calls
from relm_irl_jax.progress import progress_bar

DEVICES = (1, 2, 4, 8)


@dataclass(frozen=True)
class Scaling:
    """One number of devices.

    Attributes:
        devices: their number.
        workers: workers of all of them.
        first_seconds: the first call, compilation included.
        update_seconds: an update, at the median of the calls after it.
        frames_per_second: of all workers.
        exchanged_megabytes: gradient that an update averages over the devices.
    """

    devices: int
    workers: int
    first_seconds: float
    update_seconds: float
    frames_per_second: float
    exchanged_megabytes: float


def scaled(settings: SiameseSettings, workers: int, repeats: int) -> Scaling:
    """Time training on all devices of this process.

    Args:
        settings: the agent's settings but for the workers.
        workers: workers of each device.
        repeats: timed calls after the first.

    Returns:
        The times.
    """
    devices = jax.device_count()
    settings = replace(settings, workers=workers * devices)
    state, inputs, form = prepare_training(jax.random.key(0), benchmark_problem(), settings, devices)
    state, inputs = shard_workers(state, inputs, jax.devices())
    timing = time_calls(lambda: run_updates(state, inputs, form=form, updates=UPDATES), repeats)
    target_range = inputs.task.target_range
    frames = target_range.first.size * settings.t_max * UPDATES
    # Summed over the devices: the gradient with respect to θ, or to the four logits and the value of every pair.
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
        folder: where the table goes.
        repeats: timed calls of each case after the first.
        workers: workers of each device, a multiple of the three heads.
        settings: the agent's settings but for the workers.
        counts: numbers of devices.

    Returns:
        The rows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    with progress_bar("scaling benchmark", len(counts), "cases") as advance:
        for count in counts:
            rows.append(_measured_apart(count, settings, workers, repeats))
            advance(1)
    with (folder / "scaling.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    caption = (
        "Virtual devices share this machine's cores: n of them have n times the work of one. Ratio: an update's time "
        "over n times the first row's; 1 where working together costs nothing."
    )
    table = Table(title=describe_machine(), caption=caption, padding=(0, 0))
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
        work = rows[0].update_seconds * row.devices / rows[0].devices
        table.add_row(
            f"{row.devices}",
            f"{row.workers}",
            f"{row.first_seconds:.1f}",
            f"{1e3 * row.update_seconds:.1f}",
            f"{row.frames_per_second:,.0f}",
            f"{row.update_seconds / work:.2f}",
            f"{row.exchanged_megabytes:.1f}" if row.devices > 1 else "",
        )
    Console().print(table)
    return tuple(rows)


def _measured_apart(devices: int, settings: SiameseSettings, workers: int, repeats: int) -> Scaling:
    flag = f"--xla_force_host_platform_device_count={devices}"
    environment = os.environ | {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": f"{os.environ.get('XLA_FLAGS', '')} {flag}"}
    task = json.dumps({"settings": asdict(settings), "workers": workers, "repeats": repeats})
    done = subprocess.run(
        [sys.executable, "-m", __name__, task], env=environment, stdout=subprocess.PIPE, text=True, check=True
    )
    return Scaling(**json.loads(done.stdout))


if __name__ == "__main__":
    given = json.loads(sys.argv[1])
    print(json.dumps(asdict(scaled(SiameseSettings(**given["settings"]), given["workers"], given["repeats"]))))
