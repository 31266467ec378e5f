"""Which encoder a run uses, at which size rooms are rendered, and that nothing is mixed."""

from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest

from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.features import EncoderSettings
from relm_irl_jax.features.convnet import fold_batch_norms, initial_variables
from relm_irl_jax.features.convnet_weights import save_convnet
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.selection import scene_to_show
from relm_irl_jax.scenes.settings import SceneSettings
from relm_irl_jax.stages.encoding import check_encoder, encode_training, encode_unseen, scene_settings

ROOMS = SceneSettings(training_per_type=1, unseen_per_type=1, size="tiny")


@pytest.fixture(scope="module")
def layers():
    return fold_batch_norms(initial_variables(jax.random.key(0)))


def weights_trained_on(scene: str, layers, folder: Path) -> EncoderSettings:
    path = folder / "mine.safetensors"
    save_convnet(path, layers, {"scenes": f'["{scene}"]'})
    return EncoderSettings(weights=str(path))


def test_rooms_are_rendered_at_the_size_that_the_encoder_takes(layers, tmp_path):
    assert scene_settings(Config()).image_size == 64
    assert scene_settings(Config(encoder=EncoderSettings(weights="random"))).image_size == 224
    assert scene_settings(Config(encoder=weights_trained_on("none", layers, tmp_path))).image_size == 64
    assert scene_settings(Config(scene=replace(ROOMS, image_size=32))).image_size == 32
    assert scene_to_show("rooms", ROOMS, "bathroom-0").views.shape[1:] == (224, 224, 3)


def test_an_encoder_must_not_know_the_rooms_of_a_task(layers, tmp_path):
    config = Config(scene=ROOMS, encoder=weights_trained_on("bedroom-0", layers, tmp_path))
    with pytest.raises(InputError, match="trained on bedroom-0"):
        encode_training(config)
    config = Config(scene=ROOMS, encoder=weights_trained_on("bedroom-1", layers, tmp_path))
    with pytest.raises(InputError, match="trained on bedroom-1"):
        encode_unseen(config, encode_training(config))


def test_the_default_encoder_of_rooms_is_named_in_results():
    encoded = encode_training(Config(scene=ROOMS))
    assert encoded.encoder_name.startswith("rooms ")
    assert all(scene.encoder == encoded.encoder_name for scene in encoded.scenes)
    features = np.concatenate([scene.encoded for scene in encoded.scenes])
    assert features.shape[1] == 512
    assert np.isfinite(features).all()
    assert (features.std(0) > 0).all()


def test_a_run_folder_does_not_mix_encoders(layers, tmp_path):
    folder = RunFolder(tmp_path / "run")
    settings = weights_trained_on("none", layers, tmp_path)
    encoded = encode_training(Config(scene=ROOMS, encoder=settings))
    check_encoder(folder, encoded)
    check_encoder(folder, encoded)
    save_convnet(Path(settings.weights), layers | {"features": {k: v + 1 for k, v in layers["features"].items()}}, {})
    with pytest.raises(InputError, match="were trained with encoder mine"):
        check_encoder(folder, encode_training(Config(scene=ROOMS, encoder=settings)))
