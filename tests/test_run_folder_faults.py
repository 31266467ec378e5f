"""Run folders that are damaged, in use, or left by a process that was killed."""

import json
import subprocess
import sys
from dataclasses import replace

import jax
import numpy as np
import pytest
from tiny import SMALL, problem

from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import save_arrays, write_bytes
from relm_irl_jax.parameters import save_parameters
from relm_irl_jax.run_config import find_run, locked, opened_run
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.stages.evaluation import load_policy
from relm_irl_jax.stages.worlds import EvaluationTask
from relm_irl_jax.types import TrainingLog


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{}",
        b"[]",
        b"null",
        b"3",
        b'"x"',
        b"{",
        b"\xff\xfe",
        b'{"task": "II"}',
        b"[" * 100_000,
        b'{"frames": NaN}',
    ],
)
def test_a_damaged_configuration_is_one_sentence_and_starts_nothing(tmp_path, content):
    (tmp_path / "config.json").write_bytes(content)
    for use in (lambda: find_run(tmp_path), lambda: opened_run(Config(run=tmp_path)).__enter__()):
        with pytest.raises(InputError, match=r"config\.json") as refusal:
            use()
        assert "\n" not in str(refusal.value)
    assert (tmp_path / "config.json").read_bytes() == content


HOLDER = """
import sys, time
from pathlib import Path
from relm_irl_jax.run_config import locked
from relm_irl_jax.run_folder import RunFolder
with locked(RunFolder(Path(sys.argv[1]))):
    print("held", flush=True)
    time.sleep(60)
"""


def test_one_process_at_a_time_writes_to_a_folder(tmp_path):
    """The other one is a process, since a lock belongs to a process; it is killed, as by `kill -9`."""
    other = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    try:
        assert other.stdout.readline() == "held\n"
        for use in (lambda: locked(RunFolder(tmp_path)), lambda: opened_run(Config(run=tmp_path))):
            with pytest.raises(InputError, match="another process is writing to"), use():
                raise AssertionError("both hold the lock")
        assert not (tmp_path / "config.json").exists()
    finally:
        other.kill()
        other.communicate()
    with locked(RunFolder(tmp_path)), locked(RunFolder(tmp_path)):
        pass  # within one process, a command may lock again


def test_what_a_killed_process_leaves_is_removed(tmp_path):
    config = Config(run=tmp_path)
    write_bytes(tmp_path / ".config.abc.partial", b"half")  # killed before the configuration was written
    with opened_run(config) as folder:
        assert sorted(path.name for path in tmp_path.iterdir() if path.suffix != ".lock") in (
            ["config.json"],
            [".lock", "config.json"],
        )
    for name in ("agents/.rl-seed-0.x.partial", "rewards/seed-0/.press.y.partial", "agents/rl-seed-0.safetensors"):
        write_bytes(tmp_path / name, b"")
    for name in ("rl-seed-0", "irl-seed-0"):
        write_bytes(tmp_path / "checkpoints" / name / "8" / "state", b"")
    with opened_run(config):
        pass
    assert not list(tmp_path.rglob("*.partial"))
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["irl-seed-0"]
    assert folder.agent("rl", 0).exists()


def test_processes_of_a_cluster_share_a_folder(tmp_path):
    config = Config(run=tmp_path)
    clustered = replace(config, cluster=replace(config.cluster, processes=2, coordinator="localhost:1"))
    with locked(RunFolder(tmp_path)), opened_run(clustered) as folder:
        assert folder.config.exists()


@pytest.fixture(scope="module")
def trained():
    """Parameters of a short training, and the task that they act in."""
    given = problem()
    parameters, _ = SiameseAgent(SMALL).train(jax.random.key(0), given, TrainingLog())
    return parameters, EvaluationTask("II", 0, [], given.world, given.targets, [])


def flat(parameters):
    return {"/".join(key.key for key in path): np.asarray(leaf) for path, leaf in jax.tree.leaves_with_path(parameters)}


def test_weights_that_do_not_fit_are_one_sentence(trained, tmp_path):
    parameters, task = trained
    folder, config = RunFolder(tmp_path), Config(siamese=SMALL)
    save_parameters(folder.agent("rl", 0), parameters)
    load_policy(config, folder, "rl", 0, task)
    tensors = flat(parameters)
    for name, tensor in tensors.items():
        without = {other: value for other, value in tensors.items() if other != name}
        damages = [without, without | {f"{name}x": tensor}, without | {name: tensor * np.float32(np.nan)}]
        if tensor.ndim > 1:
            damages.append(without | {name: tensor[..., :-1]})
        for damaged in damages:
            save_arrays(folder.agent("rl", 0), damaged)
            with pytest.raises(InputError, match=r"rl-seed-0\.safetensors: ") as refusal:
                load_policy(config, folder, "rl", 0, task)
            assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"{}", b"[]", b"{", b"\xff", b'{"hardware": 3, "seconds": {}}', b"null"])
def test_a_damaged_description_of_the_computer_costs_nothing_else(tmp_path, content):
    from relm_irl_jax.hardware import Stopwatch, load_stage_times

    path = tmp_path / "hardware.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"hardware\.json: ") as refusal:
        load_stage_times(path)
    assert "\n" not in str(refusal.value)
    with Stopwatch(path)("evaluation"):
        pass
    assert set(json.loads(path.read_text())["seconds"]) == {"evaluation"}
