"""What a run found on a task, in sentences that follow from its intervals."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from relm_irl_jax.report.comparison import OURS
from relm_irl_jax.report.intervals import LEVEL, MeanInterval
from relm_irl_jax.report.names import TARGETS_OF_TASK, listed, method_name
from relm_irl_jax.report.tables import MEAN, columns_of, interval_of, methods_of, seeds_of
from relm_irl_jax.results import BESIDE_NAMES, OWN, ResultRow, Results

RANDOM = "random"


def finding(results: Results) -> list[str]:
    """Say which share of the targets the methods find, and which of them can be told apart.

    Two methods can be told apart if their 95% intervals do not overlap. With several seeds these are intervals over
    seeds, with one seed over episodes.

    Args:
        results: the metrics of a task.

    Returns:
        Sentences; none if no method but Random was evaluated.
    """
    rows = results.rows
    found = {method: success(rows, method) for method in methods_of(rows)}
    own = {row.method for row in rows if row.agent == OWN}
    compared = {method: value for method, value in found.items() if method not in (*BESIDE_NAMES, *own)}
    trained = {method: value for method, value in compared.items() if method != RANDOM}
    beside = [f"{method_name(method)}, {found[method].mean:.2f}" for method in found if method in (*BESIDE_NAMES, *own)]
    sentences = []
    if trained:
        subject = OURS if OURS in trained else max(trained, key=lambda method: trained[method].mean)
        sentences.append(_sentence(subject, trained, compared.get(RANDOM), TARGETS_OF_TASK[results.task]))
    if beside and sentences:
        sentences.append(f"Beside it: {'; '.join(beside)}.")
    if sentences:
        seeds = len(seeds_of(rows))
        sentences.append(
            f"Told apart by 95% intervals over {seeds} seeds."
            if seeds > 1
            else "Told apart by 95% intervals over the episodes of one training; other seeds may differ by more."
        )
    return sentences


def success(rows: Sequence[ResultRow], method: str) -> MeanInterval:
    """Success rate of a method, the mean over room types, with its 95% interval over seeds, or over episodes of one.

    Args:
        rows: the rows.
        method: the method.

    Returns:
        The mean and its interval. Over episodes, the interval is normal, from the variances of binomial shares with two
        successes and two failures added (Agresti and Coull, 1998).
    """
    value = interval_of(rows, method, "sr", MEAN)
    of_method = [row for row in rows if row.method == method]
    if len(seeds_of(of_method)) > 1:
        return value
    variances = []
    for room_type in columns_of(of_method)[:-1]:
        scenes = [row for row in of_method if row.room_type == room_type]
        shares = [(row.sr * row.episodes + 2) / (row.episodes + 4) for row in scenes]
        of_scenes = [p * (1 - p) / (row.episodes + 4) for p, row in zip(shares, scenes, strict=True)]
        variances.append(sum(of_scenes) / len(scenes) ** 2)
    error = np.sqrt(sum(variances)) / len(variances)
    return MeanInterval(value.mean, float(stats.norm.ppf((1 + LEVEL) / 2) * error))


def _sentence(subject: str, trained: Mapping[str, MeanInterval], random: MeanInterval | None, targets: str) -> str:
    """What a method finds, compared with the other methods and with Random."""
    ours = trained[subject]
    groups: dict[int, list[str]] = {1: [], -1: [], 0: []}
    for method, value in trained.items():
        if method != subject:
            groups[_order(ours, value)].append(f"{method_name(method)} ({value.mean:.2f})")
    text = f"{method_name(subject)} finds {ours.mean:.2f} of {targets}"
    text += "".join(
        f", {words} {listed(groups[n])}" for n, words in ((1, "more than"), (-1, "fewer than")) if groups[n]
    )
    if groups[0]:
        text += f"; it cannot be told from {listed(groups[0])}"
    if random is None:
        return f"{text}."
    like = [method_name(method) for method, value in trained.items() if _order(value, random) == 0]
    below = [method_name(method) for method, value in trained.items() if _order(value, random) < 0]
    against = [f"{listed(like)} cannot be told from Random"] if like else []
    against += [f"{listed(below)} {'find' if len(below) > 1 else 'finds'} fewer than Random"] if below else []
    return f"{text}. {listed(against) or 'Random finds fewer than any of them'} ({random.mean:.2f})."


def _order(first: MeanInterval, second: MeanInterval) -> int:
    """1 if the first interval lies above the second, −1 if below, 0 if they overlap."""
    apart = abs(first.mean - second.mean) > first.half_width + second.half_width
    return int(np.sign(first.mean - second.mean)) if apart else 0
