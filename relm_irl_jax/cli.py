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
from relm_irl_jax.pipeline import evaluate_run, run
from relm_irl_jax.play.animation import play as play_run
from relm_irl_jax.play.keyboard import any_task, draw_episode, play_in_terminal, task_of_run
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
    """Watch an agent: one episode in each scene, as a GIF in the run folder. Or walk yourself, by keyboard."""

    run: tyro.conf.Positional[Path | None] = None
    """Run folder; without one you walk."""
    method: Method = "relm-irl"
    """Whose agent."""
    task: Task = "I"
    """Task whose targets are sought."""
    seed: NonNegativeInt = 0
    """Seed of the agent."""
    episode: NonNegativeInt = 0
    """Number of the episode; another one draws another start and target."""
    keyboard: bool = False
    """Walk to a target of the task yourself, in the terminal."""
    scene: str | None = None
    """Scene to walk in: one of the run, its first by default; without a run a scene file or a built-in room, by default
    bathroom-0."""
    target: str | None = None
    """Category of objects to walk to, without a run; by default any."""


@dataclass(frozen=True)
class Generate:
    """Generate built-in rooms as scene files in the THOR v1 format."""

    out: Path
    """Folder for the files."""
    room_types: tuple[Literal["bathroom", "bedroom", "living_room"], ...] = ROOM_TYPES
    """Room types."""
    count: PositiveInt = 1
    """Rooms of each type."""
    first: NonNegativeInt = 0
    """Number of the first room of each type."""
    size: Literal["full", "tiny"] = "full"
    """The original scenes' state counts, or a dozen places."""
    image_size: PositiveInt = 224
    """Rows and columns of a view."""


@dataclass(frozen=True)
class Check:
    """Check scene files for everything that training relies on."""

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Scene files, or folders of them."""


@dataclass(frozen=True)
class ExportVizdoom:
    """Record maps of ViZDoom; Freedoom's come with it (pip install vizdoom)."""

    out: Path
    """Folder for the files. Files that exist are kept; a record that was cut off goes on."""
    maps: tuple[str, ...]
    """Maps: map01 to map32, or e1m1 to e4m9."""
    settings: Annotated[VizdoomSettings, tyro.conf.arg(name="")] = VizdoomSettings()
    """What is recorded."""


@dataclass(frozen=True)
class ExportThor:
    """Record scenes of AI2-THOR, live (pip install ai2thor)."""

    out: Path
    """Folder for the files. Files that exist are kept; a record that was cut off goes on."""
    scenes: tuple[str, ...]
    """iTHOR scenes, such as FloorPlan401, or JSON files of ProcTHOR houses."""
    settings: Annotated[ThorSettings, tyro.conf.arg(name="")] = ThorSettings()
    """What is recorded."""


RecordedVizdoom = Annotated[ExportVizdoom, tyro.conf.subcommand("vizdoom", prefix_name=False)]
RecordedThor = Annotated[ExportThor, tyro.conf.subcommand("thor", prefix_name=False)]


@dataclass(frozen=True)
class Export:
    """Record scenes of another engine in the THOR v1 format."""

    engine: Annotated[RecordedVizdoom | RecordedThor, tyro.conf.arg(name="")]


Generated = Annotated[Generate, tyro.conf.subcommand("generate", prefix_name=False)]
Checked = Annotated[Check, tyro.conf.subcommand("check", prefix_name=False)]
Exported = Annotated[Export, tyro.conf.subcommand("export", prefix_name=False)]


@dataclass(frozen=True)
class Bench:
    """Measure speed on this machine."""

    name: tyro.conf.Positional[Literal["agent", "scaling", "elm", "irl", "encoder"]]
    """What to measure."""
    out: Path = Path("runs/bench")
    """Folder in which each benchmark has one of its own, for its table, figure and numbers; that of the encoder is only
    printed."""


def main() -> None:
    """Run the command; exit with code 2 and one sentence where the input cannot be used."""
    if sys.argv[1:] == ["--version"]:
        print(f"relm-irl-jax {__version__}")
        return
    try:
        _dispatch(sys.argv[1:])
    except InputError as error:
        _refuse(str(error))
    except ValidationError as error:
        _refuse(first_fault(error))


def _refuse(sentence: str) -> None:
    print(f"relm-irl: {sentence}", file=sys.stderr)
    sys.exit(2)


