"""Steps per second of the Gymnasium environments, random actions drawn in advance.

Writes `gym.csv` and prints the table. Episodes that end are started anew, which counts as one step.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table

from relm_irl_jax.benchmarks.rows import three_digits, write_rows
from relm_irl_jax.benchmarks.timing import describe_computer
from relm_irl_jax.config import Config
from relm_irl_jax.gym import TaskEnv, TaskVectorEnv
from relm_irl_jax.scenes.scene import ACTIONS

Observations = Literal["features", "frames"]

CASES: tuple[tuple[int, Observations], ...] = ((1, "features"), (1, "frames"), (64, "features"), (1024, "features"))
"""Number of agents, 1 for the environment of one agent, and what they observe."""

SECONDS = 2.0
"""Time for which each environment is stepped."""


@dataclass(frozen=True)
class GymSpeed:
    """The measured speed of an environment.

    Attributes:
        agents: agents in lockstep; 1 is the environment of one agent.
        observation: what they observe.
        shape: shape of one view.
        steps_per_second: steps of all agents per second.
        computer: processor, cores, load, JAX version and device.
    """

    agents: int
    observation: str
    shape: str
    steps_per_second: int
    computer: str


def single_stepper(environment: TaskEnv) -> Callable[[int], None]:
    """A function that takes an action and starts an episode where the last one has ended.

    Args:
        environment: the environment of one agent, reset once.

    Returns:
        The function of the action's number.
    """

    def step(action: int) -> None:
        _, _, terminated, truncated, _ = environment.step(action)
        if terminated or truncated:
            environment.reset()

    return step


def measure(agents: int, observation: Observations, seconds: float = SECONDS, config: Config | None = None) -> GymSpeed:
    """Time the steps of one environment.

    Args:
        agents: agents in lockstep; 1 for the environment of one agent.
        observation: `features` or `frames`.
        seconds: for how long.
        config: scenes and tasks; by default those of the tables.

    Returns:
        The row.
    """
    drawn = np.random.default_rng(0).integers(0, len(ACTIONS), (1024, agents))
    if agents == 1:
        environment = TaskEnv("II", 0, "train", obs=observation, config=config)
        step, actions = single_stepper(environment), [int(action) for action in drawn[:, 0]]
        seen = environment.reset(seed=0)[0]["view"]
    else:
        vector = TaskVectorEnv(agents, "II", 0, "train", obs=observation, config=config)
        step, actions, seen = vector.step, list(drawn), vector.reset(seed=0)[0]["view"][0]
    taken, start = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - start) < seconds:
        for action in actions:
            step(action)
        taken += agents * len(actions)
    shape = " × ".join(str(size) for size in seen.shape)
    return GymSpeed(agents, observation, shape, round(taken / elapsed), describe_computer())


def main(folder: Path = Path("runs/bench/gym")) -> tuple[GymSpeed, ...]:
    """Run the benchmark.

    Args:
        folder: output folder of the table.

    Returns:
        The rows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = tuple(measure(agents, observation) for agents, observation in CASES)
    write_rows(folder / "gym.csv", rows)
    table = Table(title=rows[0].computer, padding=(0, 0))
    for heading in ("agents", "observation", "shape", "steps/s"):
        table.add_column(heading, justify="left" if heading == "observation" else "right")
    for row in rows:
        table.add_row(str(row.agents), row.observation, row.shape, three_digits(row.steps_per_second))
    Console().print(table)
    return rows
