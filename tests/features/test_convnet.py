"""The small network, its weights as a file, and the encoder made of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file

from relm_irl_jax.errors import InputError
from relm_irl_jax.features import EncoderSettings, encode, make_encoder, weights
from relm_irl_jax.features.convnet import (
    LAYERS,
    MOMENTUM,
    VIEW,
    ConvNet,
    fold_batch_norms,
    halving_neighbourhoods,
    initial_variables,
    large_patches,
    neighbourhoods,
)
from relm_irl_jax.features.convnet_weights import (
    expected_shapes,
    is_convnet,
    load_convnet,
    save_convnet,
    shipped_path,
    trained_scenes,
)
from relm_irl_jax.features.encoder import image_size_of, preprocess
from relm_irl_jax.features.settings import SHIPPED, settings_for
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE


@pytest.fixture(scope="module")
def variables():
    return initial_variables(jax.random.key(0))


@pytest.fixture(scope="module")
def layers(variables):
    return fold_batch_norms(variables)


@pytest.fixture
def file(layers, tmp_path):
    path = tmp_path / "mine.safetensors"
    save_convnet(path, layers, {"command": "by hand", "scenes": '["bathroom-1000"]'})
    return path


@pytest.fixture(scope="module")
def small_views():
    return np.random.default_rng(0).integers(0, 256, (6, VIEW, VIEW, 3), np.uint8)


@pytest.mark.parametrize(
    ("function", "side", "stride", "before"),
    [(large_patches, 8, 4, 0), (neighbourhoods, 3, 1, 1), (halving_neighbourhoods, 3, 2, 1)],
)
def test_patches_hold_the_pixels_of_their_windows(function, side, stride, before):
    image = np.arange(1, 1 + 16 * 16 * 2, dtype=np.float32).reshape(1, 16, 16, 2)
    padded = np.pad(image, [(0, 0), (before, side), (before, side), (0, 0)])
    patches = np.asarray(function(jnp.asarray(image)))
    assert patches.shape == (1, 16 // stride, 16 // stride, side * side * 2)
    for row in range(16 // stride):
        for column in range(16 // stride):
            top, left = row * stride, column * stride
            window = padded[0, top : top + side, left : left + side]
            assert sorted(patches[0, row, column]) == sorted(window.ravel())


def test_patches_of_all_positions_have_the_same_order():
    # The same window gives the same patch wherever it lies, so that one kernel fits all positions.
    for function in (large_patches, neighbourhoods, halving_neighbourhoods):
        image = np.tile(np.random.default_rng(1).random((1, 4, 4, 3), np.float32), (1, 6, 6, 1))
        patches = np.asarray(function(jnp.asarray(image)))
        step = 24 // patches.shape[1]
        inner = patches[:, 1:-1, 1:-1][:, :: max(4 // step, 1), :: max(4 // step, 1)]
        np.testing.assert_array_equal(inner, np.broadcast_to(inner[:, :1, :1], inner.shape))


def test_folded_batch_norms_give_the_features_of_training(variables, small_views):
    images = preprocess(jnp.asarray(small_views), VIEW)
    network = jax.jit(ConvNet(train=True).apply, static_argnames="mutable")
    trained, changed = network(variables, images, mutable="batch_stats")
    # The running statistics began at 0 and 1, so the batch's own are known.
    of_batch = {
        layer: {
            "mean": values["mean"] / (1 - MOMENTUM),
            "var": (values["var"] - MOMENTUM) / (1 - MOMENTUM),
        }
        for layer, values in changed["batch_stats"].items()
    }
    folded = fold_batch_norms({"params": variables["params"], "batch_stats": of_batch})
    np.testing.assert_allclose(jax.jit(ConvNet().apply)({"params": folded}, images), trained, atol=2e-3)


def test_weights_survive_their_file_in_half_precision(layers, file):
    read, provenance = load_convnet(file)
    assert is_convnet(file)
    assert trained_scenes(provenance) == {"bathroom-1000"}
    assert file.stat().st_size <= 5_000_000
    for layer in LAYERS:
        np.testing.assert_array_equal(read[layer]["kernel"], layers[layer]["kernel"].astype(np.float16))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda tensors, metadata: tensors.pop("residual.bias"), "residual.bias is missing"),
        (lambda tensors, metadata: tensors.update(more=np.zeros(1, np.float16)), "more is not one of"),
        (lambda tensors, metadata: tensors.update({"stage_1.bias": np.zeros(3, np.float16)}), "has shape"),
        (lambda tensors, metadata: tensors["stage_1.bias"].fill(np.nan), "not finite"),
        (lambda tensors, metadata: tensors["stage_1.bias"].fill(1.0), "checksum"),
        (lambda tensors, metadata: metadata.update(network="convnet-9"), "convnet-9"),
    ],
)
def test_wrong_files_of_weights_are_input_errors(file, damage, message):
    tensors, metadata = load_arrays_and_metadata(file)
    tensors = {name: tensor.copy() for name, tensor in tensors.items()}
    damage(tensors, metadata)
    save_arrays(file, tensors, metadata)
    with pytest.raises(InputError, match=message):
        make_encoder(EncoderSettings(weights=str(file)))


def test_the_file_says_which_network_it_is_for(file, tmp_path, small_views):
    encoder = make_encoder(EncoderSettings(weights=str(file)))
    assert encoder.name.startswith("mine ")
    assert image_size_of(EncoderSettings(weights=str(file))) == VIEW
    features = encode(encoder, small_views)
    assert features.shape == (6, 512)
    np.testing.assert_allclose(encode(encoder, small_views[2:3]), features[2:3], atol=1e-4)

    resnet = tmp_path / "resnet50.safetensors"
    save_file(weights.random_state_dict(seed=0), resnet)
    assert not is_convnet(resnet)
    assert not is_convnet(tmp_path / "none.safetensors")
    with pytest.raises(InputError, match=r"encoder\.image_size"):
        make_encoder(EncoderSettings(weights=str(file), image_size=224))


def test_the_fingerprint_follows_the_weights(layers, file, tmp_path):
    other = tmp_path / "other.safetensors"
    save_convnet(other, layers | {"features": {k: v + 1 for k, v in layers["features"].items()}}, {})
    first, second = (make_encoder(EncoderSettings(weights=str(path))) for path in (file, other))
    assert first.fingerprint != second.fingerprint


def test_the_default_depends_on_the_scenes():
    assert settings_for(EncoderSettings(), built_in=True).weights == "rooms"
    assert settings_for(EncoderSettings(), built_in=False).weights == "auto"
    assert settings_for(EncoderSettings(weights="imagenet"), built_in=True).weights == "imagenet"


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_weights_say_where_they_come_from_and_saw_no_room_of_a_task(name):
    path = shipped_path(name)
    layers, provenance = load_convnet(path)
    assert {f"{layer}.{part}": value.shape for layer in LAYERS for part, value in layers[layer].items()} == (
        expected_shapes()
    )
    assert path.stat().st_size <= 5_000_000
    assert provenance["command"].startswith("relm-irl encoder train")
    assert ("--paths" in provenance["command"]) == (name == "rooms-paths")
    assert provenance["source"] == SOURCE
    numbers = [int(scene.rsplit("-", 1)[1]) for scene in trained_scenes(provenance)]
    assert len(numbers) > 100
    assert min(numbers) >= 100
    assert max(numbers) < 10000
