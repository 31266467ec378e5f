"""`make fuzz`: damaged and absurd inputs of every kind are read, or refused in one sentence.

An input is a file, or the arguments of a command as JSON. A case changes a good one (its bytes, or values in it) and
reads it. It may be accepted, if what was read is whole; otherwise the reader raises an `InputError` of one line, and
nothing else. Inputs that once did something else are kept in `tests/corpus`, and read by `make test`.
"""

import argparse
import base64
import contextlib
import copy
import dataclasses
import io
import itertools
import json
import math
import os
import random
import sys
import tempfile
import time
import tomllib
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import conftest  # noqa: E402, F401
import h5py  # noqa: E402
import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from builders import grid_scene, labelled  # noqa: E402
from run_folders import CONFIG, HARDWARE, episode, results, row, state_map, write_curve  # noqa: E402
from safetensors.numpy import load, save  # noqa: E402

from relm_irl_jax import cli  # noqa: E402
from relm_irl_jax.agents.map import weights as map_weights  # noqa: E402
from relm_irl_jax.checkpoints import Checkpoints  # noqa: E402
from relm_irl_jax.config import Config, config_to_dict, load_config  # noqa: E402
from relm_irl_jax.demonstrations import load_demonstrations  # noqa: E402
from relm_irl_jax.elm import ELMRegressor, load_elm, save_elm  # noqa: E402
from relm_irl_jax.errors import InputError  # noqa: E402
from relm_irl_jax.features import pretrained  # noqa: E402
from relm_irl_jax.features.resnet import layers  # noqa: E402
from relm_irl_jax.features.weights import BATCH_NORM  # noqa: E402
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays, write_json, write_table  # noqa: E402
from relm_irl_jax.hardware import load_stage_times  # noqa: E402
from relm_irl_jax.parameters import load_parameters, save_parameters  # noqa: E402
from relm_irl_jax.report.figures import load_press_curve  # noqa: E402
from relm_irl_jax.report.learning_curves import load_curve  # noqa: E402
from relm_irl_jax.report.run_settings import load_run_settings  # noqa: E402
from relm_irl_jax.results import load_results, load_reward_quality, save_results  # noqa: E402
from relm_irl_jax.run_config import find_run  # noqa: E402
from relm_irl_jax.run_folder import RunFolder  # noqa: E402
from relm_irl_jax.saved_episodes import load_episodes, save_episodes  # noqa: E402
from relm_irl_jax.saved_maps import load_map, save_map  # noqa: E402
from relm_irl_jax.scenes.check import check_files  # noqa: E402
from relm_irl_jax.scenes.scene_file import load_scene, save_scene  # noqa: E402

CORPUS = ROOT / "tests" / "corpus"

ODD = (
    *(None, True, False, 0, 1, -1, 2, 0.5, -0.0, 1e308, -1e308, 1e-320, math.nan, math.inf, -math.inf, 10**12, 10**30),
    *("", "x", "true", "mean", "../..", "a b", "\x00", "\n", "é", "\U0001f4a5", "[bold]", "$x^{", "a" * 5000, "1e400"),
    *([], {}, [[]], [None], {"": 0}, [1, "x"], [[[[[]]]]], list(range(50))),
)
"""Values that stand where another kind of value, or a smaller one, is expected."""


def changed_value(generator, value):
    """A plain value with one part replaced, removed, doubled or renamed."""
    value = copy.deepcopy(value)
    for _ in range(generator.randint(1, 3)):
        parent, key, here = None, None, value
        while isinstance(here, dict | list) and here and generator.random() < 0.8:
            parent, key = here, generator.choice(list(here) if isinstance(here, dict) else range(len(here)))
            here = parent[key]
        if parent is None:
            return generator.choice(ODD)
        fate = generator.randrange(5)
        if fate == 0:
            del parent[key]
        elif fate == 1 and isinstance(parent, list):
            parent.insert(key, here)
        elif fate == 2 and isinstance(parent, dict):
            parent[f"{key}{generator.choice('x_.')}"] = parent.pop(key)
        else:
            parent[key] = copy.deepcopy(generator.choice(ODD))
    return value


