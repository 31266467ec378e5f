"""The command `relm-irl`."""

import signal
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import tyro
from pydantic import NonNegativeInt, PositiveInt, ValidationError
from pydantic.dataclasses import dataclass
from rich.console import Console

from relm_irl_jax import __version__
from relm_irl_jax.config import Config, Method, Task, load_config
from relm_irl_jax.errors import InputError, first_fault
from relm_irl_jax.features.training.settings import EncoderTraining
from relm_irl_jax.pipeline import evaluate_run, run
from relm_irl_jax.play.animation import play as play_run
from relm_irl_jax.play.keyboard import draw_episode, play_in_terminal, scene_and_targets, scene_and_targets_of_run
from relm_irl_jax.report.run_report import write_report
from relm_irl_jax.report.tables import console_table
from relm_irl_jax.results import Results, load_results
from relm_irl_jax.run_config import find_run
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.check import check_files, check_table
from relm_irl_jax.scenes.recording.export import export_scenes, export_table
from relm_irl_jax.scenes.recording.thor import ThorSettings, thor_scenes
from relm_irl_jax.scenes.recording.vizdoom import VizdoomSettings, vizdoom_maps
from relm_irl_jax.scenes.rooms import generate_room
from relm_irl_jax.scenes.scene import ROOM_TYPES
from relm_irl_jax.scenes.scene_file import save_scene
from relm_irl_jax.scenes.selection import scene_files
from relm_irl_jax.stages.episodes import AgentChoice, EpisodePath


@dataclass(frozen=True)
class Evaluate:
    """Evaluate the agents of a run on a task."""

    run: tyro.conf.Positional[Path]
    """Run folder."""
    task: Task = "II"
    """Task to evaluate."""


@dataclass(frozen=True)
class Report:
    """Write the report of a run again."""

    run: tyro.conf.Positional[Path]
    """Run folder."""


@dataclass(frozen=True)
class Play:
    """Save animations of an agent (GIF files in the run folder), or navigate by keyboard."""

    run: tyro.conf.Positional[Path | None] = None
    """Run folder; without it, you navigate by keyboard."""
    method: Method = "relm-irl"
    """Method that trained the agent."""
    task: Task = "I"
    """Task, which determines scenes and targets."""
    seed: NonNegativeInt = 0
    """Seed of the agent."""
    episode: NonNegativeInt = 0
    """Number of the episode, which determines start and target."""
    keyboard: bool = False
    """Navigate to a target of the task by keyboard."""
    scene: str | None = None
    """Scene for navigation by keyboard: with a run, the name of one of its scenes (default: the first); without a run,
    a scene file or a built-in room (default: bathroom-0)."""
    target: str | None = None
    """Category of the target object for navigation without a run; by default a random one."""


@dataclass(frozen=True)
class Generate:
    """Generate built-in rooms as scene files in the THOR v1 format."""

    out: Path
    """Output folder."""
    room_types: tuple[Literal["bathroom", "bedroom", "living_room"], ...] = ROOM_TYPES
    """Room types."""
    count: PositiveInt = 1
    """Rooms of each type."""
    first: NonNegativeInt = 0
    """Number of the first room of each type."""
    size: Literal["full", "tiny"] = "full"
    """The original scenes' state counts (full), or 12 to 20 places (tiny)."""
    image_size: PositiveInt = 224
    """Rows and columns of a view."""


@dataclass(frozen=True)
class Check:
    """Check that scene files are consistent and usable for training."""

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Scene files, or folders of them."""


@dataclass(frozen=True)
class ExportVizdoom:
    """Record maps of ViZDoom, which includes Freedoom's maps (pip install vizdoom)."""

    out: Path
    """Output folder. Existing files are kept; an interrupted recording continues."""
    maps: tuple[str, ...]
    """Maps: map01 to map32, or e1m1 to e4m9."""
    settings: Annotated[VizdoomSettings, tyro.conf.arg(name="")] = VizdoomSettings()
    """States and views."""


@dataclass(frozen=True)
class ExportThor:
    """Record scenes of AI2-THOR (pip install ai2thor)."""

    out: Path
    """Output folder. Existing files are kept; an interrupted recording continues."""
    scenes: tuple[str, ...]
    """iTHOR scenes, such as FloorPlan401, or JSON files of ProcTHOR houses."""
    settings: Annotated[ThorSettings, tyro.conf.arg(name="")] = ThorSettings()
    """Views."""


