"""`make chaos`: a real process is ended at seeded moments of every stage, and the results are compared bit for bit.

The processes are forked from one that has imported the package, so that a moment costs seconds. Compiled programs are
kept in `.cache/jax`, as in the other tests.
"""

import argparse
import json
import os
import random
import select
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import conftest  # noqa: E402, F401  keeps compiled programs
import numpy as np  # noqa: E402
from builders import grid_scene, labelled  # noqa: E402
from command import EXPERIMENT, QUICK  # noqa: E402

from relm_irl_jax import hardware, pipeline  # noqa: E402
from relm_irl_jax.__main__ import main as relm_irl  # noqa: E402
from relm_irl_jax.files import write_table  # noqa: E402
from relm_irl_jax.play import animation  # noqa: E402, F401
from relm_irl_jax.run_folder import RunFolder  # noqa: E402
from relm_irl_jax.scenes.scene_file import save_scene  # noqa: E402

SECONDS_TO_END = 5.0
"""Seconds within which an interrupted process must end."""

TRAIN = ("train", "--config", str(EXPERIMENT), "--run", "run", *QUICK, "--log.checkpoint-minutes", "0")
LEARNED = ("--frames", "6144", "--seeds", "2", "--methods", "rl", "irl", "relm-irl")
IN_FOLDER = ("--scenes", "../scenes", "--irl.processes", "1", "--irl.dimension", "8")
IMAGINED = (
    *("--frames", "6144", "--methods", "rl", "relm-irl"),
    *("--siamese.imagine", "told", "--siamese.targets-at-once", "2"),
)
MAP = (
    *("--agent", "map", "--methods", "rl", "--frames", "256", "--evaluation.episodes", "2"),
    *("--map.weights", "train", "--map.views", "8", "--map.targets", "4"),
)
THEN = (("evaluate", "run", "--task", "I"), ("report", "run"))

SETUPS = {
    "rooms": ((*TRAIN, *LEARNED), *THEN),
    "folder": ((*TRAIN, *LEARNED, *IN_FOLDER), *THEN),
    "metric": ((*TRAIN, *IN_FOLDER, "--frames", "6144", "--agent", "metric", "--methods", "rl"), *THEN),
    "imagined": ((*TRAIN, *IN_FOLDER, *IMAGINED), *THEN),
    "map": ((*TRAIN, *IN_FOLDER, *MAP), *THEN),
    "quick": ((*TRAIN, *IN_FOLDER, "--frames", "3072", "--methods", "rl"),),
}
"""Commands that are ended. In a folder of scenes with features, a moment costs less: nothing is encoded."""

SHARES = {"rooms": 1, "folder": 2, "metric": 1, "imagined": 1, "map": 1}
"""How many of the cases have which commands, unless they are named."""


def save_scenes(folder):
    """Two training scenes of each room type, with features."""
    generator = np.random.default_rng(0)
    for name in ("bathroom-0", "bathroom-1", "bedroom-0", "bedroom-1", "living_room-0", "living_room-1"):
        features = generator.normal(size=(36, 12)).astype(np.float32)
        views = generator.integers(0, 256, (36, 8, 8, 3), dtype=np.uint8)
        scene = replace(grid_scene(3, 3, name=name, features=features), observation=views)
        save_scene(labelled(scene, 6, generator), folder / f"{name}.h5")


