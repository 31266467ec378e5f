"""Results are read as they were written, and refused in one sentence where they are damaged."""

import json

import numpy as np
import pytest
from run_folders import results

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_json
from relm_irl_jax.results import (
    RewardQualityRow,
    load_all_results,
    load_results,
    load_reward_quality,
    save_results,
    save_reward_quality,
)
from relm_irl_jax.run_folder import RunFolder

VALUES = {"rl": [0.25, 0.5], "relm-irl": [0.75, 1.0]}


def test_results_are_read_as_they_were_written(tmp_path):
    folder = RunFolder(tmp_path / "run")
    one, two = results("III", VALUES), results("I", VALUES)
    save_results(folder, one)
    save_results(folder, two)
    assert load_results(folder) == two
    assert load_all_results(folder) == {"I": two, "III": one}


def test_the_file_has_its_public_form(tmp_path):
    folder = RunFolder(tmp_path)
    save_results(folder, results("II", {"rl": [0.25]}))
    held = json.loads((tmp_path / "results.json").read_text())
    assert held == json.loads((tmp_path / "results-II.json").read_text())
    assert list(held) == ["task", "cap", "encoder", "rows"]
    assert held["rows"][0] == {
        "method": "rl",
        "agent": "siamese",
        "scene": "bathroom-0",
        "room_type": "bathroom",
        "seed": 0,
        "episodes": 10,
        "sr": 0.25,
        "ple": 75.0,
        "spl": 0.25,
    }


def test_rows_may_say_less_and_more(tmp_path):
    folder = RunFolder(tmp_path)
    save_results(folder, results("II", {"rl": [0.25]}))
    held = json.loads(folder.results().read_text())
    for row in held["rows"]:
        del row["agent"]
        row["note"] = "by hand"
    write_json(folder.results(), held)
    assert {row.agent for row in load_results(folder).rows} == {""}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"sr": 1.5}, r"rows\.0\.sr = 1\.5 is refused"),
        ({"sr": float("nan")}, r"rows\.0\.sr = nan is refused"),
        ({"ple": float("inf")}, r"rows\.0\.ple = inf is refused"),
        ({"seed": -1}, r"rows\.0\.seed = -1 is refused"),
        ({"episodes": "many"}, r"rows\.0\.episodes = 'many' is refused"),
        ({"scene": None}, r"rows\.0\.scene = None is refused"),
    ],
)
def test_a_damaged_row_is_one_sentence(tmp_path, change, sentence):
    folder = RunFolder(tmp_path)
    save_results(folder, results("II", {"rl": [0.25]}))
    held = json.loads(folder.results().read_text())
    held["rows"][0] |= change
    write_json(folder.results("II"), held)
    with pytest.raises(InputError, match=sentence + ".*Remove the file and run `relm-irl evaluate .* --task II`"):
        load_all_results(folder)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", "Invalid JSON|invalid JSON"),
        ("[]", "input should be an object"),
        ('{"task": "II", "cap": 1, "encoder": "x"}', "rows is missing"),
        ('{"task": "II", "cap": 1, "encoder": "x", "rows": []}', "at least 1"),
        ('{"task": "IV", "cap": 1, "encoder": "x", "rows": []}', "task = 'IV' is refused"),
    ],
)
def test_a_damaged_file_is_one_sentence(tmp_path, content, sentence):
    folder = RunFolder(tmp_path)
    folder.results("II").write_text(content)
    with pytest.raises(InputError, match=sentence):
        load_results(folder, "II")


def test_missing_and_misnamed_files_are_named(tmp_path):
    folder = RunFolder(tmp_path)
    with pytest.raises(InputError, match=r"results\.json: cannot be read"):
        load_results(folder)
    with pytest.raises(InputError, match="contains no results; run `relm-irl evaluate"):
        load_all_results(folder)
    save_results(folder, results("II", {"rl": [0.25]}))
    folder.results("II").rename(folder.results("I"))
    with pytest.raises(InputError, match="task = 'II' contradicts the file's name"):
        load_all_results(folder)


def test_the_quality_of_rewards_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "quality.csv"
    rows = (
        RewardQualityRow(method="irl", targets="trained", median_rank=1.5, median_rank_share=0.1, mean_order=0.25),
        RewardQualityRow(method="relm-irl", targets="new", median_rank=2, median_rank_share=0.2, mean_order=np.nan),
    )
    save_reward_quality(path, rows)
    read = load_reward_quality(path)
    assert read[0] == rows[0]
    assert repr(read[1]) == repr(rows[1])
    path.write_text(path.read_text().replace("new", "old"))
    with pytest.raises(InputError, match=r"quality\.csv: 1\.targets = 'old' is refused"):
        load_reward_quality(path)
