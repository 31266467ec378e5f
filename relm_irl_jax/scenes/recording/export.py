"""Recording of several scenes of a simulator in a folder of scene files."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from rich import box
from rich.table import Table

from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.recording.record import Recording, record_scene
from relm_irl_jax.scenes.recording.simulator import SceneOpener


@dataclass(frozen=True)
class ExportedScene:
    """One scene file of an export.

    Attributes:
        path: the file.
        recording: the recording; None if the file already existed.
        seconds: duration.
    """

    path: Path
    recording: Recording | None
    seconds: float


def export_scenes(openers: Mapping[str, SceneOpener], folder: Path) -> Iterator[ExportedScene]:
    """Record scenes one after the other; existing files are not changed.

    Args:
        openers: function that starts the simulator in each scene, by file name.
        folder: folder for the files.

    Yields:
        Each scene as soon as it is recorded.
    """
    for name, open_scene in openers.items():
        path = folder / f"{name}.h5"
        start = monotonic()
        recording = None
        if not path.exists():
            with open_scene() as simulated:
                recording = record_scene(simulated, path)
        yield ExportedScene(path, recording, monotonic() - start)


def export_table(exported: Sequence[ExportedScene]) -> Table:
    """Format an export as a table, one row for each scene.

    Args:
        exported: the scenes.

    Returns:
        The table.
    """
    table = Table(
        title="Recorded scenes",
        caption="refused, disconnected: states left out; closed: moves replaced by collisions",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for heading in ("file", "states", "refused", "closed", "disconnected", "objects", "seconds"):
        table.add_column(heading, justify="left" if heading == "file" else "right", no_wrap=True)
    for item in exported:
        recording = item.recording
        if recording is None:
            table.add_row(item.path.name, "exists", *[""] * 5)
            continue
        counts = (recording.scene.n_states, recording.refused, recording.closed, recording.disconnected)
        n_objects = len(best_views(recording.scene))
        table.add_row(item.path.name, *map(str, counts), str(n_objects), f"{item.seconds:.0f}")
    return table
