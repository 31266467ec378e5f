"""Frames a second: the environment alone, with the policy, and training, beside a plain matrix product.

Writes `agent.csv` and `agent.png`, and prints the table. The scenes are empty rooms with the built-in rooms' numbers of
states, random features of 2048 numbers and a learned reward of 64; no rate depends on what the views show. An
update's operations are counted by hand: products of the shared layer, both halves of the fusion layer and the heads,
forward once and backward, as often as they are computed.
"""

import csv
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray
from rich.console import Console
from rich.table import Table

from relm_irl_jax.agent.rollout import rollout, sample_action
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.network import SiameseActorCritic
from relm_irl_jax.agent.siamese.passes import passes
from relm_irl_jax.agent.siamese.train import begin, cheaper_pairs, network_of, run_chunk, worker_lanes
from relm_irl_jax.agent.siamese.update import Learner, Setting, sampling_actor
from relm_irl_jax.benchmarks.axes import label_log_axes
from relm_irl_jax.benchmarks.irl import open_room
from relm_irl_jax.benchmarks.timing import Timing, describe_machine, time_calls
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.rewards.model import LinearReward
from relm_irl_jax.tasks import Target
from relm_irl_jax.world import build_targets, build_world

PLACES = (42, 42, 90, 90, 148, 148)
"""Places of the six scenes, four states each: two bathrooms, bedrooms and living rooms."""

FEATURES, DIMENSION, CAP, UPDATES = 2048, 64, 100, 8


@dataclass(frozen=True)
class Rate:
    """One timed case.

    Attributes:
        what: `environment`, `acting` (environment and policy) or `training`.
        history: number of last views that the network sees.
        workers: number of workers.
        t_max: steps of each worker in a rollout or update.
        frames: frames of a call.
        first_seconds: the first call, compilation included.
        median_seconds: of the calls after it.
        worst_seconds: of the calls after it.
        frames_per_second: at the median.
        gflops: operations a second at the median, in 1e9; NaN where none are counted.
    """

    what: str
    history: int
    workers: int
    t_max: int
    frames: int
    first_seconds: float
    median_seconds: float
    worst_seconds: float
    frames_per_second: float
    gflops: float


