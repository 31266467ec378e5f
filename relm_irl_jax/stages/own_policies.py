"""Rows of other programs in a run's tables: a policy of the user's, or results that were measured elsewhere."""

import importlib
import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relm_irl_jax.batch_policies import BatchPolicy, Protocol, evaluate_batch_policy
from relm_irl_jax.config import METHODS, Config, Task
from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.evaluation import evaluation_key
from relm_irl_jax.features.settings import Observed
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.results import (
    BESIDE_NAMES,
    OWN,
    ResultRow,
    Results,
    join_results,
    load_results,
    save_entry,
    save_results,
)
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.selection import training_scenes, unseen_scenes
from relm_irl_jax.stages.encoding import EncodedScenes, scene_settings
from relm_irl_jax.stages.evaluation import result_rows
from relm_irl_jax.stages.worlds import EvaluationTask, evaluation_task

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._+-]{0,39}")
"""Names of methods that can be names of files, too."""


@dataclass(frozen=True)
class OwnPolicy:
    """A policy of the user's, and what it observes.

    Attributes:
        source: `module:name` of a function of a batch of observations, see `relm_irl_jax.batch_policies`; or of a
            class, which is called with the seed and gives such a function.
        obs: what the policy observes.
        history: number of last views that it observes.
    """

    source: str
    obs: Observed = "features"
    history: int = 1

    def load(self, seed: int) -> BatchPolicy:
        """Import the policy; modules are also looked for in the current folder.

        Args:
            seed: the seed, for classes.

        Returns:
            The policy.

        Raises:
            InputError: there is no such module or name, or it is no function.
        """
        module, _, name = self.source.partition(":")
        if not module or not name:
            raise InputError(f"policy: {self.source} is no policy; give module:function, such as my_agent:policy.")
        if module.endswith(".py"):
            raise InputError(f"policy: {module} is a file; give its module, {Path(module).stem}:{name}.")
        if "" not in sys.path:
            sys.path.insert(0, "")
        try:
            found = importlib.import_module(module)
        except ImportError as error:
            raise InputError(
                f"policy: {module} cannot be imported ({first_line(error)}); give a module of the current folder, or "
                "an installed one."
            ) from error
        for part in name.split("."):
            if not hasattr(found, part):
                raise InputError(f"policy: {module} has no {name}; give the name of a function in it.")
            found = getattr(found, part)
        policy = found(seed) if isinstance(found, type) else found
        if not callable(policy):
            raise InputError(f"policy: {self.source} is no function of observations; give one.")
        return policy


def check_name(name: str) -> str:
    """Check the name of an entry in the tables.

    Args:
        name: the name.

    Returns:
        The name.

    Raises:
        InputError: it is a method's of this package, or cannot be a file's name.
    """
    if name in METHODS or name in BESIDE_NAMES:
        raise InputError(f"name: {name} is a method of this package; give another name.")
    if not NAME.fullmatch(name):
        raise InputError(f"name: {name!r} is refused; give up to 40 letters, digits, blanks or . _ + -")
    return name


def evaluate_own_policy(config: Config, training: EncodedScenes, task: Task, policy: OwnPolicy, name: str) -> Results:
    """Evaluate a user's policy on the targets and episodes of a run.

    Args:
        config: the configuration of the run.
        training: its training scenes.
        task: `I`, `II` or `III`.
        policy: the policy.
        name: its name in tables.

    Returns:
        The metrics, which are not saved.

    Raises:
        InputError: the policy cannot be used.
    """
    rows: list[ResultRow] = []
    protocol = Protocol(config.tasks.cap, config.evaluation.episodes, policy.history)
    for seed in range(config.seeds):
        of_seed, function = evaluation_task(config, training, task, seed), policy.load(seed)
        observed = _observed(config, of_seed, policy.obs)
        total = len(of_seed.scenes) * config.evaluation.episodes
        with progress_bar(f"evaluating {name}, seed {seed}", total, "episodes") as advance:
            episodes = evaluate_batch_policy(
                evaluation_key(seed),
                function,
                of_seed.world,
                of_seed.targets,
                observed,
                protocol,
                advance=advance,
            )
        rows += result_rows(name, OWN, of_seed, episodes)
    return Results(task, config.tasks.cap, training.encoder_name, tuple(rows))


def _observed(config: Config, task: EvaluationTask, obs: Observed) -> list[np.ndarray]:
    """What is observed of the views of a task's scenes."""
    if obs == "features":
        if not task.scenes[0].encoded.shape[1]:
            raise InputError("obs: the agents of this run look at frames, and no features were made; give frames.")
        return [scene.encoded for scene in task.scenes]
    load = unseen_scenes if task.name == "III" else training_scenes
    views = {scene.name: scene.views for scene in (each() for each in load(config.scenes, scene_settings(config)))}
    return [views[scene.name] for scene in task.scenes]


def enter(folder: RunFolder, own: Results) -> Results:
    """Add rows to a run's results of a task, and keep them for later evaluations; rows of the same names are replaced.

    Args:
        folder: the run folder, in which the task has been evaluated.
        own: the rows.

    Returns:
        All rows, which are also saved.

    Raises:
        InputError: the rows were not measured as the run's were.
    """
    names = {check_name(row.method) for row in own.rows}
    own = replace(own, rows=tuple(replace(row, agent=OWN) for row in own.rows))
    present = load_results(folder, own.task)
    others = tuple(row for row in present.rows if row.method not in names)
    joined = join_results([replace(present, rows=others), own])
    for name in names:
        save_entry(folder, replace(own, rows=tuple(row for row in own.rows if row.method == name)))
    save_results(folder, replace(joined, encoder=present.encoder))
    return joined


def results_file(path: Path, read: Results, name: str | None) -> Results:
    """Give the rows of a file another name.

    Args:
        path: the file, for messages.
        read: its contents.
        name: the name; None to keep the names of its rows.

    Returns:
        The rows.

    Raises:
        InputError: rows of several methods cannot have one name.
    """
    if name is None:
        return read
    if len({row.method for row in read.rows}) > 1:
        raise InputError(f"name: {path} has rows of several methods; leave out the name.")
    return replace(read, rows=tuple(replace(row, method=name) for row in read.rows))
