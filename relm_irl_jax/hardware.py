"""The computer of a run, and the duration of each of its stages."""

import importlib.metadata
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError, first_fault
from relm_irl_jax.files import write_json

PACKAGES = ("jax", "flax", "optax", "numpy", "cvxpy", "clarabel")
"""Packages that do the computation, whose versions are recorded."""


@dataclass(frozen=True)
class Hardware:
    """A computer, and the versions of the packages that do the computation.

    Attributes:
        processor: name of the processor.
        cores: number of its cores; None if the system does not report it.
        devices: kind of each JAX device.
        system: operating system.
        python: Python version.
        packages: version of each of `PACKAGES`.
    """

    processor: str
    cores: int | None
    devices: tuple[str, ...]
    system: str
    python: str
    packages: dict[str, str]

    def __str__(self) -> str:
        """The description in one line."""
        packages = ", ".join(f"{name} {version}" for name, version in self.packages.items())
        return (
            f"{self.processor}, {self.cores} cores, {', '.join(self.devices)}; {self.system}, Python {self.python}, "
            f"{packages}"
        )


@dataclass(frozen=True)
class StageTimes:
    """Contents of a run folder's `hardware.json`.

    Attributes:
        hardware: the computer that ran the last stage.
        seconds: total seconds of each stage, over all calls.
        earlier: other computers, or other versions of the packages, that ran stages before it.
    """

    hardware: Hardware
    seconds: dict[str, float]
    earlier: tuple[Hardware, ...] = ()

    @property
    def computers(self) -> tuple[Hardware, ...]:
        """All computers that ran a stage, the last one first."""
        return (self.hardware, *self.earlier)


_STAGE_TIMES = TypeAdapter(StageTimes)


SYSTEM, GROUPS = Path("/proc"), Path("/sys/fs/cgroup")
"""Where the system reports the memory of processes and of control groups."""

_GROUP_FILES = {
    "": ("memory.current", "memory.max", "file"),
    "memory": ("memory.usage_in_bytes", "memory.limit_in_bytes", "total_cache"),
}
"""By controller, which version 2 of control groups does not name: the files with the memory in use and its limit, and
the line of `memory.stat` with what files occupy, which the system can free."""


def available_memory() -> int | None:
    """Memory that this process can still use, under the limits of the system, of its control groups and of `ulimit`.

    Returns:
        Bytes; None if the system does not report them.
    """
    found = [*_left_in_groups(), *_left_for_process()]
    with suppress(OSError, ValueError, KeyError):
        found.append(_kilobytes(SYSTEM / "meminfo")["MemAvailable"] * 1024)
    return max(min(found), 0) if found else None


def _left_in_groups() -> Iterator[int]:
    """What the limits of this process's control groups leave, from its own group up to the root."""
    lines = []
    with suppress(OSError):
        lines = (SYSTEM / "self" / "cgroup").read_text().splitlines()
    for line in lines:
        _, controllers, path = line.split(":", 2)
        for controller in _GROUP_FILES.keys() & set(controllers.split(",")):
            used, limit, cached = _GROUP_FILES[controller]
            own = GROUPS / controller / path.lstrip("/")
            for group in (own, *own.parents):
                # A group without a limit has no such file, or one with a word.
                with suppress(OSError, ValueError, KeyError):
                    occupied = int((group / used).read_text()) - _numbers(group / "memory.stat")[cached]
                    yield int((group / limit).read_text()) - occupied
                if group == GROUPS / controller:
                    break


def _left_for_process() -> Iterator[int]:
    """What `ulimit -v` and `ulimit -d` leave."""
    with suppress(ImportError, OSError, ValueError, KeyError):
        import resource  # not on every system

        used = _kilobytes(SYSTEM / "self" / "status")
        for limit, what in ((resource.RLIMIT_AS, "VmSize"), (resource.RLIMIT_DATA, "VmData")):
            allowed = resource.getrlimit(limit)[0]
            if allowed != resource.RLIM_INFINITY:
                yield allowed - used[what] * 1024


def _numbers(path: Path) -> dict[str, int]:
    """Lines of a name and a number."""
    return {name: int(number) for name, number in (line.split() for line in path.read_text().splitlines())}


def _kilobytes(path: Path) -> dict[str, int]:
    """Lines of a name, a colon and a number of kilobytes."""
    pairs = (line.split(":", 1) for line in path.read_text().splitlines())
    return {name: int(value.split()[0]) for name, value in pairs if value.strip().endswith(" kB")}


def require_memory(needed: int, what: str) -> None:
    """Refuse work that the memory does not suffice for, before it begins.

    Args:
        needed: an estimate of the bytes that the work needs.
        what: the work, in a few words.

    Raises:
        InputError: the work needs more memory than is available.
    """
    available = available_memory()
    if available is not None and needed > available:
        raise InputError(
            f"{what} needs about {needed / 1e9:,.1f} GB of memory, and {available / 1e9:,.1f} GB are available; give "
            "smaller settings, smaller scenes, or a computer with more memory."
        )


def describe_computer() -> Hardware:
    """Describe the computer that runs this process.

    Returns:
        The hardware.
    """
    import jax  # not needed by the report, which reads hardware.json only

    return Hardware(
        processor=processor_name(),
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
        raise InputError(f"{path}: {first_fault(error)} Remove the file; the next stage writes a new one.") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); the next stage writes a new one.") from error


@dataclass(frozen=True)
class Stopwatch:
    """Adds up the seconds of each stage, and writes them to the run folder with the computers that ran stages.

    Attributes:
        path: the file, `RunFolder.hardware`.
    """

    path: Path

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the duration of a block to a stage."""
        start = time.perf_counter()
        yield
        duration = time.perf_counter() - start
        computer = describe_computer()
        try:
            previous = load_stage_times(self.path)
        except InputError:  # missing or damaged: this loses the times of earlier stages, but not the run
            previous = StageTimes(computer, {})
        seconds = previous.seconds | {stage: round(previous.seconds.get(stage, 0.0) + duration, 2)}
        earlier = tuple(other for other in previous.computers if other != computer)
        write_json(self.path, _STAGE_TIMES.dump_python(StageTimes(computer, seconds, earlier), mode="json"))


def processor_name() -> str:
    """Name of the processor, as far as the system reports it.

    Returns:
        The name; the architecture on systems that report no name.
    """
    cpu_info = Path("/proc/cpuinfo")
    if cpu_info.exists():
        for line in cpu_info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
