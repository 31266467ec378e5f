"""Every table and figure of the paper, from scratch; what is finished is kept, so that the same command goes on.

    make paper                                all pieces, then runs/paper/report.html
    make paper PIECE=metric                   one of siamese, siamese-given, siamese-long, siamese-told, siamese-rooms,
                                              siamese-resnet50, metric, metric-open, metric-no-hindsight,
                                              metric-resnet50, metric-reward-alone, vizdoom, elm, stability,
                                              reward-ranks, ablation, irl-methods, regularisation, map, map-vizdoom,
                                              unseen, many-rooms, report
    make paper PIECE=ablation VARIANT=lp      one variant, and the base that it is compared with
    make paper QUICK=1                        the same code on tiny rooms, in runs/paper-quick
    make paper JOBS=4                         four runs at a time, each in a process of its own

Tables 1 to 3 and Figures 6 and 11 are of the pieces `siamese` (the paper's agent) and `metric`, Figures 7 to 10 of
`elm`. The piece `map` measures the mapping agent in unseen rooms. Some pieces run only where they are named:
`vizdoom` and `map-vizdoom`, whose scenes have to be recorded first, `metric-reward-alone`, `regularisation`,
`siamese-long`, which trains with more frames, and `siamese-rooms` and `many-rooms`, which train agents on up to
hundreds of rooms. The presets lie in experiments/paper. Runs go where joblib's context sends them: a script that calls
`main` within `joblib.parallel_config` can spread them over a cluster.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args

import elm_ablation
import irl_stability
import reward_ranks
import search_study
import tyro
from joblib import parallel_config
from pydantic import PositiveInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.config import read_fields
from relm_irl_jax.elm.ablation import PAPER_SIZES
from relm_irl_jax.errors import InputError
from relm_irl_jax.exits import errors_as_sentences
from relm_irl_jax.interruption import Resume, exit_interrupted, interruptible
from relm_irl_jax.progress import console
from relm_irl_jax.studies.ablation import Ablation, AblationRow, ablation_rows, load_ablation, run_ablation
from relm_irl_jax.studies.page import RUN_TITLES, STUDY_TEXTS, write_study
from relm_irl_jax.studies.settings_file import check_settings
from relm_irl_jax.studies.study import SCENE_FIELDS, complete_run, complete_runs, load_preset
from relm_irl_jax.studies.times import load_times, timed

PRESETS = Path(__file__).parent / "paper"
QUICK = PRESETS / "quick.toml"

Piece = Literal[
    "siamese",
    "siamese-given",
    "siamese-long",
    "siamese-told",
    "siamese-rooms",
    "siamese-resnet50",
    "metric",
    "metric-open",
    "metric-no-hindsight",
    "metric-resnet50",
    "metric-reward-alone",
    "vizdoom",
    "elm",
    "stability",
    "reward-ranks",
    "ablation",
    "irl-methods",
    "regularisation",
    "map",
    "map-vizdoom",
    "unseen",
    "many-rooms",
    "report",
]
NAMED = (
    "vizdoom",
    "map-vizdoom",
    "metric-reward-alone",
    "siamese-long",
    "siamese-rooms",
    "many-rooms",
    "regularisation",
)
"""Pieces that run only where they are named."""

PIECES: tuple[Piece, ...] = tuple(piece for piece in get_args(Piece) if piece not in NAMED)


@dataclass(frozen=True)
class Paper:
    """What to measure and where."""

    pieces: tuple[Piece, ...] = PIECES
    """Pieces to run; the report is written after any of them."""
    variants: tuple[str, ...] = ()
    """Variants of the pieces that have some; all where none is named."""
    quick: bool = False
    """Tiny rooms, few frames and seeds: whether everything runs, not what it finds."""
    out: Path | None = None
    """Folder of the study; by default runs/paper or runs/paper-quick."""
    jobs: PositiveInt = 1
    """Runs at a time, each in a process of its own; with 1, as joblib's context says, by default in this process."""


