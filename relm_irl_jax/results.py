"""Results of a run: metrics of trained agents (`results.json`) and quality of learned rewards (`quality.csv`)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, NonNegativeInt, PositiveInt, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError, first_fault
from relm_irl_jax.inputs import refuse_device
from relm_irl_jax.lazy import deferred
from relm_irl_jax.run_folder import RunFolder

# Names of tasks and methods are read more often than results.
read_table = deferred("relm_irl_jax.files", "read_table")
write_json = deferred("relm_irl_jax.files", "write_json")
write_table = deferred("relm_irl_jax.files", "write_table")

Task = Literal["I", "II", "III"]
TASKS: tuple[Task, ...] = get_args(Task)

Method = Literal["random", "bc", "rl", "constant", "irl", "elm-irl", "relm-irl"]

LEARNED: tuple[Method, ...] = ("irl", "elm-irl", "relm-irl")
"""Methods whose reward is learned from demonstrations."""

PREDICTED: tuple[Method, ...] = ("elm-irl", "relm-irl")
"""Methods whose reward a regressor predicts; the paper's Figure 11 compares them."""

BESIDE: Mapping[str, Method] = {"metric": "relm-irl", "map": "rl"}
"""Agents that can be evaluated beside another agent, and the method that trains them there. The mapping agent learns no
reward: with RL, every step of its plans costs the same."""

OWN = "own"
"""Kind of agent of rows that another program measured."""

TargetGroup = Literal["trained", "new", "uniform"]
"""Targets of Task I, and the two kinds of Task II targets."""

Share = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True, kw_only=True, config={"defer_build": True})
class ResultRow:
    """Metrics of one agent in one scene.

    Attributes:
        method: the method that trained it, such as `relm-irl`.
        agent: kind of agent, such as `siamese`; empty if the file does not say.
        scene: name of the scene.
        room_type: room type of the scene.
        seed: seed of the training.
        episodes: number of episodes.
        sr: share of the episodes that ended at the target.
        ple: mean over all episodes of path length minus shortest path; the path length of a failed episode is the cap.
        spl: success weighted by path length: mean over all episodes of S · shortest / max(length, shortest).
    """

    method: str
    agent: str = ""
    scene: str
    room_type: str
    seed: NonNegativeInt
    episodes: PositiveInt
    sr: Share
    ple: Annotated[float, Field(allow_inf_nan=False)]
    spl: Share


@dataclass(frozen=True, config={"defer_build": True})
class Results:
    """Metrics of all agents of a run on one task.

    Attributes:
        task: the task.
        cap: number of steps after which an episode was truncated.
        encoder: name of the encoder.
        rows: one for each method, seed and scene.
    """

    task: Task
    cap: PositiveInt
    encoder: str
    rows: Annotated[tuple[ResultRow, ...], Field(min_length=1)]


def beside_name(agent: str) -> str:
    """Name in the tables of an agent that is evaluated beside another.

    Args:
        agent: kind of agent.

    Returns:
        The name, which takes the place of a method's.
    """
    return f"{agent} {BESIDE[agent]}"


BESIDE_NAMES = {beside_name(agent): agent for agent in BESIDE}
"""The agent of each such name."""


def is_of_run(row: ResultRow) -> bool:
    """Whether a row is of an agent of the run itself: neither of an agent beside it nor of another program.

    Args:
        row: the row.
    """
    return row.agent != OWN and row.method not in BESIDE_NAMES


_RESULTS = TypeAdapter(Results)


def save_results(folder: RunFolder, results: Results) -> None:
    """Write the metrics to `results-TASK.json` and to `results.json`, which belongs to the task evaluated last.

    Args:
        folder: the run folder.
        results: the metrics.
    """
    values = results_to_dict(results)
    write_json(folder.results(results.task), values)
    write_json(folder.results(), values)


def results_to_dict(results: Results) -> dict[str, Any]:
    """The metrics as plain values, ready for JSON.

    Args:
        results: the metrics.
    """
    return _RESULTS.dump_python(results, mode="json")


def read_results(path: Path) -> Results:
    """Read a file in the form of `results.json`, written by any program.

    Args:
        path: the file.

    Returns:
        The metrics.

    Raises:
        InputError: the file cannot be read, or a field is missing or refused.
    """
    refuse_device(path)
    try:
        return _RESULTS.validate_json(path.read_bytes())
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)} Correct the file; its form is that of results.json.") from error
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); give a file in the form of results.json."
        ) from error


