"""The report of a study: tables and figures of all runs, the regressor's figures, and the ablation."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import ParamSpec

from joblib import Parallel, delayed

from relm_irl_jax.config import config_from_dict, read_fields
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_numbers, write_table
from relm_irl_jax.report.comparison import PairedDifference, differences, statement
from relm_irl_jax.report.figures import save_figure
from relm_irl_jax.report.run_report import circumstances, run_sections, write_page
from relm_irl_jax.results import load_all_results
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.studies.ablation import AblationRow, ablation_columns, ablation_table
from relm_irl_jax.studies.contributions import contributions, contributions_table
from relm_irl_jax.studies.reward_tables import selections_table, stability_table
from relm_irl_jax.studies.rooms_figure import rooms_figure, unseen_by_rooms
from relm_irl_jax.studies.search_page import maps_section, search_section
from relm_irl_jax.studies.times import times_table

P = ParamSpec("P")

CLAIM = (
    "The paper claims that rewards predicted by a regularised extreme learning machine (RELM-IRL) navigate better than "
    "a hand-made reward (RL) and than inverse reinforcement learning alone (IRL): a higher success weighted by path "
    "length (SPL) on all three tasks, and a higher success rate (SR) on new targets and in unseen scenes."
)

RUN_TITLES = {
    "siamese": "The paper's agent: the siamese actor-critic",
    "siamese-given": "The paper's agent on the given targets alone, with the paper's frames",
    "siamese-long": "The paper's agent, with three times the frames",
    "siamese-told": "The paper's agent, told of arrivals at imagined targets: what the targets alone teach",
    "siamese-rooms": "The paper's agent, trained in 60 rooms",
    "siamese-resnet50": "The paper's agent, with the encoder ResNet-50 of random weights",
    "metric": "The metric agent: distances between views (not in the paper)",
    "metric-open": "The metric agent, open: evaluation targets may also be goals",
    "metric-no-hindsight": "The metric agent without hindsight: RL and IRL have the training targets alone as goals",
    "metric-resnet50": "The metric agent, with the encoder ResNet-50 of random weights",
    "metric-reward-alone": "The metric agent, not told where imagined targets are: only the predicted reward says so",
    "vizdoom": "The metric agent in scenes recorded from ViZDoom",
}
"""Titles of a study's runs, by the names of their folders."""

AGENT_TITLES = RUN_TITLES | {
    "recurrent": "The paper's network with recurrent memory (not in the paper)",
    "savn": "The paper's network with recurrent memory, which learns to adapt (not in the paper)",
    "map": "The mapping agent (not in the paper)",
}
"""Titles of the tables of each agent."""


STUDY_TEXTS = {
    "ablation": (
        "What the paper leaves open",
        "RELM-IRL with one setting changed, and fewer frames and episodes than in the tables above. Changes are paired "
        "with the base on the same seeds, ± half of the 95% interval (Student's t, without correction for multiple "
        "comparisons); bold if the interval excludes zero, which happens for one in twenty by chance. Rank: rank of a "
        "new target by predicted reward among the states of its scene, median over targets; 1 is best.",
    ),
    "irl-methods": (
        "Rewards of other methods of inverse reinforcement learning",
        "IRL, with rewards for the demonstrated targets only; the base is the maximum-margin program. Changes are "
        "paired with the base on the same seeds and demonstrations, ± half of the 95% interval (Student's t); bold if "
        "the interval excludes zero.",
    ),
    "regularisation": (
        "Two regularisations: of inverse RL and of the regressor",
        "By the reward alone; the base is ELM-IRL with λ = 10. Changes are paired with the base on the same seeds, "
        "± half of the 95% interval (Student's t); bold if the interval excludes zero. Rank as above.",
    ),
    "many-rooms": (
        "Memory and adaptation, trained on few and many rooms",
        "RL with the hand-made reward and ten training targets for each room; the base is 6 rooms. The unseen rooms of "
        "Task III are the same in all rows. Changes are paired with the base on the same seeds, ± half of the 95% "
        "interval (Student's t); bold if the interval excludes zero.",
    ),
    "unseen": (
        "The mapping agent trained on few and many rooms, with and without random convolutions",
        "The base is 600 generated rooms. The number of views is the same in all rows, and so are the unseen rooms. "
        "Changes are paired with the base on the same seeds, ± half of the 95% interval (Student's t); bold if the "
        "interval excludes zero.",
    ),
}
"""Title and introduction of each study of a base and its variants, by the name of its piece."""


