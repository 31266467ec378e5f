"""The page of the whole study: both agents' tables and figures, the machine's figures, and the ablations."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from relm_irl_jax.report.comparison import Difference, differences, statement
from relm_irl_jax.report.curves import thousands
from relm_irl_jax.report.page import circumstances, run_sections, write_page
from relm_irl_jax.report.tables import Cell
from relm_irl_jax.runs import find_run, read_all_results, read_table, write_table
from relm_irl_jax.studies.ablation import Measured, ablation_columns, ablation_table

CLAIM = (
    "The paper claims that rewards predicted by a regularised extreme learning machine (RELM-IRL) navigate better than "
    "a hand-made reward (RL) and than inverse reinforcement learning alone (IRL): a higher success weighted by path "
    "length (SPL) on all three tasks, and a higher success rate (SR) on new targets and in unseen scenes."
)

RUN_TITLES = {
    "siamese": "The paper's agent: the siamese actor-critic",
    "metric": "The metric agent: distances between views, not the paper's",
    "metric-open": "The metric agent, open: targets kept for evaluation may be its goals, too",
    "metric-no-hindsight": "The metric agent without hindsight: only predicted rewards imagine targets",
    "vizdoom": "The metric agent in scenes recorded from ViZDoom",
}
"""Runs of a study on all tasks, by the names of their folders."""


def write_study(out: Path, lines: Sequence[Measured]) -> Path:
    """Write `report.html` and `report.md` of a study from the runs that its folder holds.

    Args:
        out: folder of the study.
        lines: the ablations' lines.

    Returns:
        The Markdown file.
    """
    runs = [(name, *find_run(out / name)) for name in RUN_TITLES if list((out / name).glob("results-*.json"))]
    text = ["# RELM-IRL: every table and figure, measured", "", CLAIM, ""]
    for name, folder, _ in runs:
        found = differences(read_all_results(folder))
        text += [f"**{RUN_TITLES[name]}.** {tally(found)}", "", *(f"- {line}" for line in statement(found)), ""]
    text += [
        "These sentences are worded by the intervals alone: *ahead of* and *behind* where the 95% interval of the "
        "difference over seeds excludes zero. Seeds are 0, 1, …; none is left out.",
        "",
    ]
    for name, folder, config in runs:
        text += [f"## {RUN_TITLES[name]}", "", *run_sections(folder, config, out, "###", worded=False)]
    text += [*_machine_figures(out), *_ablations(out, lines), *_stability(out)]
    text += ["Rewards that runs share are learned once; their seconds are counted in the run that learned them.", ""]
    for name, folder, config in runs:
        text += [f"## Circumstances: {RUN_TITLES[name]}", "", *circumstances(folder, config, "###")]
    return write_page(text, out)


def tally(found: Sequence[Difference]) -> str:
    """Count what the differences say.

    Args:
        found: the differences.

    Returns:
        One sentence; empty without differences.
    """
    if not found:
        return ""
    ahead, behind = (sum(d.verdict == verdict for d in found) for verdict in ("ahead of", "behind"))
    return (
        f"Of {len(found)} comparisons of RELM-IRL with other methods (SR and SPL of each task, {found[0].seeds} "
        f"seeds), it is ahead in {ahead}, behind in {behind}, and {len(found) - ahead - behind} are not decided."
    )


def _machine_figures(out: Path) -> list[str]:
    if not (out / "elm" / "choices.csv").exists():
        return []
    accuracy = read_table(out / "elm" / "accuracy.csv")
    config = json.loads((out / "elm" / "settings.json").read_text())["config"]
    return [
        "## What the extreme learning machine learns (Figures 7 to 10)",
        "",
        f"One target in six is held out with all its pairs; at most {config['elm']['pairs']} pairs are fitted, "
        f"{config['elm']['hidden']} neurons before selection; {len(accuracy['seed'])} seeds. The paper neither says "
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
        "*Leave-one-out error against neurons, one curve a seed, minima marked (Figure 9; the paper's lies at 593)*",
        "",
        "| Seed | R², all neurons | R², regularised | Neurons kept |",
        "|---|---:|---:|---:|",
        *(
            f"| {seed} | {float(plain):.3f} | {float(regularised):.3f} | {float(kept):.0f} |"
            for seed, plain, regularised, kept in zip(*accuracy.values(), strict=True)
        ),
        "",
        "Pairs of one target have the same weights, so that leaving out one pair at a time, as in the paper, does not "
        "say what a machine is worth for new targets; leaving out all pairs of a target does.",
        "",
        "| Chosen by | R² on held-out targets | Neurons kept |",
        "|---|---:|---:|",
        *(
            f"| {row['choice']} | {Cell(float(row['accuracy']), float(row['accuracy_half_width']))} "
            f"| {thousands(Cell(float(row['kept']), float(row['kept_half_width'])))} |"
            for row in _rows(read_table(out / "elm" / "choices.csv"))
        ),
        "",
    ]


def _rows(table: Mapping[str, list[str]]) -> list[dict[str, str]]:
    return [dict(zip(table, values, strict=True)) for values in zip(*table.values(), strict=True)]


def _ablations(out: Path, lines: Sequence[Measured]) -> list[str]:
    if not lines:
        return []
    (out / "tables").mkdir(parents=True, exist_ok=True)
    write_table(out / "tables" / "ablation.csv", ablation_columns(lines))
    text = [
        "## What the paper leaves open",
        "",
        "RELM-IRL with one setting changed, and fewer frames and episodes than in the tables above. Changes are paired "
        "with the base on the same seeds, ± half of the 95% interval (Student's t), each on its own; bold where it "
        "excludes zero, which one in twenty does by chance. Rank: where the reward predicted from the views of start "
        "and target places a new target among the states of its scene, in the median over targets; 1 is best.",
        "",
    ]
    for agent in dict.fromkeys(line.agent for line in lines):
        own = [line for line in lines if line.agent == agent]
        text += [f"### {RUN_TITLES[agent]}", "", f"{own[0].frames:,} training frames, {own[0].seeds} seeds.", ""]
        text += [ablation_table(own, "sr"), "", ablation_table(own, "spl"), ""]
    return text


def _stability(out: Path) -> list[str]:
    if not (out / "stability" / "stability.csv").exists():
        return []
    table = read_table(out / "stability" / "stability.csv")
    columns = list(table)
    return [
        "## How far reward weights jump",
        "",
        "Relative movement of w over single trajectories in one room, when the start moves one step and when every "
        "margin moves by a thousandth, and the share of the linear program's objective that is kept.",
        "",
        "| " + " | ".join(name.replace("_", " ") for name in columns) + " |",
        "|---|---|" + "---:|" * (len(columns) - 2),
        *("| " + " | ".join(row) + " |" for row in zip(*table.values(), strict=True)),
        "",
    ]