RecordedVizdoom = Annotated[ExportVizdoom, tyro.conf.subcommand("vizdoom", prefix_name=False)]
RecordedThor = Annotated[ExportThor, tyro.conf.subcommand("thor", prefix_name=False)]


@dataclass(frozen=True)
class Export:
    """Record scenes of another simulator as scene files in the THOR v1 format."""

    engine: Annotated[RecordedVizdoom | RecordedThor, tyro.conf.arg(name="")]


Generated = Annotated[Generate, tyro.conf.subcommand("generate", prefix_name=False)]
Checked = Annotated[Check, tyro.conf.subcommand("check", prefix_name=False)]
Exported = Annotated[Export, tyro.conf.subcommand("export", prefix_name=False)]


@dataclass(frozen=True)
class ShowEncoder:
    """Show how weights of the small encoder were trained."""

    weights: tyro.conf.Positional[str]
    """rooms, rooms-paths, or a file of weights."""


TrainedEncoder = Annotated[EncoderTraining, tyro.conf.subcommand("train", prefix_name=False)]
ShownEncoder = Annotated[ShowEncoder, tyro.conf.subcommand("show", prefix_name=False)]


@dataclass(frozen=True)
class Bench:
    """Measure speed on this computer."""

    name: tyro.conf.Positional[Literal["agent", "scaling", "elm", "irl", "encoder"]]
    """The benchmark."""
    out: Path = Path("runs/bench")
    """Output folder, with a sub-folder for each benchmark. The encoder's benchmark writes no files."""


def main() -> None:
    """Run the command; for unusable input, print one sentence and exit with code 2."""
    if sys.argv[1:] == ["--version"]:
        print(f"relm-irl-jax {__version__}")
        return
    try:
        _dispatch(sys.argv[1:])
    except InputError as error:
        _exit_with_error(str(error))
    except ValidationError as error:
        _exit_with_error(first_fault(error))


def _exit_with_error(message: str) -> None:
    print(f"relm-irl: {message}", file=sys.stderr)
    sys.exit(2)


def _dispatch(arguments: list[str]) -> None:
    """Parse and run the sub-command."""
    app = tyro.extras.SubcommandApp()
    default, arguments = _default_config(arguments)

    @app.command
    def train(config: Annotated[Config, tyro.conf.arg(name="")] = default) -> None:
        """Train agents and evaluate them on a task.

        `--config FILE` reads other defaults from a TOML file. `--resume RUN` continues a run with the configuration in
        its folder. Agents that are already trained are not trained again, and an interrupted training continues from
        its last checkpoint.
        """
        folder = run(config)
        _show(load_results(folder), folder.path)

    @app.command
    def evaluate(command: Annotated[Evaluate, tyro.conf.arg(name="")]) -> None:
        """Evaluate the agents of a run on a task."""
        folder, config = find_run(command.run)
        evaluate_run(config, folder, command.task)
        _show(load_results(folder), folder.path)

    @app.command
    def report(command: Annotated[Report, tyro.conf.arg(name="")]) -> None:
        """Write the report of a run again."""
        folder = RunFolder(command.run)
        write_report(folder)
        _show(load_results(folder), folder.path)

    @app.command
    def play(command: Annotated[Play, tyro.conf.arg(name="")]) -> None:
        """Save animations of an agent (GIF files in the run folder), or navigate by keyboard."""
        console = Console()
        if command.keyboard or command.run is None:
            _play_by_keyboard(command, console)
            return
        folder, config = find_run(command.run)
        choice = AgentChoice(command.method, command.task, command.seed)
        for file, path in play_run(config, folder, choice, command.episode):
            console.print(f"{file}: {_outcome(path)}", highlight=False, soft_wrap=True)

    @app.command
    def scenes(command: Annotated[Generated | Checked | Exported, tyro.conf.arg(name="")]) -> None:
        """Generate built-in rooms as scene files, record scenes of other simulators, or check scene files."""
        if isinstance(command, Generate):
            _generate(command)
        elif isinstance(command, Export):
            _export(command.engine)
        else:
            _check(command)

    @app.command
    def encoder(command: Annotated[TrainedEncoder | ShownEncoder, tyro.conf.arg(name="")]) -> None:
        """Train the small encoder on generated rooms or your own scenes, or show how weights were trained."""
        from relm_irl_jax.features.training.command import provenance_table, quality_table, train_encoder

        if isinstance(command, ShowEncoder):
            Console().print(provenance_table(command.weights))
        else:
            Console().print(quality_table(*train_encoder(command)))

    @app.command
    def bench(command: Annotated[Bench, tyro.conf.arg(name="")]) -> None:
        """Measure speed on this computer."""
        _bench(command)

    app.cli(
        args=arguments,
        prog="relm-irl",
        description="Target-driven visual navigation with learned rewards. `relm-irl --version` prints the version.",
    )


