"""Speed of maximum-margin inverse reinforcement learning: comparison of `solve_many` with cvxpy, and scaling.

Writes `irl.csv` and `irl.png`, and prints the table. Problems are random pairs of start and target in an empty square
room with random features. The durations include the factorisation of the features and the start of the workers, but not
the computation of experts.
"""

import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from joblib.externals.loky import get_reusable_executor
from rich.console import Console
from rich.table import Table

from relm_irl_jax.benchmarks.axes import label_log_axes
from relm_irl_jax.benchmarks.rows import write_rows
from relm_irl_jax.benchmarks.timing import describe_computer
from relm_irl_jax.experts import follow_expert, shortest_path_expert
from relm_irl_jax.files import write_bytes
from relm_irl_jax.irl import MaxMarginProblem, MaxMarginSettings, Solution, reference_max_margin, solve_many
from relm_irl_jax.irl.settings import Variant
from relm_irl_jax.report.figures import as_png
from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances, successors


@dataclass(frozen=True)
class Case:
    """Size and variant of the problems."""

    variant: Variant
    places: int
    dimension: int
    trajectories: int


@dataclass(frozen=True)
class Measurement:
    """One timed case; seconds are for all its problems, processor seconds include the workers."""

    sweep: str
    variant: str
    states: int
    dimension: int
    trajectories: int
    median_seconds: float
    worst_seconds: float
    processor_seconds: float
    optimal: int
    worst_gap: float
    worst_residual: float
    cvxpy_seconds_each: float
    ratio: float


HEADLINE = Case("lp", 100, 2048, 2000)
"""The main case; its time limit is 30 s on two cores."""


def open_room(places: int) -> Scene:
    """A square room without furniture.

    Args:
        places: number of places; 4 states each.

    Returns:
        The scene, without views.
    """
    side = int(np.ceil(np.sqrt(places)))
    location, rotation, graph = pose_graph([divmod(number, side) for number in range(places)])
    return Scene("open", "bedroom", location, rotation, graph, shortest_path_distances(graph))


def random_problems(case: Case, seed: int) -> list[MaxMarginProblem]:
    """Single-trajectory problems of one scene.

    Args:
        case: size of the problems.
        seed: seed of features, starts and targets.

    Returns:
        The problems.
    """
    scene, generator = open_room(case.places), np.random.default_rng(seed)
    features = generator.normal(size=(scene.n_states, case.dimension)).astype(np.float32)
    next_states = successors(scene.graph)
    problems = []
    for _ in range(case.trajectories):
        start, target = generator.choice(scene.n_states, 2, replace=False).tolist()
        expert = shortest_path_expert(scene, target)
        problems.append(
            MaxMarginProblem(features, next_states, expert, follow_expert(scene, expert, start).states[:-1])
        )
    return problems


def measure(sweep: str, case: Case, repeats: int, references: int) -> Measurement:
    """Time one case.

    Args:
        sweep: the series of measurements that the case belongs to.
        case: size and variant of the problems.
        repeats: number of timed runs.
        references: number of problems that cvxpy also solves; the objectives must agree.

    Returns:
        The measurement.
    """
    problems = random_problems(case, seed=0)
    settings = MaxMarginSettings(variant=case.variant, compare_with_lp=False)
    seconds, processor, solutions = [], [], ()
    for _ in range(repeats):
        start, processor_start = time.perf_counter(), _processor_seconds()
        solutions = solve_many(problems, settings, description=f"{case.variant} {sweep}")
        seconds.append(time.perf_counter() - start)
        # The processor time of workers is only available after they have ended; the next run starts new ones.
        get_reusable_executor().shutdown()
        processor.append(_processor_seconds() - processor_start)
    each = _reference_seconds(problems[:references], solutions, settings) if references else np.nan
    return Measurement(
        sweep=sweep,
        variant=case.variant,
        states=4 * case.places,
        dimension=case.dimension,
        trajectories=case.trajectories,
        median_seconds=float(np.median(seconds)),
        worst_seconds=max(seconds),
        processor_seconds=float(np.median(processor)),
        optimal=sum(solution.status == "optimal" for solution in solutions),
        worst_gap=float(np.nanmax([solution.duality_gap for solution in solutions])),
        worst_residual=float(np.nanmax([solution.primal_residual for solution in solutions])),
        cvxpy_seconds_each=each,
        ratio=each * case.trajectories / float(np.median(seconds)),
    )


