"""How well each choice of inverse reinforcement learning and of the regressor predicts rewards: no agent is trained.

    .venv/bin/python experiments/reward_ranks.py --out runs/reward-ranks

The variants are those of `experiments/paper/ablation.toml` that change `irl` or `elm` alone. The rank of a target is
the number of states of its scene whose predicted reward is at least the target's; 1 is best, and half of the states is
chance. What is finished is kept.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from relm_irl_jax.config import Config, overlay
from relm_irl_jax.errors import InputError
from relm_irl_jax.exits import errors_as_sentences
from relm_irl_jax.files import read_table, write_table
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.report.intervals import mean_interval
from relm_irl_jax.report.names import method_name
from relm_irl_jax.results import PREDICTED
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.rewards.quality import predicted_reward_quality
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import encode_training, encode_unseen
from relm_irl_jax.stages.rewards import learn, reward_quality_rows
from relm_irl_jax.studies.ablation import BASE, load_ablation
from relm_irl_jax.studies.settings_file import check_settings
from relm_irl_jax.studies.study import PREDICTION_FIELDS
from relm_irl_jax.tasks import draw_split

ABLATION = Path(__file__).parent / "paper" / "ablation.toml"

TARGETS = ("trained", "new", "uniform", "unseen")
"""Training targets, those of Task II as in the paper and drawn uniformly, and those of Task III in unseen scenes."""

PAID = {"irl.minimum_cost", "irl.cost_horizon", "elm.predict_from"}
"""Settings that change what agents are paid, and leave what is learned as it is."""


@dataclass(frozen=True)
class Study:
    """What to measure, and where to save it."""

    out: Path = Path("runs/reward-ranks")
    """Folder for the table."""
    seeds: int = 3
    """Seeds of targets, demonstrations and regressors."""
    variants: tuple[str, ...] = ()
    """Variants; by default all that change the rewards."""
    config: Config = field(default_factory=Config)
    """Scenes, targets, and all that a variant does not change."""


def reward_variants() -> dict[str, tuple[str, dict[str, Any]]]:
    """Title and changes of each variant of the ablation that changes what is learned or predicted."""
    found: dict[str, tuple[str, dict[str, Any]]] = {BASE: ("the default", {})}
    for name, variant in load_ablation(ABLATION).variants.items():
        if set(variant.set) <= {"irl", "elm"}:
            changed = {f"{group}.{setting}" for group, settings in variant.set.items() for setting in settings}
            if not changed & PAID:
                found[name] = (variant.title, variant.set)
    return found


def ranks(
    config: Config, scenes: Sequence[Scene], unseen: Sequence[Scene], seeds: int
) -> Iterator[dict[tuple[str, str], float]]:
    """Median rank of each method's targets, seed by seed.

    Args:
        config: the configuration.
        scenes: encoded training scenes.
        unseen: encoded scenes of Task III.
        seeds: number of seeds.

    Yields:
        Ranks by method and targets.
    """
    for seed in range(seeds):
        split = draw_split(scenes, unseen, config.tasks, seed)
        learned = learn(config, scenes, split, seed)
        rows = reward_quality_rows(scenes, split, learned, seed)
        found = {(row.method, row.targets): row.median_rank for row in rows if row.method in PREDICTED}
        phi = [learned.basis.phi(scene) for scene in unseen]
        for method, regressor in learned.regressors.items():
            predictor = RewardPredictor(unseen, phi, regressor, learned.form)
            generator = np.random.default_rng([seed, 3])
            qualities = predicted_reward_quality(unseen, split.similar, predictor, generator)
            found[method, "unseen"] = float(np.median([quality.rank for quality in qualities]))
        yield found


def main(study: Study) -> Path:
    """Run the study, and print its table.

    Args:
        study: what and where.

    Returns:
        The table's file.

    Raises:
        InputError: there is no such variant, or the folder holds results of other settings.
    """
    config = study.config.resolved()
    known = reward_variants()
    if unknown := set(study.variants) - set(known):
        raise InputError(f"variants: there is no {min(unknown)}; known variants: {', '.join(known)}.")
    check_settings(study.out, config, PREDICTION_FIELDS, seeds=study.seeds)
    # The table is of all variants that the folder holds, whichever were measured now.
    held = [name for name in known if (study.out / name / "ranks.csv").exists()]
    variants = {name: known[name] for name in known if name in (*held, *(study.variants or known))}
    configs = {name: overlay(config, changes, ABLATION.name) for name, (_, changes) in variants.items()}
    for name, changed in configs.items():
        check_settings(study.out / name, changed, PREDICTION_FIELDS, seeds=study.seeds)
    training = encode_training(config)
    unseen = encode_unseen(config, training)
    columns: dict[str, list[Any]] = {
        name: [] for name in ("variant", "title", "method", "targets", "mean", "half_width", "seeds")
    }
    with progress_bar("ranks of targets", len(variants), "variants") as advance:
        for name, (title, _) in variants.items():
            file = study.out / name / "ranks.csv"
            if not file.exists():
                found = list(ranks(configs[name], training.scenes, unseen, study.seeds))
                keys = [(method, targets) for method in PREDICTED for targets in TARGETS]
                intervals = [mean_interval([of_seed[key] for of_seed in found]) for key in keys]
                write_table(
                    file,
                    {
                        "variant": [name] * len(keys),
                        "title": [title] * len(keys),
                        "method": [method for method, _ in keys],
                        "targets": [targets for _, targets in keys],
                        "mean": [interval.mean for interval in intervals],
                        "half_width": [interval.half_width for interval in intervals],
                        "seeds": [study.seeds] * len(keys),
                    },
                )
            for column, values in read_table(file).items():
                columns[column] += values
            advance(1)
    write_table(study.out / "reward-ranks.csv", columns)
    table = Table(title=f"Median rank of targets, mean of {study.seeds} seeds, encoder {training.encoder_name}")
    for heading in ("variant", "method", "targets", "rank"):
        table.add_column(heading)
    for name, method, targets, mean in zip(
        *(columns[column] for column in ("variant", "method", "targets", "mean")), strict=True
    ):
        table.add_row(name, method_name(method), targets, f"{float(mean):.1f}")
    Console().print(table)
    return study.out / "reward-ranks.csv"


if __name__ == "__main__":
    with errors_as_sentences("reward_ranks"):
        main(tyro.cli(Study, description=__doc__))
