"""Tables of speed and of robustness in the pages, from `docs/tables`."""

from collections.abc import Mapping, Sequence

from committed_tables import TABLES

from relm_irl_jax.benchmarks.rows import three_digits
from relm_irl_jax.files import read_table
from relm_irl_jax.report.names import method_name


def _measured_on(rows: Mapping[str, Sequence[str]], lines: Sequence[str]) -> list[str]:
    """A table under the name of the computer that its first row was measured on."""
    return [f"{rows['computer'][0]}:", "", *lines]


def peers() -> list[str]:
    """Rates of this package and of the peer, and their ratio."""
    rows = read_table(TABLES / "speed-peers.csv")
    lines = ["| | | Here, per second | Peer | Its rate | Ratio |", "|---|---|---:|---|---:|---:|"]
    columns = (rows[name] for name in ("part", "unit", "ours", "peer", "theirs", "ratio"))
    for part, unit, ours, peer, theirs, ratio in zip(*columns, strict=True):
        rates = [three_digits(float(value)) for value in (ours, theirs, ratio)]
        lines.append(f"| {part} | {unit} | {rates[0]} | {peer} | {rates[1]} | {rates[2]} |")
    return _measured_on(rows, lines)


def scaling() -> list[str]:
    """Updates on several virtual devices."""
    rows = read_table(TABLES / "speed-scaling.csv")
    measured = zip(*([float(x) for x in rows[name]] for name in ("devices", "workers", "update_seconds")), strict=True)
    lines = ["| Devices | Workers | Update | Ratio |", "|---:|---:|---:|---:|"]
    one = float(rows["update_seconds"][0]) / float(rows["devices"][0])
    for devices, workers, seconds in measured:
        lines.append(f"| {devices:.0f} | {workers:.0f} | {1e3 * seconds:.0f} ms | {seconds / (one * devices):.2f} |")
    return lines


def trainings(device: str) -> list[str]:
    """Trainings of all agents on a kind of device."""
    rows = read_table(TABLES / f"speed-trainings-{device}.csv")
    lines = [
        "| Agent, method | Workers | Frames/s | Frames | Seconds | Compiling and first frames, in seconds |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    names = ("agent", "method", "workers", "frames_per_second", "frames", "other_chunks_seconds", "first_chunk_seconds")
    for agent, method, workers, rate, frames, seconds, first in zip(*(rows[name] for name in names), strict=True):
        cells = (
            workers,
            three_digits(float(rate)),
            three_digits(float(frames)),
            f"{float(seconds):.1f}",
            f"{float(first):.0f}",
        )
        lines.append(f"| {agent}, {method_name(method)} | " + " | ".join(cells) + " |")
    return _measured_on(rows, lines)


def commands() -> list[str]:
    """Time of whole commands."""
    rows = read_table(TABLES / "speed-commands.csv")
    lines = ["| From nothing | Minutes | Minutes of the cores |", "|---|---:|---:|"]
    for command, *seconds in zip(rows["command"], rows["seconds"], rows["processor_seconds"], strict=True):
        lines.append(f"| `{command}` | " + " | ".join(f"{float(value) / 60:.1f}" for value in seconds) + " |")
    return _measured_on(rows, lines)


def gym() -> list[str]:
    """Steps per second of the Gymnasium environments."""
    rows = read_table(TABLES / "speed-gym.csv")
    lines = ["| Agents | Observation | Steps/s |", "|---:|---|---:|"]
    columns = (rows[name] for name in ("agents", "observation", "shape", "steps_per_second"))
    for agents, observation, shape, rate in zip(*columns, strict=True):
        lines.append(f"| {agents} | {observation}, {shape} | {three_digits(float(rate))} |")
    return _measured_on(rows, lines)


def robustness() -> list[str]:
    """Processes that were ended, and inputs that were damaged."""
    chaos, fuzz = (
        {column: int(values[0]) for column, values in read_table(TABLES / f"{name}.csv").items()}
        for name in ("chaos", "fuzz")
    )
    signals = {name: chaos[name] for name in ("SIGKILL", "SIGTERM", "SIGINT")}
    ended = ", ".join(f"{count} by {name}" for name, count in signals.items())
    chaos_row = (
        "`make chaos`",
        "a process is ended at seeded moments of every stage, and continued; results, weights and tables are compared",
        f"{sum(signals.values())} times in {chaos['runs']} runs ({ended}; seed {chaos['seed']})",
        "all are equal, bit for bit",
    )
    fuzz_row = (
        "`make fuzz`",
        f"changed inputs of {fuzz['kinds']} kinds, configurations to checkpoints, are read or refused in one sentence",
        f"{fuzz['inputs']:,} times (seed {fuzz['seed']})",
        f"{fuzz['findings']} faults",
    )
    lines = ["| | What is done | How often | What was found |", "|---|---|---|---|"]
    return [*lines, *("| " + " | ".join(row) + " |" for row in (chaos_row, fuzz_row))]
