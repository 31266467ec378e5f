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
    columns = ["accuracy", "accuracy_half_width", "kept", "kept_half_width"]
    rows = zip(*(column.tolist() for column in read_numbers(path, columns).values()), strict=True)
    return [
        "| Selection | R² on held-out targets | Neurons kept |",
        "|---|---:|---:|",
        *(
            f"| {choice} | {MeanInterval(accuracy, accuracy_error)} | {MeanInterval(kept, kept_error):,.0f} |"
            for choice, (accuracy, accuracy_error, kept, kept_error) in zip(
                read_table(path)["choice"], rows, strict=True
            )
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
