"""What a run found, in sentences from intervals."""

import numpy as np
import pytest
from scipy import stats

from relm_irl_jax.report.finding import finding, success
from relm_irl_jax.results import OWN, ResultRow, Results


def row(method, sr, *, seed=0, room_type="bathroom", agent="siamese", episodes=1000):
    named = {"method": method, "agent": agent, "scene": f"{room_type}-0", "room_type": room_type}
    return ResultRow(**named, seed=seed, episodes=episodes, sr=sr, ple=10.0, spl=sr / 2)


def sentences(*rows, task="II"):
    return finding(Results(task, 100, "rooms", tuple(rows)))


def test_methods_are_ordered_by_their_intervals():
    shares = {"random": 0.14, "rl": 0.11, "irl": 0.15, "elm-irl": 0.56, "relm-irl": 0.72}
    assert sentences(*(row(method, share) for method, share in shares.items()))[0] == (
        "RELM-IRL finds 0.72 of the new targets, more than RL (0.11), IRL (0.15) and ELM-IRL (0.56). "
        "RL and IRL cannot be told from Random (0.14)."
    )


def test_what_is_behind_or_alike_is_said_too():
    shares = {"random": 0.14, "rl": 0.05, "irl": 0.70, "elm-irl": 0.51, "relm-irl": 0.50}
    assert sentences(*(row(method, share) for method, share in shares.items()), task="I")[0] == (
        "RELM-IRL finds 0.50 of the trained targets, more than RL (0.05), fewer than IRL (0.70); it cannot be told "
        "from ELM-IRL (0.51). RL finds fewer than Random (0.14)."
    )


def test_without_relm_irl_the_best_method_is_the_subject():
    assert sentences(row("random", 0.1), row("rl", 0.2), row("irl", 0.3), task="III")[0] == (
        "IRL finds 0.30 of the targets in unseen scenes, more than RL (0.20). "
        "Random finds fewer than any of them (0.10)."
    )
    assert sentences(row("random", 0.1)) == []


def test_other_agents_are_listed_and_not_compared():
    rows = (row("relm-irl", 0.3), row("metric relm-irl", 0.9, agent="metric"), row("mine", 0.5, agent=OWN))
    first, second, third = sentences(*rows)
    assert first == "RELM-IRL finds 0.30 of the new targets."
    assert second == "Beside it: RELM-IRL, metric agent, 0.90; mine, 0.50."
    assert "episodes of one training" in third


def test_with_several_seeds_the_intervals_are_over_seeds():
    relm = [row("relm-irl", sr, seed=n) for n, sr in enumerate((0.5, 0.7, 0.9))]
    rl = [row("rl", sr, seed=n) for n, sr in enumerate((0.4, 0.5, 0.6))]
    first, last = sentences(*relm, *rl)
    assert first == "RELM-IRL finds 0.70 of the new targets; it cannot be told from RL (0.50)."
    assert last == "Told apart by 95% intervals over 3 seeds."


def test_the_interval_over_episodes_covers_the_true_share():
    """In 95% of 500 simulated evaluations, of which the standard error is one percent."""
    generator, true, covered = np.random.default_rng(0), {"bathroom": 0.3, "bedroom": 0.9}, []
    for _ in range(500):
        rows = [row("rl", generator.binomial(50, p) / 50, room_type=name, episodes=50) for name, p in true.items()]
        value = success(rows, "rl")
        covered.append(abs(value.mean - 0.6) <= value.half_width)
    assert np.mean(covered) == pytest.approx(0.95, abs=0.03)


def test_the_interval_of_one_scene_is_agresti_and_coulls():
    value = success([row("rl", 0.2, episodes=100)], "rl")
    p = 22 / 104
    assert value.half_width == pytest.approx(stats.norm.ppf(0.975) * np.sqrt(p * (1 - p) / 104))
