"""Benchmark of the regularised ELM: comparison with hpelm, the largest size in this project, and scaling.

The table also contains the minimum computation of any such method ("floor"), measured on the same computer: one QR
factorisation of the N × L hidden outputs, and one pass over an L × p array for each of L steps.
"""

import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Float64, Int
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from relm_irl_jax.benchmarks.axes import label_log_axes
from relm_irl_jax.benchmarks.rows import write_rows
from relm_irl_jax.benchmarks.timing import REPEATS, describe_computer, time_calls
from relm_irl_jax.elm.hidden_layer import HiddenLayer, draw_hidden_layer
from relm_irl_jax.elm.least_squares import solve_output_weights
from relm_irl_jax.elm.matrices import float64
from relm_irl_jax.elm.mrsr import mrsr_path
from relm_irl_jax.elm.press import press_path_of_basis
from relm_irl_jax.files import write_bytes
from relm_irl_jax.report.figures import as_png


class Size(NamedTuple):
    """Samples N, neurons L and outputs p of a problem."""

    N: int
    L: int
    p: int


PEER = Size(2000, 400, 64)
"""Size of the comparison with hpelm."""

LARGEST = Size(2000, 1950, 256)
"""Largest size in this project."""

LIMITS = {1: 60.0, 2: 25.0}
"""Time limit in seconds at the largest size on two cores, for each norm."""

SCALING = {
    "L": [Size(2000, L, 64) for L in (50, 100, 200, 400, 800, 1600)],
    "N": [Size(N, 400, 64) for N in (500, 1000, 2000, 4000, 8000)],
    "p": [Size(2000, 400, p) for p in (1, 4, 16, 64, 256, 1024)],
}
"""Sizes along each axis of the figure."""

INPUTS = 128
"""Dimension of the synthetic inputs."""

NORMS: tuple[Literal[1], Literal[2]] = (1, 2)
"""Norms of MRSR."""


@dataclass(frozen=True)
class Measurement:
    """One measured case.

    Attributes:
        case: `hpelm`, `largest`, or the axis of the scaling figure.
        method: the timed method.
        N: number of samples.
        L: number of neurons.
        p: number of outputs.
        first: seconds of the first call, including compilation.
        median: median seconds of the other calls.
        worst: largest number of seconds of the other calls.
        repeats: number of the other calls.
        kept: number of selected neurons.
        error: mean squared error on test samples, as a share of the targets' variance.
    """

    case: str
    method: str
    N: int
    L: int
    p: int
    first: float
    median: float
    worst: float
    repeats: int
    kept: int | None = None
    error: float | None = None


@dataclass(frozen=True)
class Problem:
    """Inputs, targets and hidden outputs for training and testing."""

    X: Float64[np.ndarray, "samples inputs"]
    T: Float64[np.ndarray, "samples outputs"]
    H: Float64[np.ndarray, "samples neurons"]
    X_test: Float64[np.ndarray, "test inputs"]
    T_test: Float64[np.ndarray, "test outputs"]
    H_test: Float64[np.ndarray, "test neurons"]
    layer: HiddenLayer


@dataclass(frozen=True)
class Fit:
    """Selected neurons, their output weights and the intercept."""

    neurons: Int[np.ndarray, "kept"]
    coef: Float64[np.ndarray, "kept outputs"]
    intercept: Float64[np.ndarray, "outputs"]


def make_problem(size: Size) -> Problem:
    """Random inputs, smooth targets with noise of standard deviation 0.1, and one hidden layer."""
    rng = np.random.default_rng(0)
    X = rng.standard_normal((size.N + 1000, INPUTS))
    T = np.tanh(X @ rng.standard_normal((INPUTS, size.p)) / np.sqrt(INPUTS))
    T += 0.1 * rng.standard_normal(T.shape)
    layer = draw_hidden_layer(X[: size.N], size.L, "tanh", np.random.RandomState(0))
    H = layer(X)
    return Problem(X[: size.N], T[: size.N], H[: size.N], X[size.N :], T[size.N :], H[size.N :], layer)


def fit(problem: Problem, norm: Literal[1, 2]) -> Fit:
    """MRSR, PRESS of every prefix, and the refit: the steps of `ELMRegressor.fit` after drawing the layer."""
    path = mrsr_path(problem.H, problem.T, norm)
    press = press_path_of_basis(path.basis, problem.T, problem.H.shape[1])
    neurons = path.order[: press.best_size]
    return Fit(neurons, *solve_output_weights(problem.H[:, neurons], problem.T))


def relative_error(T: Float64[np.ndarray, "test outputs"], prediction: Float64[np.ndarray, "test outputs"]) -> float:
    """Mean squared error divided by the variance."""
    return float(np.mean((T - prediction) ** 2) / np.mean((T - T.mean(axis=0)) ** 2))


def time_fit(case: str, size: Size, norm: Literal[1, 2], repeats: int) -> Measurement:
    """Time this library at one size."""
    problem = make_problem(size)
    timing = time_calls(lambda: fit(problem, norm), repeats)
    fitted = fit(problem, norm)
    error = relative_error(problem.T_test, problem.H_test[:, fitted.neurons] @ fitted.coef + fitted.intercept)
    kept = len(fitted.neurons)
    return Measurement(case, f"relm-irl-jax, norm {norm}", *size, **asdict(timing), kept=kept, error=error)


