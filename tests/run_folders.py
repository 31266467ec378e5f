"""Run folders written by hand: what the stages leave, without a training."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from builders import grid_scene
from PIL import Image

from relm_irl_jax.files import write_bytes, write_json, write_table
from relm_irl_jax.report import run_figures
from relm_irl_jax.results import ResultRow, Results, RewardQualityRow, Task, save_results, save_reward_quality
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_episodes import SavedEpisode, save_episodes
from relm_irl_jax.saved_maps import SHORTEST_PATH, StateMap, save_map
from relm_irl_jax.saved_poses import poses_of

ROOM = grid_scene(3, 2)
"""Six places, 24 states; state 4 · (2 · column + row) + heading."""

POSES = poses_of(ROOM)

CONFIG = {
    "scenes": "rooms",
    "frames": 1000,
    "agent": "siamese",
    "encoder": {"weights": "random"},
    "evaluation": {"new_targets": "paper", "policy": "sample"},
}
"""The fields of a configuration that a report states."""

HARDWARE = {
    "hardware": {
        "processor": "abacus",
        "cores": 2,
        "devices": ["cpu"],
        "system": "Linux",
        "python": "3.11",
        "packages": {"jax": "0.10"},
    },
    "seconds": {"evaluation": 1.5},
}


def row(method: str, value: float, *, room: str = "bathroom", seed: int = 0, scene: int = 0) -> ResultRow:
    """A row whose SR and SPL are one value."""
    return ResultRow(
        method=method,
        agent="siamese",
        scene=f"{room}-{scene}",
        room_type=room,
        seed=seed,
        episodes=10,
        sr=value,
        ple=100 * (1 - value),
        spl=value,
    )


def results(task: Task, values: Mapping[str, Sequence[float]]) -> Results:
    """Results in which SR and SPL of a method are one value a seed, the same in the scenes of two room types."""
    rows = [
        row(method, value, room=room, seed=seed)
        for method, own in values.items()
        for seed, value in enumerate(own)
        for room in ("bathroom", "bedroom")
    ]
    return Results(task, 100, "none", tuple(rows))


def write_curve(path: Path, success: Sequence[float], episodes: Sequence[float] | None = None) -> None:
    """A learning curve in chunks of 100 frames, its SPL half of the success rate."""
    success = np.asarray(success, float)
    columns = {"frames": 100.0 * np.arange(1, len(success) + 1), "success_rate": success, "spl": success / 2}
    ended = np.full(len(success), 10.0) if episodes is None else episodes
    write_table(path, columns | {"path_length_error": 100 * (1 - success), "episodes": ended, "reward": success})


def state_map(
    methods: Sequence[str], *, start: int | None = None, limits: tuple[float, float] | None = None
) -> StateMap:
    """Distances to state 20 of the room, or, with a start, as many negative rewards; each method has its own."""
    distance = ROOM.shortest_path_distance[:, 20].astype(float)
    values = {m: distance * (1 + 0.1 * n) * (1 if start is None else -0.1) for n, m in enumerate(methods)}
    return StateMap(poses=POSES, seed=0, target=20, category="lamp", values=values, start=start, limits=limits)


def episode(path: Sequence[int] = (0, 8, 16, 20), method: str = "relm-irl") -> SavedEpisode:
    """A walk along the room, to state 20."""
    return SavedEpisode(
        poses=POSES,
        method=method,
        seed=0,
        target=20,
        category="lamp",
        path=np.asarray(path, np.int32),
        shortest_path=np.asarray([0, 4, 12, 20], np.int32),
        target_view=np.full((4, 4, 3), 200, np.uint8),
    )


def write_run(path: Path, values: Mapping[str, Sequence[float]], tasks: Sequence[Task] = ("II", "III")) -> RunFolder:
    """A whole run folder.

    Args:
        path: the folder.
        values: SR and SPL of each method, one value a seed.
        tasks: tasks evaluated.
    """
    folder = RunFolder(path)
    write_json(folder.config, CONFIG)
    write_json(folder.hardware, HARDWARE)
    for task in tasks:
        save_results(folder, results(task, values))
        save_episodes(folder.episodes(task), [episode(), episode([0, 1])])
        save_map(folder.distance_map(task, "bathroom"), state_map([SHORTEST_PATH, "rl"]))
    for targets in ("trained", "new"):
        predicted = ["elm-irl", "relm-irl"] if targets == "new" else ["irl", "elm-irl", "relm-irl"]
        save_map(folder.reward_map(targets, "bathroom"), state_map(predicted, start=0, limits=(-1.0, 0.0)))
    for method, own in values.items():
        for seed, value in enumerate(own):
            if method != "random":
                write_curve(folder.curve(method, seed), [np.nan, value, 1.0, 1.0, 1.0, 1.0, 1.0])
            quality = [RewardQualityRow(method="relm-irl", targets="new", median_rank=2 + seed, median_rank_share=0.1,
                                        mean_order=0.5)]  # fmt: skip
            save_reward_quality(folder.rewards(seed, "quality.csv"), quality)
            write_table(folder.rewards(seed, "press.csv"), {"mean_squared_error": [3.0, 1.0, 2.0, np.inf]})
    return folder


def draw_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every figure of a run is one pixel, for tests that look at the page alone."""
    pixel = io.BytesIO()
    Image.new("RGB", (1, 1)).save(pixel, "PNG")
    monkeypatch.setattr(run_figures, "save_figure", lambda figure, path, table: write_bytes(path, pixel.getvalue()))