def write_study(out: Path, studies: Mapping[str, Sequence[AblationRow]]) -> Path:
    """Write `report.html` and `report.md` of a study from the runs in its folder; joblib's context selects who draws.

    Args:
        out: folder of the study.
        studies: rows by the names in `STUDY_TEXTS`; those left out are not shown.

    Returns:
        The Markdown file.
    """
    rows = {name: studies.get(name, ()) for name in STUDY_TEXTS}
    runs = {name: RunFolder(out / name) for name in RUN_TITLES if list((out / name).glob("results-*.json"))}
    text = ["# RELM-IRL: every table and figure, measured", "", CLAIM, ""]
    for name, folder in runs.items():
        text += _readable(_findings, folder, RUN_TITLES[name])
    text += [
        "These sentences depend on the intervals only: *ahead of* and *behind* mean that the 95% interval of the "
        "difference over seeds excludes zero. Seeds are 0, 1, …; none is left out.",
        "",
    ]
    for name, section in zip(runs, _sections(list(runs.values()), out), strict=True):
        text += [f"## {RUN_TITLES[name]}", "", *section]
    text += _readable(_regressor, out)
    for name, of_study in rows.items():
        text += _study(out, name, of_study)
    text += _contributions(out, rows["many-rooms"])
    text += _rooms_figure(out, [*rows["unseen"], *rows["many-rooms"]])
    text += _readable(_stability, out)
    text += _readable(search_section, out / "map")
    text += _readable(maps_section, out / "map-vizdoom")
    text += ["Runs share learned rewards; the time to learn them is counted in the first run only.", ""]
    if times := times_table(out / "tables" / "times.csv"):
        text += ["## Time", "", "Of all calls of the command, with what was repeated.", "", *times, ""]
    for name, folder in runs.items():
        text += [f"## Hardware and configuration: {RUN_TITLES[name]}", "", *_readable(circumstances, folder, "###")]
    return write_page(text, out)


def _sections(runs: Sequence[RunFolder], out: Path) -> list[list[str]]:
    """The results of each run. Drawing the figures takes most of the time of a report, so joblib's workers share it."""
    sections = partial(_readable, partial(run_sections, worded=False))
    return list(Parallel()(delayed(sections)(folder, out, "###") for folder in runs))


def _readable(section: Callable[P, list[str]], *arguments: P.args, **named: P.kwargs) -> list[str]:
    """A section of the report; one line if its data is missing or damaged."""
    try:
        return section(*arguments, **named)
    except InputError as error:
        return [f"Not shown: {error}", ""]


def _findings(folder: RunFolder, title: str) -> list[str]:
    """The paired differences of a run, in words."""
    paired = differences(load_all_results(folder))
    return [f"**{title}.** {tally(paired)}", "", *(f"- {line}" for line in statement(paired)), ""]


def tally(paired: Sequence[PairedDifference]) -> str:
    """Count the significant differences.

    Args:
        paired: the differences.

    Returns:
        One sentence; empty without differences.
    """
    if not paired:
        return ""
    ahead, behind = (sum(d.verdict == verdict for d in paired) for verdict in ("ahead of", "behind"))
    return (
        f"Of {len(paired)} comparisons of RELM-IRL with other methods (SR and SPL of each task, {paired[0].seeds} "
        f"seeds), it is ahead in {ahead}, behind in {behind}, and {len(paired) - ahead - behind} are not decided."
    )


