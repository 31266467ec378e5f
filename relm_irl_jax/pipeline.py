"""The chain from scenes to the table: scenes → features → targets → demonstrations → rewards → agents → evaluation.

A stage whose result lies in the run folder is not run again.
"""

import time
from contextlib import contextmanager
from dataclasses import dataclass, field

from relm_irl_jax.cluster import join
from relm_irl_jax.config import Config, Method
from relm_irl_jax.errors import InputError
from relm_irl_jax.report.page import machine, write_report
from relm_irl_jax.runs import RunFolder, open_run, write_json
from relm_irl_jax.scenes.catalog import check_source
from relm_irl_jax.stages.encoding import encode_training
from relm_irl_jax.stages.evaluating import evaluate_task
from relm_irl_jax.stages.learning import learn
from relm_irl_jax.stages.playing import map_episodes
from relm_irl_jax.stages.training import train_method
from relm_irl_jax.tasks import draw_split

LEARNED: tuple[Method, ...] = ("irl", "elm-irl", "relm-irl")
"""Methods whose reward is learned from demonstrations."""


@dataclass
class Stopwatch:
    """Seconds that each stage took."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str):
        """Time a block under the name of a stage."""
        begun = time.perf_counter()
        yield
        self.seconds[stage] = round(self.seconds.get(stage, 0.0) + time.perf_counter() - begun, 2)


def run(config: Config) -> tuple[RunFolder, dict]:
    """Train what is not yet trained, evaluate the configuration's task and write the report.

    Args:
        config: the configuration.

    Returns:
        The run folder and the contents of its `results.json`.

    Raises:
        InputError: the configuration, the scenes or the run folder cannot be used.
    """
    check_source(config.scenes)
    join(config.cluster)
    if config.agent == "metric" and "bc" in config.methods:
        raise InputError("methods: bc clones the siamese agent's policy; leave it out, or use --agent siamese.")
    if config.agent == "siamese" and config.siamese.heads == "scene" and config.task == "III":
        raise InputError(
            "siamese.heads: scene leaves the unseen scenes of task III without a head; use room_type or shared."
        )
    folder = open_run(config)
    stopwatch = Stopwatch()
    with stopwatch("scenes and features"):
        encoded = encode_training(config)
    for seed in range(config.seeds):
        split = draw_split(encoded.scenes, (), config.tasks, seed)
        missing = [m for m in config.chosen_methods() if m != "random" and not folder.agent(m, seed).exists()]
        learned = None
        if set(missing) & set(LEARNED):
            with stopwatch("inverse reinforcement learning and ELM"):
                learned = learn(config, encoded.scenes, split, seed, folder)
        for method in missing:
            with stopwatch(f"training {method}"):
                train_method(config, method, seed, encoded.scenes, split, learned, folder)
    with stopwatch("evaluation"):
        results = evaluate_task(config, folder, encoded, config.task)
        map_episodes(config, folder, encoded, _shown(results), config.task)
    write_json(folder.file("machine.json"), machine() | {"seconds": stopwatch.seconds})
    write_report(folder, config, results)
    return folder, results


def evaluate_run(config: Config, folder: RunFolder, task: str) -> dict:
    """Evaluate the agents of a run folder on a task and write the report.

    Args:
        config: the configuration as run.
        folder: the run folder.
        task: `I`, `II` or `III`.

    Returns:
        The contents of `results.json`.
    """
    encoded = encode_training(config)
    results = evaluate_task(config, folder, encoded, task)
    map_episodes(config, folder, encoded, _shown(results), task)
    write_report(folder, config, results)
    return results


def _shown(results: dict) -> Method:
    """The method whose episodes the report shows: the last one evaluated, which is the paper's where it was."""
    return results["rows"][-1]["method"]
