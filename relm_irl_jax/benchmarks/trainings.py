"""Speed of every agent's training in the default run's rooms, compiling apart.

Writes `trainings.csv` and prints the table. The first chunk of updates includes compilation; the rate is that of all
others. Fewer frames on a processor than on an accelerator: enough for some chunks of each agent.
"""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rich.console import Console
from rich.table import Table

from relm_irl_jax.benchmarks.rows import three_digits, write_rows
from relm_irl_jax.benchmarks.timing import describe_computer
from relm_irl_jax.config import AgentName, Config, Method, overlay
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.stages.encoding import encode_training
from relm_irl_jax.stages.make_agent import make_agent
from relm_irl_jax.stages.rewards import learn
from relm_irl_jax.stages.training import SeedInputs, training_problem
from relm_irl_jax.tasks import draw_split
from relm_irl_jax.types import Row, State, TrainingLog


@dataclass(frozen=True)
class Case:
    """One training.

    Attributes:
        agent: the agent.
        method: the method, which determines the reward.
        frames: training frames on an accelerator; for the mapping agent, views.
        frames_on_cpu: training frames on a processor.
        changes: settings other than the defaults.
    """

    agent: AgentName
    method: Method
    frames: int
    frames_on_cpu: int
    changes: dict[str, Any] = field(default_factory=dict)


CASES = (
    Case("siamese", "relm-irl", 20_000_000, 2_000_000),
    Case("siamese", "rl", 20_000_000, 2_000_000),
    Case("siamese", "rl", 20_000_000, 4_000_000, {"siamese": {"workers": 8192}}),
    Case("metric", "relm-irl", 1_000_000, 300_000),
    Case("recurrent", "rl", 2_000_000, 300_000),
    Case("savn", "rl", 1_000_000, 200_000),
    Case("map", "rl", 20_480, 2_560, {"map": {"weights": "train", "rooms": 12}}),
)


@dataclass(frozen=True)
class TrainingSpeed:
    """The measured speed of a training.

    Attributes:
        agent: the agent.
        method: the method.
        workers: workers in lockstep.
        frames: training frames.
        first_chunk_seconds: duration of the first chunk of updates, including compilation.
        other_chunks_seconds: duration of the other chunks.
        frames_per_second: frames of the other chunks per second.
        computer: processor, cores, load, JAX version and device.
    """

    agent: str
    method: str
    workers: int
    frames: int
    first_chunk_seconds: float
    other_chunks_seconds: float
    frames_per_second: int
    computer: str


class _Clock(TrainingLog):
    """Notes when each chunk ends."""

    def __init__(self) -> None:
        self.seconds, self.frames = [time.perf_counter()], [0.0]

    def add(self, state: State, rows: list[Row]) -> None:
        jax.block_until_ready(jax.tree.leaves(state))
        self.seconds.append(time.perf_counter())
        self.frames.append(rows[-1]["frames"])


def measure(case: Case, config: Config, inputs: SeedInputs) -> TrainingSpeed:
    """Time one training.

    Args:
        case: agent, method and frames.
        config: scenes and tasks.
        inputs: scenes, targets and rewards.

    Returns:
        The row.
    """
    frames = case.frames_on_cpu if jax.default_backend() == "cpu" else case.frames
    config = replace(overlay(config, case.changes, "benchmark"), agent=case.agent, frames=frames)
    agent, clock = make_agent(config, case.method), _Clock()
    agent.train(jax.random.key(0), training_problem(config, case.method, inputs, agent), clock)
    first, *others = np.diff(clock.seconds).tolist()
    return TrainingSpeed(
        agent=case.agent,
        method=case.method,
        workers=getattr(getattr(config, case.agent), "workers", 1),
        frames=int(clock.frames[-1]),
        first_chunk_seconds=round(first, 2),
        other_chunks_seconds=round(sum(others), 2),
        frames_per_second=round((clock.frames[-1] - clock.frames[1]) / sum(others)),
        computer=describe_computer(),
    )


def main(
    folder: Path = Path("runs/bench/trainings"),
    config: Config = Config(),  # noqa: B008  it is frozen
    cases: tuple[Case, ...] = CASES,
) -> tuple[TrainingSpeed, ...]:
    """Run the benchmark.

    Args:
        folder: output folder of the table.
        config: scenes and tasks.
        cases: the trainings, each of at least two chunks.

    Returns:
        The rows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    config = config.resolved()
    scenes = encode_training(config).scenes
    split = draw_split(scenes, (), config.tasks, 0)
    inputs = SeedInputs(0, scenes, split, learn(config, scenes, split, 0))
    rows: list[TrainingSpeed] = []
    with progress_bar("speed of trainings", len(cases), "trainings") as advance:
        for case in cases:
            rows.append(measure(case, config, inputs))
            write_rows(folder / "trainings.csv", rows)
            advance(1)
    table = Table(title=describe_computer(), caption="the first chunk includes compilation", padding=(0, 0))
    for heading in ("agent", "method", "workers", "frames", "first chunk s", "others s", "frames/s"):
        table.add_column(heading, justify="left" if heading in ("agent", "method") else "right")
    for row in rows:
        numbers = (f"{row.workers}", f"{row.frames:,}", f"{row.first_chunk_seconds:.1f}")
        others = (f"{row.other_chunks_seconds:.1f}", three_digits(row.frames_per_second))
        table.add_row(row.agent, row.method, *numbers, *others)
    Console().print(table)
    return tuple(rows)
