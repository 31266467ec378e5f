"""Weights from everywhere: seeded, published, from files whole and damaged."""

import hashlib

import numpy as np
import pytest
from safetensors.numpy import save_file

from relm_irl_jax.errors import InputError
from relm_irl_jax.features import pretrained, weights


@pytest.fixture(scope="module")
def state():
    return weights.random_state_dict(seed=0)


def test_random_weights_follow_the_seed(state):
    assert weights.fingerprint(weights.random_state_dict(seed=0)) == weights.fingerprint(state)
    assert weights.fingerprint(weights.random_state_dict(seed=1)) != weights.fingerprint(state)


def test_random_kernels_have_he_scale(state):
    kernel = state["layer3.2.conv2.weight"]
    assert kernel.std() == pytest.approx(np.sqrt(2 / (256 * 9)), rel=0.01)


def test_a_file_with_torchvisions_classifier_and_counters_loads(state, tmp_path):
    path = tmp_path / "resnet50.safetensors"
    extra = {
        "fc.weight": np.zeros((1000, 2048), np.float32),
        "fc.bias": np.zeros(1000, np.float32),
        "bn1.num_batches_tracked": np.asarray(7),
    }
    save_file({**state, **extra}, path)
    loaded = pretrained.load_state_dict(path)
    assert loaded.keys() == weights.expected_shapes().keys()
    assert weights.fingerprint(loaded) == weights.fingerprint(state)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("bn1.weight", np.full(64, 1e300), "not finite in single precision"),
        ("layer2.1.bn3.running_var", None, "is missing"),
        (
            "layer2.1.conv2.weight",
            np.zeros((128, 128, 1, 1), np.float32),
            r"shape \(128, 128, 1, 1\), expected",
        ),
        ("layer9.0.conv1.weight", np.zeros(1, np.float32), "is not one of torchvision's"),
        ("bn1.weight", np.full(64, np.nan, np.float32), "not finite"),
        ("bn1.running_var", np.full(64, -1, np.float32), "negative"),
        ("bn1.bias", np.zeros(64, np.int32), "type int32"),
    ],
)
def test_a_damaged_file_is_named_with_its_tensor(state, tmp_path, name, value, says):
    path = tmp_path / "broken.safetensors"
    broken = {key: tensor for key, tensor in state.items() if key != name}
    save_file(broken if value is None else broken | {name: value}, path)
    with pytest.raises(InputError, match=says) as error:
        pretrained.load_state_dict(path)
    assert str(path) in str(error.value)
    assert name in str(error.value)


def test_finite_weights_that_overflow_together_are_refused(state, tmp_path):
    path = tmp_path / "large.safetensors"
    large = {"bn1.weight": np.full(64, 3e38, np.float32), "bn1.running_var": np.zeros(64, np.float32)}
    save_file(state | large, path)
    with pytest.raises(InputError, match=r"tensors of bn1 overflow in single precision"):
        pretrained.load_state_dict(path)


def test_a_missing_file_and_a_file_of_another_format_are_input_errors(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        pretrained.load_state_dict(tmp_path / "absent.safetensors")
    pickle = tmp_path / "resnet50.pth"
    pickle.write_bytes(b"\x80\x02}q\x00.")
    with pytest.raises(InputError, match="not a readable safetensors file"):
        pretrained.load_state_dict(pickle)


class HttpError(Exception):
    """As the hub's HTTP libraries raise them."""


@pytest.fixture
def cache(monkeypatch, tmp_path):
    """An empty cache folder, and a hub that answers with whatever the test puts into `hub`."""
    monkeypatch.setattr(pretrained.platformdirs, "user_cache_path", lambda *_, **__: tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["imagenet", "imagenet-v2"])
@pytest.mark.parametrize("kind", [ConnectionError, HttpError])
def test_without_a_network_the_error_says_where_to_put_the_file(monkeypatch, cache, name, kind):
    """Of `imagenet-v2`, the hub tells the checksum."""

    def offline(*_, **__):
        raise kind("no network")

    monkeypatch.setattr(pretrained, "hf_hub_download", offline)
    monkeypatch.setattr(pretrained, "get_hf_file_metadata", offline)
    with pytest.raises(InputError, match="could not be downloaded") as error:
        pretrained.fetch_published(name)
    assert str(pretrained.published_path(name)) in str(error.value)
    assert cache in pretrained.published_path(name).parents


def test_a_download_is_kept_and_its_checksum_compared(monkeypatch, cache):
    content, downloads = b"weights", []

    def download(repository, name, revision, local_dir):
        downloads.append((repository, revision))
        local_dir.mkdir(parents=True)
        (local_dir / name).write_bytes(content)

    monkeypatch.setattr(pretrained, "hf_hub_download", download)
    checksum = hashlib.sha256(content).hexdigest()
    monkeypatch.setitem(pretrained.PUBLISHED, "imagenet", pretrained.PublishedWeights("timm/resnet50", "abc", checksum))
    path = pretrained.fetch_published("imagenet")
    assert pretrained.fetch_published("imagenet") == path
    assert downloads == [("timm/resnet50", "abc")]

    path.write_bytes(b"something else")
    with pytest.raises(InputError, match="not the published"):
        pretrained.fetch_published("imagenet")
