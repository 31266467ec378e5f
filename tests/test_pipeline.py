"""The whole pipeline through the command line, on tiny rooms: what a user runs, what it leaves, what it refuses."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from command import EXPERIMENT, QUICK, relm_irl
from PIL import Image, ImageSequence

from relm_irl_jax.files import read_table
from relm_irl_jax.parameters import load_parameters
from relm_irl_jax.play.animation import FRAME_MILLISECONDS


def succeed(folder, *arguments):
    code, out, err = relm_irl(folder, *arguments)
    assert code == 0, err
    return out, err


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("work")


@pytest.fixture(scope="module")
def first(folder):
    out, err = succeed(folder, "train", "--config", str(EXPERIMENT), "--run", "one", *QUICK)
    assert "Warning" not in err
    return out


def test_the_run_leaves_what_it_promises(first, folder):
    results = json.loads((folder / "one" / "results.json").read_text())
    assert set(results) == {"task", "cap", "encoder", "rows"}
    assert (results["task"], results["cap"]) == ("II", 100)
    assert len(results["rows"]) == 5 * 6
    for row in results["rows"]:
        assert set(row) == {"method", "agent", "scene", "room_type", "seed", "episodes", "sr", "ple", "spl"}
        assert 0 <= row["spl"] <= row["sr"] <= 1
        assert row["episodes"] == 50
    for method in ("rl", "irl", "elm-irl", "relm-irl"):
        assert load_parameters(folder / "one" / "agents" / f"{method}-seed-0.safetensors")
        assert float(read_table(folder / "one" / "curves" / f"{method}-seed-0.csv")["frames"][-1]) >= 1536
        assert list((folder / "one" / "tensorboard" / f"{method}-seed-0").glob("events.*"))
    assert not (folder / "one" / "checkpoints").exists()
    for name in ("config.json", "hardware.json", "report.md", "figures/learning.png", "figures/press.png"):
        assert (folder / "one" / name).stat().st_size > 0
    assert sorted((folder / "one" / "figures").glob("reward-*.png"))
    assert "RELM-IRL" in first
    page = (folder / "one" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(list((folder / "one" / "figures").glob("*.png")))
    assert 'src="figures' not in page
    assert (folder / "one" / "figures" / "episodes-II.png").exists()
    for figure in (folder / "one" / "figures").glob("*.png"):
        assert read_table(figure.with_suffix(".csv")), f"{figure.name} has no table"
    quality = read_table(folder / "one" / "rewards" / "seed-0" / "quality.csv")
    assert {"irl", "elm-irl", "relm-irl"} == set(quality["method"])


def test_the_same_seed_gives_the_same_results(first, folder):
    """Of one method, which does not depend on the others."""
    succeed(folder, "train", "--config", str(EXPERIMENT), "--run", "two", *QUICK, "--methods", "relm-irl")
    one, two = (json.loads((folder / run / "results.json").read_text())["rows"] for run in ("one", "two"))
    assert two == [row for row in one if row["method"] == "relm-irl"]
    weights = [(folder / run / "agents" / "relm-irl-seed-0.safetensors").read_bytes() for run in ("one", "two")]
    assert weights[0] == weights[1]


def test_a_finished_run_is_evaluated_without_training(first, folder):
    weights = folder / "one" / "agents" / "rl-seed-0.safetensors"
    before = weights.stat().st_mtime_ns
    succeed(folder, "evaluate", "one", "--task", "III")
    results = json.loads((folder / "one" / "results-III.json").read_text())
    trained = {row["scene"] for row in json.loads((folder / "one" / "results-II.json").read_text())["rows"]}
    unseen = {row["scene"] for row in results["rows"]}
    assert len(unseen) == 9
    assert not unseen & trained
    assert weights.stat().st_mtime_ns == before


def test_an_agent_can_be_watched(first, folder):
    out, _ = succeed(folder, "play", "one", "--method", "irl", "--task", "I")
    lines = [line for line in out.splitlines() if "shortest path" in line]
    assert len(lines) == 6
    for line in lines:
        path, outcome = line.split(": ", 1)
        steps, shortest = (int(word) for word in re.findall(r"\d+", outcome))
        with Image.open(folder / path) as picture:
            # Steps that change nothing, collisions, are one longer frame.
            shown = sum(frame.info["duration"] for frame in ImageSequence.Iterator(picture))
            assert shown == FRAME_MILLISECONDS * (steps + 4)
            assert picture.size == (3 * 64, 64)
        assert steps >= shortest > 0
        assert ("not reached" in outcome) == (steps == 100)


def test_a_run_is_continued_with_another_method(first, folder):
    """Behaviour cloning joins, and nothing that was trained is trained again."""
    weights = folder / "one" / "agents" / "rl-seed-0.safetensors"
    before = weights.stat().st_mtime_ns
    succeed(folder, "train", "--resume", "one", "--methods", "all", "bc")
    assert weights.stat().st_mtime_ns == before
    rows = json.loads((folder / "one" / "results.json").read_text())["rows"]
    assert {row["method"] for row in rows} == {"random", "bc", "rl", "irl", "elm-irl", "relm-irl"}
    assert "BC" in (folder / "one" / "report.md").read_text()


@pytest.mark.slow
def test_joint_seeds_are_the_seeds_alone(first, folder):
    options = ("--methods", "rl", "--seeds", "2", "--siamese.seeds-at-once", "always")
    succeed(folder, "train", "--config", str(EXPERIMENT), "--run", "joint", *QUICK, *options)
    alone, own, other = (
        read_table(folder / run / "curves" / f"rl-seed-{seed}.csv")["reward"]
        for run, seed in (("one", 0), ("joint", 0), ("joint", 1))
    )
    np.testing.assert_allclose(np.asarray(own, float), np.asarray(alone, float), rtol=1e-4)
    assert own != other
    rows = json.loads((folder / "joint" / "results.json").read_text())["rows"]
    assert {row["seed"] for row in rows} == {0, 1}


def test_the_command_starts_as_a_process_of_its_own(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "relm_irl_jax", "evaluate", "nowhere"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stderr.startswith("relm-irl: run: nowhere contains no config.json")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("train", "--task", "IV"), "invalid choice 'IV'"),
        (("train", "--methods", "magic"), "invalid choice 'magic'"),
        (("train", "--frames", "0"), "frames = '0' is refused"),
        (("train", "--scenes", "nowhere"), "nowhere is not a folder"),
        (("train", "--scenes", "empty"), "contains no file ending in .h5"),
        (("train", "--scenes", "malformed"), "scene.h5: cannot be read as HDF5"),
        (("train", "--run", "one"), "one contains agents trained with"),
        (("train", "--agent", "metric", "--methods", "bc"), "methods: bc clones the siamese agent's policy"),
        (("evaluate", "empty"), "contains no config.json"),
        (("train", "--config", "absent.toml"), "absent.toml: cannot be read"),
        (("train", "--resume", "empty"), "contains no config.json"),
        (("train", "--resume", "one", "--frames", "7"), "one contains agents trained with frames = 1536, not 7"),
        (("train", "--resume"), "--resume: the folder is missing"),
        (("train", "--resume", "one", "--config", str(EXPERIMENT)), "the run already has a configuration"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(first, folder, arguments, sentence):
    (folder / "empty").mkdir(exist_ok=True)
    (folder / "malformed").mkdir(exist_ok=True)
    (folder / "malformed" / "scene.h5").write_bytes(b"not HDF5")
    code, _, printed = relm_irl(folder, *arguments)
    assert code == 2
    assert sentence in " ".join(printed.replace("│", " ").split())
    assert "Traceback" not in printed
