"""The tables of the documentation, from the committed CSV files and from nothing else: `make tables`.

    make tables RUN=runs/paper    copy the tables of a study into docs/tables and its figures into docs, then write the
                                  tables of the pages; rows of variants that this study has not run stay as they are
    make tables RUN=runs/bench    the same with what the benchmarks have measured
    make tables RUN=runs/robustness                    with what `make chaos` and `make fuzz` have counted
    make tables RUN=runs/default                       with the table of the default run, `make train TASK=II RUN=...`
    make tables RUN=runs/examples                      with the rows of the programs in experiments/examples
    make tables                   write those of the pages from docs/tables

A page says where a table belongs, and which, between two comments:

    <!-- table: tasks siamese -->        SR, PLE and SPL of a piece's methods on each task
    <!-- table: differences siamese -->  RELM-IRL minus the other methods, paired over seeds
    <!-- table: summary -->                         SR and SPL of the pieces of the claims, and the paper's
    <!-- table: rooms unseen many-rooms -->         success in unseen rooms against the number of training rooms
    <!-- table: all-tasks many-rooms -->           SR and SPL on every task by agent and number of training rooms
    <!-- table: contributions -->                  what memory and adaptation add
    <!-- table: search -->                          the mapping agent in unseen rooms
    <!-- table: learned-rewards -->                 what learned rewards change there
    <!-- table: failed-rooms -->                    where it fails
    <!-- table: ranks -->                           ranks of targets by predicted reward
    <!-- table: variants ablation metric -->       a base and its variants, of all agents or those named
    <!-- table: selections -->                      accuracy of several ways to select neurons
    <!-- table: stability -->                       how stable reward weights are
    <!-- table: peers -->                           speed of every part beside another library
    <!-- table: trainings gpu -->                   frames per second of all agents' trainings
    <!-- table: commands -->                        time of whole commands from nothing
    <!-- table: gym -->                             steps per second of the Gymnasium environments
    <!-- table: examples -->                        agents of other programs
    <!-- table: robustness -->                      processes that were ended and inputs that were damaged
    <!-- table: times -->                           how long the pieces of `make paper` took
    <!-- table: scaling -->                         an update on several virtual devices
    <!-- table: maps map-vizdoom -->                the mapping agent in unseen recorded maps
    <!-- /table -->
"""

import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import result_tables
import speed_tables
from claims_figure import claims_figure
from committed_tables import ROOT, TABLES, copy_tables

from relm_irl_jax.errors import InputError
from relm_irl_jax.exits import errors_as_sentences
from relm_irl_jax.files import read_table, write_bytes
from relm_irl_jax.report.figures import as_png
from relm_irl_jax.studies.contributions import contributions_table
from relm_irl_jax.studies.reward_tables import selections_table, stability_table
from relm_irl_jax.studies.rooms_figure import rooms_figure, unseen_by_rooms
from relm_irl_jax.studies.times import times_table

PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

BLOCK = re.compile(r"(<!-- table: ([a-z-]+)((?: [\w-]+)*) -->\n).*?(<!-- /table -->)", re.DOTALL)
"""A table of a page: its first line, kind, arguments, and last line."""


def written(page: str) -> str:
    """A page with its tables written from `docs/tables`.

    Args:
        page: the page's text.

    Returns:
        The text with the tables as they must be.

    Raises:
        InputError: a table has no end, or is of no known kind.
    """

    def table(block: re.Match[str]) -> str:
        if block[2] not in KINDS or "<!-- table:" in block[0][len(block[1]) :]:
            fault = "has no <!-- /table -->" if block[2] in KINDS else f"is of no known kind ({', '.join(KINDS)})"
            raise InputError(f"the table {block[1].strip()} {fault}.")
        lines = KINDS[block[2]](*block[3].split())
        return f"{block[1]}\n" + "\n".join(lines) + f"\n\n{block[4]}"

    return BLOCK.sub(table, page)


KINDS: dict[str, Callable[..., list[str]]] = {
    "tasks": result_tables.tasks,
    "differences": result_tables.differences,
    "summary": result_tables.summary,
    "rooms": result_tables.rooms,
    "all-tasks": result_tables.all_tasks,
    "contributions": lambda: contributions_table(read_table(TABLES / "contributions.csv")),
    "search": result_tables.search,
    "learned-rewards": result_tables.learned_rewards,
    "failed-rooms": result_tables.failed_rooms,
    "ranks": result_tables.ranks,
    "variants": result_tables.variants,
    "selections": lambda: selections_table(TABLES / "elm-selections.csv"),
    "stability": lambda: stability_table(TABLES / "stability.csv"),
    "peers": speed_tables.peers,
    "trainings": speed_tables.trainings,
    "scaling": speed_tables.scaling,
    "commands": speed_tables.commands,
    "gym": speed_tables.gym,
    "examples": result_tables.examples,
    "robustness": speed_tables.robustness,
    "times": lambda: times_table(TABLES / "times.csv"),
    "maps": result_tables.maps,
}
"""What fills a table, by kind."""


def main(arguments: Sequence[str]) -> None:
    """Copy the tables of the named studies, draw the figures of tables of several pieces, and write the pages."""
    for study in arguments:
        copy_tables(Path(study))
    rooms = unseen_by_rooms(*(read_table(TABLES / f"{name}.csv") for name in ("unseen", "many-rooms")))
    write_bytes(ROOT / "docs" / "training-rooms.png", as_png(rooms_figure(rooms)))
    write_bytes(ROOT / "docs" / "claims.png", as_png(claims_figure()))
    for page in PAGES:
        text = page.read_text()
        if (new := written(text)) != text:
            write_bytes(page, new.encode())


if __name__ == "__main__":
    with errors_as_sentences("tables"):
        main(sys.argv[1:])
