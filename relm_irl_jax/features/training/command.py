"""`relm-irl encoder train`: train the small encoder on generated rooms or on scene files, and write its weights."""

import json
import shlex
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.table import Table

from relm_irl_jax.errors import InputError
from relm_irl_jax.features.convnet import fold_batch_norms
from relm_irl_jax.features.convnet_weights import load_convnet, save_convnet, shipped_path, trained_scenes
from relm_irl_jax.features.settings import SHIPPED
from relm_irl_jax.features.training.heads import HeadSettings, Losses
from relm_irl_jax.features.training.labels import LabelledScene, label_scene
from relm_irl_jax.features.training.quality import Quality, measure_quality
from relm_irl_jax.features.training.rooms import CATEGORIES, labelled_room, room_loaders
from relm_irl_jax.features.training.settings import EncoderTraining
from relm_irl_jax.features.training.train import LoadScene, TrainState, scenes_met, train
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE
from relm_irl_jax.scenes.rooms.training_rooms import training_numbers
from relm_irl_jax.scenes.selection import check_scenes_setting, training_scenes
from relm_irl_jax.scenes.settings import ROOMS

HELD_OUT = 5
"""Built-in rooms of each type, after the ones trained on, that judge the features."""


@dataclass(frozen=True)
class Material:
    """What an encoder is trained on.

    Attributes:
        scenes: functions that load the training scenes.
        names: their names.
        categories: categories of the objects that they show.
        held_out: loads the scenes that judge the features; the training scenes where there are no others.
        judged_on: what those scenes are, for the table.
        source: what made the scenes.
    """

    scenes: list[LoadScene]
    names: list[str]
    categories: tuple[str, ...]
    held_out: list[LoadScene]
    judged_on: str
    source: str


def train_encoder(settings: EncoderTraining) -> tuple[Quality, str]:
    """Train an encoder and write its weights.

    Args:
        settings: on what and how.

    Returns:
        How well labels are read from the features, and on which scenes that was measured.

    Raises:
        InputError: the scenes cannot be used, or the file cannot be written.
    """
    if settings.output.is_dir():
        raise InputError(f"output: {settings.output} is a folder; give the name of a file.")
    material = rooms_material(settings.rooms) if settings.scenes == ROOMS else files_material(settings)
    heads = HeadSettings(len(material.categories), settings.paths)
    begin = time.perf_counter(), time.process_time()
    with progress_bar("training the encoder", settings.training.steps, "updates") as advance:

        def report(number: int, losses: Losses) -> None:
            advance(1)

        state = train(material.scenes, settings.training, heads, settings.seed, report)
    seconds = time.perf_counter() - begin[0], time.process_time() - begin[1]
    quality = measure_quality(state, [load() for load in material.held_out], paths=settings.paths)
    save_convnet(settings.output, _layers(state), _provenance(settings, material, quality, seconds))
    return quality, material.judged_on


def rooms_material(rooms: int) -> Material:
    """Built-in rooms to train on, and the ones after them to judge the features.

    Args:
        rooms: how many to train on, spread over the room types.

    Returns:
        The rooms, all among those kept for training networks.
    """
    numbers = training_numbers(rooms + 3 * HELD_OUT + 3)
    last = numbers[rooms - 1][1]
    held_out = [room for room in numbers if last < room[1] <= last + HELD_OUT]
    return Material(
        scenes=[*room_loaders(numbers[:rooms])],
        names=[f"{room_type}-{number}" for room_type, number in numbers[:rooms]],
        categories=CATEGORIES,
        held_out=[partial(labelled_room, *room) for room in held_out],
        judged_on=f"built-in rooms {held_out[0][1]} to {held_out[-1][1]} of each type, not trained on",
        source=SOURCE,
    )


def files_material(settings: EncoderTraining) -> Material:
    """Scene files to train on: those that `relm-irl train` takes as training scenes.

    Args:
        settings: the folder, and which scenes of it.

    Returns:
        The scenes; the unseen scenes of Task III are left alone.
    """
    check_scenes_setting(settings.scenes)
    scenes = [load() for load in training_scenes(settings.scenes, settings.scene)]
    shown = {category for scene in scenes if scene.visible_object is not None for category in scene.categories}
    categories = tuple(sorted(shown))
    labelled = [label_scene(scene, categories) for scene in scenes]
    loaders: list[LoadScene] = [partial(_same, scene) for scene in labelled]
    return Material(
        scenes=loaders,
        names=[scene.name for scene in scenes],
        categories=categories,
        held_out=loaders,
        judged_on="the scenes trained on",
        source=", ".join(sorted({scene.source for scene in scenes})),
    )


def quality_table(quality: Quality, judged_on: str) -> Table:
    """What is read from the features, as a table.

    Args:
        quality: the numbers.
        judged_on: the scenes that they were measured on.

    Returns:
        The table.
    """
    table = Table(title=f"Read from the features on {judged_on}")
    table.add_column("label")
    table.add_column("measure")
    table.add_column("value", justify="right")
    rows = (
        ("objects shown", "mean average precision", quality.shown),
        ("free steps ahead, right, left", "accuracy", quality.free),
        ("relative heading of two views", "accuracy", quality.heading),
        ("relative place of two views", "median error in steps", quality.displacement),
        ("the same, at most 4 actions apart", "median error in steps", quality.near_displacement),
        ("first action of a shortest path", "accuracy", quality.action),
        ("number of actions of a shortest path", "median error of its logarithm", quality.distance),
    )
    for label, measure, value in rows:
        if value == value:  # NaN marks what was not learned
            table.add_row(label, measure, f"{value:.3f}")
    return table


def provenance_table(weights: str) -> Table:
    """How weights of the small encoder were trained, as a table.

    Args:
        weights: one of `SHIPPED`, or a file.

    Returns:
        The table.

    Raises:
        InputError: the file cannot be used.
    """
    path = shipped_path(weights) if weights in SHIPPED else Path(weights)
    provenance = load_convnet(path)[1]
    names = sorted(trained_scenes(provenance))
    table = Table(title=str(path), show_header=False)
    for key, value in provenance.items():
        table.add_row(key, f"{len(names)}: {names[0]} … {names[-1]}" if key == "scenes" and names else value)
    return table


def _same(scene: LabelledScene) -> LabelledScene:
    return scene


def _layers(state: TrainState) -> dict:
    return fold_batch_norms({"params": state.parameters["network"], "batch_stats": state.statistics})


def _provenance(
    settings: EncoderTraining, material: Material, quality: Quality, seconds: tuple[float, float]
) -> dict[str, str]:
    """Where weights come from, for their file."""
    learned = "objects, free steps, relative poses" + (", shortest paths" if settings.paths else "")
    return {
        "command": shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
        "learned": learned,
        "scenes": json.dumps(material.names[: scenes_met(len(material.names), settings.training)]),
        "source": material.source,
        "seed": str(settings.seed),
        "settings": str(settings.training),
        "seconds": f"{seconds[0]:.0f}, of the processors {seconds[1]:.0f}",
        "quality": f"{quality} on {material.judged_on}",
    }
