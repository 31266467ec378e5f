"""The figures of a run, drawn from the files of its folder. A damaged file only affects the figures that need it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from matplotlib.figure import Figure

from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.files import columns_of_rows
from relm_irl_jax.report.episodes import episode_caption, episode_columns, episode_figure
from relm_irl_jax.report.figures import (
    DrawnFigure,
    bar_figure,
    load_press_curve,
    press_columns,
    press_figure,
    save_figure,
)
from relm_irl_jax.report.learning_curves import TrainingCurve, band_columns, learning_figure, load_curve
from relm_irl_jax.report.maps import distance_caption, distance_figure, map_columns, reward_caption, reward_figure
from relm_irl_jax.report.names import heading
from relm_irl_jax.report.run_settings import load_run_settings
from relm_irl_jax.report.searches import search_caption, search_columns, search_figure
from relm_irl_jax.report.tables import columns_of, interval_of, methods_of, seeds_of
from relm_irl_jax.results import LEARNED, PREDICTED, Results, RewardQualityRow, Task, is_of_run, load_reward_quality
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_episodes import load_episodes
from relm_irl_jax.saved_maps import StateMap, load_map
from relm_irl_jax.saved_searches import load_searches

CURVELESS = ("random", "bc")
"""Methods whose training has no episodes; neither has that of the mapping agent."""

Content = TypeVar("Content")


@dataclass
class RunData:
    """The data of a run folder for the report, as far as it can be read.

    Attributes:
        folder: the run folder.
        results: metrics by task.
        faults: one sentence for each file that could not be read.
    """

    folder: RunFolder
    results: Mapping[Task, Results]
    faults: list[str] = field(default_factory=list)

    @property
    def trained(self) -> dict[str, list[int]]:
        """The seeds of each method that was trained in this run."""
        rows = [row for results in self.results.values() for row in results.rows if is_of_run(row)]
        return {method: seeds_of([row for row in rows if row.method == method]) for method in methods_of(rows)}

    @property
    def seeds(self) -> list[int]:
        """The seeds of the results."""
        return seeds_of([row for results in self.results.values() for row in results.rows])

    @property
    def agent(self) -> str:
        """The agent of the results; empty if there is none but Random."""
        rows = [row for results in self.results.values() for row in results.rows if is_of_run(row)]
        agents = {row.agent for row in rows} - {"random"}
        return min(agents, default="")

    @property
    def imagined(self) -> str:
        """Which imagined targets the run's agent trained on; `none` if there are none."""
        return load_run_settings(self.folder).imagined

    @property
    def learned_rewards(self) -> bool:
        """Whether the results contain a method with a learned reward."""
        return bool(set(LEARNED) & set(self.trained))

    def read(self, load: Callable[[Path], Content], path: Path) -> Content | None:
        """Read a file; if that fails, add the error to `faults`.

        Args:
            load: reads the file, or raises InputError.
            path: the file.

        Returns:
            The contents, or None.
        """
        try:
            return load(path)
        except InputError as error:
            self.faults.append(str(error))
            return None

    def drawn(self, name: str, draw: Callable[[], list[DrawnFigure]]) -> list[DrawnFigure]:
        """Draw figures; if that fails, add the error to `faults`.

        Args:
            name: what is drawn.
            draw: draws the figures.

        Returns:
            The figures; an empty list if they cannot be drawn.
        """
        try:
            return draw()
        except InputError as error:
            self.faults.append(str(error))
        except Exception as error:  # a figure that cannot be drawn, for whatever reason, never costs the report
            reason = first_line(error)
            self.faults.append(f"figure {name}: cannot be drawn ({reason}).")
        return []

    def curves(self) -> dict[str, dict[int, TrainingCurve]]:
        """The learning curves of every method and seed; all curves of a method have the same frames.

        Returns:
            The curves; methods without a readable curve are left out.
        """
        curves: dict[str, dict[int, TrainingCurve]] = {}
        for method, seeds in self.trained.items():
            for seed in () if method in CURVELESS or self.agent == "map" else seeds:
                path = self.folder.curve(method, seed)
                curve = self.read(load_curve, path)
                if curve is None:
                    continue
                by_seed = curves.setdefault(method, {})
                if by_seed and next(iter(by_seed.values())).frames.tolist() != curve.frames.tolist():
                    self.faults.append(f"{path}: its frames are not those of the method's other seeds; restore it.")
                else:
                    by_seed[seed] = curve
        return curves

    def reward_quality(self) -> dict[int, tuple[RewardQualityRow, ...]]:
        """The quality of the learned rewards of each seed, if the run has any.

        Returns:
            The rows by seed.
        """
        seeds = self.seeds if self.learned_rewards else []
        read = {seed: self.read(load_reward_quality, self.folder.rewards(seed, "quality.csv")) for seed in seeds}
        return {seed: rows for seed, rows in read.items() if rows}


def learning_curve_figure(data: RunData, curves: Mapping[str, Mapping[int, TrainingCurve]]) -> DrawnFigure:
    """Draw the learning curves.

    Args:
        data: the run.
        curves: the curves of at least one method.

    Returns:
        The figure.
    """
    path = data.folder.figure("learning")
    save_figure(learning_figure(curves), path, band_columns(curves))
    bands = " and bands of 95% intervals over seeds" if len(data.seeds) > 1 else ""
    caption = (
        "Episodes that ended during training on the training targets: path length error (the paper's Figure 6), "
        f"success rate and SPL, means over the last chunks{bands}"
    )
    if data.imagined == "reward-alone" and set(PREDICTED) & set(curves):
        caption += (
            ". ELM-IRL and RELM-IRL: share of walks of t_max actions that meet their target, given or imagined, whose "
            "path lengths are not known; not to be compared with the other curves"
        )
    if data.imagined == "told":
        caption += ". Walks of t_max actions to given or imagined targets, whose path lengths are not known"
    return DrawnFigure(path, "Learning curves", caption)