def changed_json(generator, content):
    return json.dumps(changed_value(generator, json.loads(content))).encode()


def changed_bytes(generator, content):
    """Bytes flipped, removed, doubled, inserted or cut."""
    content = bytearray(content)
    for _ in range(generator.randint(1, 6)):
        place = generator.randrange(len(content) + 1)
        size = min(generator.choice((1, 1, 1, 2, 8, 64)), len(content) - place)
        fate = generator.randrange(6)
        if fate == 0:
            content[place : place + size] = b""
        elif fate == 1:
            content[place:place] = content[place : place + size]
        elif fate == 2:
            content[place:place] = generator.choice(
                (b"\x00", b"\xff", b'"', b"{", b",", b"[" * 2000, b"nan", b"-", b"9")
            )
        elif fate == 3 and generator.random() < 0.3:
            del content[place:]
        elif place < len(content):
            content[place] = generator.choice(
                (content[place] ^ (1 << generator.randrange(8)), generator.randrange(256))
            )
    return bytes(content)


def changed_lines(generator, content):
    """One JSON value of a file of lines is changed."""
    lines = content.decode().splitlines()
    place = generator.randrange(len(lines))
    lines[place] = json.dumps(changed_value(generator, json.loads(lines[place])))
    return "\n".join(lines).encode()


def changed_tensors(generator, content):
    """Tensors and metadata of a safetensors file are changed, and its checksum is right."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.safetensors"
        path.write_bytes(content)
        arrays, metadata = load_arrays_and_metadata(path)
        for _ in range(generator.randint(1, 3)):
            if metadata and generator.random() < 0.4:
                key = generator.choice(list(metadata))
                with contextlib.suppress(ValueError):
                    metadata[key] = json.dumps(changed_value(generator, json.loads(metadata[key])))
            elif arrays:
                arrays = changed_arrays(generator, arrays)
        save_arrays(path, arrays, metadata)
        return path.read_bytes()


def changed_arrays(generator, arrays):
    arrays, name = dict(arrays), generator.choice(list(arrays))
    array, fate = arrays[name], generator.randrange(6)
    if fate == 0:
        del arrays[name]
    elif fate == 1:
        other = generator.choice(("predict", "fit", "a/b", f"{name}/x", f"{name}x", "", "__class__", "n_hidden"))
        arrays[other] = arrays.pop(name)
    elif fate == 2 and array.size:
        arrays[name] = array.reshape(-1)[: generator.randrange(array.size)]
    elif fate == 3:
        kind = generator.choice((np.float16, np.int8, np.bool_, np.float64, np.uint32))
        with np.errstate(all="ignore"):
            arrays[name] = array.astype(kind)
    elif fate == 4 and array.size and array.dtype.kind == "f":
        arrays[name] = array.copy()
        with np.errstate(over="ignore"):
            odd = np.asarray(generator.choice((np.nan, np.inf, -np.inf, 1e30))).astype(array.dtype)
        arrays[name].flat[generator.randrange(array.size)] = odd
    else:
        arrays[name] = array[None] if generator.random() < 0.5 else array.T
    return arrays


def changed_plain_tensors(generator, content):
    """As `changed_tensors`, in a file of another program."""
    arrays = load(content)
    for _ in range(generator.randint(1, 2)):
        if arrays:
            arrays = changed_arrays(generator, arrays)
    return save({name: np.ascontiguousarray(array) for name, array in arrays.items()})


def changed_scene(generator, content):
    """Datasets and attributes of a scene file are changed."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.h5"
        path.write_bytes(content)
        with h5py.File(path, "r+") as file:
            for _ in range(generator.randint(1, 3)):
                name = generator.choice(list(file))
                if generator.random() < 0.3:
                    value = generator.choice(
                        [odd for odd in ODD if isinstance(odd, str | int | float) and odd != 10**30]
                    )
                    with contextlib.suppress(ValueError, TypeError, OSError):
                        file.attrs[generator.choice(("name", "room_type", "format_version", "source", "encoder"))] = (
                            value
                        )
                    continue
                if not isinstance(file[name], h5py.Dataset):
                    continue
                array, attributes = file[name][()], dict(file[name].attrs)
                del file[name]
                changed = changed_arrays(generator, {name: np.asarray(array)})
                if generator.random() < 0.4 and array.size:
                    array = np.array(array)
                    array.flat[generator.randrange(array.size)] = generator.randrange(20)
                    changed = {name: array}
                for new, value in changed.items():
                    with contextlib.suppress(ValueError, TypeError, OSError):
                        file[new or "x"] = value
                        file[new or "x"].attrs.update(attributes)
        return path.read_bytes()


