"""Where a run was computed, and how long its stages took."""

import json
import resource

import pytest
from run_folders import HARDWARE

from relm_irl_jax import hardware
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_json
from relm_irl_jax.hardware import Stopwatch, describe_computer, load_stage_times


def test_stages_add_up(tmp_path):
    path = tmp_path / "hardware.json"
    write_json(path, HARDWARE)
    for _ in range(2):
        with Stopwatch(path)("training rl"):
            pass
    times = load_stage_times(path)
    assert times.seconds["evaluation"] == 1.5
    assert 0 <= times.seconds["training rl"] < 1
    assert times.hardware == describe_computer()
    assert [computer.processor for computer in times.earlier] == ["abacus"]


def test_a_computer_to_which_a_run_returns_is_named_once(tmp_path, monkeypatch):
    path = tmp_path / "hardware.json"
    write_json(path, HARDWARE)
    here, elsewhere = describe_computer(), load_stage_times(path).hardware
    for computer in (here, elsewhere):
        monkeypatch.setattr(hardware, "describe_computer", lambda computer=computer: computer)
        with Stopwatch(path)("evaluation"):
            pass
        assert load_stage_times(path).hardware == computer
    assert load_stage_times(path).computers == (elsewhere, here)


def test_a_damaged_file_is_written_anew(tmp_path):
    path = tmp_path / "hardware.json"
    path.write_text("{}")
    with pytest.raises(InputError, match="hardware is missing"):
        load_stage_times(path)
    with Stopwatch(path)("evaluation"):
        pass
    assert list(json.loads(path.read_text())["seconds"]) == ["evaluation"]


@pytest.fixture
def system(tmp_path, monkeypatch):
    """Files of a system with 9 GB of available memory, and without limits."""

    def write(path, text):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)

    write("proc/meminfo", "MemTotal: 16000000 kB\nMemAvailable: 9000000 kB\nHugePages_Total: 0\n")
    write("proc/self/status", "Name:\tpython\nVmSize:\t 700 kB\nVmData:\t 200 kB\nThreads:\t3\n")
    monkeypatch.setattr(hardware, "SYSTEM", tmp_path / "proc")
    monkeypatch.setattr(hardware, "GROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(resource, "getrlimit", lambda limit: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    return write


def test_the_least_limit_of_all_control_groups_counts(system):
    """What files occupy can be freed, and does not count as used."""
    assert hardware.available_memory() == 9_000_000 * 1024
    system("proc/self/cgroup", "9:cpu,memory:/jobs/mine\n0::/jobs/mine\n")
    for group, limit in (("cgroup/jobs/mine", "max\n"), ("cgroup/jobs", "5000\n")):
        system(f"{group}/memory.max", limit)
        system(f"{group}/memory.current", "1500\n")
        system(f"{group}/memory.stat", "anon 1000\nfile 500\n")
    assert hardware.available_memory() == 4000
    system("cgroup/memory/memory.limit_in_bytes", "3000\n")
    system("cgroup/memory/memory.usage_in_bytes", "2000\n")
    system("cgroup/memory/memory.stat", "cache 1\ntotal_cache 700\n")
    assert hardware.available_memory() == 1700
    system("cgroup/memory/memory.usage_in_bytes", "9000\n")
    assert hardware.available_memory() == 0


@pytest.mark.parametrize(("limit", "used"), [(resource.RLIMIT_AS, 700), (resource.RLIMIT_DATA, 200)])
def test_limits_of_the_shell_count(system, monkeypatch, limit, used):
    allowed = {limit: 10**6}
    monkeypatch.setattr(resource, "getrlimit", lambda which: (allowed.get(which, resource.RLIM_INFINITY), 0))
    assert hardware.available_memory() == 10**6 - used * 1024
