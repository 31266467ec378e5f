"""How much reward weights change under small changes of the problem, for each form and regulariser.

    .venv/bin/python experiments/irl_stability.py --out runs/irl-stability

Problems are single trajectories in one built-in room. Weights that jump between neighbouring starts cannot be predicted
by regression; the default regulariser was chosen by this table.
"""

from dataclasses import dataclass, field
from pathlib import Path

import tyro
from rich.console import Console
from rich.table import Table

from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.exits import errors_as_sentences
from relm_irl_jax.files import write_table
from relm_irl_jax.irl import MaxMarginSettings
from relm_irl_jax.irl.weight_stability import WeightStability, measure_weight_stability
from relm_irl_jax.rewards.basis import fit_basis
from relm_irl_jax.stages.encoding import encode_training

SETTINGS = (
    MaxMarginSettings(form="cost", variant="lp"),
    MaxMarginSettings(form="cost", variant="lp-l1", regularisation=0.01),
    *(MaxMarginSettings(form="cost", variant="lp-l2", regularisation=size) for size in (1e-3, 0.1, 1.0, 10.0)),
    MaxMarginSettings(form="free", variant="lp"),
    *(MaxMarginSettings(form="free", variant="lp-l2", regularisation=size) for size in (1e-3, 0.1, 1.0, 10.0)),
)
"""One row of the table each."""


@dataclass(frozen=True)
class Study:
    """What to measure, and where to save it."""

    out: Path = Path("runs/irl-stability")
    """Folder for the table."""
    scene: str = "bedroom-0"
    """Training scene."""
    trajectories: int = 40
    """Number of random pairs of start and target, the same for every row."""
    seed: int = 0
    """Seed of the pairs."""
    config: Config = field(default_factory=Config)
    """Scenes, and the dimension of φ."""


def main(study: Study) -> tuple[WeightStability, ...]:
    """Run the study.

    Args:
        study: what and where.

    Returns:
        One row for each of `SETTINGS`.

    Raises:
        InputError: there is no such scene.
    """
    scenes = encode_training(study.config).scenes
    by_name = {scene.name: scene for scene in scenes}
    if study.scene not in by_name:
        raise InputError(f"scene: there is no {study.scene}; training scenes: {', '.join(by_name)}.")
    scene = by_name[study.scene]
    basis = fit_basis(scenes, study.config.irl.dimension)
    rows = measure_weight_stability(scene, basis.phi(scene), SETTINGS, trajectories=study.trajectories, seed=study.seed)
    columns = {
        "form": [row.settings.form for row in rows],
        "variant": [row.settings.variant for row in rows],
        "regularisation": [0.0 if row.settings.variant == "lp" else row.settings.regularisation for row in rows],
        "start_median": [round(row.start_median, 5) for row in rows],
        "start_90th_percentile": [round(row.start_p90, 5) for row in rows],
        "margin_median": [round(row.margin_median, 5) for row in rows],
        "margin_90th_percentile": [round(row.margin_p90, 5) for row in rows],
        "share_of_lp": [round(row.share_of_lp, 4) for row in rows],
        "solved": [row.solved for row in rows],
    }
    write_table(study.out / "stability.csv", columns)
    d = basis.components.shape[1]
    table = Table(title=f"Relative change of w: {study.trajectories} trajectories in {scene.name}, φ of {d} components")
    for name in columns:
        table.add_column(name.replace("_", " "))
    for values in zip(*columns.values(), strict=True):
        table.add_row(*map(str, values))
    Console().print(table)
    return rows


if __name__ == "__main__":
    with errors_as_sentences("irl_stability"):
        main(tyro.cli(Study, description=__doc__))
