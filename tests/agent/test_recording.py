"""Records of trainings: going on behind a checkpoint, damaged checkpoints, TensorBoard's scalars."""

import dataclasses
import struct

import jax
import numpy as np
import pytest
from interruption import EVERY_CHUNK, assert_same, cut_off, take_up
from relm_irl_jax.agent.learning import TrainingRecord
from relm_irl_jax.agent.settings import RecordSettings, SiameseSettings
from relm_irl_jax.agent.siamese.cloning import clone, decisions_of
from relm_irl_jax.agent.siamese.train import train
from test_cloning import two_rooms
from test_update import STEP_COST, room

from relm_irl_jax.run_folder import RunFolder

SMALL = SiameseSettings(workers=8, t_max=4, width=8)


def siamese(record):
    world, targets = room()
    return train(jax.random.key(5), world, targets, STEP_COST, 10.0, 2, SMALL, 20, 1000, record)


def cloning(record):
    world, targets, state, target, action = two_rooms()
    decisions = decisions_of(state, target, action, world, 2)
    return clone(jax.random.key(0), world, targets, decisions, 2, SMALL, 1000, record)


@pytest.fixture(scope="module")
def uninterrupted():
    return siamese(TrainingRecord())


def test_a_training_that_was_cut_off_ends_the_same(uninterrupted, tmp_path):
    cut_off(tmp_path, siamese)
    assert [x.name for x in RunFolder(tmp_path).checkpoints("rl", 0).iterdir()] == ["2"]
    result, moved = take_up(tmp_path, siamese)
    assert moved == [512, 256, 256]
    assert_same(uninterrupted, result)


def test_a_cloning_that_was_cut_off_ends_the_same(tmp_path):
    cut_off(tmp_path, cloning)
    assert_same(cloning(TrainingRecord()), take_up(tmp_path, cloning)[0])


def test_checkpoints_are_as_far_apart_as_asked(tmp_path):
    seldom = dataclasses.replace(EVERY_CHUNK, record=RecordSettings(checkpoint_minutes=1))
    cut_off(tmp_path, siamese, seldom)
    assert not RunFolder(tmp_path).checkpoints("rl", 0).exists()


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_a_damaged_checkpoint_costs_no_more_than_its_training(uninterrupted, tmp_path, capsys):
    cut_off(tmp_path, siamese)
    folder = RunFolder(tmp_path).checkpoints("rl", 0)
    for file in folder.rglob("d/*"):
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    result, moved = take_up(tmp_path, siamese)
    printed = capsys.readouterr().err
    assert "checkpoint cannot be read" in printed
    assert "begins anew" in printed
    assert "Traceback" not in printed
    assert moved == [256] * 4
    assert_same(uninterrupted, result)
    # The new checkpoints are good ones.
    assert_same(uninterrupted, take_up(tmp_path, siamese)[0])


def test_a_checkpoint_of_another_configuration_is_left_alone(uninterrupted, tmp_path, capsys):
    cut_off(tmp_path, siamese, dataclasses.replace(EVERY_CHUNK, frames=7))
    result, moved = take_up(tmp_path, siamese)
    assert "is of another configuration" in capsys.readouterr().err
    assert moved == [256] * 4
    assert_same(uninterrupted, result)


def events(folder):
    """TensorBoard's scalars in order: records of a length, its checksum, the event and its checksum."""
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
    cut_off(tmp_path, siamese)
    take_up(tmp_path, siamese)
    _, curve = uninterrupted
    found = list(events(RunFolder(tmp_path).scalars("rl", 0)))
    for field in dataclasses.fields(curve):
        if field.name != "frames":
            steps, values = zip(*[(step, value) for tag, step, value in found if tag == field.name], strict=True)
            known = np.isfinite(getattr(curve, field.name))
            np.testing.assert_array_equal(steps, curve.frames[known])
            np.testing.assert_array_equal(values, getattr(curve, field.name)[known].astype(np.float32))


def test_tensorboard_can_be_switched_off(tmp_path):
    take_up(tmp_path, siamese, dataclasses.replace(EVERY_CHUNK, record=RecordSettings(tensorboard=False)))
    assert not (tmp_path / "tensorboard").exists()
