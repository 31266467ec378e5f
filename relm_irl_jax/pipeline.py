"""The chain from scenes to the table: scenes → features → targets → demonstrations → rewards → agents → evaluation.

A stage whose result lies in the run folder is not run again.
"""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from relm_irl_jax.cluster import join
from relm_irl_jax.config import Config, Method, Task
from relm_irl_jax.errors import InputError
from relm_irl_jax.report.page import machine, write_report
from relm_irl_jax.runs import RunFolder, open_run, write_json
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import check_scenes_setting
from relm_irl_jax.stages.encoding import EncodedScenes, encode_training
from relm_irl_jax.stages.evaluating import evaluate_task
from relm_irl_jax.stages.learning import LearnedRewards, keep_rewards, learn
from relm_irl_jax.stages.playing import map_episodes
from relm_irl_jax.stages.training import train_method, train_together, trains_together
from relm_irl_jax.tasks import TaskSplit, draw_split

LEARNED: tuple[Method, ...] = ("irl", "elm-irl", "relm-irl")
"""Methods whose reward is learned from demonstrations."""

Learner = Callable[[Config, Sequence[Scene], TaskSplit, int], LearnedRewards]
"""Learns the rewards of a configuration from encoded training scenes, the targets of all tasks, and a seed."""


@dataclass(frozen=True)
class Stopwatch:
    """Seconds that each stage took, in all calls together, kept in the run folder with the machine.

    Attributes:
        path: the file, `machine.json`.
    """

    path: Path

    @contextmanager
    def __call__(self, stage: str):
        """Time a block under the name of a stage."""
        begun = time.perf_counter()
        yield
        before = json.loads(self.path.read_text())["seconds"] if self.path.exists() else {}
        passed = round(before.get(stage, 0.0) + time.perf_counter() - begun, 2)
        write_json(self.path, machine() | {"seconds": before | {stage: passed}})


def run(
    config: Config,
    tasks: Sequence[Task] = (),
    encoded: EncodedScenes | None = None,
    learner: Learner = learn,
    *,
    maps: bool = True,
) -> RunFolder:
    """Train what is not yet trained, evaluate the agents and write the report.

    Args:
        config: the configuration.
        tasks: tasks to evaluate; the configuration's where empty.
        encoded: the training scenes, where they are encoded already.
        learner: learns rewards; runs that share them can be given one that remembers.
        maps: whether to draw episodes and rewards from above.

    Returns:
        The run folder.

    Raises:
        InputError: the configuration, the scenes or the run folder cannot be used.
    """
    check_scenes_setting(config.scenes)
    join(config.cluster)
    if config.agent == "metric" and "bc" in config.methods:
        raise InputError("methods: bc clones the siamese agent's policy; leave it out, or use --agent siamese.")
    if config.agent == "siamese" and config.siamese.heads == "scene" and "III" in (tasks or (config.task,)):
        raise InputError(
            "siamese.heads: scene leaves the unseen scenes of task III without a head; use room_type or shared."
        )
    folder = open_run(config)
    stopwatch = Stopwatch(folder.file("machine.json"))
    if encoded is None:
        with stopwatch("scenes and features"):
            encoded = encode_training(config)
    together: dict[Method, list] = {}
    for seed in range(config.seeds):
        split = draw_split(encoded.scenes, (), config.tasks, seed)
        missing = [m for m in config.chosen_methods() if m != "random" and not folder.agent(m, seed).exists()]
        learned = None
        if set(missing) & set(LEARNED):
            with stopwatch("inverse reinforcement learning and ELM"):
                learned = learner(config, encoded.scenes, split, seed)
                keep_rewards(encoded.scenes, split, learned, seed, folder, maps=maps)
        for method in missing:
            if config.seeds > 1 and trains_together(config, method):
                together.setdefault(method, []).append((seed, split, learned))
                continue
            with stopwatch(f"training {method}"):
                train_method(config, method, seed, encoded.scenes, split, learned, folder)
    for method, prepared in together.items():
        with stopwatch(f"training {method}"):
            train_together(config, method, prepared, encoded.scenes, folder)
    for task in tasks or (config.task,):
        with stopwatch("evaluation"):
            _evaluate(config, folder, encoded, task, maps=maps)
    write_report(folder, config)
    return folder


def _evaluate(config: Config, folder: RunFolder, encoded: EncodedScenes, task: Task, *, maps: bool = True) -> None:
    """Evaluate the agents and map episodes of the last method, which is the paper's where it was trained."""
    rows = evaluate_task(config, folder, encoded, task)["rows"]
    if maps:
        map_episodes(config, folder, encoded, rows[-1]["method"], task)


def evaluate_run(config: Config, folder: RunFolder, task: Task) -> None:
    """Evaluate the agents of a run folder on a task and write the report.

    Args:
        config: the configuration as run.
        folder: the run folder.
        task: `I`, `II` or `III`.
    """
    _evaluate(config, folder, encode_training(config), task)
    write_report(folder, config)