def press_curve_figure(data: RunData) -> list[DrawnFigure]:
    """Draw the PRESS curves of RELM-IRL's regressors.

    Args:
        data: the run.

    Returns:
        The figure; an empty list if no seed has a curve.
    """
    paths = [data.folder.rewards(seed, "press.csv") for seed in data.seeds]
    curves = [curve for p in paths if p.exists() and (curve := data.read(load_press_curve, p)) is not None]
    if not curves:
        return []
    path = data.folder.figure("press")
    caption = (
        "Leave-one-out error (PRESS) of RELM-IRL's regressor on the demonstrated pairs against the number of neurons, "
        "one curve for each seed, minima marked (as the paper's Figure 9)"
    )

    def draw() -> list[DrawnFigure]:
        save_figure(press_figure(curves), path, press_columns(curves))
        return [DrawnFigure(path, "Leave-one-out error against neurons", caption)]

    return data.drawn("press", draw)


def prediction_figure(data: RunData) -> list[DrawnFigure]:
    """Draw ELM-IRL and RELM-IRL on Task III, the paper's Figure 11.

    Args:
        data: the run.

    Returns:
        The figure; an empty list if the task or a method was not evaluated.
    """
    rows = data.results["III"].rows if "III" in data.results else ()
    if not set(PREDICTED) <= {row.method for row in rows}:
        return []
    columns = columns_of(rows)
    bars = {str(method): [interval_of(rows, method, "spl", column) for column in columns] for method in PREDICTED}
    table = [
        (method, column, value.mean, value.half_width)
        for method, values in bars.items()
        for column, value in zip(columns, values, strict=True)
    ]
    path = data.folder.figure("figure-11")
    names = ("method", "column", "spl", "half_width")
    caption = "SPL of ELM-IRL and RELM-IRL on Task III, before and after regularisation (the paper's Figure 11)"

    def draw() -> list[DrawnFigure]:
        figure = bar_figure(bars, [heading(column) for column in columns], "SPL on Task III")
        save_figure(figure, path, columns_of_rows(names, table))
        return [DrawnFigure(path, "ELM-IRL and RELM-IRL on Task III", caption)]

    return data.drawn("figure-11", draw)


def episode_figures(data: RunData) -> list[DrawnFigure]:
    """Draw the saved episodes of every task.

    Args:
        data: the run.

    Returns:
        One figure for each task.
    """

    def draw(task: Task) -> list[DrawnFigure]:
        episodes = data.read(load_episodes, data.folder.episodes(task))
        if not episodes:
            return []
        path = data.folder.figure(f"episodes-{task}")
        save_figure(episode_figure(episodes), path, episode_columns(episodes))
        return [DrawnFigure(path, f"Episodes of Task {task} from above", episode_caption(episodes, task))]

    return [figure for task in data.results for figure in data.drawn(f"episodes-{task}", partial(draw, task))]


def search_figures(data: RunData) -> list[DrawnFigure]:
    """Draw what an agent that searches believed, for every task that it was saved of.

    Args:
        data: the run.

    Returns:
        One figure for each task.
    """

    def draw(task: Task) -> list[DrawnFigure]:
        searches = data.read(load_searches, data.folder.searches(task))
        if not searches:
            return []
        path = data.folder.figure(f"search-{task}")
        save_figure(search_figure(searches), path, search_columns(searches))
        return [DrawnFigure(path, f"Searches of Task {task}", search_caption(searches, task))]

    saved = [task for task in data.results if data.folder.searches(task).exists()]
    return [figure for task in saved for figure in data.drawn(f"search-{task}", partial(draw, task))]


def map_figures(data: RunData) -> list[DrawnFigure]:
    """Draw the saved maps of learned distances and of rewards.

    Args:
        data: the run.

    Returns:
        One figure for each map.
    """
    drawn = []

    def draw(file: Path, figure: Callable[[StateMap], Figure], title: str, caption: Callable[[StateMap], str]) -> None:
        saved = data.read(load_map, file)
        if saved is not None:
            path = data.folder.figure(file.stem)

            def save() -> list[DrawnFigure]:
                save_figure(figure(saved), path, map_columns(saved))
                return [DrawnFigure(path, title.replace("{scene}", saved.poses.name), caption(saved))]

            drawn.extend(data.drawn(file.stem, save))

    for task in data.results:
        title = f"Distances to a target of Task {task} in {{scene}}"
        for file in data.folder.distance_maps(task):
            draw(file, distance_figure, title, partial(distance_caption, task=task))
    if data.learned_rewards and not data.folder.reward_maps("*"):
        data.faults.append(f"{data.folder.path}: contains no maps of rewards.")
    for targets in ("trained", "new"):
        for file in data.folder.reward_maps(targets):
            title = f"Rewards over {{scene}} for a {targets} target"
            draw(file, reward_figure, title, partial(reward_caption, targets=targets))
    return drawn
