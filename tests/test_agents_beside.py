"""Other agents in a run's tables."""

import json
from dataclasses import replace
from unittest.mock import Mock

import pytest
from command import EXPERIMENT, QUICK, relm_irl
from tiny import two_rooms

from relm_irl_jax.config import MAP_EPISODES_BESIDE, Config, config_from_dict, config_to_dict, fingerprint
from relm_irl_jax.errors import InputError
from relm_irl_jax.results import BESIDE_NAMES
from relm_irl_jax.rewards.learned import LearnedRewards
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.stages.agents_beside import learned_once, rows_beside, runs_beside
from relm_irl_jax.stages.own_policies import check_name
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import draw_split


def test_all_agents_are_meant_by_default_and_where_it_makes_sense():
    config = Config().resolved()
    assert (config.agent, config.beside) == ("siamese", ("metric", "map"))
    for other in (Config(agent="siamese"), Config(scenes="folder"), Config(methods=("rl",)), Config(agent="metric")):
        assert other.resolved().beside == ()
    assert config_from_dict(config_to_dict(config), "test").resolved() == config


def test_agents_beside_do_not_change_what_is_trained():
    assert fingerprint(Config().resolved()) == fingerprint(Config(agent="siamese").resolved())


def test_the_runs_beside_are_of_the_same_scenes_targets_and_seeds(tmp_path):
    config = replace(Config(frames=1000, seeds=3, run=tmp_path).resolved(), task="III")
    runs = runs_beside(config, RunFolder(tmp_path))
    assert runs["metric"].run == tmp_path / "metric"
    assert runs["metric"].methods == ("relm-irl",)
    assert runs["map"].methods == ("rl",)
    assert runs["map"].evaluation.episodes == MAP_EPISODES_BESIDE < config.evaluation.episodes
    for agent, run in runs.items():
        same = replace(
            run, agent=config.agent, beside=config.beside, methods=config.methods, evaluation=config.evaluation
        )
        assert replace(same, run=config.run) == config, agent


def test_rewards_are_learned_once_for_each_seed():
    calls, rewards = [], [Mock(spec=LearnedRewards) for _ in range(2)]

    def learn(config, scenes, split, seed):
        calls.append(seed)
        return rewards[seed]

    learn = learned_once(learn)
    split = draw_split(two_rooms(), (), TaskSettings(training_targets=4, new_targets_per_scene=2), 0)
    assert [rewards.index(learn(Config(), (), split, seed)) for seed in (0, 1, 0, 1)] == [0, 1, 0, 1]
    assert calls == [0, 1]


def test_a_policy_cannot_take_the_name_of_an_agent_beside():
    for name in BESIDE_NAMES:
        with pytest.raises(InputError, match="is a method of this package"):
            check_name(name)


def test_results_that_are_missing_are_one_sentence(tmp_path):
    with pytest.raises(InputError, match=r"metric.*cannot be read"):
        rows_beside(Config().resolved(), RunFolder(tmp_path), "II")


@pytest.mark.slow
def test_the_default_run_has_all_agents_in_one_table(tmp_path):
    """Another task is then evaluated with all of them, too."""
    quick = [option for option in QUICK if option not in ("--agent", "siamese")]
    quick += ["--evaluation.episodes", "10"]
    code, out, err = relm_irl(tmp_path, "train", "--config", str(EXPERIMENT), "--run", "run", *quick)
    assert code == 0, err
    assert "RELM-IRL finds" in out
    code, _, err = relm_irl(tmp_path, "evaluate", "run", "--task", "I")
    assert code == 0, err
    for task in ("II", "I"):
        rows = json.loads((tmp_path / "run" / f"results-{task}.json").read_text())["rows"]
        agents = {row["method"]: row["agent"] for row in rows}
        assert agents["metric relm-irl"] == "metric"
        assert agents["map rl"] == "map"
        assert set(agents.values()) == {"random", "siamese", "metric", "map"}
        alone = json.loads((tmp_path / "run" / "metric" / f"results-{task}.json").read_text())["rows"]
        assert [row | {"method": "relm-irl"} for row in rows if row["method"] == "metric relm-irl"] == alone
    page = (tmp_path / "run" / "report.html").read_text()
    assert "<code>metric/report.html</code>" in page
    assert "Mapping agent, no learned reward" in page
