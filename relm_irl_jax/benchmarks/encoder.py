"""Images per second of the encoders: the small network at 64x64, and ResNet-50 at 224x224.

ResNet-50 is compared with the same network in torch if torch is installed. The programs run in turn in one process on
the same images, so that all have the same conditions: this package, and torch in both of its memory layouts, also with
folded batch norms. Wall-clock time depends on the load of the computer, to a different extent for programs with several
threads; processor time does not include other processes. On a busy computer, compare the processor times with one
thread: `taskset -c 0 relm-irl bench encoder`.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32, Float64
from rich.table import Table

from relm_irl_jax.benchmarks.timing import REPEATS, describe_computer
from relm_irl_jax.features import weights
from relm_irl_jax.features.convnet import VIEW, fold_batch_norms, initial_variables
from relm_irl_jax.features.encoder import IMAGENET_MEAN, IMAGENET_STD, Views, encode_batch
from relm_irl_jax.features.resnet import STAGES, layers
from relm_irl_jax.progress import console

SIZE = 224
"""Height and width of the images."""

BATCH_SIZES = (8, 16, 32)
"""Numbers of images in a batch."""


@dataclass(frozen=True)
class Timing:
    """Durations of one program in seconds.

    Attributes:
        wall: wall-clock time of each repeat.
        processor: processor time of each repeat.
    """

    wall: Float64[np.ndarray, "repeat"]
    processor: Float64[np.ndarray, "repeat"]


SMALL_BATCH_SIZES = (16, 64, 256)
"""Numbers of views in a batch of the small network."""


def main() -> None:
    """Measure and print the tables."""
    console.print(small_table())
    state = weights.random_state_dict(seed=0)
    params = jax.tree.map(jnp.asarray, weights.fold_batch_norms(state))
    references = {
        "torch": torch_program(state, channels_last=False),
        "torch channels last": torch_program(state, channels_last=True),
    }
    table = Table(title=f"ResNet-50 at {SIZE}x{SIZE}, images/s\n{describe_computer()}")
    for heading in ("program", "batch", "wall median", "wall worst", "processor median"):
        table.add_column(heading, justify="left" if heading == "program" else "right")
    for batch in BATCH_SIZES:
        views = np.random.default_rng(0).integers(0, 256, (batch, SIZE, SIZE, 3), np.uint8)
        programs: dict[str, Callable[[], object]] = {"relm_irl_jax": partial(encode_views, params, views)}
        for name, reference in references.items():
            if reference is not None:
                programs[name] = partial(reference, views)
                difference = np.abs(reference(views) - encode_views(params, views)).max()
                console.print(f"batch {batch}: largest difference to {name} {difference:.1e}")
        for name, timing in measure_in_turn(programs).items():
            seconds = (np.median(timing.wall), timing.wall.max(), np.median(timing.processor))
            table.add_row(name, str(batch), *(f"{batch / value:.1f}" for value in seconds))
    console.print(table)
    if None in references.values():
        console.print("torch (extra `peers`) is not installed, so there is no comparison")


def small_table() -> Table:
    """Measure the small network, on random weights: the rate does not depend on their values."""
    params = jax.tree.map(jnp.asarray, fold_batch_norms(initial_variables(jax.random.key(0))))
    table = Table(title=f"Small network at {VIEW}x{VIEW}, views/s\n{describe_computer()}")
    for heading in ("batch", "wall median", "wall worst", "processor median"):
        table.add_column(heading, justify="right")
    for batch in SMALL_BATCH_SIZES:
        views = np.random.default_rng(0).integers(0, 256, (batch, VIEW, VIEW, 3), np.uint8)

        def program(views: Views = views) -> np.ndarray:
            return np.asarray(encode_batch(params, views, VIEW, "convnet"))

        timing = measure_in_turn({"small": program})["small"]
        seconds = (np.median(timing.wall), timing.wall.max(), np.median(timing.processor))
        table.add_row(str(batch), *(f"{batch / value:.0f}" for value in seconds))
    return table


def encode_views(params: weights.Params, views: Views) -> Float32[np.ndarray, "view 2048"]:
    """Encode views with this package, and copy the features to the host.

    Args:
        params: parameters of `ResNet50`.
        views: views.
    """
    return np.asarray(encode_batch(params, views, SIZE))


def measure_in_turn(programs: dict[str, Callable[[], object]]) -> dict[str, Timing]:
    """Time programs in turn, repeatedly, so that all have the same conditions; the first call of each is not counted.

    Args:
        programs: the programs by name.

    Returns:
        Durations by name.
    """
    wall: dict[str, list[float]] = {name: [] for name in programs}
    processor: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(REPEATS + 1):
        for name, program in programs.items():
            start = time.perf_counter(), time.process_time()
            program()
            wall[name].append(time.perf_counter() - start[0])
            processor[name].append(time.process_time() - start[1])
    return {name: Timing(np.asarray(wall[name][1:]), np.asarray(processor[name][1:])) for name in programs}


def torch_program(state: weights.StateDict, *, channels_last: bool) -> Callable[[np.ndarray], np.ndarray] | None:
    """The same network in torch, with folded batch norms; None if torch is not installed.

    Args:
        state: the weights.
        channels_last: whether torch's memory layout is NHWC instead of its default, NCHW.

    Returns:
        A function from uint8 views to features.
    """
    try:
        import torch
    except ImportError:
        return None
    layout = torch.channels_last if channels_last else torch.contiguous_format
    mean, deviation = (torch.tensor(values)[:, None, None] for values in (IMAGENET_MEAN, IMAGENET_STD))
    parameters = {}
    for layer in layers():
        kernel, bias = weights.fold_layer(state, layer)
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
