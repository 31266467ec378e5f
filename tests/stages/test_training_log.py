"""Logs of trainings: continuing from a checkpoint, damaged checkpoints, TensorBoard's scalars."""

import dataclasses
import struct

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from interruption import EVERY_CHUNK, assert_same, interrupt, resume
from tiny import CHUNK, SMALL, problem

from relm_irl_jax.agents.settings import LogSettings
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.checkpoints import Checkpoints
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.types import TrainingLog


def trained(log):
    return SiameseAgent(SMALL).train(jax.random.key(5), problem(), log)


@pytest.fixture(scope="module")
def uninterrupted():
    return trained(TrainingLog())


def test_checkpoints_are_as_far_apart_as_asked(tmp_path):
    seldom = dataclasses.replace(EVERY_CHUNK, log=LogSettings(checkpoint_minutes=1))
    interrupt(tmp_path, trained, seldom)
    assert not RunFolder(tmp_path).checkpoints("rl", 0).exists()


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_a_damaged_checkpoint_costs_no_more_than_its_training(uninterrupted, tmp_path, capsys):
    interrupt(tmp_path, trained)
    folder = RunFolder(tmp_path).checkpoints("rl", 0)
    for file in folder.rglob("d/*"):
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    result, moved = resume(tmp_path, trained)
    printed = capsys.readouterr().err
    assert "checkpoint cannot be read" in printed
    assert "starts again" in printed
    assert "Traceback" not in printed
    assert moved == [CHUNK] * 4
    assert_same(uninterrupted, result)
    # The new checkpoints are good ones.
    assert_same(uninterrupted, resume(tmp_path, trained)[0])


def test_no_flipped_bit_of_a_checkpoint_gives_another_state(tmp_path):
    """Orbax itself restores other numbers after some of them."""
    state, rows = {"a": jnp.sqrt(jnp.arange(200.0))}, [{"frames": 10.0, "loss": 0.5}]
    with Checkpoints(tmp_path / "c", Config()) as checkpoints:
        checkpoints.save(state, rows)
    arrays = max((tmp_path / "c").rglob("d/*"), key=lambda path: path.stat().st_size)
    refused = 0
    for path, step in ((arrays, 16), (tmp_path / "c/1/rows/metadata", 8)):
        content = path.read_bytes()
        for place in range(0, len(content), step):
            path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
            try:
                with Checkpoints(tmp_path / "c", Config()) as checkpoints:
                    found, found_rows = checkpoints.restore(state)
            except InputError:
                refused += 1
            else:
                assert found_rows == rows
                np.testing.assert_array_equal(found["a"], state["a"])
        path.write_bytes(content)
    assert refused > 5


def test_a_checkpoint_of_another_configuration_is_left_alone(uninterrupted, tmp_path, capsys):
    interrupt(tmp_path, trained, dataclasses.replace(EVERY_CHUNK, frames=7))
    result, moved = resume(tmp_path, trained)
    assert "belongs to another configuration" in capsys.readouterr().err
    assert moved == [CHUNK] * 4
    assert_same(uninterrupted, result)


def events(folder):
    """TensorBoard's scalars in order: each is a length, its checksum, the event and its checksum."""
    from tensorboardX.proto.event_pb2 import Event

    for file in sorted(folder.glob("events.*")):
        content, place = file.read_bytes(), 0
        while place < len(content):
            (length,) = struct.unpack_from("<Q", content, place)
            event = Event.FromString(content[place + 12 : place + 12 + length])
            place += 16 + length
            for value in event.summary.value:
                yield value.tag, event.step, value.simple_value


def test_tensorboard_shows_the_learning_curve(uninterrupted, tmp_path):
    interrupt(tmp_path, trained)
    resume(tmp_path, trained)
    _, curve = uninterrupted
    found = list(events(RunFolder(tmp_path).scalars("rl", 0)))
    for field in dataclasses.fields(curve):
        if field.name != "frames":
            steps, values = zip(*[(step, value) for tag, step, value in found if tag == field.name], strict=True)
            known = np.isfinite(getattr(curve, field.name))
            np.testing.assert_array_equal(steps, curve.frames[known])
            np.testing.assert_array_equal(values, getattr(curve, field.name)[known].astype(np.float32))


def test_tensorboard_can_be_switched_off(tmp_path):
    resume(tmp_path, trained, dataclasses.replace(EVERY_CHUNK, log=LogSettings(tensorboard=False)))
    assert not (tmp_path / "tensorboard").exists()
