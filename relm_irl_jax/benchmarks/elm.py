"""Benchmark of the regularised ELM: against hpelm, at the project's largest size, and how it scales.

The floor drawn in the figure is the least that any such method does: one QR of the N × L hidden outputs, and one pass
over an L × p array for each of L steps. Both are measured on the same machine, not assumed.
"""

import csv
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Float64
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from relm_irl_jax.benchmarks.axes import log_axes
from relm_irl_jax.benchmarks.timing import REPEATS, machine, measure
from relm_irl_jax.elm.hidden import HiddenLayer, draw_hidden
from relm_irl_jax.elm.linear import float64
from relm_irl_jax.elm.mrsr import path_and_basis
from relm_irl_jax.elm.press import basis_path
from relm_irl_jax.elm.regressor import output_weights

PEER = (2000, 400, 64)
"""N, L and p of the comparison with hpelm."""

LARGEST = (2000, 1950, 256)
"""N, L and p of the project's largest use."""

LIMITS = {1: 60.0, 2: 25.0}
"""Seconds allowed at the largest size on two cores, for each norm."""

SCALING = {
    "L": [(2000, L, 64) for L in (50, 100, 200, 400, 800, 1600)],
    "N": [(N, 400, 64) for N in (500, 1000, 2000, 4000, 8000)],
    "p": [(2000, 400, p) for p in (1, 4, 16, 64, 256, 1024)],
}
"""Sizes along each axis of the figure."""

INPUTS = 128
"""Dimension of the synthetic inputs."""


@dataclass(frozen=True)
class Row:
    """One measured case.

    Attributes:
        group: `hpelm`, `largest`, or the axis along which the case lies.
        method: what was timed.
        N, L, p: samples, neurons, outputs.
        first: seconds of the first call, compilation included.
        median, worst: seconds of the repeats.
        repeats: their number.
        kept: neurons kept.
        error: mean squared error on unseen samples, as a share of the targets' variance.
    """

    group: str
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
    """Inputs, targets and hidden outputs, for fitting and for judging."""

    X: Float64[np.ndarray, "samples inputs"]
    T: Float64[np.ndarray, "samples outputs"]
    H: Float64[np.ndarray, "samples neurons"]
    X_test: Float64[np.ndarray, "test inputs"]
    T_test: Float64[np.ndarray, "test outputs"]
    H_test: Float64[np.ndarray, "test neurons"]
    layer: HiddenLayer


def problem(N: int, L: int, p: int, seed: int = 0) -> Problem:
    """Smooth targets of random inputs with a tenth of noise, and one hidden layer of L neurons."""
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((N + 1000, INPUTS))
    T = np.tanh(X @ rng.standard_normal((INPUTS, p)) / np.sqrt(INPUTS))
    T += 0.1 * rng.standard_normal(T.shape)
    layer = draw_hidden(X[:N], L, "tanh", np.random.RandomState(seed))
    H = layer(X)
    return Problem(X[:N], T[:N], H[:N], X[N:], T[N:], H[N:], layer)


def fit(data: Problem, norm: int) -> tuple[Any, Any, int]:
    """MRSR, PRESS of every prefix, and the refit: what `ELMRegressor.fit` does after drawing the layer."""
    path, basis = path_and_basis(data.H, data.T, norm)
    press = basis_path(basis, data.T, data.H.shape[1])
    kept = path.order[: press.best]
    beta, intercept = output_weights(data.H[:, kept], data.T)
    return (kept, beta), intercept, press.best


def relative_error(T: Any, prediction: Any) -> float:
    """Mean squared error as a share of the variance."""
    return float(np.mean((T - prediction) ** 2) / np.mean((T - T.mean(axis=0)) ** 2))


def ours(group: str, size: tuple[int, int, int], norm: int, repeats: int) -> Row:
    """Time this library at one size."""
    data = problem(*size)
    timing = measure(lambda: fit(data, norm), repeats)
    (kept, beta), intercept, count = fit(data, norm)
    error = relative_error(data.T_test, data.H_test[:, kept] @ beta + intercept)
    return Row(group, f"relm-irl-jax, norm {norm}", *size, **asdict(timing), kept=count, error=error)


