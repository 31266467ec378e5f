"""Checks of scene files for `relm-irl scenes check`: all faults of every file, and a table."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich import box
from rich.table import Table

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.consistency import check_scene
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.scene_file import read_scene


@dataclass(frozen=True)
class SceneCheck:
    """Result of the checks of one file.

    Attributes:
        path: the file.
        scene: the scene without its views; None if the file could not be read.
        image_size: rows and columns of the views; None if the file could not be read.
        faults: errors that make the scene unusable for training, one sentence each; empty for a valid scene.
        notes: unusual properties that do not matter.
    """

    path: Path
    scene: Scene | None
    image_size: tuple[int, int] | None
    faults: tuple[str, ...]
    notes: tuple[str, ...]


def check_files(paths: Sequence[Path]) -> tuple[SceneCheck, ...]:
    """Check scene files; one that cannot be read does not stop the others.

    Args:
        paths: the files.

    Returns:
        One result for each file.
    """
    checked = []
    for path in paths:
        try:
            scene = read_scene(path)
        except InputError as error:
            checked.append(SceneCheck(path, None, None, (str(error),), ()))
            continue
        faults, notes = check_scene(scene)
        rows, columns = scene.views.shape[1:3]
        named = tuple(f"{path}: {fault}" for fault in faults)
        checked.append(SceneCheck(path, scene.without_views(), (rows, columns), named, notes))
    return tuple(checked)


def check_table(checked: Sequence[SceneCheck]) -> Table:
    """Format results as a table, one row for each file.

    Args:
        checked: results of `check_files`.

    Returns:
        The table.
    """
    table = Table(
        title="Scene files",
        caption="unreached: states that no other state can reach; longest: longest of all shortest paths",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for heading in ("file", "type", "states", "unreached", "longest", "views", "features", "labels", "verdict"):
        numeric = heading in ("states", "unreached", "longest")
        table.add_column(heading, justify="right" if numeric else "left", no_wrap=heading != "verdict")
    for result in checked:
        scene = result.scene
        if scene is None or result.image_size is None:
            table.add_row(result.path.name, *[""] * 7, "cannot be read")
            continue
        n_faults = len(result.faults)
        verdict = {0: "valid", 1: "1 fault"}.get(n_faults, f"{n_faults} faults")
        distance = scene.shortest_path_distance
        table.add_row(
            result.path.stem,
            scene.room_type,
            f"{scene.n_states}",
            f"{scene.n_states - len(scene.reachable)}",
            f"{int(distance.max(initial=0))}",
            "×".join(map(str, result.image_size)),
            "no" if scene.features is None else "yes",
            "no" if scene.visible_object is None else f"{len(scene.categories)}",
            "; ".join((verdict, *result.notes)),
        )
    return table
