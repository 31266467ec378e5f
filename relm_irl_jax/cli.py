"""The command `relm-irl`."""

import difflib
import gc
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import ValidationError

from relm_irl_jax.errors import (
    DivergenceError,
    InputError,
    first_fault,
    is_memory_fault,
    not_installed,
    printable,
    system_fault,
)
from relm_irl_jax.help_pages import COMMANDS, overview, train_help
from relm_irl_jax.interruption import Resume
from relm_irl_jax.lazy import deferred
from relm_irl_jax.run_folder import RunFolder

if TYPE_CHECKING:
    from rich.console import Console

    from relm_irl_jax.commands import Bench, Evaluate, Play, Record, Report
    from relm_irl_jax.commands_of_scenes import Check, ExportThor, ExportVizdoom, Generate
    from relm_irl_jax.config import Config
    from relm_irl_jax.results import Results
    from relm_irl_jax.stages.episodes import EpisodePath

# What the commands do is imported when they do it.
check_files = deferred("relm_irl_jax.scenes.check", "check_files")
check_table = deferred("relm_irl_jax.scenes.check", "check_table")
console_table = deferred("relm_irl_jax.report.tables", "console_table")
draw_episode = deferred("relm_irl_jax.play.keyboard", "draw_episode")
enter_policy = deferred("relm_irl_jax.pipeline", "enter_policy")
enter_results = deferred("relm_irl_jax.pipeline", "enter_results")
encode_training = deferred("relm_irl_jax.stages.encoding", "encode_training")
ensure_writable = deferred("relm_irl_jax.files", "ensure_writable")
evaluate_run = deferred("relm_irl_jax.pipeline", "evaluate_run")
expert_recordings = deferred("relm_irl_jax.stages.recordings", "expert_recordings")
agent_recordings = deferred("relm_irl_jax.stages.recordings", "agent_recordings")
check_demonstrations = deferred("relm_irl_jax.run_config", "check_demonstrations")
check_output = deferred("relm_irl_jax.stages.exports", "check_output")
export_recordings = deferred("relm_irl_jax.stages.exports", "export_recordings")
save_demonstrations = deferred("relm_irl_jax.demonstrations", "save_demonstrations")
export_scenes = deferred("relm_irl_jax.scenes.recording.export", "export_scenes")
export_table = deferred("relm_irl_jax.scenes.recording.export", "export_table")
finding = deferred("relm_irl_jax.report.finding", "finding")
find_run = deferred("relm_irl_jax.run_config", "find_run")
generate_room = deferred("relm_irl_jax.scenes.rooms.generate", "generate_room")
load_config = deferred("relm_irl_jax.config", "load_config")
load_results = deferred("relm_irl_jax.results", "load_results")
load_run_settings = deferred("relm_irl_jax.report.run_settings", "load_run_settings")
locked = deferred("relm_irl_jax.run_config", "locked")
play_in_terminal = deferred("relm_irl_jax.play.keyboard", "play_in_terminal")
play_run = deferred("relm_irl_jax.play.animation", "play")
read_results = deferred("relm_irl_jax.results", "read_results")
register_environments = deferred("relm_irl_jax.registration", "register_environments")
record_walk = deferred("relm_irl_jax.play.recording", "record_walk")
results_file = deferred("relm_irl_jax.stages.own_policies", "results_file")
run = deferred("relm_irl_jax.pipeline", "run")
run_path = deferred("relm_irl_jax.run_config", "run_path")
save_scene = deferred("relm_irl_jax.scenes.scene_file", "save_scene")
scene_and_targets = deferred("relm_irl_jax.play.keyboard", "scene_and_targets")
scene_and_targets_of_run = deferred("relm_irl_jax.play.keyboard", "scene_and_targets_of_run")
scene_files = deferred("relm_irl_jax.scenes.selection", "scene_files")
search_frames = deferred("relm_irl_jax.play.search", "search_frames")
search_scene = deferred("relm_irl_jax.play.search", "search_scene")
show_in_terminal = deferred("relm_irl_jax.play.search", "show_in_terminal")
thor_scenes = deferred("relm_irl_jax.scenes.recording.thor", "thor_scenes")
vizdoom_maps = deferred("relm_irl_jax.scenes.recording.vizdoom", "vizdoom_maps")
write_search_gif = deferred("relm_irl_jax.play.search", "write_search_gif")
write_report = deferred("relm_irl_jax.report.run_report", "write_report")

