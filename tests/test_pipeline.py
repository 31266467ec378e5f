"""The whole pipeline through the command line, on tiny rooms: what a user runs, what it leaves, what it refuses."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from command import EXPERIMENT, QUICK, relm_irl
from PIL import Image, ImageSequence

from relm_irl_jax.config import load_config
from relm_irl_jax.demonstrations import load_demonstrations_by_scene
from relm_irl_jax.files import read_table
from relm_irl_jax.parameters import load_parameters
from relm_irl_jax.play.animation import FRAME_MILLISECONDS
from relm_irl_jax.scenes.selection import training_scenes

NO_REPORT = "relm_irl_jax.pipeline.write_report"
"""What tests replace that do not look at the report: drawing its figures takes most of a command's time."""


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


def test_the_same_seed_gives_the_same_results(first, folder, monkeypatch):
    """Of one method, which does not depend on the others."""
    monkeypatch.setattr(NO_REPORT, lambda folder: None)
    succeed(folder, "train", "--config", str(EXPERIMENT), "--run", "two", *QUICK, "--methods", "relm-irl")
    one, two = (json.loads((folder / run / "results.json").read_text())["rows"] for run in ("one", "two"))
    assert two == [row for row in one if row["method"] == "relm-irl"]
    files = ("agents/relm-irl-seed-0.safetensors", "curves/relm-irl-seed-0.csv", "rewards/seed-0/relm-irl.safetensors")
    for name in files:
        assert (folder / "one" / name).read_bytes() == (folder / "two" / name).read_bytes(), name


def test_a_finished_run_is_evaluated_without_training(first, folder, monkeypatch):
    monkeypatch.setattr(NO_REPORT, lambda folder: None)
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


def test_one_scene_can_be_watched(first, folder):
    out, _ = succeed(folder, "play", "one", "--method", "irl", "--task", "I", "--scene", "bedroom-1")
    lines = [line for line in out.splitlines() if "shortest path" in line]
    assert len(lines) == 1
    assert "bedroom-1" in lines[0]


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
        (("play", "one", "--method", "irl", "--scene", "attic"), "Task I of this run is not in attic; give one of"),
        (("play", "one", "--method", "irl", "--target", "lamp"), "the targets are those of the run's task"),
        (("demonstrations", "one", "--out", "one"), "one is a folder; give the name of a file"),
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


MODULE = """
import json, pathlib
import numpy as np

class Turner:
    def __init__(self, seed):
        self.seed = seed

    def __call__(self, observation):
        assert observation["view"].shape[1:] == observation["target"].shape[1:] == (64, 64, 3)
        return np.ones(len(observation["view"]), int)

def forward(observation):
    return np.zeros(len(observation["view"]), int)

number = 3
"""


def test_a_policy_of_the_user_gets_a_row_beside_the_run(first, folder, monkeypatch):
    (folder / "turners.py").write_text(MODULE)
    before = json.loads((folder / "one" / "results-II.json").read_text())
    entry = ("--policy", "turners:Turner", "--obs", "frames", "--name", "turner")
    out, _ = succeed(folder, "evaluate", "one", "--task", "II", *entry)
    assert "turner" in out
    after = json.loads((folder / "one" / "results-II.json").read_text())
    own = [row for row in after["rows"] if row["method"] == "turner"]
    assert [row for row in after["rows"] if row["method"] != "turner"] == before["rows"]
    theirs = [(row["scene"], row["seed"], row["episodes"]) for row in before["rows"] if row["method"] == "rl"]
    assert [(row["scene"], row["seed"], row["episodes"]) for row in own] == theirs
    assert all(row["sr"] < 0.5 and row["ple"] > 40 for row in own)  # turning on the spot reaches three poses
    assert "turner is not of this package" in (folder / "one" / "report.md").read_text()
    # The same rows, measured elsewhere, under another name; the report, written above, is not drawn again.
    monkeypatch.setattr(NO_REPORT, lambda folder: None)
    (folder / "elsewhere.json").write_text(json.dumps(after | {"rows": own}))
    succeed(folder, "evaluate", "one", "--results", "elsewhere.json", "--name", "twin")
    twice = json.loads((folder / "one" / "results-II.json").read_text())["rows"]
    assert [row | {"method": "turner"} for row in twice if row["method"] == "twin"] == own
    assert {path.name for path in (folder / "one" / "entries" / "II").iterdir()} == {"turner.json", "twin.json"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--policy", "turners"], "turners is no policy"),
        (["--policy", "burners:forward"], "burners cannot be imported"),
        (["--policy", "turners.py:forward"], "turners.py is a file; give its module, turners:forward."),
        (["--policy", "turners:backward"], "turners has no backward"),
        (["--policy", "turners:number"], "is no function"),
        (["--policy", "turners:forward", "--name", "rl"], "rl is a method of this package"),
        (["--policy", "turners:forward", "--name", "../x"], "give up to 40"),
        (["--policy", "turners:forward", "--results", "x.json"], "either a policy or results"),
        (["--results", "x.json"], "x.json: cannot be read"),
        (["--results", "one/results-II.json", "--name", "x"], "rows of several methods"),
        (["--results", "one/results-II.json"], "is a method of this package"),
        (["--results", "short.json"], "only one of them has"),
    ],
)
def test_an_entry_that_cannot_be_used_is_one_sentence(first, folder, arguments, sentence):
    (folder / "turners.py").write_text(MODULE)
    results = json.loads((folder / "one" / "results-II.json").read_text())
    results["rows"] = [results["rows"][0] | {"method": "short", "episodes": 7}]
    (folder / "short.json").write_text(json.dumps(results))
    code, _, err = relm_irl(folder, "evaluate", "one", *arguments)
    assert (code, err.count("\n")) == (2, 1), err
    assert sentence in err


@pytest.mark.parametrize("options", [(), ("--method", "rl", "--task", "I", "--episodes", "2")])
def test_demonstrations_of_a_run_are_written_and_read_again(first, folder, options):
    out, _ = succeed(folder, "demonstrations", "one", "--out", "walks.jsonl", *options)
    lines = [json.loads(line) for line in (folder / "walks.jsonl").read_text().splitlines()]
    assert f"{len(lines)} demonstrations" in out
    settings = load_config(folder / "one" / "config.json").scene
    scenes = [load(views=False) for load in training_scenes("rooms", settings)]
    read = load_demonstrations_by_scene(folder / "walks.jsonl", scenes)  # refuses what the scenes do not allow
    assert sum(map(len, read)) == len(lines)
    if not options:
        assert len(lines) == 12 * 4


@pytest.mark.parametrize(
    ("form", "name", "file"),
    [("minari", "expert-v0", "expert-v0/data/main_data.hdf5"), ("imitation", "x.npz", "x.npz")],
)
def test_demonstrations_of_a_run_for_other_libraries(first, folder, form, name, file):
    out, _ = succeed(folder, "demonstrations", "one", "--format", form, "--out", name)
    assert f"{name}: 48 demonstrations" in out
    assert (folder / file).stat().st_size > 1000