class Child:
    """A forked process that runs the command in a folder, and says when a stage begins."""

    def __init__(self, folder, arguments, cache):
        self.folder, reading_writing = folder, os.pipe()
        self.reading = reading_writing[0]
        self.errors = folder / "stderr.txt"
        self.errors.write_text("")  # a process that is ended at once leaves nothing of the one before it
        self.number = os.fork()
        if self.number == 0:
            os.close(self.reading)
            self._run(arguments, cache, reading_writing[1])
        os.close(reading_writing[1])
        self.code = None

    def _run(self, arguments, cache, writing):
        code = 70
        try:
            os.setsid()
            os.chdir(self.folder)
            os.environ["XDG_CACHE_HOME"] = str(cache)
            for number, path in ((1, self.folder / "stdout.txt"), (2, self.errors)):
                os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), number)
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # an interrupt ends what is not the package's own code
            announce_stages(writing)
            sys.argv = ["relm-irl", *arguments]
            signal.signal(signal.SIGINT, signal.default_int_handler)
            relm_irl()
            code = 0
        except SystemExit as stop:
            code = stop.code or 0
        except BaseException:
            import traceback

            traceback.print_exc()
        finally:
            end_workers()
            sys.stderr.flush()
            sys.stdout.flush()
            os._exit(code)

    def stage(self, timeout=600.0):
        """The next stage that begins; None when the process has ended."""
        if not select.select([self.reading], [], [], timeout)[0]:
            raise AssertionError(f"{self.folder}: no stage begins")
        received = os.read(self.reading, 1)
        line = b""
        while received not in (b"", b"\n"):
            line, received = line + received, os.read(self.reading, 1)
        return line.decode() if received else None

    def wait(self, timeout=600.0):
        """The exit code; a negative number for a signal."""
        deadline = time.monotonic() + timeout
        while self.code is None:
            ended, status = os.waitpid(self.number, os.WNOHANG)
            if ended:
                self.code = os.waitstatus_to_exitcode(status)
                os.close(self.reading)
            elif time.monotonic() > deadline:
                os.killpg(self.number, signal.SIGKILL)
                raise AssertionError(f"{self.folder}: the process did not end within {timeout:g} s")
            else:
                time.sleep(0.01)
        return self.code


def end_workers():
    """What the end of an interpreter does for joblib's workers, which the end of a forked process does not."""
    loky = sys.modules.get("joblib.externals.loky.reusable_executor")
    if loky is not None and loky._executor is not None:
        loky._executor.shutdown(wait=True, kill_workers=True)


def announce_stages(writing):
    """Write the name of each stage to a pipe when it begins."""

    def announced(name, function):
        def run(*arguments, **options):
            os.write(writing, f"{name}\n".encode())
            return function(*arguments, **options)

        return run

    timed = hardware.Stopwatch.__call__

    @contextmanager
    def stopwatch(self, stage):
        os.write(writing, f"{stage}\n".encode())
        with timed(self, stage):
            yield

    hardware.Stopwatch.__call__ = stopwatch
    pipeline.evaluate_task = announced("evaluate", pipeline.evaluate_task)
    pipeline.save_shown_episodes = announced("episodes", pipeline.save_shown_episodes)
    pipeline.write_report = announced("report", pipeline.write_report)
    from relm_irl_jax.cli import report

    report.write_report = pipeline.write_report


def uninterrupted(folder, all_commands, cache):
    """Run all commands; the stages of each with their durations in seconds."""
    folder.mkdir()
    stages = []
    for arguments in all_commands:
        child, began = Child(folder, arguments, cache), [("start", time.monotonic())]
        while (stage := child.stage()) is not None:
            began.append((stage, time.monotonic()))
        assert child.wait() == 0, child.errors.read_text()
        ends = [moment for _, moment in began[1:]] + [time.monotonic()]
        stages.append([(stage, end - start) for (stage, start), end in zip(began, ends, strict=True)])
    return stages


def contents(folder):
    """Every file of a run folder, without what depends on time."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_dir() or name.startswith("tensorboard") or name in (".lock", "report.html", "hardware.json"):
            continue
        found[name] = path.read_bytes()
        if name == "report.md":
            found[name] = found[name].split(b"Hardware and time")[0]
    return found


def end(child, generator, delay):
    """End a process after a delay; the signal, or None if it had ended before."""
    time.sleep(delay)
    ended, status = os.waitpid(child.number, os.WNOHANG)
    if ended:
        child.code = os.waitstatus_to_exitcode(status)
        os.close(child.reading)
        assert child.code == 0, child.errors.read_text()
        return None
    number = generator.choices([signal.SIGKILL, signal.SIGTERM, signal.SIGINT], [3, 1, 1])[0]
    began = time.monotonic()
    os.kill(child.number, number)
    code = child.wait(30)
    seconds = time.monotonic() - began
    said = child.errors.read_text(errors="replace")
    if number == signal.SIGKILL:
        assert code in (-number, 0), (code, said)
    else:
        # Before the first line of the package runs, the system ends the process.
        assert code in (128 + number, 0) or (code == -number and not said), (code, said)
        assert seconds <= SECONDS_TO_END, f"{number.name} took {seconds:.1f} s"
        assert "Traceback" not in said, said
        if code > 0:
            assert "relm-irl: interrupted" in said, (code, said)
    wait_for_group(child.number)
    return number


def wait_for_group(group, seconds=5.0):
    """No process that the ended one has started remains."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    os.killpg(group, signal.SIGKILL)
    raise AssertionError("a process was left")


