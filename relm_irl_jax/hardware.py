"""The computer that a run used, and how long each of its stages took there."""

import importlib.metadata
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError, first_fault
from relm_irl_jax.files import write_json

PACKAGES = ("jax", "flax", "optax", "numpy", "cvxpy", "clarabel")
"""Packages that compute, whose versions are kept."""


@dataclass(frozen=True)
class Hardware:
    """A computer, and the versions of the packages that compute.

    Attributes:
        processor: name of the processor.
        cores: number of its cores; None where the system does not tell.
        devices: kinds of JAX's devices.
        system: operating system.
        python: version of Python.
        packages: version of each of `PACKAGES`.
    """

    processor: str
    cores: int | None
    devices: tuple[str, ...]
    system: str
    python: str
    packages: dict[str, str]


@dataclass(frozen=True)
class StageTimes:
    """What `hardware.json` of a run folder holds.

    Attributes:
        hardware: the computer that ran the last stage.
        seconds: seconds of each stage, all calls together.
    """

    hardware: Hardware
    seconds: dict[str, float]


_STAGE_TIMES = TypeAdapter(StageTimes)


def describe_computer() -> Hardware:
    """The computer that runs this process.

    Returns:
        The hardware.
    """
    import jax  # the report reads what other computers wrote, and needs no JAX

    return Hardware(
        processor=_processor(),
        cores=os.cpu_count(),
        devices=tuple(device.device_kind for device in jax.devices()),
        system=platform.platform(terse=True),
        python=platform.python_version(),
        packages={name: importlib.metadata.version(name) for name in PACKAGES},
    )


def load_stage_times(path: Path) -> StageTimes:
    """Read `hardware.json`.

    Args:
        path: the file.

    Returns:
        Its contents.

    Raises:
        InputError: the file is missing or damaged.
    """
    try:
        return _STAGE_TIMES.validate_json(path.read_bytes())
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)} Remove the file; the next stage writes it anew.") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); the next stage writes it anew.") from error


@dataclass(frozen=True)
class Stopwatch:
    """Adds up the seconds that each stage takes, and keeps them with the computer in the run folder.

    Attributes:
        path: the file, `RunFolder.hardware`.
    """

    path: Path

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time a block under the name of a stage."""
        begun = time.perf_counter()
        yield
        passed = time.perf_counter() - begun
        try:
            before = load_stage_times(self.path).seconds
        except InputError:  # missing or damaged: the times of earlier stages are lost, the run is not
            before = {}
        seconds = before | {stage: round(before.get(stage, 0.0) + passed, 2)}
        write_json(self.path, _STAGE_TIMES.dump_python(StageTimes(describe_computer(), seconds), mode="json"))


def _processor() -> str:
    """Name of the processor, where the system tells."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