def _dispatch(arguments: list[str]) -> None:
    """Parse the sub-command and call it."""
    app = tyro.extras.SubcommandApp()
    default, arguments = _default_config(arguments)

    @app.command
    def train(config: Annotated[Config, tyro.conf.arg(name="")] = default) -> None:
        """Train agents and evaluate them on a task.

        `--config FILE` reads other defaults from a TOML file, `--resume RUN` continues a run with the configuration
        that its folder holds. What the folder already holds is not trained again, and a training that was cut off goes
        on from its last checkpoint.
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
        """Watch an agent: one episode in each scene, as a GIF in the run folder. Or walk yourself, by keyboard."""
        console = Console()
        if command.keyboard or command.run is None:
            _walk(command, console)
            return
        folder, config = find_run(command.run)
        choice = AgentChoice(command.method, command.task, command.seed)
        for file, path in play_run(config, folder, choice, command.episode):
            console.print(f"{file}: {_outcome(path)}", highlight=False, soft_wrap=True)

    @app.command
    def scenes(command: Annotated[Generated | Checked | Exported, tyro.conf.arg(name="")]) -> None:
        """Generate built-in rooms as scene files, record scenes of other engines, or check scene files."""
        if isinstance(command, Generate):
            _generate(command)
        elif isinstance(command, Export):
            _export(command.engine)
        else:
            _check(command)

    @app.command
    def bench(command: Annotated[Bench, tyro.conf.arg(name="")]) -> None:
        """Measure speed on this machine."""
        _bench(command)

    app.cli(
        args=arguments,
        prog="relm-irl",
        description="Target-driven visual navigation with learned rewards. `relm-irl --version` prints the version.",
    )


def _walk(command: Play, console: Console) -> None:
    if command.run is None:
        scene, targets = any_task(command.scene or "bathroom-0", command.target)
    else:
        scene, targets = task_of_run(find_run(command.run)[1], command.task, command.seed, command.scene)
    start, target = draw_episode(scene, targets, command.seed, command.episode)
    walk = play_in_terminal(scene, start, target, console)
    console.print(f"{scene.name}: {_outcome(walk)}", highlight=False, soft_wrap=True)


def _outcome(path: EpisodePath) -> str:
    steps = len(path.states) - 1
    return f"{'found after' if path.success else 'not found in'} {steps} steps, shortest path {path.shortest}"


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
    # Engines outlive a process that is terminated without stopping them.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    Console().print(export_table(list(export_scenes(openers, command.out))))


def _check(command: Check) -> None:
    paths = [file for path in command.files for file in (scene_files(path) if path.is_dir() else [path])]
    if not paths:
        raise InputError("scenes check: no scene files; give HDF5 files or folders that hold some.")
    checked = check_files(paths)
    Console().print(check_table(checked))
    faults = [fault for record in checked for fault in record.faults]
    if faults:
        raise InputError("\n".join(faults))


def _bench(command: Bench) -> None:
    benchmark = import_module(f"relm_irl_jax.benchmarks.{command.name}")
    benchmark.main(*(() if command.name == "encoder" else (command.out / command.name,)))


def _default_config(arguments: list[str]) -> tuple[Config, list[str]]:
    """Take `--config FILE` or `--resume RUN` out of a training's arguments and read the defaults that it sets."""
    if arguments[:1] != ["train"]:
        return Config(), arguments
    file, arguments = _take(arguments, "--config", "file", "a TOML file")
    run, arguments = _take(arguments, "--resume", "folder", "the folder of a run made by `relm-irl train`")
    if file and run:
        raise InputError("--resume: the run brings its own configuration; leave out --config.")
    if run:
        folder, config = find_run(Path(run))
        return replace(config, run=folder.path), arguments
    return load_config(Path(file)) if file else Config(), arguments


def _take(arguments: list[str], option: str, kind: str, remedy: str) -> tuple[str | None, list[str]]:
    """Take an option and its value out of the arguments."""
    if option not in arguments:
        return None, arguments
    place = arguments.index(option)
    if place + 1 == len(arguments):
        raise InputError(f"{option}: the {kind} is missing; give {remedy}.")
    return arguments[place + 1], arguments[:place] + arguments[place + 2 :]


def _show(results: Results, folder: Path) -> None:
    console = Console()
    console.print(console_table(results))
    console.print(f"Report: {folder / 'report.md'}", highlight=False, soft_wrap=True)