def setting_of(settings: SiameseSettings, devices: int = 1) -> tuple[Setting, Learner, SiameseActorCritic]:
    """Six empty rooms, twenty targets and a learned reward.

    Args:
        settings: the agent's settings.
        devices: number of devices that share the workers.

    Returns:
        What training looks up, its first state, and the network.
    """
    generator = np.random.default_rng(0)
    scenes = []
    for number, places in enumerate(PLACES):
        room = open_room(places)
        features = generator.normal(size=(room.n_states, FEATURES)).astype(np.float32)
        scenes.append(replace(room, name=f"{number}", features=features))
    world = build_world(scenes, [number // 2 for number in range(len(scenes))])
    count = [4, 4, 3, 3, 3, 3]
    chosen = [
        Target(number, int(state))
        for number, scene in enumerate(scenes)
        for state in sorted(generator.choice(scene.n_states, count[number], replace=False))
    ]
    targets = build_targets(scenes, chosen)
    longest = max(scene.n_states for scene in scenes)
    reward = LinearReward(
        weights=jnp.asarray(generator.normal(size=(len(chosen) * longest, DIMENSION)) / DIMENSION, jnp.float32),
        row=jnp.arange(len(chosen) * longest).reshape(len(chosen), longest),
        features=world.features[:, :DIMENSION],
        r_max=jnp.float32(1.0),
        least_cost=jnp.float32(0.3),
    )
    network = network_of(settings, 3)
    lane = worker_lanes(targets, world, 3, settings.workers)
    learner = begin(jax.random.key(0), world, targets, lane, network, settings)
    pairs = cheaper_pairs(world, targets, network, lane.first.size * settings.t_max // devices)
    return Setting(world, targets, lane, reward, jnp.float32(10.0), pairs), learner, network


def operations(setting: Setting, network: SiameseActorCritic, frames: int) -> float:
    """Multiplications and additions of one update's products.

    Args:
        setting: gives the number of states, targets and features.
        network: gives the width.
        frames: frames of an update.

    Returns:
        Their number. A product costs as much again for the gradient in its weights and in its input; features have no
        gradient. The values behind the rollout are left out.
    """
    states, features = setting.world.features.shape
    width, targets = network.width, len(setting.targets.state)
    encoded = min(states, frames)  # tables over all states, or every frame by itself
    fused = encoded if network.history == 1 else frames
    if network.history > 1 or frames < states:
        encoded += targets
    shared = 2 * 2 * encoded * network.history * features * width
    fusion = 3 * 2 * (fused + targets) * width * width
    computed = frames if setting.pairs is None else setting.pairs.count
    heads = 3 * 2 * computed * width * (width + 5)
    return float(shared + fusion + heads)


def rates(settings: SiameseSettings, repeats: int) -> list[Rate]:
    """Time the environment, acting and training with one number of workers.

    Args:
        settings: the agent's settings.
        repeats: timed calls after the first.

    Returns:
        One row for each of the three.
    """
    setting, learner, network = setting_of(settings)
    workers = setting.lane.first.size
    keys = iter(jax.random.split(jax.random.key(1), 4 * (repeats + 1)))

    def indifferent(key: PRNGKeyArray, views: Array, target: Array) -> tuple[Array, None]:
        return sample_action(key, jnp.zeros((*target.shape, 4))), None

    @jax.jit
    def environment(key: PRNGKeyArray):
        episode, experience, sums = _roll(key, indifferent, setting, learner, UPDATES * settings.t_max)
        return episode, experience.reward.sum(), sums

    @jax.jit
    def acting(key: PRNGKeyArray, parameters):
        frames = workers * settings.t_max
        at, _ = passes(network, parameters, setting.world, setting.targets, setting.pairs, frames)
        episode, experience, sums = _roll(key, sampling_actor(at), setting, learner, UPDATES * settings.t_max)
        return episode, experience.reward.sum(), sums

    def training():
        return run_chunk(learner, setting, network=network, settings=settings, cap=CAP, updates=UPDATES)

    frames = workers * settings.t_max * UPDATES
    counted = UPDATES * operations(setting, network, frames // UPDATES)
    cases = {
        "environment": (lambda: environment(next(keys)), np.nan),
        "acting": (lambda: acting(next(keys), learner.parameters), np.nan),
        "training": (training, counted),
    }
    return [_rate(what, settings, frames, time_calls(call, repeats), work) for what, (call, work) in cases.items()]


def _roll(key: PRNGKeyArray, actor, setting: Setting, learner: Learner, length: int):
    return rollout(
        key,
        actor,
        learner.episode,
        setting.lane,
        setting.world,
        setting.targets,
        setting.reward_model,
        jnp.int32(CAP),
        length,
    )


def _rate(what: str, settings: SiameseSettings, frames: int, timing: Timing, work: float) -> Rate:
    return Rate(
        what,
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
    """Rate of a square float32 product on this machine.

    Args:
        repeats: timed calls after the first.

    Returns:
        Operations a second, in 1e9.
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
        folder: where the table and the figure go.
        repeats: timed calls of each case after the first.
        workers: numbers of workers to sweep.
        histories: numbers of views seen at once, with each of them.

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
    with (folder / "agent.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    _draw(rows, folder / "agent.png")
    caption = f"share: of a plain 2048 × 2048 float32 product, {peak:.0f} GFLOP/s"
    table = Table(title=describe_machine(), caption=caption, padding=(0, 0))
    for heading in ("", "views", "workers", "first s", "median ms", "worst ms", "frames/s", "GFLOP/s", "share"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for row in rows:
        table.add_row(
            row.what,
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
    for what, history in dict.fromkeys((row.what, row.history) for row in rows):
        own = [row for row in rows if (row.what, row.history) == (what, history)]
        label = what if history == 1 else f"{what}, {history} views"
        axes.loglog([row.workers for row in own], [row.frames_per_second for row in own], "o-", label=label)
    axes.set(xlabel="workers", ylabel="frames a second")
    label_log_axes(axes, [row.workers for row in rows])
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(path, dpi=150)
