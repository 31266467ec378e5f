"""What the package says of itself."""

import tomllib
import zipfile
from importlib.resources import files
from pathlib import Path

import pytest
from command import in_process

import relm_irl_jax
from relm_irl_jax.cli import _default_config
from relm_irl_jax.config import load_config

ROOT = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_the_version_is_the_one_of_pyproject():
    assert relm_irl_jax.__version__ == PYPROJECT["project"]["version"]


def test_citation_and_changelog_name_the_version():
    assert f"\nversion: {relm_irl_jax.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{relm_irl_jax.__version__}] - " in (ROOT / "CHANGELOG.md").read_text()


def test_the_command_prints_the_version(monkeypatch, tmp_path, capsys):
    in_process(monkeypatch, tmp_path, "--version")
    assert capsys.readouterr().out == f"relm-irl-jax {relm_irl_jax.__version__}\n"


def test_the_package_is_marked_as_typed():
    assert files(relm_irl_jax).joinpath("py.typed").is_file()


def test_the_wheel_holds_weights_and_presets(tmp_path):
    from hatchling.builders.wheel import WheelBuilder

    wheel = next(iter(WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])))
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    for folder, pattern in ((ROOT, "relm_irl_jax/**/*.safetensors"), (ROOT, "relm_irl_jax/py.typed")):
        files = {path.relative_to(folder).as_posix() for path in folder.glob(pattern)}
        assert files
        assert files <= names
    presets = {path.name for path in (ROOT / "experiments").glob("*.toml")}
    assert {name.rpartition("/")[2] for name in names if "/presets/" in name} == presets


@pytest.mark.parametrize("name", ["metric", "experiments/metric.toml"])
def test_presets_are_found_by_name(monkeypatch, name):
    monkeypatch.chdir(ROOT)
    assert _default_config(["--config", name])[0] == load_config(ROOT / "experiments" / "metric.toml")


def test_benchmarks_write_where_they_are_told(monkeypatch, tmp_path):
    folders = []
    monkeypatch.setattr("relm_irl_jax.benchmarks.irl.main", lambda *folder: folders.append(folder))
    monkeypatch.setattr("relm_irl_jax.benchmarks.encoder.main", lambda *folder: folders.append(folder))
    in_process(monkeypatch, tmp_path, "bench", "irl", "--out", "x")
    in_process(monkeypatch, tmp_path, "bench", "irl")
    in_process(monkeypatch, tmp_path, "bench", "encoder", "--out", "x")
    assert folders == [(Path("x/irl"),), (Path("runs/bench/irl"),), ()]