def toml_of(values, prefix=""):
    """A configuration as TOML, one dotted field a line."""
    lines = []
    for key, value in values.items():
        if isinstance(value, dict):
            lines += toml_of(value, f"{prefix}{key}.")
        elif value is not None:
            lines.append(f"{prefix}{key} = {json.dumps(value)}")
    return lines


def save_map_weights(path):
    """A small file in the form of the mapping agent's weights."""
    map_weights.save_weights(path, small_map_parameters(), {"rooms": "three", "status": "made up"})


def small_map_parameters(network=None):
    return {
        "network": {"params": {"a": {"kernel": jnp.ones((3, 2))}}},
        "prior": {"free": jnp.ones(4), "scale": jnp.ones(())},
    }


def read_map_weights(path):
    with mock.patch.object(map_weights, "initial_parameters", small_map_parameters):
        parameters, _ = map_weights.load_weights(path)
    if not all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(parameters)):
        raise AssertionError("loaded with numbers that are not finite")


def training_state():
    """What a checkpoint holds: arrays of several types and a random key; rows of the learning curve."""
    rows = [{"frames": 100.0, "loss": 0.25}, {"frames": 200.0, "loss": 0.125}]
    return {"a": jnp.arange(60.0).reshape(6, 10), "b": (jnp.int32(3), jax.random.key(0))}, rows


def save_checkpoint(path):
    """All files of a checkpoint as one JSON object."""
    with tempfile.TemporaryDirectory() as folder:
        with Checkpoints(Path(folder) / "c", Config()) as checkpoints:
            checkpoints.save(*training_state())
        files = {
            str(file.relative_to(folder)): base64.b64encode(file.read_bytes()).decode()
            for file in sorted(Path(folder).rglob("*"))
            if file.is_file()
        }
    path.write_text(json.dumps(files))


def changed_files(generator, content):
    """One of several files is changed or missing."""
    files = json.loads(content)
    name = generator.choice(list(files))
    if generator.random() < 0.1:
        del files[name]
    else:
        changed = changed_bytes(generator, base64.b64decode(files[name]))
        files[name] = base64.b64encode(changed).decode()
    return json.dumps(files).encode()


def read_checkpoint(path):
    state, rows = training_state()
    with tempfile.TemporaryDirectory(dir=path.parent) as folder, contextlib.redirect_stderr(io.StringIO()):
        for name, content in json.loads(path.read_bytes()).items():
            file = Path(folder) / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(base64.b64decode(content))
        with Checkpoints(Path(folder) / "c", Config()) as checkpoints:
            found = checkpoints.restore(state)
    if found is None:
        return
    if found[1] != rows or not jax.tree.all(jax.tree.map(lambda a, b: bool((a == b).all()), found[0], state)):
        raise AssertionError("another state is restored")


