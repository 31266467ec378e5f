"""Where a run was computed, and how long its stages took."""

import json

import pytest
from run_folders import HARDWARE

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


def test_a_damaged_file_is_written_anew(tmp_path):
    path = tmp_path / "hardware.json"
    path.write_text("{}")
    with pytest.raises(InputError, match="hardware is missing"):
        load_stage_times(path)
    with Stopwatch(path)("evaluation"):
        pass
    assert list(json.loads(path.read_text())["seconds"]) == ["evaluation"]