Export = deferred("relm_irl_jax.stages.exports", "Export")
AgentChoice = deferred("relm_irl_jax.stages.episodes", "AgentChoice")
OwnPolicy = deferred("relm_irl_jax.stages.own_policies", "OwnPolicy")

HELP = ("-h", "--help")


def main() -> None:
    """Run the command; for unusable input, print one sentence and exit with code 2."""
    if sys.argv[1:] == ["--version"]:
        from relm_irl_jax import __version__

        print(f"relm-irl-jax {__version__}")
        return
    try:
        _dispatch(sys.argv[1:])
    except InputError as error:
        _exit_with_error(str(error))
    except DivergenceError as error:
        _exit_with_error(str(error), 3)
    except ValidationError as error:
        _exit_with_error(first_fault(error))
    except ModuleNotFoundError as error:
        _exit_with_error(not_installed(error))
    except BrokenPipeError:  # the reader of the output has ended, as in `relm-irl ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except (OSError, MemoryError, UnicodeError) as error:
        _exit_with_error(system_fault(error))
    except RuntimeError as error:  # JAX's errors are of this kind
        if not is_memory_fault(error):
            raise
        _exit_with_error(system_fault(error))


def _exit_with_error(message: str, code: int = 2) -> None:
    # Paths need not be UTF-8; `scenes check` has one line for each fault.
    lines = (printable(line) for line in f"relm-irl: {message}".split("\n"))
    print("\n".join(lines).encode(errors="backslashreplace").decode(), file=sys.stderr)
    sys.exit(code)


def _dispatch(arguments: list[str]) -> None:
    """Parse and run the command."""
    if not arguments or arguments[0] in HELP:
        print(overview())
        sys.exit(0 if arguments else 2)
    name, rest = arguments[0], arguments[1:]
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, 1)
        meant = f"did you mean {near[0]}? " if near else ""
        raise InputError(f"there is no command {name}; {meant}`relm-irl --help` lists the commands.")
    {"train": _train}.get(name, lambda rest: _other(name, rest))(rest)


def _other(name: str, arguments: list[str]) -> None:
    """Any command but `train`."""
    import tyro

    kind, work = _scene_command(name) if name in ("scenes", "encoder") else _run_command(name)

    # A function, so that refused values raise here instead of ending the process within the parser.
    def parsed(command: Annotated[kind, tyro.conf.arg(name="")]) -> Any:  # pyrefly: ignore
        return command

    command = tyro.cli(parsed, args=arguments, prog=f"relm-irl {name}", description=COMMANDS[name])
    register_environments()
    work(command)


def _run_command(name: str) -> tuple[Any, Callable[[Any], None]]:
    """Arguments of a command, and what does it."""
    from relm_irl_jax.commands import Bench, Evaluate, Play, Record, Report

    kinds: dict[str, tuple[Any, Callable[[Any], None]]] = {
        "evaluate": (Evaluate, _evaluate),
        "report": (Report, _report),
        "play": (Play, _play),
        "demonstrations": (Record, _record),
        "bench": (Bench, _bench),
    }
    return kinds[name]


def _scene_command(name: str) -> tuple[Any, Callable[[Any], None]]:
    """The same for scenes and encoders, whose settings load more."""
    from relm_irl_jax.commands_of_scenes import Checked, Exported, Generated, ShownEncoder, TrainedEncoder

    return {"scenes": (Generated | Checked | Exported, _scenes), "encoder": (TrainedEncoder | ShownEncoder, _encoder)}[
        name
    ]


def _train(arguments: list[str]) -> None:
    """Train agents and evaluate them on a task."""
    for option in HELP:
        if option in arguments:
            position = arguments.index(option)
            _help_of_train(arguments[position + 1] if position + 1 < len(arguments) else None)
            return
    import tyro

    from relm_irl_jax.config import Config

    default, arguments = _default_config(arguments)

    def parsed(config: Annotated[Config, tyro.conf.arg(name="")] = default) -> Config:
        return config

    config = tyro.cli(parsed, args=arguments, prog="relm-irl train", description=COMMANDS["train"])
    register_environments()
    Resume.run = run_path(config.resolved())
    folder = run(config)
    _show(load_results(folder), folder.path)


