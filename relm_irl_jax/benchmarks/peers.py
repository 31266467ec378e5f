"""Every part beside another library's, one after the other in one process of this computer.

Writes `peers.csv` and prints the table. A ratio above 1 says how many times as fast this package is. Libraries that are
not installed have no row; `pip install 'relm-irl-jax[peers]'` installs them. Only the two programs of a row do the same
work; what each row compares is its first column.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.training import prepare_training, run_updates
from relm_irl_jax.benchmarks import elm, encoder, irl
from relm_irl_jax.benchmarks.agent import UPDATES, benchmark_problem, imagined_program
from relm_irl_jax.benchmarks.environment import STEPS, environment_program, gymnax_program
from relm_irl_jax.benchmarks.plain_a2c import plain_program
from relm_irl_jax.benchmarks.rows import three_digits, write_rows
from relm_irl_jax.benchmarks.timing import describe_computer, time_calls
from relm_irl_jax.features import weights
from relm_irl_jax.progress import progress_bar

WORKERS = 4096
"""Workers of the environment."""

VIEWS = 16
"""Views in a batch of the encoder."""


@dataclass(frozen=True)
class Comparison:
    """One part beside a peer.

    Attributes:
        part: what is computed.
        peer: the other library and its program.
        unit: what is counted.
        ours: rate of this package, in units per second.
        theirs: rate of the peer, in units per second.
        ratio: ours divided by theirs.
        computer: processor, cores, load, JAX version and device.
    """

    part: str
    peer: str
    unit: str
    ours: float
    theirs: float
    ratio: float
    computer: str


def compare(part: str, peer: str, unit: str, ours: float, theirs: float) -> Comparison:
    """One row.

    Args:
        part: what is computed.
        peer: the other library and its program.
        unit: what is counted.
        ours: rate of this package, in units per second.
        theirs: rate of the peer, in units per second.

    Returns:
        The row, with the ratio and the computer.
    """
    return Comparison(part, peer, unit, ours, theirs, ours / theirs, describe_computer())


def _rate(program: Callable[[], Any], count: int, repeats: int) -> float:
    return count / time_calls(program, repeats).median


def environment_rows(repeats: int) -> Iterator[Comparison]:
    """The environment beside gymnax's; resets are part of both.

    Args:
        repeats: timed calls of each program.

    Yields:
        The row, if gymnax is installed.
    """
    if (peer := gymnax_program(WORKERS)) is not None:
        ours = _rate(environment_program(benchmark_problem(), WORKERS), STEPS * WORKERS, repeats)
        part = f"environment alone, {WORKERS} workers"
        yield compare(part, "gymnax, FourRooms-misc", "steps", ours, _rate(peer, STEPS * WORKERS, repeats))


def training_rows(repeats: int) -> Iterator[Comparison]:
    """Training of the paper's agent beside a plain actor-critic with the same network, environment and batch.

    Args:
        repeats: timed calls of each program.

    Yields:
        The rows: on given targets, and on imagined targets.
    """
    problem, settings = benchmark_problem(), SiameseSettings()
    frames = UPDATES * settings.workers * settings.t_max
    state, inputs, form = prepare_training(jax.random.key(0), problem, settings)
    theirs = _rate(plain_program(problem, settings, UPDATES), frames, repeats)
    peer = "plain A2C in JAX, same network and batch"
    given = _rate(lambda: run_updates(state, inputs, form=form, updates=UPDATES), frames, repeats)
    yield compare("training, 20 given targets", peer, "frames", given, theirs)
    imagined = _rate(imagined_program(problem, settings, UPDATES), frames, repeats)
    yield compare("training, 2,240 imagined targets", peer, "frames", imagined, theirs)


def elm_rows(repeats: int) -> Iterator[Comparison]:
    """The regularised ELM beside hpelm's leave-one-out training with ordered neurons.

    Args:
        repeats: timed fits of each program.

    Yields:
        The row, if hpelm is installed.
    """
    if (peer := elm.time_hpelm(elm.PEER, min(repeats, 3))) is not None:
        ours = elm.time_fit("hpelm", elm.PEER, 2, repeats)
        part = f"ELM, {elm.PEER.N} samples, {elm.PEER.L} neurons, {elm.PEER.p} outputs"
        yield compare(part, "hpelm, LOO and OP", "fits", 1 / ours.median, 1 / peer.median)


def irl_rows(repeats: int) -> Iterator[Comparison]:
    """The maximum-margin problems beside the same programs written in cvxpy, over w.

    Args:
        repeats: timed runs.

    Yields:
        A row for each variant of the problem.
    """
    for case in (irl.HEADLINE, replace(irl.HEADLINE, variant="lp-l2", dimension=64)):
        row = irl.measure("peers", case, min(repeats, 3), references=3)
        part = f"IRL, `{case.variant}`, {row.states} states, φ {case.dimension}-D"
        ours = row.trajectories / row.median_seconds
        yield compare(part, "cvxpy, a fresh problem each", "problems", ours, 1 / row.cvxpy_seconds_each)


def encoder_rows() -> Iterator[Comparison]:
    """ResNet-50 beside torch, in both of its memory layouts.

    Yields:
        The rows, if torch is installed.
    """
    state = weights.random_state_dict(seed=0)
    params = jax.tree.map(jnp.asarray, weights.fold_batch_norms(state))
    views = np.random.default_rng(0).integers(0, 256, (VIEWS, encoder.SIZE, encoder.SIZE, 3), np.uint8)
    layouts = {"torch": False, "torch, channels last": True}
    peers = {name: encoder.torch_program(state, channels_last=last) for name, last in layouts.items()}
    programs = {name: partial(program, views) for name, program in peers.items() if program is not None}
    if programs:
        timings = encoder.measure_in_turn({"ours": partial(encoder.encode_views, params, views), **programs})
        rate = {name: VIEWS / float(np.median(timing.wall)) for name, timing in timings.items()}
        for name in programs:
            yield compare(f"ResNet-50, {encoder.SIZE}², batch {VIEWS}", name, "views", rate["ours"], rate[name])


def main(folder: Path = Path("runs/bench/peers"), repeats: int = 10) -> tuple[Comparison, ...]:
    """Run the benchmark.

    Args:
        folder: output folder of the table.
        repeats: timed calls of each program after the first.

    Returns:
        The rows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    parts = (
        partial(environment_rows, repeats),
        partial(training_rows, repeats),
        partial(elm_rows, repeats),
        partial(irl_rows, repeats),
        encoder_rows,
    )
    rows: list[Comparison] = []
    with progress_bar("speed beside peers", len(parts), "parts") as advance:
        for part in parts:
            rows += part()
            write_rows(folder / "peers.csv", rows)
            advance(1)
    table = Table(title=describe_computer(), caption="rates in units per second", padding=(0, 0))
    for heading in ("part", "unit", "ours", "peer", "rate of the peer", "ratio"):
        table.add_column(heading, justify="left" if heading in ("part", "unit", "peer") else "right")
    for row in rows:
        table.add_row(
            row.part, row.unit, three_digits(row.ours), row.peer, three_digits(row.theirs), three_digits(row.ratio)
        )
    Console().print(table)
    return tuple(rows)
