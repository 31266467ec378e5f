"""What is the same bit for bit, and what another machine may change: as `docs/reproduce.md` says.

Each run is a process of its own, since what is varied is fixed when a process starts.
"""

import os
import shutil
import subprocess
import sys

import pytest
from chaos import IN_FOLDER, TRAIN, contents, save_scenes

pytestmark = pytest.mark.slow

GIVEN = ("--siamese.imagine", "none")
"""Workers with given targets are divided among devices; imagined targets train on one."""

COMMAND = (*TRAIN, *IN_FOLDER, "--frames", "6144", "--methods", "random", "relm-irl", *GIVEN)


def files_of_a_run(folder, prefix=(), **environment):
    """Run the command in a folder with caches of its own; what it leaves."""
    folder.mkdir()
    variables = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache"), **environment}
    command = [*prefix, sys.executable, "-m", "relm_irl_jax", *COMMAND]
    done = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return contents(folder / "run")


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    folder = tmp_path_factory.mktemp("determinism")
    save_scenes(folder / "scenes")
    return folder


@pytest.fixture(scope="module")
def usual(work):
    return files_of_a_run(work / "usual", PYTHONHASHSEED="1")


def test_caches_and_hashes_change_nothing(work, usual):
    other = {"PYTHONHASHSEED": "2", "JAX_COMPILATION_CACHE_DIR": str(work / "programs")}
    found = files_of_a_run(work / "other", **other)
    assert set(found) == set(usual)
    assert [name for name, content in usual.items() if found[name] != content] == []


def test_cores_and_devices_change_trained_agents_but_not_learned_rewards(work, usual):
    """Gradients are sums over workers, in another order. Features in files are given, and the rest is one by one."""
    one_core = ("taskset", "-c", str(min(os.sched_getaffinity(0)))) if shutil.which("taskset") else ()
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count=2"
    found = files_of_a_run(work / "devices", one_core, XLA_FLAGS=flags)
    assert set(found) == set(usual)
    changed = {name for name, content in usual.items() if found[name] != content}
    assert "agents/relm-irl-seed-0.safetensors" in changed
    assert not [name for name in changed if name == "config.json" or name.startswith("rewards/")]
    assert any(name.startswith("rewards/") for name in usual)