def _regressor(out: Path) -> list[str]:
    """Figures 7 to 10."""
    if not (out / "elm" / "choices.csv").exists():
        return []
    accuracy = read_numbers(out / "elm" / "accuracy.csv", ["seed", "elm_r2", "relm_r2", "kept"])
    settings = out / "elm" / "settings.json"
    elm = config_from_dict(read_fields(settings).get("config", {}), str(settings)).elm
    return [
        "## What the extreme learning machine learns (Figures 7 to 10)",
        "",
        f"One target in six is held out with all its pairs; at most {elm.pairs} pairs are fitted, with "
        f"{elm.hidden} neurons before selection; {len(accuracy['seed'])} seeds. The paper neither says "
        "how its test set was drawn nor defines its accuracy; R² is 1 for a perfect prediction.",
        "",
        "![R² against the number of hidden neurons](elm/figure-7.png)",
        "",
        "*Accuracy against hidden neurons, without selection (the paper's Figure 7)*",
        "",
        "![Predicted against true reward weights](elm/figure-8-10.png)",
        "",
        "*Predicted against true weights on held-out targets, before and after regularisation (Figures 8 and 10)*",
        "",
        "![Leave-one-out error](elm/figure-9.png)",
        "",
        "*Leave-one-out error against neurons, one curve for each seed, minima marked (Figure 9; 593 in the paper)*",
        "",
        "| Seed | R², all neurons | R², regularised | Neurons kept |",
        "|---|---:|---:|---:|",
        *(
            f"| {seed:.0f} | {plain:.3f} | {regularised:.3f} | {kept:.0f} |"
            for seed, plain, regularised, kept in zip(*accuracy.values(), strict=True)
        ),
        "",
        "Pairs of one target have the same weights. Leaving out one pair at a time, as in the paper, does not estimate "
        "the error for new targets; leaving out all pairs of a target does.",
        "",
        *selections_table(out / "elm" / "choices.csv"),
        "",
    ]


def _study(out: Path, name: str, rows: Sequence[AblationRow]) -> list[str]:
    """The tables of a base and its variants."""
    if not rows:
        return []
    write_table(out / "tables" / f"{name}.csv", ablation_columns(rows))
    title, introduction = STUDY_TEXTS[name]
    return [f"## {title}", "", introduction, "", *_tables_by_agent(rows)]


def _contributions(out: Path, rows: Sequence[AblationRow]) -> list[str]:
    """What memory and adaptation add."""
    table = contributions(rows)
    if not table["part"]:
        return []
    write_table(out / "tables" / "contributions.csv", table)
    return [
        "Differences between agents trained on the same rooms, paired over seeds:",
        "",
        *contributions_table(table),
        "",
    ]


def _rooms_figure(out: Path, rows: Sequence[AblationRow]) -> list[str]:
    """The figure over the number of training rooms."""
    if not rows:
        return []
    table = ablation_columns(rows)
    save_figure(rooms_figure(unseen_by_rooms(table)), out / "rooms.png", table)
    return [
        "![Success in unseen rooms against the number of training rooms](rooms.png)",
        "",
        "*Task III against the number of training rooms; bars are 95% intervals over seeds (Student's t). The mapping "
        "agent learns from walks, the others from episodes with the hand-made reward.*",
        "",
    ]


def _tables_by_agent(rows: Sequence[AblationRow]) -> list[str]:
    """A section for each agent with tables of SR and SPL."""
    text = []
    for agent in dict.fromkeys(row.agent for row in rows):
        of_agent = [row for row in rows if row.agent == agent]
        text += [f"### {AGENT_TITLES[agent]}", ""]
        if len({(row.frames, row.seeds) for row in of_agent}) == 1:
            text += [f"{of_agent[0].frames:,} training frames, {of_agent[0].seeds} seeds.", ""]
        text += [ablation_table(of_agent, "sr"), "", ablation_table(of_agent, "spl"), ""]
    return text


def _stability(out: Path) -> list[str]:
    """The stability of reward weights."""
    path = out / "stability" / "stability.csv"
    if not path.exists():
        return []
    return [
        "## Stability of reward weights",
        "",
        "Relative change of w for single trajectories in one room, if the start moves by one step and if every margin "
        "changes by a thousandth, and the share of the linear program's objective that the solutions reach.",
        "",
        *stability_table(path),
        "",
    ]
