"""The structure that CONTRIBUTING describes: layers, agents behind their interface, functions with few parameters."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "relm_irl_jax"
MODULES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): ast.parse(path.read_text())
    for path in sorted(PACKAGE.rglob("*.py"))
}

LAYERS = (
    ("bounds", "errors", "exits", "inputs", "files", "frames", "interruption", "progress", "lazy", "hardware"),
    ("scenes",),
    ("features",),
    ("experts", "demonstrations", "exports"),
    ("irl",),
    ("elm",),
    ("task_settings", "tasks", "transitions", "tables", "world", "env"),
    ("rewards",),
    ("types",),
    ("agents",),
    ("episode_runner", "evaluation", "batch_policies"),
    (
        "run_folder",
        "results",
        "saved_poses",
        "saved_maps",
        "saved_episodes",
        "saved_searches",
        "parameters",
        "cluster",
        "config",
        "run_config",
        "checkpoints",
    ),
    ("stages",),
    ("report",),
    ("pipeline",),
    ("help_pages", "commands", "commands_of_scenes", "api", "gym", "registration", "play", "studies", "benchmarks"),
    ("cli", "__init__", "__main__"),
)
"""A module imports from its own line or from lines above it."""


def layer_of(module):
    return next(number for number, names in enumerate(LAYERS) if module.split(".")[0] in names)


def imported(tree):
    """Modules of the package that a module imports, also within functions."""
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names = [node.module] + [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            inside = name.removeprefix("relm_irl_jax.")
            if inside != name and (inside in MODULES or f"{inside}.__init__" in MODULES):
                yield inside


@pytest.mark.parametrize("module", [name for name in MODULES if name != "__init__"])
def test_no_import_runs_back_up_the_chain(module):
    for name in imported(MODULES[module]):
        assert layer_of(name) <= layer_of(module), f"{module} imports {name}"


@pytest.mark.parametrize("user", ["evaluation", "play", "gym", "report", "studies"])
def test_users_of_policies_know_no_agent(user):
    for module in MODULES:
        if module.split(".")[0] == user:
            assert not [name for name in imported(MODULES[module]) if name.split(".")[0] == "agents"], module


BUILT_ON = {"savn": "recurrent"}
"""Agents that are another agent and more."""


def test_agents_know_nothing_of_each_other():
    folders = {path.name for path in (PACKAGE / "agents").iterdir() if path.is_dir() and path.name != "__pycache__"}
    for module in MODULES:
        own = module.split(".")[1] if module.startswith("agents.") else None
        if own in folders:
            others = {f"agents.{name}" for name in folders - {own, BUILT_ON.get(own)}}
            assert not [name for name in imported(MODULES[module]) if name.startswith(tuple(others))], module


def test_the_agent_is_chosen_in_one_place():
    compared = {
        module
        for module, tree in MODULES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Compare) and ast.unparse(node.left) == "config.agent"
    }
    assert compared == {"stages.make_agent"}


def functions():
    for module, tree in MODULES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield module, node


def test_no_function_takes_more_than_six_positional_parameters():
    for module, function in functions():
        names = [argument.arg for argument in (*function.args.posonlyargs, *function.args.args)]
        names = names[1:] if names[:1] in (["self"], ["cls"]) else names
        assert len(names) <= 6, f"{module}.{function.name}({', '.join(names)})"


def test_public_functions_say_what_they_take_and_return():
    for module, function in functions():
        documented = ast.get_docstring(function) or ""
        public = not function.name.startswith("_") and function in ast.iter_child_nodes(MODULES[module])
        if not module.startswith("benchmarks.") and public and len(function.args.args) > 2:
            assert "Args:" in documented, f"{module}.{function.name}"


def test_agents_donate_no_state():
    """The state before a chunk is saved if the chunk is interrupted, which a donated one cannot be."""
    for module, tree in MODULES.items():
        if module.startswith("agents."):
            assert "donate" not in ast.unparse(tree), module