def _play_by_keyboard(command: Play, console: Console) -> None:
    if command.run is None:
        scene, targets = scene_and_targets(command.scene or "bathroom-0", command.target)
    else:
        scene, targets = scene_and_targets_of_run(find_run(command.run)[1], command.task, command.seed, command.scene)
    start, target = draw_episode(scene, targets, command.seed, command.episode)
    path = play_in_terminal(scene, start, target, console)
    console.print(f"{scene.name}: {_outcome(path)}", highlight=False, soft_wrap=True)


def _outcome(path: EpisodePath) -> str:
    steps = len(path.states) - 1
    outcome = "reached after" if path.success else "not reached in"
    return f"target {outcome} {steps} steps; shortest path: {path.shortest}"


def _generate(command: Generate) -> None:
    for room_type in command.room_types:
        for number in range(command.first, command.first + command.count):
            scene = generate_room(room_type, number, size=command.size, image_size=command.image_size)
            save_scene(scene, command.out / f"{scene.name}.h5")


def _export(command: ExportVizdoom | ExportThor) -> None:
    if isinstance(command, ExportVizdoom):
        openers = vizdoom_maps(command.maps, command.settings)
    else:
        openers = thor_scenes(command.scenes, command.settings)
    # Simulators continue to run if this process is terminated without stopping them.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    Console().print(export_table(list(export_scenes(openers, command.out))))


def _check(command: Check) -> None:
    paths = [file for path in command.files for file in (scene_files(path) if path.is_dir() else [path])]
    if not paths:
        raise InputError("scenes check: there are no scene files; give HDF5 files or folders that contain some.")
    checked = check_files(paths)
    Console().print(check_table(checked))
    faults = [fault for result in checked for fault in result.faults]
    if faults:
        raise InputError("\n".join(faults))


def _bench(command: Bench) -> None:
    benchmark = import_module(f"relm_irl_jax.benchmarks.{command.name}")
    benchmark.main(*(() if command.name == "encoder" else (command.out / command.name,)))


def _default_config(arguments: list[str]) -> tuple[Config, list[str]]:
    """Remove `--config FILE` or `--resume RUN` from the arguments of `train`, and read the configuration."""
    if arguments[:1] != ["train"]:
        return Config(), arguments
    file, arguments = _pop_option(arguments, "--config", "file", "a TOML file")
    run, arguments = _pop_option(arguments, "--resume", "folder", "the folder of a run made by `relm-irl train`")
    if file and run:
        raise InputError("--resume: the run already has a configuration; leave out --config.")
    if run:
        folder, config = find_run(Path(run))
        return replace(config, run=folder.path), arguments
    return load_config(Path(file)) if file else Config(), arguments


def _pop_option(arguments: list[str], option: str, kind: str, remedy: str) -> tuple[str | None, list[str]]:
    """Remove an option and its value from the arguments."""
    if option not in arguments:
        return None, arguments
    position = arguments.index(option)
    if position + 1 == len(arguments):
        raise InputError(f"{option}: the {kind} is missing; give {remedy}.")
    return arguments[position + 1], arguments[:position] + arguments[position + 2 :]


def _show(results: Results, folder: Path) -> None:
    console = Console()
    console.print(console_table(results))
    console.print(f"Report: {folder / 'report.md'}", highlight=False, soft_wrap=True)