ARGUMENTS = (
    ["train", "--task", "II", "--methods", "rl", "irl", "--frames", "5M", "--siamese.workers", "8", "--seeds", "2"],
    ["train", "--config", "c.toml", "--run", "r", "--scenes", "rooms", "--irl.max-margin.discount", "0.9"],
    ["train", "--resume", "r", "--elm.ridge", "press", "--no-log.tensorboard"],
    ["evaluate", "r", "--task", "I"],
    ["report", "r"],
    ["train", "--agent", "map", "--map.weights", "w.safetensors", "--map.memory", "filled", "--map.turns", "2"],
    ["train", "--agent", "map", "--map.weights", "train", "--map.rooms", "9", "--map.best-share", "0.5"],
    ["play", "r", "--method", "irl", "--seed", "1", "--episode", "3"],
    ["play", "--keyboard", "--scene", "bathroom-0", "--target", "toilet"],
    ["scenes", "generate", "--out", "o", "--count", "2", "--size", "tiny", "--image-size", "8"],
    ["scenes", "check", "a.h5", "b.h5"],
    ["scenes", "export", "vizdoom", "--out", "o", "--maps", "map01", "--states", "40", "--room-type", "base"],
    ["bench", "irl", "--out", "o"],
)
WORDS = (
    *("--help", "--", "--task", "--run", "--config", "--frames", "--siamese.learning-rate", "--methods", "all"),
    *("-1", "1e308", "nan", "inf", "10000000000000", "", "x", "IV", "true", "None", "\udcff", "é", "[x]", "a" * 3000),
)


def changed_arguments(generator, content):
    arguments = json.loads(content)
    for _ in range(generator.randint(1, 3)):
        place, fate = generator.randrange(len(arguments) + 1), generator.randrange(3)
        if fate == 0 and place < len(arguments):
            del arguments[place]
        elif fate == 1 and place < len(arguments):
            arguments[place] = generator.choice(WORDS)
        else:
            arguments.insert(place, generator.choice(WORDS))
    return json.dumps(arguments).encode()


DONE = {
    "pipeline": ("run",),
    "results": ("load_results",),
    "cli.output": ("show_results",),
    "cli.evaluate": ("evaluate_run", "load_results", "show_results"),
    "cli.report": ("write_report", "load_results", "load_run_settings", "locked", "show_results"),
    "cli.play": ("play", "_play_by_keyboard"),
    "cli.scenes": ("_generate", "_export", "scene_files"),
    "cli.bench": ("import_module",),
}
"""What does what a command says, by the module that calls it."""


def read_arguments(path):
    """Parse a command line, without doing what it says."""
    out = io.StringIO()
    with contextlib.ExitStack() as stack, contextlib.chdir(path.parent):
        for module, names in DONE.items():
            for name in names:
                stack.enter_context(mock.patch(f"relm_irl_jax.{module}.{name}", mock.MagicMock()))
        arguments = json.loads(path.read_bytes())
        stack.enter_context(mock.patch.object(sys, "argv", ["relm-irl", *arguments]))
        stack.enter_context(contextlib.redirect_stdout(out))
        said = stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
        try:
            cli.main()
        except SystemExit as stop:
            if stop.code not in (0, 2, None):
                raise AssertionError(f"exit code {stop.code}: {said.getvalue()}") from stop
            if stop.code == 2 and not (said.getvalue() + out.getvalue()).strip():
                raise AssertionError("nothing is said") from stop


def read_scene(path):
    checked = check_files([path])[0]
    try:
        scene = load_scene(path)
    except InputError as error:
        if not checked.faults or not str(error).startswith(checked.faults[0]):
            raise AssertionError(f"loading says {error}, checking {checked.faults}") from error
        raise
    if checked.faults:
        raise AssertionError(f"loaded with {checked.faults}")
    whole = np.isfinite(scene.location).all() and (scene.features is None or np.isfinite(scene.features).all())
    if not whole:
        raise AssertionError("loaded with numbers that are not finite")


ONE_LAYER = dataclasses.replace(next(layers()), convolution="conv1", batch_norm="bn1", shape=(2, 3, 1, 1))
"""A network of one layer, whose weights are small enough to be changed ten thousand times."""


def read_encoder_weights(path):
    shapes = {"conv1.weight": ONE_LAYER.shape} | {f"bn1.{name}": (2,) for name in BATCH_NORM}
    with (
        mock.patch.object(pretrained, "expected_shapes", return_value=shapes),
        mock.patch.object(pretrained, "layers", return_value=(ONE_LAYER,)),
    ):
        state = pretrained.load_state_dict(path)
    if not all(np.isfinite(array).all() for array in state.values()):
        raise AssertionError("loaded with numbers that are not finite")


