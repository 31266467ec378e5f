"""The command `relm-irl scenes`."""

from relm_irl_jax.cli.output import standard_output
from relm_irl_jax.commands_of_scenes import Check, Export, ExportThor, ExportVizdoom, Generate
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import ensure_writable
from relm_irl_jax.scenes.check import check_files, check_table
from relm_irl_jax.scenes.recording.export import export_scenes, export_table
from relm_irl_jax.scenes.recording.thor import thor_scenes
from relm_irl_jax.scenes.recording.vizdoom import vizdoom_maps
from relm_irl_jax.scenes.scene_file import save_scene
from relm_irl_jax.scenes.selection import scene_files


def execute(command: Generate | Export | Check) -> None:
    """Generate, record or check scene files.

    Args:
        command: the arguments.
    """
    if isinstance(command, Generate):
        _generate(command)
    elif isinstance(command, Export):
        _export(command.engine)
    else:
        _check(command)


def _generate(command: Generate) -> None:
    from relm_irl_jax.scenes.rooms.generate import generate_room  # it loads JAX, which checking files does not need

    ensure_writable(command.out)
    for room_type in command.room_types:
        for number in range(command.first, command.first + command.count):
            scene = generate_room(room_type, number, size=command.size, image_size=command.image_size)
            save_scene(scene, command.out / f"{scene.name}.h5")


def _export(command: ExportVizdoom | ExportThor) -> None:
    if isinstance(command, ExportVizdoom):
        openers = vizdoom_maps(command.maps, command.settings)
    else:
        openers = thor_scenes(command.scenes, command.settings)
    ensure_writable(command.out)
    standard_output().print(export_table(list(export_scenes(openers, command.out))))


def _check(command: Check) -> None:
    paths = [file for path in command.files for file in (scene_files(path) if path.is_dir() else [path])]
    if not paths:
        raise InputError("scenes check: there are no scene files; give HDF5 files or folders that contain some.")
    checked = check_files(paths)
    standard_output().print(check_table(checked))
    faults = [fault for result in checked for fault in result.faults]
    if faults:
        raise InputError("\n".join(faults))
