"""Scenes of one engine to a folder of scene files."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from time import monotonic

from rich import box
from rich.table import Table

from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.record import Recording, record_scene
from relm_irl_jax.scenes.source import Source

Opener = Callable[[], AbstractContextManager[Source]]
"""Starts the engine in one place; it stops when the block ends."""


def export(openers: Mapping[str, Opener], out: Path) -> Iterator[tuple[Path, Recording | None, float]]:
    """Record scenes one after the other; files that exist are left as they are.

    Args:
        openers: what opens each scene, by the name of its file.
        out: folder for the files.

    Yields:
        For each scene its file, what was recorded, None where the file existed, and the seconds it took.
    """
    for name, opened in openers.items():
        path = out / f"{name}.h5"
        began = monotonic()
        recording = None
        if not path.exists():
            with opened() as source:
                recording = record_scene(source, path)
        yield path, recording, monotonic() - began


def export_table(exported: list[tuple[Path, Recording | None, float]]) -> Table:
    """One line a scene.

    Args:
        exported: what `export` gave.

    Returns:
        The table, ready to print.
    """
    table = Table(
        title="Recorded scenes",
        caption="refused, cut off: states left out; closed: one-way moves",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for heading in ("file", "states", "refused", "closed", "cut off", "objects", "seconds"):
        table.add_column(heading, justify="left" if heading == "file" else "right", no_wrap=True)
    for path, recording, seconds in exported:
        if recording is None:
            table.add_row(path.name, "kept as it was", *[""] * 5)
            continue
        counts = (recording.scene.n_states, recording.dropped, recording.closed, recording.cut_off)
        table.add_row(path.name, *map(str, counts), str(len(best_views(recording.scene))), f"{seconds:.0f}")
    return table
