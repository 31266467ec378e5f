"""Notebooks are kept without outputs; `make notebooks` runs them."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "experiments" / "notebooks").glob("*.ipynb"))


def test_there_are_notebooks():
    assert len(NOTEBOOKS) == 5


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_no_outputs_are_committed(path):
    for cell in json.loads(path.read_text())["cells"]:
        assert not cell.get("outputs"), f"{path.name} holds outputs; strip them: nbstripout {path.name}"
        assert cell.get("execution_count") is None, f"{path.name} was run; strip it: nbstripout {path.name}"


def test_an_own_reward_takes_twelve_lines_from_one_import():
    cells = json.loads(next(path for path in NOTEBOOKS if path.stem == "4-own-reward").read_text())["cells"]
    code = "".join("".join(cell["source"]) + "\n" for cell in cells if cell["cell_type"] == "code")
    lines = [line for line in code.splitlines() if line.strip()]
    assert len(lines) <= 12
    assert [line for line in lines if "import" in line] == ["import relm_irl_jax as relm"]
    for needed in ("def reward(", "relm.rooms(", "relm.train(", ".plot()", "relm.evaluate(", "relm.compare("):
        assert needed in code