def time_hpelm(size: Size, repeats: int) -> Measurement | None:
    """Time hpelm's `train(…, "LOO", "OP")` with the same neurons; None if it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from hpelm import ELM  # pyrefly: ignore[missing-import]
    except ImportError:
        return None
    problem = make_problem(size)
    layer = problem.layer
    X, X_test = ((x - layer.mean) / layer.scale for x in (problem.X, problem.X_test))

    def train():
        elm = ELM(INPUTS, size.p)
        elm.add_neurons(size.L, "tanh", layer.weights, layer.bias)
        elm.train(X, problem.T, "LOO", "OP")
        return elm

    timing = time_calls(lambda: train() and None, repeats)
    elm = train()
    error = relative_error(problem.T_test, elm.predict(X_test))
    kept = len(np.asarray(elm.nnet.B))
    return Measurement("hpelm", "hpelm LOO OP", *size, **asdict(timing), kept=kept, error=error)


@jax.jit
def _minimum_computation(H, A, E):
    """One QR factorisation, and one pass over an L × p array for each step."""
    Q, _ = jnp.linalg.qr(H)
    return Q, lax.fori_loop(0, H.shape[1], lambda i, a: 0.999 * a + 0.001 * E, A)


def time_floor(case: str, size: Size, repeats: int) -> Measurement:
    """Time the minimum computation of any such method."""
    rng = np.random.default_rng(0)
    shapes = (size.N, size.L), (size.L, size.p), (size.L, size.p)
    with float64():
        H, A, E = (jnp.asarray(rng.standard_normal(shape)) for shape in shapes)
        timing = time_calls(lambda: _minimum_computation(H, A, E), repeats)
    return Measurement(case, "floor", *size, **asdict(timing))


def measure_all(repeats: int) -> Iterator[Measurement]:
    """Measure every case."""
    for norm in NORMS:
        yield time_fit("hpelm", PEER, norm, repeats)
    peer = time_hpelm(PEER, repeats)
    if peer is not None:
        yield peer
    for case, sizes in {"largest": [LARGEST], **SCALING}.items():
        for size in sizes:
            for norm in NORMS:
                yield time_fit(case, size, norm, repeats)
            yield time_floor(case, size, repeats)


def draw_scaling(rows: list[Measurement], path: Path) -> None:
    """Time against L, N and p on logarithmic axes, with the floor."""
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    for axes, axis in zip(figure.subplots(1, 3, sharey=True), SCALING, strict=True):
        along = [row for row in rows if row.case == axis]
        for method in ("relm-irl-jax, norm 1", "relm-irl-jax, norm 2", "floor"):
            line = [row for row in along if row.method == method]
            style = "k--" if method == "floor" else "o-"
            axes.loglog([getattr(row, axis) for row in line], [row.median for row in line], style, label=method)
        fixed = ", ".join(f"{name} = {getattr(along[0], name)}" for name in SCALING if name != axis)
        axes.set(xlabel=axis, title=fixed)
        label_log_axes(axes, [getattr(row, axis) for row in along])
    figure.axes[0].set_ylabel("seconds (median)")
    figure.axes[0].legend()
    figure.suptitle(f"MRSR + PRESS of every prefix + refit: {describe_computer()}", fontsize=8)
    write_bytes(path, as_png(figure))


def print_table(console: Console, rows: list[Measurement]) -> None:
    """Print all measurements, and whether they are within the limits."""
    caption = f"{rows[0].repeats} repeats; error: mean squared error on test samples divided by the variance"
    table = Table(title=f"ELM: MRSR + PRESS + refit\n{describe_computer()}", caption=caption, padding=(0, 0))
    for name in ("case", "method", "N × L × p", "first s", "median s", "worst s", "kept", "error"):
        table.add_column(name, justify="left" if name in ("case", "method") else "right", no_wrap=True)
    for row in rows:
        table.add_row(
            row.case,
            row.method.removeprefix("relm-irl-jax, "),
            f"{row.N}×{row.L}×{row.p}",
            *(f"{seconds:.3f}" for seconds in (row.first, row.median, row.worst)),
            "" if row.kept is None else str(row.kept),
            "" if row.error is None else f"{row.error:.5f}",
        )
    console.print(table)
    median = {(row.case, row.method): row.median for row in rows}
    peer = median.get(("hpelm", "hpelm LOO OP"))
    if peer is None:
        console.print(
            "hpelm is not installed; the comparison needs it: pip install 'relm-irl-jax[peers]'.", markup=False
        )
    for norm, limit in LIMITS.items():
        method = f"relm-irl-jax, norm {norm}"
        if peer is not None:
            console.print(f"norm {norm} is {peer / median['hpelm', method]:.1f} times as fast as hpelm (target: 10)")
        console.print(
            f"largest size, norm {norm}: {median['largest', method]:.1f} s (limit on two cores: {limit:.0f} s)"
        )


def main(folder: str | Path = "runs/bench/elm", repeats: int = REPEATS) -> list[Measurement]:
    """Run the benchmark, print its table, and save `elm.csv` and `elm.png`.

    Args:
        folder: output folder.
        repeats: timed calls of each case after the first.

    Returns:
        The rows of the table.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    console = Console()
    rows = []
    for row in measure_all(repeats):
        console.log(f"{row.case} {row.method} N={row.N} L={row.L} p={row.p}: {row.median:.3f} s")
        rows.append(row)
        write_rows(folder / "elm.csv", rows)
    print_table(console, rows)
    draw_scaling(rows, folder / "elm.png")
    return rows


if __name__ == "__main__":
    main()
