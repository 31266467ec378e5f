"""The report of a run folder that was written by hand."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from run_folders import CONFIG, HARDWARE, draw_nothing, write_run

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_table, write_json
from relm_irl_jax.report.run_report import write_report
from relm_irl_jax.run_folder import RunFolder

SEEDS = {"random": [0.1, 0.2], "rl": [0.3, 0.5], "irl": [0.4, 0.4], "elm-irl": [0.5, 0.6], "relm-irl": [0.8, 1.0]}
PAIR = {"rl": [0.3], "relm-irl": [0.8]}


def pages(folder: RunFolder) -> tuple[str, str]:
    return (folder.path / "report.md").read_text(), (folder.path / "report.html").read_text()


ALONE = """
import json, sys
import relm_irl_jax.report.run_report as report
from relm_irl_jax.run_folder import RunFolder
opened = []
sys.addaudithook(lambda event, values: event == "open" and opened.append(str(values[0])))
report.write_report(RunFolder(report.Path(sys.argv[1])))
print(json.dumps({"modules": sorted(sys.modules), "opened": opened, "prefixes": [sys.prefix, sys.base_prefix]}))
"""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A run folder whose report is drawn by a process of its own, and what this process imported and opened."""
    folder = write_run(tmp_path_factory.mktemp("drawn") / "run", SEEDS)
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    command = [sys.executable, "-c", ALONE, str(folder.path)]
    done = subprocess.run(command, cwd=elsewhere, capture_output=True, text=True, check=True)
    return folder, json.loads(done.stdout)


def test_the_report_shows_all_that_the_folder_holds(drawn):
    folder, _ = drawn
    text, page = pages(folder)
    assert text.startswith("# Task II and III\n")
    for part in (
        "Scenes `rooms`, encoder none, siamese agent, cap 100 steps, 10 episodes for each scene, 1,000 training frames",
        "seeds 0, 1, actions drawn from the policy.",
        "## Task II: new targets in the trained scenes (the paper's Table 2)",
        "## Differences on the same seeds",
        "Task III: RELM-IRL is ",
        "| RELM-IRL | of Task II | 2.5 ± 6.4 | 0.50 ± 0.00 |",
        "| RL | 1 ± 0 | 2 of 2 |",
        "abacus, 2 cores, cpu; Linux, Python 3.11, jax 0.10.",
        '"frames": 1000',
    ):
        assert part in text
    assert "Not shown" not in text
    figures = sorted(path.stem for path in (folder.path / "figures").glob("*.png"))
    assert figures == [
        "distance-II-bathroom",
        "distance-III-bathroom",
        "episodes-II",
        "episodes-III",
        "figure-11",
        "learning",
        "press",
        "reward-new-bathroom",
        "reward-trained-bathroom",
    ]
    assert page.count("data:image/png;base64,") == len(figures)
    assert all(text.count(f"](figures/{name}.png)") == 1 for name in figures)
    assert all(read_table(folder.figure(name).with_suffix(".csv")) for name in figures)
    tables = ["differences", "frames-to-success", "task-II", "task-III"]
    assert sorted(path.stem for path in (folder.path / "tables").iterdir()) == tables


def test_the_report_is_drawn_without_agents_or_jax_and_from_its_folder_alone(drawn):
    folder, seen = drawn
    loaded = {name for name in seen["modules"] if name.split(".")[0] in ("jax", "jaxlib", "flax", "relm_irl_jax")}
    layers = {name.split(".")[1] for name in loaded if name.startswith("relm_irl_jax.")}
    known = {
        "bounds",
        "errors",
        "files",
        "hardware",
        "inputs",
        "lazy",
        "registration",
        "report",
        "results",
        "run_folder",
    }
    assert layers <= known | {"saved_poses", "saved_maps", "saved_episodes", "saved_searches", "scenes"}
    of_scenes = {name.removeprefix("relm_irl_jax.") for name in loaded if "scenes" in name}
    assert of_scenes <= {"scenes", "scenes.scene", "scenes.settings"}
    assert not any(name.startswith(("jax", "flax")) for name in loaded)
    package = str(Path(__file__).parents[2] / "relm_irl_jax")
    code = tuple({*seen["prefixes"], package, str(Path(sys.executable).parent.parent)})
    foreign = [
        name for name in seen["opened"]
        if not name.startswith((str(folder.path), *code)) and not name.endswith((".ttf", ".py", ".pyc"))
    ]  # fmt: skip
    assert foreign == []


