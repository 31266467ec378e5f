"""Images per second of the encoder at 224x224, beside torch's CPU rate for the same network where torch is installed.

All run in turn in one process, on the same images, so that they meet the same load: torch in both of its memory
layouts, with batch norms folded as ours are. Wall-clock time has the load of the machine in it, and programs of several
threads do not suffer from it equally; processor time leaves out the time that others had the cores. On a busy machine
read the processor times of one thread: `taskset -c 0 relm-irl bench encoder`.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt8
from rich.table import Table

from relm_irl_jax.benchmarks.timing import REPEATS, describe_machine
from relm_irl_jax.features import weights
from relm_irl_jax.features.encoder import DEVIATION, MEAN, Views, preprocess
from relm_irl_jax.features.resnet import STAGES, ResNet50, layers, pooled
from relm_irl_jax.progress import console

SIZE = 224
"""Height and width of the images."""

BATCH_SIZES = (8, 16, 32)
"""Images encoded at once."""


@dataclass(frozen=True)
class Timing:
    """Seconds of each repeat of one program."""

    wall: np.ndarray
    processor: np.ndarray


def main() -> None:
    """Print the table."""
    state = weights.random_state_dict(seed=0)
    params = jax.tree.map(jnp.asarray, weights.folded(state))
    rivals = {"torch": torch_program(state, False), "torch channels last": torch_program(state, True)}
    table = Table(title=f"ResNet-50 at {SIZE}x{SIZE}, images/s\n{describe_machine()}")
    for heading in ("program", "batch", "wall median", "wall worst", "processor median"):
        table.add_column(heading, justify="left" if heading == "program" else "right")
    for batch in BATCH_SIZES:
        views = np.random.default_rng(0).integers(0, 256, (batch, SIZE, SIZE, 3), np.uint8)
        programs: dict[str, Callable[[], object]] = {"relm_irl_jax": partial(ours, params, views)}
        for name, rival in rivals.items():
            if rival is not None:
                programs[name] = partial(rival, views)
                difference = np.abs(rival(views) - ours(params, views)).max()
                console.print(f"batch {batch}: largest difference to {name} {difference:.1e}")
        for name, timing in timed_in_turn(programs).items():
            seconds = (np.median(timing.wall), timing.wall.max(), np.median(timing.processor))
            table.add_row(name, str(batch), *(f"{batch / value:.1f}" for value in seconds))
    console.print(table)
    if None in rivals.values():
        console.print("torch (extra `peers`) is not installed: no comparison")


@jax.jit
def _features(params: weights.Params, views: UInt8[Array, "view height width 3"]) -> Float[Array, "view 2048"]:
    return pooled(ResNet50().bind({"params": params})(preprocess(views, SIZE)))


def ours(params: weights.Params, views: Views) -> np.ndarray:
    """Features of views by this package, on the host.

    Args:
        params: parameters of `ResNet50`.
        views: views.
    """
    return np.asarray(_features(params, views))


def timed_in_turn(programs: dict[str, Callable[[], object]]) -> dict[str, Timing]:
    """Time programs one after the other, over and over, so that all meet the same load of the machine.

    Args:
        programs: what to run, by name.

    Returns:
        Seconds of each program.
    """
    wall: dict[str, list[float]] = {name: [] for name in programs}
    processor: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(REPEATS + 1):
        for name, program in programs.items():
            started = time.perf_counter(), time.process_time()
            program()
            wall[name].append(time.perf_counter() - started[0])
            processor[name].append(time.process_time() - started[1])
    return {name: Timing(np.asarray(wall[name][1:]), np.asarray(processor[name][1:])) for name in programs}


def torch_program(state: weights.StateDict, channels_last: bool) -> Callable[[np.ndarray], np.ndarray] | None:
    """The same network in torch, batch norms folded too; None where torch is not installed.

    Args:
        state: the weights.
        channels_last: torch's memory layout: NHWC, or its default, NCHW.

    Returns:
        A function of uint8 views that gives features.
    """
    try:
        import torch
    except ImportError:
        return None
    layout = torch.channels_last if channels_last else torch.contiguous_format
    mean, deviation = (torch.tensor(values)[:, None, None] for values in (MEAN, DEVIATION))
    parameters = {}
    for layer in layers():
        kernel, bias = weights.folded_layer(state, layer)
        parameters[layer.path] = torch.from_numpy(kernel).to(memory_format=layout), torch.from_numpy(bias)

    def convolve(x: "torch.Tensor", path: tuple[str, ...], stride: int = 1) -> "torch.Tensor":
        kernel, bias = parameters[path]
        return torch.nn.functional.conv2d(x, kernel, bias, stride, kernel.shape[-1] // 2)

    def encode(views: np.ndarray) -> np.ndarray:
        with torch.inference_mode():
            x = (torch.from_numpy(views).permute(0, 3, 1, 2).float() / 255 - mean) / deviation
            x = convolve(x.contiguous(memory_format=layout), ("conv1",), 2).relu_()
            x = torch.nn.functional.max_pool2d(x, 3, 2, 1)
            for stage, (_, blocks, stage_stride) in enumerate(STAGES, start=1):
                for block in range(blocks):
                    name, stride = f"layer{stage}.{block}", stage_stride if block == 0 else 1
                    y = convolve(x, (name, "conv1")).relu_()
                    y = convolve(y, (name, "conv2"), stride).relu_()
                    y = convolve(y, (name, "conv3"))
                    if block == 0:
                        x = convolve(x, (name, "downsample"), stride)
                    x = y.add_(x).relu_()
            return x.mean((2, 3)).numpy()

    return encode


if __name__ == "__main__":
    main()