def read_elm(path):
    model = load_elm(path)
    prediction = model.predict(np.zeros((1, model.n_features_in_)))
    if not np.isfinite(prediction).all():
        raise AssertionError("predicts numbers that are not finite")


class Input:
    """A kind of input: a good one, ways to change it, and its reader.

    Args:
        name: the file's name.
        good: contents of good inputs.
        changes: functions of a random generator and a content.
        read: reads a file.
        share: how many of the cases are of this kind.
    """

    def __init__(self, name, good, changes, read, share=1.0):
        self.name, self.good, self.changes, self.read, self.share = name, good, changes, read, share


def written(write: Callable[[Path], object], name: str) -> bytes:
    """What a function writes to a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def results_file(path):
    folder = RunFolder(path.parent)
    save_results(folder, results("II", {"random": [0.1], "rl": [0.3, 0.4]}))


def inputs() -> dict[str, Input]:
    """All kinds of inputs."""
    generator = np.random.default_rng(0)
    features = generator.normal(size=(8, 4)).astype(np.float32)
    scene = labelled(grid_scene(1, 2, features=features), 2, generator)
    pixels = generator.integers(0, 256, (8, 2, 2, 3), dtype=np.uint8)
    scene = type(scene)(**{**vars(scene), "observation": pixels})
    model = ELMRegressor(n_hidden=5, random_state=0).fit(generator.normal(size=(20, 3)), generator.normal(size=(20, 2)))
    network = {"params": {"a": {"kernel": np.ones((3, 2), np.float32), "bias": np.zeros(2, np.float32)}}}
    encoder = {"conv1.weight": np.ones(ONE_LAYER.shape, np.float32)} | {
        f"bn1.{n}": np.ones(2, np.float32) for n in BATCH_NORM
    }
    config = json.dumps(config_to_dict(Config())).encode()
    mapping = json.dumps(config_to_dict(Config(agent="map", methods=("rl",)).resolved())).encode()
    toml = [path.read_bytes() for path in sorted((ROOT / "experiments").glob("*.toml"))]
    toml += ["\n".join(toml_of(config_to_dict(Config()))).encode()]
    assert all(tomllib.loads(text.decode()) for text in toml)
    steps = {"states": [0, 1, 2], "actions": [1, "RotateRight"]}
    quality = b"method,targets,median_rank,median_rank_share,mean_order\nirl,new,1.0,0.1,0.5\nrl,trained,2.0,0.2,nan\n"
    assert row("rl", 0.5)
    both = (changed_bytes, changed_json)
    tensors = (changed_bytes, changed_tensors)

    def folder_of(reader):
        return lambda path: reader(RunFolder(path.parent))

    return {
        "config.toml": Input("c.toml", toml, (changed_bytes,), load_config),
        "config": Input("c.json", [config, mapping], both, load_config, 2),
        "run": Input("config.json", [config], both, lambda path: find_run(path.parent)),
        "run-settings": Input("config.json", [json.dumps(CONFIG).encode()], both, folder_of(load_run_settings)),
        "arguments": Input(
            "a.json", [json.dumps(a).encode() for a in ARGUMENTS], (changed_arguments,), read_arguments, 0.5
        ),
        "scene": Input(
            "bathroom-0.h5",
            [written(lambda p: save_scene(scene, p), "a.h5")],
            (changed_bytes, changed_scene),
            read_scene,
            2,
        ),
        "demonstrations": Input(
            "d.jsonl",
            ["\n".join([json.dumps(steps)] * 3).encode()],
            (changed_bytes, changed_lines),
            lambda path: load_demonstrations(path, scene),
        ),
        "elm": Input("e.safetensors", [written(lambda p: save_elm(model, p), "e")], tensors, read_elm),
        "weights": Input(
            "w.safetensors", [written(lambda p: save_parameters(p, network), "w")], tensors, load_parameters
        ),
        "map-weights": Input("w.safetensors", [written(save_map_weights, "w")], tensors, read_map_weights),
        "checkpoint": Input("c.json", [written(save_checkpoint, "c")], (changed_files,), read_checkpoint, 0.2),
        "encoder": Input(
            "r.safetensors", [save(encoder)], (changed_bytes, changed_plain_tensors), read_encoder_weights
        ),
        "results": Input("results.json", [written(results_file, "results.json")], both, folder_of(load_results)),
        "hardware": Input("hardware.json", [written(lambda p: write_json(p, HARDWARE), "h")], both, load_stage_times),
        "quality": Input("quality.csv", [quality], (changed_bytes,), load_reward_quality),
        "curve": Input("c.csv", [written(lambda p: write_curve(p, [0.1, 0.2]), "c")], (changed_bytes,), load_curve),
        "press": Input("p.csv", [b"neurons,mean_squared_error\n1,2.5\n2,1.5\n"], (changed_bytes,), load_press_curve),
        "map": Input(
            "m.safetensors", [written(lambda p: save_map(p, state_map(["rl"], start=1)), "m")], tensors, load_map
        ),
        "episodes": Input(
            "e.safetensors", [written(lambda p: save_episodes(p, [episode()]), "e")], tensors, load_episodes
        ),
    }


def fault_of(kind: Input, content: bytes, folder: Path) -> str | None:
    """Read an input; what is wrong with how it was read, or None."""
    path = folder / kind.name
    path.write_bytes(content)
    try:
        with np.errstate(all="ignore"):
            kind.read(path)
    except InputError as error:
        if "\n" in str(error) or not str(error).strip() or len(str(error)) > 8000:
            return f"not one sentence: {error}"
    except Exception:
        return traceback.format_exc(limit=-4)
    return None


def fuzz(cases: int, seed: int, folder: Path, only: str = "") -> tuple[Counter, list[tuple[str, bytes, str]]]:
    """Read many changed inputs; how many of each kind, and the findings."""
    generator, kinds = random.Random(seed), inputs()
    chosen = {name: kind for name, kind in kinds.items() if only in name}
    counts, findings = Counter(), []
    names = generator.choices(list(chosen), [kind.share for kind in chosen.values()], k=cases)
    for name in names:
        kind = chosen[name]
        content = generator.choice(kind.changes)(generator, generator.choice(kind.good))
        counts[name] += 1
        fault = fault_of(kind, content, folder)
        if fault is not None:
            findings.append((name, content, fault))
    return counts, findings


def keep(name: str, content: bytes) -> None:
    """Keep a finding in the corpus."""
    CORPUS.mkdir(exist_ok=True)
    number = next(n for n in itertools.count() if not (CORPUS / f"{name}-{n}.json").exists())
    values = {"input": name, "content": base64.b64encode(content).decode()}
    (CORPUS / f"{name}-{number}.json").write_text(json.dumps(values) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="kinds of inputs whose names contain this")
    parser.add_argument("--keep", action="store_true", help="keep one finding of each kind of fault in tests/corpus")
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "robustness", help="folder for the counts")
    options = parser.parse_args()
    if not any(options.only in name for name in inputs()):
        parser.error(f"--only: no kind of inputs contains {options.only}; kinds: {', '.join(inputs())}.")
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        os.environ["XDG_CACHE_HOME"] = str(Path(folder) / "cache")
        (Path(folder) / "work").mkdir()
        counts, findings = fuzz(options.cases, options.seed, Path(folder) / "work", options.only)
    columns = {"seed": options.seed, "kinds": len(counts), "inputs": counts.total(), "findings": len(findings)}
    write_table(options.out / "fuzz.csv", {name: [value] for name, value in columns.items()})
    seen = set()
    for name, content, fault in findings:
        cause = name, fault.splitlines()[-1][:60], fault.splitlines()[-2][:80] if "\n" in fault else ""
        if cause not in seen:
            seen.add(cause)
            print(f"--- {name}: {content[:300]!r}\n{fault}")
            if options.keep:
                keep(name, content)
    print(json.dumps(dict(counts)))
    print(
        f"{sum(counts.values())} inputs, {len(findings)} findings of {len(seen)} kinds "
        f"({time.monotonic() - began:.0f} s)"
    )
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
