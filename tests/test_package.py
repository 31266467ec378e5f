"""What the package says of itself."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import packages_distributions
from importlib.resources import files
from pathlib import Path

import pytest
from command import in_process

import relm_irl_jax
from relm_irl_jax.cli.train import default_config
from relm_irl_jax.config import load_config
from relm_irl_jax.errors import TRAINING_STACK

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
    assert default_config(["--config", name])[0] == load_config(ROOT / "experiments" / "metric.toml")


def test_benchmarks_write_where_they_are_told(monkeypatch, tmp_path):
    folders = []
    monkeypatch.setattr("relm_irl_jax.benchmarks.irl.main", lambda *folder: folders.append(folder))
    monkeypatch.setattr("relm_irl_jax.benchmarks.encoder.main", lambda *folder: folders.append(folder))
    in_process(monkeypatch, tmp_path, "bench", "irl", "--out", "x")
    in_process(monkeypatch, tmp_path, "bench", "irl")
    in_process(monkeypatch, tmp_path, "bench", "encoder", "--out", "x")
    assert folders == [(Path("x/irl"),), (Path("runs/bench/irl"),), ()]


def test_the_extra_train_installs_what_its_absence_is_reported_for():
    """Distributions are compared, since modules have other names; namespaces such as `google` belong to several."""
    required = {re.split(r"[><=]", line)[0] for line in PYPROJECT["project"]["optional-dependencies"]["train"]}
    distributions = packages_distributions()
    assert {distributions[module][0].lower().replace("_", "-") for module in TRAINING_STACK} == required


WITHOUT_TRAINING = """
import sys
sys.modules.update(dict.fromkeys(STACK))  # importing one of them is an error
import numpy as np
from problems import gridworld
import relm_irl_jax
from relm_irl_jax import env, experts, irl, rewards, world
from relm_irl_jax.elm import ELMRegressor, load_elm, save_elm
from relm_irl_jax.scenes import generate_room

problem = gridworld(7)
solution = irl.max_margin(problem, irl.MaxMarginSettings())
reference = irl.reference_max_margin(problem, irl.MaxMarginSettings())
assert solution.solved and abs(solution.objective - reference.objective) < 1e-6 * abs(reference.objective)
assert irl.learn_weights([problem], irl.IrlMethodSettings(), processes=1)[0].solved

inputs = np.random.default_rng(0).normal(size=(40, 3))
model = ELMRegressor(n_hidden=8).fit(inputs, inputs[:, :2])
save_elm(model, "elm.safetensors")
np.testing.assert_array_equal(load_elm("elm.safetensors").predict(inputs), model.predict(inputs))

for package, name in ((relm_irl_jax, "train"), (relm_irl_jax.scenes, "load_scene")):
    try:
        getattr(package, name)
    except ImportError as error:
        print(error)
from relm_irl_jax.cli import main
sys.argv = ["relm-irl", "train"]
main()
"""


# In a process of its own, since this one has loaded everything.
def test_elm_and_inverse_reinforcement_learning_need_no_training_stack(tmp_path):
    program = WITHOUT_TRAINING.replace("STACK", repr(sorted(TRAINING_STACK)))
    paths = os.pathsep.join([str(ROOT / "tests" / "irl"), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": paths},
        check=False,
    )
    sentence = "is not installed; the command and training need it: pip install 'relm-irl-jax[train]'.\n"
    assert done.returncode == 2, done.stderr
    assert done.stdout == f"flax {sentence}h5py {sentence}"
    assert done.stderr.endswith(f"relm-irl: tyro {sentence}")
