"""Errors of the operating system are one sentence and exit code 2, before the work where they can be foreseen."""

import errno
import os
import resource
import sys

import pytest
from command import QUICK, in_process, relm_irl

from relm_irl_jax.errors import system_fault
from relm_irl_jax.files import write_bytes

LONG = "x" * 300
NOT_UTF_8 = "a\udcff"
EARLY = ("train", "--methods", "random", "--scene.size", "tiny", *QUICK)


@pytest.fixture
def no_work(monkeypatch):
    """Whatever takes long fails the test."""

    def work(*_, **__):
        raise AssertionError("the work began")

    for name in (
        "relm_irl_jax.pipeline.encode_training",
        "relm_irl_jax.scenes.rooms.generate.generate_room",
        "relm_irl_jax.cli.bench.import_module",
    ):
        monkeypatch.setattr(name, work)
    monkeypatch.setattr("relm_irl_jax.cli.scenes.export_scenes", work)


def one_sentence(tmp_path, *arguments):
    code, out, said = relm_irl(tmp_path, *arguments)
    assert code == 2, (out, said)
    assert said.startswith("relm-irl: ")
    assert said.count("\n") == 1
    assert "Traceback" not in said
    said.encode()
    return said


@pytest.mark.parametrize(
    "folder", [LONG, "file/below", "/proc/absent", "/dev/null/x", f"{LONG}/y", f"{NOT_UTF_8}/{LONG}"]
)
@pytest.mark.parametrize(
    "command",
    [(*EARLY, "--run"), ("scenes", "generate", "--out"), ("bench", "irl", "--out")],
    ids=lambda command: command[0],
)
def test_a_folder_that_cannot_be_written_is_refused_before_the_work(tmp_path, no_work, command, folder):
    (tmp_path / "file").touch()
    one_sentence(tmp_path, *command, folder)


@pytest.mark.parametrize(
    "arguments",
    [
        ("train", "--config", "."),
        ("train", "--config", LONG),
        ("train", "--config", "latin.toml"),
        ("train", "--resume", LONG),
        ("train", "--scenes", LONG),
        ("evaluate", LONG),
        ("report", LONG),
        ("play", LONG),
        ("scenes", "check", LONG),
        ("scenes", "check", NOT_UTF_8),
        ("report", NOT_UTF_8),
    ],
)
def test_a_path_that_cannot_be_read_is_one_sentence(tmp_path, arguments):
    (tmp_path / "latin.toml").write_bytes(b'scenes = "caf\xe9"')
    one_sentence(tmp_path, *arguments)


@pytest.mark.parametrize("number", sorted(errno.errorcode))
def test_every_error_number_is_a_sentence_with_file_and_remedy(number):
    said = system_fault(OSError(number, os.strerror(number), "a/file"))
    assert said.startswith(f"a/file: {os.strerror(number)}; ")
    assert said.endswith(".")
    assert "\n" not in said


@pytest.mark.parametrize("error", [OSError("h5: x\ny"), OSError(), MemoryError(), UnicodeError("surrogates")])
def test_errors_without_a_number_are_a_sentence(error):
    assert "\n" not in system_fault(error)


def test_a_disk_that_is_full_leaves_the_old_file(tmp_path):
    """A limit of the size of files stands for it."""
    path = tmp_path / "a.json"
    write_bytes(path, b"old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="large") as full:
            write_bytes(path, b"x" * 5000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "raise the limit of file sizes" in system_fault(full.value)
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["a.json"]


def test_a_reader_that_ends_early_is_no_error(tmp_path, monkeypatch):
    """`relm-irl ... | head`."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        with pytest.raises(SystemExit) as end:
            in_process(monkeypatch, tmp_path, "scenes", "check", "absent.h5")
        monkeypatch.undo()
    assert end.value.code == 1


@pytest.mark.parametrize(
    "options",
    [
        ("--config", "/dev/zero"),
        ("--irl.demonstrations", "/dev/zero"),
        ("--encoder.weights", "/dev/zero"),
        ("--scenes", "/dev/zero"),
        ("--agent", "map", "--map.weights", "/dev/zero"),
    ],
    ids=lambda options: options[-2],
)
def test_a_device_without_an_end_is_no_input(tmp_path, options):
    arguments = options if "--config" in options else (*EARLY[1:], *options)
    one_sentence(tmp_path, "train", *arguments)