def _processor_seconds() -> float:
    """Processor time of this process and of its ended child processes."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def _reference_seconds(
    problems: Sequence[MaxMarginProblem], solutions: Sequence[Solution], settings: MaxMarginSettings
) -> float:
    seconds = []
    for problem, solution in zip(problems, solutions, strict=False):
        start = time.perf_counter()
        reference = reference_max_margin(problem, settings)
        seconds.append(time.perf_counter() - start)
        np.testing.assert_allclose(solution.objective, reference.objective, rtol=1e-6)
    return float(np.median(seconds))


def main(folder: Path = Path("runs/bench/irl"), repeats: int = 3, references: int = 3) -> tuple[Measurement, ...]:
    """Run the benchmark.

    Args:
        folder: output folder of the table and the figure.
        repeats: number of timed runs of each case.
        references: number of problems of the headline cases that cvxpy also solves.

    Returns:
        The measurements.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = [measure("headline", HEADLINE, repeats, references)]
    rows.append(measure("headline", replace(HEADLINE, variant="lp-l2", dimension=64), repeats, references))
    for variant, dimension in (("lp", 2048), ("lp-l2", 64)):
        base = Case(variant, 100, dimension, 200)
        rows += [measure("states", replace(base, places=places), repeats, 0) for places in (25, 50, 100, 200)]
        rows += [measure("trajectories", replace(base, trajectories=n), repeats, 0) for n in (50, 100, 400, 800)]
    for dimension in (16, 32, 64, 128, 256, 512, 2048):
        # With at least half as many dimensions as states, the programs are dense and large.
        count = 100 if dimension <= 128 else 20
        rows.append(measure("dimension", Case("lp-l2", 100, dimension, count), repeats, 0))
    write_rows(folder / "irl.csv", rows)
    _draw(rows, folder / "irl.png")
    table = Table(title=f"Maximum-margin IRL: {describe_computer()}", padding=(0, 0))
    for heading in ("sweep", "variant", "states", "d", "problems", "median s", "worst s", "per s", "gap", "× cvxpy"):
        table.add_column(heading, justify="left" if heading in ("sweep", "variant") else "right", no_wrap=True)
    for row in rows:
        table.add_row(
            row.sweep,
            row.variant,
            f"{row.states}",
            f"{row.dimension}",
            f"{row.trajectories}",
            f"{row.median_seconds:.2f}",
            f"{row.worst_seconds:.2f}",
            f"{row.trajectories / row.median_seconds:.0f}",
            f"{row.worst_gap:.0e}",
            "" if np.isnan(row.ratio) else f"{row.ratio:.0f}",
        )
    Console().print(table)
    return tuple(rows)


def _draw(rows: Sequence[Measurement], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.2), layout="constrained")
    for axes, sweep in zip(figure.subplots(1, 3), ("states", "dimension", "trajectories"), strict=True):
        for variant in ("lp", "lp-l2"):
            line = [row for row in rows if row.sweep == sweep and row.variant == variant]
            if line:
                label = variant if sweep == "dimension" else f"{variant}, d = {line[0].dimension}"
                milliseconds = [1e3 * row.median_seconds / row.trajectories for row in line]
                axes.loglog([getattr(row, sweep) for row in line], milliseconds, "o-", label=label)
        axes.set(xlabel=sweep, ylabel="milliseconds per problem")
        label_log_axes(axes, [getattr(row, sweep) for row in rows if row.sweep == sweep])
        axes.legend(frameon=False, fontsize=8)
    write_bytes(path, as_png(figure))


if __name__ == "__main__":
    main()
