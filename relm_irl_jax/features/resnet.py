"""ResNet-50 without its classifier, as a Flax module with batch norm folded into the convolutions.

The network is torchvision's: a 7x7 convolution of stride 2 and a 3x3 maximum of stride 2, then four stages of
bottleneck blocks (1x1, 3x3, 1x1), the stride of a stage on the first block's 3x3 convolution. Padding is
explicit, 3 for the 7x7 kernel and 1 for the 3x3 kernels: `SAME` would shift every second pixel and
torchvision's weights would no longer fit.

A convolution followed by a batch norm with fixed statistics is one convolution with a bias,

    γ·(k * x − μ)/√(σ² + ε) + β  =  (γ/√(σ² + ε))·k * x  +  β − γμ/√(σ² + ε),

so the network that encodes has no batch norm. `ResNet50(calibrate=True)` has batch norms: it normalises each layer by
the statistics of the batch, and returns these statistics.

Images are NHWC. The smallest image size is 32x32, for which the last feature map is 1x1.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import flax.linen as nn
import jax.numpy as jnp
from jaxtyping import Array, Float

STAGES = ((64, 3, 1), (128, 4, 2), (256, 6, 2), (512, 3, 2))
"""Width, number of blocks and stride of the four stages."""

EXPANSION = 4
"""Output channels of a block, as a multiple of its width."""

N_FEATURES = STAGES[-1][0] * EXPANSION
"""Length of a feature vector: 2048."""

EPSILON = 1e-5
"""Number that batch norm adds to the variance."""


class Convolution(nn.Module):
    """A convolution with a bias; during calibration, with batch norm instead."""

    features: int
    kernel_size: int
    stride: int = 1
    calibrate: bool = False

    @nn.compact
    def __call__(self, x: Float[Array, "view height width channel"]) -> Float[Array, "view rows columns feature"]:
        """Convolve."""
        use_bias = not self.calibrate
        if self.kernel_size == 1:
            # XLA's CPU backend computes a 1x1 convolution faster as a matrix product.
            x = nn.Dense(self.features, use_bias, name="convolution")(x[:, :: self.stride, :: self.stride])
        else:
            kernel, padding = (self.kernel_size, self.kernel_size), self.kernel_size // 2
            convolution = nn.Conv(self.features, kernel, self.stride, padding, use_bias=use_bias, name="convolution")
            x = convolution(x)
        if self.calibrate:
            norm = nn.BatchNorm(False, momentum=0.0, epsilon=EPSILON, use_fast_variance=False, name="normalisation")
            x = norm(x)
        return x


class Bottleneck(nn.Module):
    """A residual block: 1x1 to the width, 3x3, 1x1 to four times the width, plus the (projected) input."""

    width: int
    stride: int
    project: bool
    calibrate: bool = False

    @nn.compact
    def __call__(self, x: Float[Array, "view height width channel"]) -> Float[Array, "view rows columns feature"]:
        """Apply the block."""
        calibrate = self.calibrate
        y = nn.relu(Convolution(self.width, 1, calibrate=calibrate, name="conv1")(x))
        y = nn.relu(Convolution(self.width, 3, self.stride, calibrate=calibrate, name="conv2")(y))
        y = Convolution(self.width * EXPANSION, 1, calibrate=calibrate, name="conv3")(y)
        if self.project:
            x = Convolution(self.width * EXPANSION, 1, self.stride, calibrate=calibrate, name="downsample")(x)
        return nn.relu(x + y)


class ResNet50(nn.Module):
    """Images, normalised by ImageNet's mean and deviation, to the last feature map: 7x7x2048 for 224x224."""

    calibrate: bool = False

    @nn.compact
    def __call__(self, x: Float[Array, "view height width 3"]) -> Float[Array, "view rows columns 2048"]:
        """Compute the feature map."""
        x = nn.relu(Convolution(64, 7, 2, calibrate=self.calibrate, name="conv1")(x))
        x = nn.max_pool(x, (3, 3), (2, 2), padding=((1, 1), (1, 1)))
        for stage, (width, blocks, stride) in enumerate(STAGES, start=1):
            for block in range(blocks):
                first = block == 0
                name = f"layer{stage}.{block}"
                x = Bottleneck(width, stride if first else 1, first, self.calibrate, name=name)(x)
        return x


@dataclass(frozen=True)
class Layer:
    """One of the 53 convolutions with its batch norm.

    Attributes:
        path: path of the `Convolution` in the tree of parameters.
        convolution: torchvision's name of the convolution, for example `layer1.0.conv1`.
        batch_norm: torchvision's name of the batch norm, for example `layer1.0.bn1`.
        shape: shape of torch's kernel: (out, in, height, width).
    """

    path: tuple[str, ...]
    convolution: str
    batch_norm: str
    shape: tuple[int, int, int, int]


def layers() -> Iterator[Layer]:
    """All convolutions, from input to output."""
    yield Layer(("conv1",), "conv1", "bn1", (64, 3, 7, 7))
    channels = 64
    for stage, (width, blocks, _) in enumerate(STAGES, start=1):
        for block in range(blocks):
            name, out = f"layer{stage}.{block}", width * EXPANSION
            shapes = ((width, channels, 1, 1), (width, width, 3, 3), (out, width, 1, 1))
            for number, shape in enumerate(shapes, start=1):
                convolution, batch_norm = f"{name}.conv{number}", f"{name}.bn{number}"
                yield Layer((name, f"conv{number}"), convolution, batch_norm, shape)
            if block == 0:
                shape = (out, channels, 1, 1)
                yield Layer((name, "downsample"), f"{name}.downsample.0", f"{name}.downsample.1", shape)
            channels = out


def global_average_pool(maps: Float[Array, "view rows columns feature"]) -> Float[Array, "view feature"]:
    """Mean over the positions of each feature map.

    Args:
        maps: feature maps.

    Returns:
        One number for each feature.
    """
    return jnp.mean(maps, axis=(1, 2))
