"""Frames per second of the environment, of acting and of training, compared with a matrix product.

Writes `agent.csv` and `agent.png`, and prints the table. The scenes are empty rooms with the built-in rooms' numbers of
states, random features with the dimension of the encoder `rooms` and a learned reward of dimension 64; the rates do not
depend on the content of views. `environment` takes no reward and draws no action. `training` has twenty given targets;
`imagined targets`, as in the default training, has up to a thousand of each scene. The operations of an update are
counted analytically: matrix products of the shared layer, both halves of the fusion layer and the heads, forward and
backward.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray
from rich.console import Console
from rich.table import Table

from relm_irl_jax.agents.rollout import rollout, sample_action
from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.forward import passes_by_frames, passes_by_pairs
from relm_irl_jax.agents.siamese.imagined_training import prepare_imagined
from relm_irl_jax.agents.siamese.imagined_update import run_imagined_updates
from relm_irl_jax.agents.siamese.network import SiameseActorCritic
from relm_irl_jax.agents.siamese.training import prepare_training, run_updates
from relm_irl_jax.agents.siamese.update import UpdateInputs, initial_memory, observe_views
from relm_irl_jax.benchmarks.axes import label_log_axes
from relm_irl_jax.benchmarks.environment import STEPS, environment_program
from relm_irl_jax.benchmarks.irl import open_room
from relm_irl_jax.benchmarks.rows import write_rows
from relm_irl_jax.benchmarks.timing import Timing, describe_computer, time_calls
from relm_irl_jax.files import write_bytes
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.report.figures import as_png
from relm_irl_jax.rewards.equation import LinearRewardForm
from relm_irl_jax.rewards.functions import LinearReward
from relm_irl_jax.rewards.imagined import ImaginedTargets
from relm_irl_jax.tasks import Target
from relm_irl_jax.types import TrainingProblem
from relm_irl_jax.world import build_targets, build_world

PLACES = (42, 42, 90, 90, 148, 148)
"""Places of the six scenes, four states each: two bathrooms, bedrooms and living rooms."""

FEATURES, DIMENSION, CAP, UPDATES = 512, 64, 100, 8


@dataclass(frozen=True)
class Rate:
    """One timed case.

    Attributes:
        case: `environment`, `acting` (environment, reward and policy), `training` or `imagined targets`.
        history: number of last views that the network observes.
        workers: number of workers.
        t_max: steps of each worker in a rollout or update.
        frames: frames in a call.
        first_seconds: duration of the first call, including compilation.
        median_seconds: median duration of the other calls.
        worst_seconds: longest duration of the other calls.
        frames_per_second: frames per second at the median duration.
        gflops: operations per second at the median duration, in 1e9; NaN if they are not counted.
    """

    case: str
    history: int
    workers: int
    t_max: int
    frames: int
    first_seconds: float
    median_seconds: float
    worst_seconds: float
    frames_per_second: float
    gflops: float


def benchmark_problem() -> TrainingProblem:
    """Six empty rooms of three room types, twenty targets and a learned reward.

    Returns:
        The problem.
    """
    generator = np.random.default_rng(0)
    scenes = []
    for number, places in enumerate(PLACES):
        room = open_room(places)
        features = generator.normal(size=(room.n_states, FEATURES)).astype(np.float32)
        scenes.append(replace(room, name=f"{number}", room_type=f"{number // 2}", features=features))
    world = build_world(scenes)
    count = [4, 4, 3, 3, 3, 3]
    chosen = [
        Target(number, int(state))
        for number, scene in enumerate(scenes)
        for state in sorted(generator.choice(scene.n_states, count[number], replace=False))
    ]
    longest = max(scene.n_states for scene in scenes)
    reward = LinearReward(
        weights=jnp.asarray(generator.normal(size=(len(chosen) * longest, DIMENSION)) / DIMENSION, jnp.float32),
        row=jnp.arange(len(chosen) * longest).reshape(len(chosen), longest),
        phi=world.features[:, :DIMENSION],
        form=LinearRewardForm(jnp.float32(1.0), jnp.float32(0.3), relative=True),
    )
    return TrainingProblem(world, build_targets(scenes, chosen), reward, CAP, frames=1, return_scale=10.0)


def operations(inputs: UpdateInputs, network: SiameseActorCritic, frames: int) -> float:
    """Number of multiplications and additions in the matrix products of one update.

    Args:
        inputs: the update's inputs, which give the numbers of states, targets and features.
        network: the network, which gives the width.
        frames: frames of an update.

    Returns:
        The number. Each product needs as many operations again for the gradient with respect to its weights, and for
        the gradient with respect to its input; features have no gradient. By frames, the layers after the shared layer
        are evaluated again for the gradient. The values after the rollout are not counted.
    """
    states, features = inputs.task.world.features.shape
    width, targets = network.width, len(inputs.task.targets.state)
    encoded = min(states, frames)  # tables over all states, or every frame separately
    tabulated = network.history == 1 and states <= frames
    shared = 2 * 2 * (encoded + (0 if tabulated else targets)) * network.history * features * width
    fusion = 2 * (3 * encoded if tabulated else 4 * frames) * width * width + 2 * 3 * targets * width * width
    evaluated = 4 * frames if inputs.pairs is None else 3 * inputs.pairs.count
    heads = 2 * evaluated * width * (width + 5)
    return float(shared + fusion + heads)


def rates(settings: SiameseSettings, repeats: int) -> list[Rate]:
    """Time the environment, acting and training with one number of workers.

    Args:
        settings: the agent's settings.
        repeats: timed calls after the first.

    Returns:
        One row for each case.
    """
    problem = benchmark_problem()
    state, inputs, form = prepare_training(jax.random.key(0), problem, settings)
    task, network = inputs.task, form.network
    shape = task.target_range.first.shape
    frames = shape[0] * shape[1] * settings.t_max
    keys = iter(jax.random.split(jax.random.key(1), repeats + 1))

    @jax.jit
    def acting(key: PRNGKeyArray, parameters):
        if inputs.pairs is None:
            forward, _ = passes_by_frames(network, parameters, task.world, task.targets, frames)
        else:
            forward, _ = passes_by_pairs(network, parameters, task.world, task.targets, inputs.pairs)

        def act(key, memory, observation, target):
            memory, views = observe_views(memory, observation)
            return memory, sample_action(key, forward(views, target).outputs.logits), None

        memory = initial_memory(shape, network.history)
        workers, experience, sums = rollout(key, act, state.workers, task, memory, UPDATES * settings.t_max)
        return workers, experience.reward.sum(), sums

    def training():
        return run_updates(state, inputs, form=form, updates=UPDATES)

    cases = {
        "environment": (environment_program(problem, settings.workers), STEPS * settings.workers, np.nan),
        "acting": (lambda: acting(next(keys), state.parameters), UPDATES * frames, np.nan),
        "training": (training, UPDATES * frames, UPDATES * operations(inputs, network, frames)),
    }
    if settings.history == 1:
        cases["imagined targets"] = (imagined_program(problem, settings, UPDATES), UPDATES * frames, np.nan)
    return [
        _rate(case, settings, count, time_calls(call, repeats), work) for case, (call, count, work) in cases.items()
    ]


def imagined_program(problem: TrainingProblem, settings: SiameseSettings, updates: int) -> Callable[[], Any]:
    """Updates of the default training, on imagined targets by the predicted reward alone.

    Args:
        problem: the benchmark problem; every state is a target, up to `imagined_targets` of each scene, with a
            random reward.
        settings: the agent's settings.
        updates: number of updates in a call.

    Returns:
        The program.
    """
    generator = np.random.default_rng(0)
    sizes = [4 * places for places in PLACES]
    counts = [min(size, settings.imagined_targets) for size in sizes]
    imagined = ImaginedTargets(
        state=tuple(jnp.arange(count, dtype=jnp.int32) for count in counts),
        trained=tuple(jnp.int32(3) for _ in sizes),
        reward=tuple(
            jnp.asarray(generator.random((count, size)), jnp.float32) for count, size in zip(counts, sizes, strict=True)
        ),
        collision=jnp.float32(0.0),
        told=jnp.asarray(False),
    )
    state, inputs, form = prepare_imagined(jax.random.key(0), replace(problem, imagined=imagined), settings)
    return lambda: run_imagined_updates(state, inputs, form=form, updates=updates)


def _rate(case: str, settings: SiameseSettings, frames: int, timing: Timing, work: float) -> Rate:
    return Rate(
        case,
        settings.history,
        settings.workers,
        settings.t_max,
        frames,
        round(timing.first, 3),
        round(timing.median, 5),
        round(timing.worst, 5),
        round(frames / timing.median),
        round(work / timing.median / 1e9, 1),
    )


def plain_product(repeats: int) -> float:
    """Speed of a square float32 matrix product on this computer.

    Args:
        repeats: timed calls after the first.

    Returns:
        Operations per second, in 1e9.
    """
    a, b = jax.random.normal(jax.random.key(0), (2, 2048, 2048))
    multiply = jax.jit(jnp.matmul)
    return 2 * 2048**3 / time_calls(lambda: multiply(a, b), repeats).median / 1e9


def main(
    folder: Path = Path("runs/bench/agent"),
    repeats: int = 10,
    workers: tuple[int, ...] = (64, 128, 256, 512, 1024),
    histories: tuple[int, ...] = (1, 4),
):
    """Run the benchmark.

    Args:
        folder: output folder of the table and the figure.
        repeats: timed calls of each case after the first.
        workers: numbers of workers.
        histories: numbers of observed views, each combined with all numbers of workers.

    Returns:
        The rows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[Rate] = []
    cases = list(product(histories, workers))
    with progress_bar("agent benchmark", len(cases), "cases") as advance:
        for history, count in cases:
            rows += rates(replace(SiameseSettings(), workers=count, history=history), repeats)
            advance(1)
    peak = plain_product(repeats)
    write_rows(folder / "agent.csv", rows)
    _draw(rows, folder / "agent.png")
    caption = f"share: relative to a 2048 × 2048 float32 matrix product, {peak:.0f} GFLOP/s"
    table = Table(title=describe_computer(), caption=caption, padding=(0, 0))
    for heading in ("", "views", "workers", "first s", "median ms", "worst ms", "frames/s", "GFLOP/s", "share"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for row in rows:
        table.add_row(
            row.case,
            f"{row.history}",
            f"{row.workers}",
            f"{row.first_seconds:.1f}",
            f"{1e3 * row.median_seconds:.1f}",
            f"{1e3 * row.worst_seconds:.1f}",
            f"{row.frames_per_second:,.0f}",
            "" if np.isnan(row.gflops) else f"{row.gflops:.0f}",
            "" if np.isnan(row.gflops) else f"{row.gflops / peak:.0%}",
        )
    Console().print(table)
    return tuple(rows)


def _draw(rows: list[Rate], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 4.2), layout="constrained")
    axes = figure.subplots()
    for case, history in dict.fromkeys((row.case, row.history) for row in rows):
        line = [row for row in rows if (row.case, row.history) == (case, history)]
        label = case if history == 1 else f"{case}, {history} views"
        axes.loglog([row.workers for row in line], [row.frames_per_second for row in line], "o-", label=label)
    axes.set(xlabel="workers", ylabel="frames per second")
    label_log_axes(axes, [row.workers for row in rows])
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    write_bytes(path, as_png(figure))