def main(settings: Paper) -> Path:
    """Run the pieces and write the report.

    Args:
        settings: what and where.

    Returns:
        The report.
    """
    out = settings.out or Path("runs") / ("paper-quick" if settings.quick else "paper")
    overlays = [QUICK] if settings.quick else []
    studies = {name: load_ablation(PRESETS / f"{name}.toml") for name in STUDY_TEXTS}
    known = [variant for name, study in studies.items() if name in settings.pieces for variant in study.variants]
    unknown = [variant for variant in settings.variants if variant not in known]
    if unknown:
        raise InputError(f"variants: there is no {unknown[0]}; variants of these pieces: {', '.join(known) or 'none'}.")
    changes = read_fields(QUICK) if settings.quick else {}
    chosen = [name for name in RUN_TITLES if name in settings.pieces]
    times = out / "tables" / "times.csv"
    with _workers(settings):
        runs = {name: replace(load_preset(PRESETS / f"{name}.toml", overlays), run=out / name) for name in chosen}
        # Several at a time have one time together.
        for names in [chosen] if settings.jobs > 1 else [[name] for name in chosen]:
            if names:
                with timed(times, ", ".join(names)):
                    complete_runs([runs[name] for name in names], complete_run)
        for name, study in studies.items():
            variants = [n for n, variant in study.variants.items() if variant.quick or not settings.quick]
            if settings.variants:
                variants = [variant for variant in settings.variants if variant in study.variants]
            if name in settings.pieces and variants:
                with timed(times, f"{name}: {', '.join(variants)}" if settings.variants else name):
                    run_ablation(study, variants, changes, out / name)
    for name, run in _other_pieces(settings, overlays, out).items():
        if name in settings.pieces:
            with timed(times, name):
                run()
    rows = {name: _rows(name, study, changes, out) for name, study in studies.items()}
    with _workers(settings):
        path = write_study(out, rows).with_suffix(".html")
    minutes = sum(load_times(times).values()) / 60
    console.print(f"All pieces so far took {minutes:,.0f} minutes.", highlight=False)
    console.print(f"Report: {path}", highlight=False, soft_wrap=True)
    return path


def _workers(settings: Paper) -> AbstractContextManager:
    """The context in which runs go to as many processes as the settings say."""
    return parallel_config(n_jobs=settings.jobs) if settings.jobs > 1 else nullcontext()


def _rows(name: str, study: Ablation, changes: Mapping[str, Any], out: Path) -> list[AblationRow]:
    """The rows of a study; a damaged file leaves the study out of the report, and is named."""
    try:
        return ablation_rows(study, changes, out / name)
    except InputError as error:
        console.print(f"{name} is not in the report: {error}", highlight=False, soft_wrap=True)
        return []


def _other_pieces(settings: Paper, overlays: Sequence[Path], out: Path) -> dict[Piece, Callable[[], object]]:
    """The pieces that are neither one run nor a base with variants."""
    config = load_preset(PRESETS / "siamese.toml", overlays)

    def elm() -> None:
        sizes = tuple(size for size in PAPER_SIZES if size <= 5 * config.elm.hidden)
        elm_ablation.main(elm_ablation.Ablation(out / "elm", config.seeds, sizes, config))

    def stability() -> None:
        walks = 4 if settings.quick else irl_stability.Study.trajectories
        check_settings(out / "stability", config, (*SCENE_FIELDS, "irl"), trajectories=walks)
        if not (out / "stability" / "stability.csv").exists():
            irl_stability.main(irl_stability.Study(out / "stability", trajectories=walks, config=config))

    def ranks() -> None:
        shown = ("random-order",) if settings.quick else ()
        reward_ranks.main(reward_ranks.Study(out / "reward-ranks", min(config.seeds, 3), shown, config))

    def search() -> None:
        search_study.main(load_preset(PRESETS / "map.toml", overlays), out / "map", quick=settings.quick)

    def maps() -> None:
        search_study.maps(load_preset(PRESETS / "map-vizdoom.toml", overlays), out / "map-vizdoom")

    return {"elm": elm, "stability": stability, "reward-ranks": ranks, "map": search, "map-vizdoom": maps}


if __name__ == "__main__":
    Resume.sentence = "paper: interrupted; the same command goes on."
    try:
        with interruptible(until_exit=True), errors_as_sentences("paper"):
            main(tyro.cli(Paper, description=__doc__))
    except KeyboardInterrupt as error:
        exit_interrupted(error)
