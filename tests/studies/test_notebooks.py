"""Notebooks are saved with their outputs, in short steps that use documented names; `make notebooks` runs them."""

import ast
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "experiments" / "notebooks").glob("*.ipynb"))
DOCUMENTED = {
    name
    for page in (ROOT / "docs" / "api").glob("*.md")
    for name in re.findall(r"^::: (\S+)", page.read_text(), re.MULTILINE)
}
"""Names in the API pages, by the module that defines them or that offers them."""


def code_cells(path: Path) -> list[dict]:
    return [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]


def source_of(cell: dict) -> str:
    return "".join(cell["source"])


def test_there_are_notebooks():
    assert [path.stem.partition("-")[0] for path in NOTEBOOKS] == [str(number) for number in range(1, 8)]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_saved(path):
    cells = code_cells(path)
    outputs = [output for cell in cells for output in cell["outputs"]]
    numbers = [cell["execution_count"] for cell in cells]
    assert numbers == list(range(1, len(cells) + 1)), "run it from the top: make notebooks ARGS=--overwrite"
    assert outputs
    assert not [output for output in outputs if output["output_type"] == "error"]
    assert path.stat().st_size < 400_000
    assert "Warning" not in json.dumps(outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_steps_are_short(path):
    for cell in code_cells(path):
        lines = [line for line in source_of(cell).splitlines() if line.strip()]
        assert len(lines) <= 10, source_of(cell)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_names_are_documented(path):
    for cell in code_cells(path):
        for node in ast.walk(ast.parse(source_of(cell).replace("%matplotlib inline", ""))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("relm_irl_jax"):
                for alias in node.names:
                    known = {name for name in DOCUMENTED if name.startswith(str(node.module))}
                    assert alias.name in {name.rpartition(".")[2] for name in known}, f"{node.module}.{alias.name}"


def test_the_learning_curve_is_shown():
    shown = [output.get("data", {}) for cell in code_cells(NOTEBOOKS[3]) for output in cell["outputs"]]
    assert "image/png" in {kind for data in shown for kind in data}


def test_an_own_reward_takes_twelve_lines_from_one_import():
    cells = code_cells(next(path for path in NOTEBOOKS if path.stem == "4-own-reward"))
    lines = [line for cell in cells for line in source_of(cell).splitlines() if line.strip()]
    assert len(lines) <= 12
    assert [line for line in lines if "import" in line] == ["import relm_irl_jax as relm"]
    for needed in ("def reward(", "relm.rooms(", "relm.train(", ".plot()", "relm.evaluate(", "relm.compare("):
        assert needed in "\n".join(lines)
