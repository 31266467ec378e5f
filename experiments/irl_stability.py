"""How far w moves when hardly anything does: the study by which the variant of the maximum-margin program is chosen.

    .venv/bin/python experiments/irl_stability.py --out runs/irl-stability

Single trajectories in one built-in room. A w that jumps between neighbouring starts cannot be regressed on them.
"""

from dataclasses import dataclass, field
from pathlib import Path

import tyro
from relm_irl_jax.rewards.demonstrations import fit_basis
from rich.console import Console
from rich.table import Table

from relm_irl_jax.config import Config
from relm_irl_jax.files import write_table
from relm_irl_jax.irl import MaxMarginSettings
from relm_irl_jax.irl.stability import Stability, stability_study
from relm_irl_jax.stages.encoding import encode_training

WAYS = (
    MaxMarginSettings(form="cost", variant="lp"),
    MaxMarginSettings(form="cost", variant="lp-l1", regularisation=0.01),
    *(MaxMarginSettings(form="cost", variant="lp-l2", regularisation=size) for size in (1e-3, 0.1, 1.0, 10.0)),
    MaxMarginSettings(form="free", variant="lp"),
    *(MaxMarginSettings(form="free", variant="lp-l2", regularisation=size) for size in (1e-3, 0.1, 1.0, 10.0)),
)
"""Forms and variants of the table."""


@dataclass(frozen=True)
class Study:
    """What to measure and where to keep it."""

    out: Path = Path("runs/irl-stability")
    """Folder for the table."""
    scene: str = "bedroom-0"
    """Training scene."""
    trajectories: int = 40
    """Random start and target pairs, the same for every variant."""
    seed: int = 0
    """Seed of the pairs."""
    config: Config = field(default_factory=Config)
    """Scenes, and the dimension of φ."""


def main(study: Study) -> tuple[Stability, ...]:
    """Run the study.

    Args:
        study: what and where.

    Returns:
        One row for each of `WAYS`.
    """
    scenes = encode_training(study.config).scenes
    scene = next(scene for scene in scenes if scene.name == study.scene)
    basis = fit_basis(scenes, study.config.irl.dimension)
    rows = stability_study(scene, basis(scene.encoded), WAYS, study.trajectories, study.seed)
    columns = {
        "form": [row.settings.form for row in rows],
        "variant": [row.settings.variant for row in rows],
        "regularisation": [0.0 if row.settings.variant == "lp" else row.settings.regularisation for row in rows],
        "start_median": [round(row.start_median, 5) for row in rows],
        "start_90th_percentile": [round(row.start_worst, 5) for row in rows],
        "margin_median": [round(row.margin_median, 5) for row in rows],
        "margin_90th_percentile": [round(row.margin_worst, 5) for row in rows],
        "share_of_lp": [round(row.share, 4) for row in rows],
        "solved": [row.solved for row in rows],
    }
    write_table(study.out / "stability.csv", columns)
    d = basis.components.shape[1]
    table = Table(
        title=f"Relative movement of w: {study.trajectories} trajectories in {scene.name}, φ of {d} components"
    )
    for name in columns:
        table.add_column(name.replace("_", " "))
    for values in zip(*columns.values(), strict=True):
        table.add_row(*map(str, values))
    Console().print(table)
    return rows


if __name__ == "__main__":
    main(tyro.cli(Study, description=__doc__))
