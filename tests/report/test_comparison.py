"""Paired differences, and the sentences that they allow, on numbers worked out by hand."""

from run_folders import results

from relm_irl_jax.report.comparison import difference_columns, difference_table, differences, statement

APART = {"rl": [0.1, 0.2, 0.3], "irl": [0.5, 0.3, 0.4], "relm-irl": [0.8, 0.9, 1.0]}


def test_the_statement_follows_the_intervals():
    """RELM−RL is 0.7 on every seed; RELM−IRL 0.3, 0.6, 0.6: mean 0.5, half width 0.43."""
    found = differences({"II": results("II", APART)})
    assert [d.verdict for d in found] == ["ahead of"] * 4
    assert statement(found) == [
        "Task II: RELM-IRL is ahead of RL (SR +0.700 ± 0.000, SPL +0.700 ± 0.000); "
        "ahead of IRL (SR +0.500 ± 0.430, SPL +0.500 ± 0.430)."
    ]
    swapped = {"rl": APART["relm-irl"], "relm-irl": APART["rl"]}
    assert "behind RL (SR −0.700" in statement(differences({"I": results("I", swapped)}))[0]
    level = {"rl": [0.1, 0.9, 0.5], "relm-irl": [0.9, 0.1, 0.5]}
    assert "not distinguishable from RL" in statement(differences({"I": results("I", level)}))[0]
    assert len(difference_columns(found)["mean"]) == 4
    assert "**+0.700 ± 0.000**" in difference_table(found)


def test_one_seed_decides_nothing():
    found = differences({"I": results("I", {"rl": [0.1], "relm-irl": [0.9]})})
    assert found == []
    assert statement(found) == []


def test_nothing_is_compared_without_both_methods():
    assert differences({"I": results("I", {"rl": [0.1, 0.2], "random": [0.9, 0.8]})}) == []
