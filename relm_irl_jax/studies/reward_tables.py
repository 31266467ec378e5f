"""Tables of the studies of rewards alone: what the regressor learns, and how stable the weights are."""

from pathlib import Path

from relm_irl_jax.files import read_numbers, read_table
from relm_irl_jax.report.intervals import MeanInterval


def selections_table(path: Path) -> list[str]:
    """Accuracy of several methods to select neurons.

    Args:
        path: `choices.csv` of the study.

    Returns:
        Lines of a Markdown table.
    """
    names = ("accuracy", "accuracy_in_unseen_scenes", "kept")
    columns = read_numbers(path, [column for name in names for column in (name, f"{name}_half_width")])
    intervals = [map(MeanInterval, columns[name], columns[f"{name}_half_width"]) for name in names]
    return [
        "| Selection | R² on held-out targets | R² in unseen scenes | Neurons kept |",
        "|---|---:|---:|---:|",
        *(
            f"| {choice} | {accuracy} | {elsewhere} | {kept:,.0f} |"
            for choice, accuracy, elsewhere, kept in zip(read_table(path)["choice"], *intervals, strict=True)
        ),
    ]


def stability_table(path: Path) -> list[str]:
    """Relative changes of reward weights under each form and regulariser of the maximum-margin problem.

    Args:
        path: `stability.csv` of the study.

    Returns:
        Lines of a Markdown table.
    """
    table = read_table(path)
    return [
        "| " + " | ".join(name.replace("_", " ") for name in table) + " |",
        "|---|---|" + "---:|" * (len(table) - 2),
        *(
            "| " + " | ".join((form, variant, *(f"{float(number):.3g}" for number in numbers))) + " |"
            for form, variant, *numbers in zip(*table.values(), strict=True)
        ),
    ]