def test_all_computers_of_a_run_are_named(tmp_path, undrawn):
    folder = write_run(tmp_path, {"random": [0.1], "rl": [0.5]})
    other = HARDWARE["hardware"] | {"processor": "slide rule"}
    write_json(folder.hardware, HARDWARE | {"earlier": [other]})
    text = write_report(folder).with_suffix(".md").read_text()
    assert "abacus, 2 cores, cpu; Linux, Python 3.11, jax 0.10.\nStages before the last one also ran on: slide" in text


def test_one_seed_has_no_intervals_and_no_differences(tmp_path, undrawn):
    folder = write_run(tmp_path, PAIR, tasks=("I",))
    write_report(folder)
    text, _ = pages(folder)
    assert "seed 0, actions" in text
    assert "±" not in text
    assert "Differences on the same seeds" not in text
    assert not folder.table("differences").exists()


@pytest.fixture
def undrawn(monkeypatch):
    draw_nothing(monkeypatch)


PARTS = {
    "curves/rl-seed-0.csv": "rl-seed-0.csv: column `frames` is missing",
    "rewards/seed-0/press.csv": "press.csv: column `mean_squared_error` is missing",
    "rewards/seed-0/quality.csv": "quality.csv: 0.method is missing",
    "episodes/I.safetensors": "I.safetensors: cannot be read",
    "maps/distance-I-bathroom.safetensors": "distance-I-bathroom.safetensors: cannot be read",
    "maps/reward-new-bathroom.safetensors": "reward-new-bathroom.safetensors: cannot be read",
    "hardware.json": "hardware.json: hardware is missing.",
}
"""Files of the report's parts, and what is said where they are damaged."""


def test_a_damaged_file_costs_its_own_part_and_one_line(tmp_path, undrawn):
    folder = write_run(tmp_path, PAIR, tasks=("I",))
    for name in PARTS:
        (tmp_path / name).write_text("no,table\n1,2\n" if name.endswith(".csv") else "{}")
    write_report(folder)
    text, page = pages(folder)
    for said in PARTS.values():
        assert sum(said in line for line in text.splitlines()) == 1, said
    assert "## Task I" in text
    assert [name for name in ("learning", "reward-trained-bathroom") if f"figures/{name}.png" in text] == [
        "learning",
        "reward-trained-bathroom",
    ]
    assert page.count("data:image") == 2


def test_missing_files_cost_one_line_each(tmp_path, undrawn):
    folder = write_run(tmp_path, PAIR, tasks=("I",))
    for name in (*PARTS, "maps/reward-trained-bathroom.safetensors"):
        (tmp_path / name).unlink()
    write_report(folder)
    text, page = pages(folder)
    for said in (
        "rl-seed-0.csv is missing",
        "quality.csv is missing",
        "contains no maps of rewards",
        "I.safetensors is",
    ):
        assert sum(said in line for line in text.splitlines()) == 1, said
    assert "hardware.json: cannot be read" in text
    assert page.count("data:image") == 1  # the learning curve of the other method


def test_curves_of_other_frames_are_not_averaged(tmp_path, undrawn):
    folder = write_run(tmp_path, {"rl": [0.3, 0.4]}, tasks=("I",))
    lines = folder.curve("rl", 1).read_text().splitlines()
    folder.curve("rl", 1).write_text("\n".join(lines[:-2]) + "\n")
    write_report(folder)
    assert "rl-seed-1.csv: its frames are not those of the method's other seeds" in pages(folder)[0]


def test_a_folder_without_results_is_refused(tmp_path, undrawn):
    folder = RunFolder(tmp_path)
    with pytest.raises(InputError, match="give the folder of a run made by"):
        write_report(folder)
    write_json(folder.config, CONFIG)
    with pytest.raises(InputError, match="contains no results; run `relm-irl evaluate"):
        write_report(folder)
    write_json(folder.config, {**CONFIG, "frames": "many"})
    with pytest.raises(InputError, match=r"config\.json: frames = 'many' is refused"):
        write_report(folder)


def test_what_the_agent_is_stands_in_the_report(tmp_path, undrawn):
    folder = write_run(tmp_path, {"rl": [0.5]}, tasks=("I",))
    write_json(folder.config, {**CONFIG, "agent": "metric", "metric": {"hindsight": "strict"}})
    write_report(folder)
    assert "metric agent (hindsight: strict)" in pages(folder)[0]