def peer(size: tuple[int, int, int], repeats: int) -> Row | None:
    """Time hpelm's `train(…, "LOO", "OP")` with the same neurons; None where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from hpelm import ELM  # pyrefly: ignore[missing-import]
    except ImportError:
        return None
    data = problem(*size)
    layer = data.layer
    X, X_test = ((x - layer.mean) / layer.scale for x in (data.X, data.X_test))

    def train():
        elm = ELM(INPUTS, size[2])
        elm.add_neurons(size[1], "tanh", layer.weights, layer.bias)
        elm.train(X, data.T, "LOO", "OP")
        return elm

    timing = measure(lambda: train() and None, repeats)
    elm = train()
    error = relative_error(data.T_test, elm.predict(X_test))
    return Row("hpelm", "hpelm LOO OP", *size, **asdict(timing), kept=len(np.asarray(elm.nnet.B)), error=error)


@jax.jit
def _floor(H, A, E):
    """One QR, and one pass over an L × p array a step."""
    Q, _ = jnp.linalg.qr(H)
    steps = lax.fori_loop(0, H.shape[1], lambda i, a: 0.999 * a + 0.001 * E, A)
    return Q, steps


def floor(group: str, size: tuple[int, int, int], repeats: int) -> Row:
    """Time the least that has to be done."""
    N, L, p = size
    rng = np.random.default_rng(0)
    with float64():
        H, A, E = (jnp.asarray(rng.standard_normal(shape)) for shape in ((N, L), (L, p), (L, p)))
        timing = measure(lambda: _floor(H, A, E), repeats)
    return Row(group, "floor", *size, **asdict(timing))


def cases(repeats: int, *, scaling: bool) -> Iterator[Row]:
    """Measure everything, one row at a time."""
    yield ours("hpelm", PEER, 1, repeats)
    yield ours("hpelm", PEER, 2, repeats)
    other = peer(PEER, repeats)
    if other is not None:
        yield other
    for norm in (1, 2):
        yield ours("largest", LARGEST, norm, repeats)
    yield floor("largest", LARGEST, repeats)
    if scaling:
        for axis, sizes in SCALING.items():
            for size in sizes:
                for norm in (1, 2):
                    yield ours(axis, size, norm, repeats)
                yield floor(axis, size, repeats)


def draw(rows: list[Row], path: Path) -> None:
    """Time against L, N and p on log axes, with the floor."""
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    for axes, axis in zip(figure.subplots(1, 3, sharey=True), SCALING, strict=True):
        for method in ("relm-irl-jax, norm 1", "relm-irl-jax, norm 2", "floor"):
            line = [row for row in rows if row.group == axis and row.method == method]
            style = "k--" if method == "floor" else "o-"
            axes.loglog([getattr(row, axis) for row in line], [row.median for row in line], style, label=method)
        fixed = ", ".join(f"{name} = {getattr(line[0], name)}" for name in SCALING if name != axis)
        axes.set(xlabel=axis, title=fixed)
        log_axes(axes, [getattr(row, axis) for row in line])
    figure.axes[0].set_ylabel("seconds (median)")
    figure.axes[0].legend()
    figure.suptitle(f"MRSR + PRESS of every prefix + refit: {machine()}", fontsize=8)
    figure.savefig(path, dpi=150)


def main(folder: str | Path = "runs/bench/elm", repeats: int = REPEATS, *, scaling: bool = True) -> list[Row]:
    """Run the benchmark, print its table, and save `elm.csv` and `elm.png`.

    Args:
        folder: where the files go.
        repeats: timed calls of each case after the first.
        scaling: measure against L, N and p too.

    Returns:
        The rows of the table.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    console = Console()
    rows = []
    for row in cases(repeats, scaling=scaling):
        console.log(f"{row.group} {row.method} N={row.N} L={row.L} p={row.p}: {row.median:.3f} s")
        rows.append(row)
        with (folder / "elm.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(asdict(row)))
            writer.writeheader()
            writer.writerows(asdict(row) for row in rows)

    caption = f"{repeats} repeats; error: on unseen samples, as a share of the variance"
    table = Table(title=f"ELM: MRSR + PRESS + refit\n{machine()}", caption=caption, padding=(0, 0))
    for name in ("case", "method", "N × L × p", "first s", "median s", "worst s", "kept", "error"):
        table.add_column(name, justify="left" if name in ("case", "method") else "right", no_wrap=True)
    for row in rows:
        table.add_row(
            row.group,
            row.method.removeprefix("relm-irl-jax, "),
            f"{row.N}×{row.L}×{row.p}",
            *(f"{seconds:.3f}" for seconds in (row.first, row.median, row.worst)),
            "" if row.kept is None else str(row.kept),
            "" if row.error is None else f"{row.error:.5f}",
        )
    console.print(table)
    median = {(row.group, row.method): row.median for row in rows}
    reference = median.get(("hpelm", "hpelm LOO OP"))
    if reference is None:
        console.print("hpelm is not installed; the comparison needs it: pip install 'relm-irl-jax[peers]'.")
    else:
        for norm in LIMITS:
            ratio = reference / median["hpelm", f"relm-irl-jax, norm {norm}"]
            console.print(f"norm {norm} is {ratio:.1f} times as fast as hpelm (wanted: 10)")
    for norm, limit in LIMITS.items():
        seconds = median["largest", f"relm-irl-jax, norm {norm}"]
        console.print(f"largest size, norm {norm}: {seconds:.1f} s (limit on two cores: {limit:.0f} s)")
    if scaling:
        draw(rows, folder / "elm.png")
    return rows


if __name__ == "__main__":
    main()