def load_results(folder: RunFolder, task: Task | None = None) -> Results:
    """Read the metrics of a task.

    Args:
        folder: the run folder.
        task: the task; None for the one evaluated last.

    Returns:
        The metrics.

    Raises:
        InputError: the task was not evaluated yet, or the file is damaged.
    """
    path = folder.results(task)
    remedy = f"run `relm-irl evaluate {folder.path}{'' if task is None else f' --task {task}'}`."
    try:
        results = _RESULTS.validate_json(path.read_bytes())
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)} Remove the file and {remedy}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {remedy}") from error
    if task not in (None, results.task):
        raise InputError(f"{path}: task = {results.task!r} contradicts the file's name; remove the file and {remedy}")
    return results


def load_all_results(folder: RunFolder) -> dict[Task, Results]:
    """Read the metrics of every task evaluated.

    Args:
        folder: the run folder.

    Returns:
        The metrics by task.

    Raises:
        InputError: nothing was evaluated yet, or a file is damaged.
    """
    results = {task: load_results(folder, task) for task in TASKS if folder.results(task).exists()}
    if not results:
        raise InputError(f"{folder.path}: contains no results; run `relm-irl evaluate {folder.path}`.")
    return results


def join_results(results: Sequence[Results]) -> Results:
    """Rows of several results, after checking that they were measured alike.

    Args:
        results: at least one.

    Returns:
        All rows; where encoders differ, all their names.

    Raises:
        InputError: two results have a method's name in common, or they were not measured alike: task, cap, scenes,
            seeds or numbers of episodes differ.
    """
    first, *others = results
    rows, encoders = list(first.rows), {first.encoder: None}
    for other in others:
        for field in ("task", "cap"):
            ours, theirs = getattr(first, field), getattr(other, field)
            if ours != theirs:
                raise InputError(f"results: {field} is {ours} in one and {theirs} in the other; evaluate both alike.")
        if both := {row.method for row in rows} & {row.method for row in other.rows}:
            raise InputError(f"results: {min(both)} is in both; give one of them another name.")
        if difference := _measured(first.rows) ^ _measured(other.rows):
            scene, seed, episodes = min(difference)
            raise InputError(
                f"results: only one of them has {episodes} episodes in {scene} with seed {seed}; evaluate both on the "
                "same scenes, seeds and numbers of episodes."
            )
        rows += other.rows
        encoders[other.encoder] = None
    return replace(first, encoder=", ".join(encoders), rows=tuple(rows))


def _measured(rows: Sequence[ResultRow]) -> set[tuple[str, int, int]]:
    return {(row.scene, row.seed, row.episodes) for row in rows}


def save_entry(folder: RunFolder, results: Results) -> None:
    """Keep rows of another program, which every evaluation of the run adds to its own.

    Args:
        folder: the run folder.
        results: the rows of one name.
    """
    write_json(folder.entry(results.task, results.rows[0].method), results_to_dict(results))


def load_entries(folder: RunFolder, task: Task) -> tuple[ResultRow, ...]:
    """Read the rows of other programs.

    Args:
        folder: the run folder.
        task: the task.

    Returns:
        The rows; none if there are no entries.

    Raises:
        InputError: a file is damaged.
    """
    return tuple(row for path in folder.entries(task) for row in read_results(path).rows)


@dataclass(frozen=True)
class RewardQualityRow:
    """Quality of one method's rewards for a group of targets, independent of agents.

    Attributes:
        method: the method whose reward it is.
        targets: `trained`, `new` (Task II) or `uniform` (Task II, targets drawn uniformly).
        median_rank: median over targets and starts of the target's rank by reward among its scene's states; 1 is best.
        median_rank_share: median of the rank divided by the number of states.
        mean_order: mean Spearman correlation between reward and closeness to the target.
    """

    method: str
    targets: TargetGroup
    median_rank: Annotated[float, Field(ge=1)]
    median_rank_share: Share
    mean_order: float


_QUALITY = TypeAdapter(tuple[RewardQualityRow, ...])
_QUALITY_COLUMNS = ("method", "targets", "median_rank", "median_rank_share", "mean_order")


def save_reward_quality(path: Path, rows: Sequence[RewardQualityRow]) -> None:
    """Write `quality.csv`.

    Args:
        path: the file.
        rows: one for each method and group of targets.
    """
    write_table(path, {name: [getattr(row, name) for row in rows] for name in _QUALITY_COLUMNS})


def load_reward_quality(path: Path) -> tuple[RewardQualityRow, ...]:
    """Read `quality.csv`.

    Args:
        path: the file.

    Returns:
        One row for each method and group of targets.

    Raises:
        InputError: the file is missing or damaged.
    """
    table = read_table(path)
    rows = [dict(zip(table, values, strict=True)) for values in zip(*table.values(), strict=True)]
    try:
        return _QUALITY.validate_python(rows)
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)} Restore the file, or remove it.") from error
