"""Encoding and the cache."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file

from relm_irl_jax.errors import InputError
from relm_irl_jax.features import EncoderSettings, cache, encode, encode_cached, make_encoder, weights
from relm_irl_jax.features.encoder import BATCH_SIZE, IMAGENET_MEAN, IMAGENET_STD, preprocess

from .conftest import draw_views


def test_batches_are_padded_and_put_together_in_order(encoder, views):
    assert BATCH_SIZE < len(views) < 2 * BATCH_SIZE
    features = encode(encoder, views)
    assert features.shape == (24, 2048)
    assert features.dtype == np.float32
    np.testing.assert_allclose(encode(encoder, views[15:18]), features[15:18], atol=1e-4)
    assert encode(encoder, views[:0]).shape == (0, 2048)


def test_the_fingerprint_follows_weights_views_and_size(encoder, settings, views, tmp_path):
    assert make_encoder(settings, views).fingerprint == encoder.fingerprint
    assert make_encoder(settings, 255 - views).fingerprint != encoder.fingerprint
    other_seed = dataclasses.replace(settings, seed=1)
    assert make_encoder(other_seed, views).fingerprint != encoder.fingerprint

    path = tmp_path / "resnet50.safetensors"
    save_file(weights.random_state_dict(seed=0), path)
    of_file = make_encoder(EncoderSettings(weights=str(path), image_size=32))
    larger = make_encoder(EncoderSettings(weights=str(path), image_size=64))
    assert of_file.name == "resnet50 resnet50.safetensors"
    assert len({encoder.fingerprint, of_file.fingerprint, larger.fingerprint}) == 3


def test_random_features_tell_views_apart(encoder):
    features = encode(encoder, draw_views(24, seed=5))
    alive = (features > 0).any(axis=0)
    assert alive.mean() > 0.9
    centred = features - features.mean(axis=0)
    singular = np.linalg.svd(centred, compute_uv=False)
    assert (singular > 1e-3 * singular[0]).sum() == 23


def test_other_sizes_are_scaled_and_centre_cropped():
    wide = np.zeros((1, 100, 200, 3), np.uint8)
    wide[:, :, 50:150] = 255
    white = (1 - np.asarray(IMAGENET_MEAN)) / np.asarray(IMAGENET_STD)
    images = np.asarray(preprocess(jnp.asarray(wide), 50))
    assert images.shape == (1, 50, 50, 3)
    np.testing.assert_allclose(images[:, :, 2:-2], np.broadcast_to(white, (1, 50, 46, 3)), atol=1e-5)
    dump = jax.ShapeDtypeStruct((1, 300, 400, 3), np.uint8)
    assert jax.eval_shape(partial(preprocess, size=224), dump).shape == (1, 224, 224, 3)


def test_wrong_input_is_an_input_error(encoder, views):
    with pytest.raises(InputError, match="uint8"):
        encode(encoder, views.astype(np.float32))
    with pytest.raises(InputError, match="calibration views"):
        make_encoder(EncoderSettings())
    with pytest.raises(ValueError, match="image_size"):
        EncoderSettings(image_size=16)


def test_the_cache_is_read_and_keyed_by_views_and_encoder(encoder, views, tmp_path, monkeypatch):
    features = encode_cached(views, encoder, tmp_path)
    changed = views.copy()
    changed[0, 0, 0, 0] ^= 1
    assert cache.cache_key(changed, encoder) != cache.cache_key(views, encoder)
    monkeypatch.setattr(cache, "encode", lambda *_: pytest.fail("encoded again"))
    np.testing.assert_array_equal(encode_cached(views, encoder, tmp_path), features)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("damage", [lambda b: b[:100], lambda b: b[:-1] + bytes([b[-1] ^ 1]), lambda b: b""])
def test_a_damaged_cache_is_computed_again_with_a_notice(encoder, views, tmp_path, monkeypatch, capsys, damage):
    features = np.zeros((len(views), 2048), np.float32)
    monkeypatch.setattr(cache, "encode", lambda *_: features)
    encode_cached(views, encoder, tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    np.testing.assert_array_equal(encode_cached(views, encoder, tmp_path), features)
    assert "encoding again" in capsys.readouterr().err
    assert cache._load(path, features.shape) is not None