def _help_of_train(topic: str | None) -> None:
    gc.disable()  # collecting garbage takes an eighth of the time of help
    try:
        from relm_irl_jax.config import Config

        print(train_help(Config, topic))
    finally:
        gc.enable()


def _report(command: "Report") -> None:
    folder = RunFolder(command.run)
    load_run_settings(folder)  # refuses other folders before the lock is created there
    with locked(folder):
        write_report(folder)
    _show(load_results(folder), folder.path)


def _play(command: "Play") -> None:
    console = _console()
    if command.agent is not None:
        _play_packaged(command, console)
        return
    if command.keyboard or command.run is None:
        _play_by_keyboard(command, console)
        return
    if command.record is not None:
        raise InputError("record: only walks by keyboard are recorded; add --keyboard, or use `demonstrations`.")
    if command.target is not None:
        raise InputError("target: the targets are those of the run's task; leave it out, or play without a run.")
    folder, config = find_run(command.run)
    choice = AgentChoice(command.method, command.task, command.seed)
    for file, path in play_run(config, folder, choice, command.episode, command.scene):
        console.print(f"{file}: {_outcome(path)}", highlight=False, soft_wrap=True)


def _console() -> "Console":
    """Standard output; names and paths are printed as they are, not as markup."""
    from rich.console import Console

    return Console(markup=False, emoji=False)


def _scenes(command: Any) -> None:
    from relm_irl_jax.commands_of_scenes import Export, Generate

    if isinstance(command, Generate):
        _generate(command)
    elif isinstance(command, Export):
        _export(command.engine)
    else:
        _check(command)


def _encoder(command: Any) -> None:
    from relm_irl_jax.commands_of_scenes import ShowEncoder
    from relm_irl_jax.features.training.command import provenance_table, quality_table, train_encoder

    if isinstance(command, ShowEncoder):
        _console().print(provenance_table(command.weights))
    else:
        _console().print(quality_table(*train_encoder(command)))


def _evaluate(command: "Evaluate") -> None:
    folder, config = find_run(command.run)
    if command.policy is not None and command.results is not None:
        raise InputError("results: give either a policy or results.")
    if command.policy is not None:
        policy = OwnPolicy(command.policy, command.obs, command.history)
        enter_policy(config, folder, command.task, policy, command.name or command.policy.rpartition(":")[2])
    elif command.results is not None:
        enter_results(config, folder, results_file(command.results, read_results(command.results), command.name))
    else:
        evaluate_run(config, folder, command.task)
    _show(load_results(folder), folder.path)


def _record(command: "Record") -> None:
    folder, config = find_run(command.run)
    check_output(command.out, command.format)
    ensure_writable(command.out.parent)
    training = encode_training(config)
    if command.method is None:
        check_demonstrations(config, folder)
        recordings = expert_recordings(config, training, command.seed)
    else:
        choice = AgentChoice(command.method, command.task, command.seed)
        recordings = agent_recordings(config, folder, training, choice, command.episodes)
    if command.format == "jsonl":
        save_demonstrations(recordings, command.out)
    else:
        export = Export(command.out, command.format, command.method, command.task, command.seed)
        export_recordings(config, training, recordings, export)
    count = sum(map(len, recordings.values()))
    _console().print(f"{command.out}: {count} demonstrations", highlight=False, soft_wrap=True)


def _play_by_keyboard(command: "Play", console: "Console") -> None:
    if command.run is None:
        scene, targets = scene_and_targets(command.scene or "bathroom-0", command.target)
    else:
        scene, targets = scene_and_targets_of_run(find_run(command.run)[1], command.task, command.seed, command.scene)
    start, target = draw_episode(scene, targets, command.seed, command.episode)
    if command.record is not None:
        ensure_writable(command.record.parent)
    path = play_in_terminal(scene, start, target, console)
    console.print(f"{scene.name}: {_outcome(path)}", highlight=False, soft_wrap=True)
    if command.record is not None:
        console.print(record_walk(scene, path, command.record), highlight=False, soft_wrap=True)