class Uninterrupted:
    """The results of commands that are not interrupted, and how long their stages take."""

    def __init__(self, setup, work, cache):
        self.commands = SETUPS[setup]
        if setup != "quick":
            uninterrupted(work / f"{setup}-first", self.commands, cache)  # compiles, renders and encodes
        self.stages = uninterrupted(work / f"{setup}-reference", self.commands, cache)
        self.files = contents(work / f"{setup}-reference" / "run")


def interrupted(folder, reference, generator, cache, kills):
    """Run commands in a folder, and end them at most `kills` times; the stages and signals."""
    ended = []
    for arguments, stages in zip(reference.commands, reference.stages, strict=True):
        trains = arguments[0] == "train"
        # A training that is continued prepares its scenes again, and goes on with the stage in which it was ended.
        again = 2 if trains else len(stages)
        reached = again
        for _ in range(generator.randint(4, 12) if trains else generator.randint(0, 3)):
            if len(ended) == kills:
                break
            if not trains or generator.random() < 0.15:
                position, skipped = generator.randrange(again), 0
            else:
                position, skipped = generator.randrange(reached, min(len(stages), reached + 4)), reached
                reached = position
            stage, duration = stages[position]
            occurrence = [name for name, _ in stages[skipped : position + 1]].count(stage)
            child, begun = Child(folder, arguments, cache), "start"
            while begun is not None:
                occurrence -= begun == stage
                if occurrence == 0:
                    break
                begun = child.stage()
            number = None
            if begun is None:
                assert child.wait() == 0, child.errors.read_text()
            else:
                number = end(child, generator, generator.uniform(0, 1.1 * duration))
            if number is None:
                break
            ended.append((stage, number.name))
        child = Child(folder, arguments, cache)
        while child.stage() is not None:
            pass
        assert child.wait() == 0, child.errors.read_text()
    return ended


def chaos(kills, seed, setups, work):
    """End processes at many moments; the number of endings by setup, stage and signal, and of cases."""
    generator, references = random.Random(seed), {}
    save_scenes(work / "scenes")
    warm = work / "cache"
    counts, case = Counter(), 0
    while counts.total() < kills:
        setup = setups[case % len(setups)]
        if setup not in references:
            references[setup] = Uninterrupted(setup, work, warm)
        expected = references[setup].files
        case += 1
        folder = work / f"case-{case}"
        folder.mkdir()
        cache = folder / "cache" if generator.random() < 0.15 else warm
        ended = interrupted(folder, references[setup], generator, cache, kills - counts.total())
        counts.update((setup, stage, number) for stage, number in ended)
        found = contents(folder / "run")
        assert set(found) == set(expected), set(found) ^ set(expected)
        for name, content in expected.items():
            assert found[name] == content, f"case {case}: {name} differs"
        assert not RunFolder(folder / "run").finished_checkpoints()
        print(f"case {case} ({setup}): {counts.total()} ended, results equal", flush=True)
        shutil.rmtree(folder)
    return counts, case


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--setups", nargs="+", choices=SETUPS, default=[s for s, n in SHARES.items() for _ in range(n)])
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "robustness", help="folder for the counts")
    options = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="chaos-") as work:
        counts, cases = chaos(options.kills, options.seed, options.setups, Path(work))
    signals = Counter(number for _, _, number in counts.elements())
    ended = {name: [signals[name]] for name in ("SIGKILL", "SIGTERM", "SIGINT")}
    write_table(options.out / "chaos.csv", {"seed": [options.seed], "runs": [cases], **ended})
    for position in range(3):
        print(json.dumps(Counter(what[position] for what in counts.elements())))
    print(
        f"{counts.total()} processes ended in {cases} runs, all results equal bit for bit "
        f"({time.monotonic() - began:.0f} s)"
    )


if __name__ == "__main__":
    main()
