"""The network is torchvision's: parity with the same network in torch, on random weights and statistics."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from relm_irl_jax.features import weights
from relm_irl_jax.features.encoder import encode, preprocess
from relm_irl_jax.features.resnet import ResNet50, global_average_pool, layers


@pytest.fixture(scope="module")
def state():
    """Random weights whose batch norms are not the identity."""
    rng = np.random.default_rng(3)
    state = weights.random_state_dict(seed=1)
    for layer in layers():
        channels = layer.shape[0]
        state[f"{layer.batch_norm}.weight"] = rng.uniform(0.5, 1.0, channels).astype(np.float32)
        state[f"{layer.batch_norm}.bias"] = rng.normal(0, 0.1, channels).astype(np.float32)
        state[f"{layer.batch_norm}.running_mean"] = rng.normal(0, 0.1, channels).astype(np.float32)
        state[f"{layer.batch_norm}.running_var"] = rng.uniform(0.5, 2.0, channels).astype(np.float32)
    return state


def torch_resnet50():
    """torchvision's resnet50 with its module names, without the classifier, from torch alone."""
    torch = pytest.importorskip("torch", reason="torch (extra `peers`) is not installed: no parity to check")
    nn = torch.nn

    def conv(inputs, outputs, size, stride=1):
        return nn.Conv2d(inputs, outputs, size, stride, padding=size // 2, bias=False)

    class Block(nn.Module):
        def __init__(self, inputs, width, stride):
            super().__init__()
            outputs = 4 * width
            self.conv1, self.bn1 = conv(inputs, width, 1), nn.BatchNorm2d(width)
            self.conv2, self.bn2 = conv(width, width, 3, stride), nn.BatchNorm2d(width)
            self.conv3, self.bn3 = conv(width, outputs, 1), nn.BatchNorm2d(outputs)
            self.downsample = None
            if stride != 1 or inputs != outputs:
                self.downsample = nn.Sequential(conv(inputs, outputs, 1, stride), nn.BatchNorm2d(outputs))

        def forward(self, x):
            y = self.bn1(self.conv1(x)).relu()
            y = self.bn2(self.conv2(y)).relu()
            y = self.bn3(self.conv3(y))
            return (y + (x if self.downsample is None else self.downsample(x))).relu()

    class Network(nn.Module):
        def __init__(self):
            super().__init__()
            self.conv1, self.bn1 = conv(3, 64, 7, 2), nn.BatchNorm2d(64)
            self.maxpool = nn.MaxPool2d(3, 2, 1)
            inputs = 64
            for stage, (width, blocks) in enumerate(((64, 3), (128, 4), (256, 6), (512, 3)), start=1):
                stack = []
                for block in range(blocks):
                    stack.append(Block(inputs, width, 2 if block == 0 and stage > 1 else 1))
                    inputs = 4 * width
                setattr(self, f"layer{stage}", nn.Sequential(*stack))

        def forward(self, x):
            x = self.maxpool(self.bn1(self.conv1(x)).relu())
            return self.layer4(self.layer3(self.layer2(self.layer1(x))))

    return Network().eval()


def test_parity_with_torch(state):
    """Two images of even height and odd width: maps of 2 x 3 positions, so that a wrong padding shows."""
    network = torch_resnet50()
    import torch

    network.load_state_dict({name: torch.from_numpy(value) for name, value in state.items()}, strict=False)
    images = np.random.default_rng(0).normal(size=(2, 64, 65, 3)).astype(np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(images.transpose(0, 3, 1, 2))).numpy().transpose(0, 2, 3, 1)

    maps = jax.jit(ResNet50().apply)({"params": weights.fold_batch_norms(state)}, images)

    assert maps.shape == (2, 2, 3, 2048)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(np.asarray(maps) / scale, expected / scale, atol=1e-4, rtol=0)
    pooled = np.asarray(global_average_pool(maps))
    np.testing.assert_allclose(pooled / scale, expected.mean((1, 2)) / scale, atol=1e-4, rtol=0)


def test_every_tensor_of_torch_is_known(state):
    theirs = {
        name: tuple(value.shape)
        for name, value in torch_resnet50().state_dict().items()
        if not name.endswith("num_batches_tracked")
    }
    assert theirs == weights.expected_shapes()


def test_calibrated_statistics_are_those_of_the_calibrated_network(encoder, views):
    """Folding the measured statistics gives the very network that ran while they were measured."""
    images = preprocess(jnp.asarray(views), encoder.image_size)
    params = weights.calibration_params(weights.random_state_dict(seed=0))
    maps, _ = weights.apply_calibrating({"params": params}, images, mutable="batch_stats")
    expected = np.asarray(global_average_pool(maps))
    np.testing.assert_allclose(encode(encoder, views), expected, atol=1e-3 * np.abs(expected).max())