def _play_packaged(command: "Play", console: "Console") -> None:
    if command.run is not None or command.keyboard:
        raise InputError("agent: an agent of the package belongs to no run; give either a run or --agent.")
    scene, targets = scene_and_targets(command.scene or "bathroom-50", command.target)
    file = Path("runs") / "play" / f"{command.agent}-{scene.name}-{command.seed}-{command.episode}.gif"
    ensure_writable(file.parent)
    search, path = search_scene(scene, targets, command.seed, command.episode)
    frames = search_frames(search)
    write_search_gif(file, frames)
    if console.is_terminal:
        show_in_terminal(frames, console, 0.35)
    console.print(f"{file}: {_outcome(path)}", highlight=False, soft_wrap=True)


def _outcome(path: "EpisodePath") -> str:
    steps = len(path.states) - 1
    outcome = "reached after" if path.success else "not reached in"
    return f"target {outcome} {steps} steps; shortest path: {path.shortest}"


def _generate(command: "Generate") -> None:
    ensure_writable(command.out)
    for room_type in command.room_types:
        for number in range(command.first, command.first + command.count):
            scene = generate_room(room_type, number, size=command.size, image_size=command.image_size)
            save_scene(scene, command.out / f"{scene.name}.h5")


def _export(command: "ExportVizdoom | ExportThor") -> None:
    from relm_irl_jax.commands_of_scenes import ExportVizdoom

    if isinstance(command, ExportVizdoom):
        openers = vizdoom_maps(command.maps, command.settings)
    else:
        openers = thor_scenes(command.scenes, command.settings)
    ensure_writable(command.out)
    _console().print(export_table(list(export_scenes(openers, command.out))))


def _check(command: "Check") -> None:
    paths = [file for path in command.files for file in (scene_files(path) if path.is_dir() else [path])]
    if not paths:
        raise InputError("scenes check: there are no scene files; give HDF5 files or folders that contain some.")
    checked = check_files(paths)
    _console().print(check_table(checked))
    faults = [fault for result in checked for fault in result.faults]
    if faults:
        raise InputError("\n".join(faults))


def _bench(command: "Bench") -> None:
    if command.name != "encoder":
        ensure_writable(command.out)
    benchmark = import_module(f"relm_irl_jax.benchmarks.{command.name}")
    benchmark.main(*(() if command.name == "encoder" else (command.out / command.name,)))


def _default_config(arguments: list[str]) -> "tuple[Config, list[str]]":
    """Remove `--config FILE` or `--resume RUN` from the arguments of `train`, and read the configuration."""
    from relm_irl_jax.config import Config

    file, arguments = _pop_option(arguments, "--config", "file", "a TOML file")
    run, arguments = _pop_option(arguments, "--resume", "folder", "the folder of a run made by `relm-irl train`")
    if file and run:
        raise InputError("--resume: the run already has a configuration; leave out --config.")
    if run:
        folder, config = find_run(Path(run))
        return replace(config, run=folder.path), arguments
    return load_config(_preset(file)) if file else Config(), arguments


def _preset(name: str) -> Path:
    """The file of a preset that is given by its name, such as `metric`; any other name is that of a file."""
    package = Path(__file__).parent
    for folder in (package / "presets", package.parent / "experiments"):
        if not Path(name).exists() and (folder / f"{name}.toml").is_file():
            return folder / f"{name}.toml"
    return Path(name)


def _pop_option(arguments: list[str], option: str, kind: str, remedy: str) -> tuple[str | None, list[str]]:
    """Remove an option and its value from the arguments."""
    if option not in arguments:
        return None, arguments
    position = arguments.index(option)
    if position + 1 == len(arguments):
        raise InputError(f"{option}: the {kind} is missing; give {remedy}.")
    return arguments[position + 1], arguments[:position] + arguments[position + 2 :]


def _show(results: "Results", folder: Path) -> None:
    console = _console()
    console.print(console_table(results))
    console.print(" ".join(finding(results)), highlight=False)
    console.print(f"Report: {folder / 'report.html'}", highlight=False, soft_wrap=True)
