"""The Python interface: own rewards, agents and policies, on the targets and episodes of the tables."""

import itertools
from dataclasses import dataclass, field, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from tiny import SMALL

import relm_irl_jax as relm
from relm_irl_jax.agents.random_agent import RandomPolicy
from relm_irl_jax.agents.training import LearningCurve
from relm_irl_jax.api.compare import Comparison
from relm_irl_jax.api.scenes import config_of
from relm_irl_jax.batch_policies import Protocol, evaluate_batch_policy
from relm_irl_jax.config import Config, overlay
from relm_irl_jax.env import Transition
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import evaluate
from relm_irl_jax.irl import relative_features
from relm_irl_jax.irl import reward as reward_of_states
from relm_irl_jax.tasks import draw_split
from relm_irl_jax.types import NO_MEMORY
from relm_irl_jax.world import build_targets, build_world

CONFIG = overlay(Config(), {"tasks": {"training_targets": 6, "new_targets_per_scene": 2, "cap": 12}}, "test")
CONFIG = overlay(CONFIG, {"evaluation": {"episodes": 40}}, "test")


RAW = {"reward": "irl", "config": overlay(CONFIG, {"irl": {"dimension": 0, "sub_trajectories": False}}, "test")}
"""Weights of the features themselves, for the training targets alone."""


def one_hot_rooms():
    """Two rooms whose features are one-hot over the states of both."""
    sizes, eye = (16, 24), np.eye(40, dtype=np.float32)
    return [
        grid_scene(2, 2, name="bathroom-0", features=eye[: sizes[0]]),
        grid_scene(3, 2, name="bedroom-0", features=eye[sizes[0] :]),
    ]


@dataclass(frozen=True)
class NoAgent:
    """An agent that keeps the problem it was given and acts at random."""

    problems: list = field(default_factory=list)
    name: str = "no-agent"
    requires: frozenset = frozenset({"features"})

    def train(self, key, problem, log):
        self.problems.append(problem)
        return {}, LearningCurve(*(np.linspace(0, 1, 3) for _ in range(6)))

    def policy(self, parameters, world, targets):
        return RandomPolicy()


def distance_reward(t):
    return 10.0 * t.arrived - 0.5 * t.collided - jnp.abs(t.next_view - t.target).sum() - (t.action == 2)


def test_an_own_agent_is_paid_the_own_reward_for_training_targets_alone():
    rooms, agent = one_hot_rooms(), NoAgent()
    trained = relm.train(rooms, agent, distance_reward, 64, seeds=2, config=CONFIG)
    assert trained.name == "distance_reward"
    for seed, problem in enumerate(agent.problems):
        split = draw_split(rooms, [], CONFIG.tasks, seed)
        assert problem.targets.state.tolist() == [t.state + 16 * t.scene for t in split.training]
        target, paid = int(problem.targets.state[0]), jax.jit(lambda *parts, reward=problem.reward: reward(*parts))
        for state, action, after in ((0, 2, 0), (5, 1, target), (3, 0, 9)):
            moved = Transition(
                *(jnp.int32(n) for n in (state, action, after, 0, state)),
                terminated=jnp.bool_(after == target),
                truncated=jnp.bool_(False),
                collided=jnp.bool_(state == after),
            )
            expected = 10.0 * (after == target) - 0.5 * (state == after) - 2.0 * (after != target) - (action == 2)
            assert float(paid(moved, problem.world, problem.targets)) == expected
    results = relm.evaluate(trained, "II")
    assert {(row.method, row.agent, row.seed) for row in results.rows} == {
        ("distance_reward", "no-agent", 0),
        ("distance_reward", "no-agent", 1),
    }


@pytest.mark.slow
def test_an_agent_of_the_package_trains_on_an_own_reward():
    config = replace(CONFIG, siamese=SMALL)
    trained = relm.train(one_hot_rooms(), "siamese", distance_reward, 256, config=config)
    assert trained.curve["frames"].tolist() == [256.0]
    assert -13 < trained.curve["reward"][0] < 10
    assert len(trained.plot().axes) == 3


class Oracle:
    """Takes a shortest path: features are one-hot, so that it knows the states."""

    def __init__(self, rooms):
        self.scenes, self.agents = rooms, []

    def reset(self, agents):
        self.agents.append(agents)

    def __call__(self, observation):
        states, targets = (observation[name].argmax(-1) for name in ("view", "target"))
        actions = []
        for state, target in zip(states, targets, strict=True):
            scene, offset = (self.scenes[0], 0) if target < 16 else (self.scenes[1], 16)
            after = np.where(scene.graph[state - offset] < 0, state - offset, scene.graph[state - offset])
            actions.append(scene.shortest_path_distance[after, target - offset].argmin())
        return actions


def test_a_perfect_policy_and_one_that_stays_get_the_metrics_that_they_must():
    rooms = one_hot_rooms()
    oracle = Oracle(rooms)
    perfect = relm.evaluate(oracle, "I", scenes=rooms, config=CONFIG, name="oracle")
    turning = relm.evaluate(lambda seen: np.zeros(len(seen["view"]), int), "I", scenes=rooms, config=CONFIG)
    assert oracle.agents == [80]
    assert {(row.sr, row.spl, row.ple, row.episodes) for row in perfect.rows} == {(1.0, 1.0, 0.0, 40)}
    assert {row.method for row in turning.rows} == {"lambda"}
    assert all(row.sr < 1 for row in turning.rows)
    table = relm.compare(perfect, turning)
    assert "oracle" in str(table)
    assert "| lambda |" in table._repr_markdown_()


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Modulo:
    """In JAX: the action is the state's number, modulo 4."""

    def init(self, shape):
        return NO_MEMORY

    def act(self, key, memory, observation, target):
        return memory, observation.view % 4


@pytest.mark.parametrize("memory", [2**27, 40 * 4 * 2 * 7])
def test_own_policies_run_the_episodes_of_all_others(monkeypatch, memory):
    monkeypatch.setattr("relm_irl_jax.batch_policies.OBSERVATION_BYTES", memory)
    rooms = one_hot_rooms()
    chosen = draw_split(rooms, [], CONFIG.tasks, 0).new
    world, targets = build_world(rooms), build_targets(rooms, chosen)
    key, observed = jax.random.key(3), [room.features for room in rooms]
    ours = evaluate(key, Modulo(), world, targets, 9, 20)
    theirs = evaluate_batch_policy(
        key, lambda seen: seen["view"].argmax(1) % 4, world, targets, observed, Protocol(9, 20)
    )
    for name in ("target", "start", "length", "shortest", "success"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), err_msg=name)


def test_the_last_views_come_first():
    rooms, seen = one_hot_rooms()[:1], []
    world, targets = build_world(rooms), build_targets(rooms, draw_split(rooms, [], CONFIG.tasks, 0).training[:1])

    def turn(observation):
        seen.append(observation["view"].argmax(-1))
        return np.ones(len(seen[-1]), int)

    evaluate_batch_policy(jax.random.key(0), turn, world, targets, [rooms[0].features], Protocol(3, 5, 2))
    assert (seen[0][:, 0] == seen[0][:, 1]).all()
    for before, after in itertools.pairwise(seen):
        assert (after[:, 1] == before[:, 0]).all()


@pytest.mark.parametrize("actions", [[0.5] * 80, [4] * 80, [0] * 79, None])
def test_a_policy_that_returns_no_actions_is_refused(actions):
    with pytest.raises(InputError, match="policy: returned"):
        relm.evaluate(lambda seen: actions, "I", scenes=one_hot_rooms(), config=CONFIG)


def test_a_trained_agent_is_evaluated_on_its_own_seeds():
    trained = relm.train(one_hot_rooms(), NoAgent(), "rl", 64, seeds=[1], config=CONFIG)
    with pytest.raises(InputError, match="was not trained with seed 0"):
        relm.evaluate(trained, "II", seeds=1)
    with pytest.raises(InputError, match="scenes: a trained agent"):
        relm.evaluate(trained, "II", scenes="rooms")
    with pytest.raises(InputError, match="unseen: Task III needs scenes"):
        relm.evaluate(trained, "III")
    unseen = replace(one_hot_rooms()[1], name="bedroom-7")
    assert {row.scene for row in relm.evaluate(trained, "III", unseen=[unseen], episodes=3).rows} == {"bedroom-7"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"reward": "rml"}, "give one of bc, rl, constant, irl"),
        ({"agent": "metric", "reward": distance_reward}, "plans with costs of states"),
        ({"agent": "map", "reward": distance_reward}, "plans with costs of states"),
        ({"frames": "many"}, "frames"),
        ({"seeds": 0}, "seeds: 0 is refused"),
        ({"scenes": []}, "the list is empty"),
        ({"scenes": "/nowhere"}, "/nowhere"),
        ({"agent": "mapp"}, "agent"),
        ({"reward": lambda t: t.view}, "return one number for a transition"),
        ({"irl": lambda problem: np.ones(3)}, "rl learns no weights; give reward='irl', 'elm-irl', 'relm-irl'"),
        ({**RAW, "irl": lambda problem: np.ones(3)}, r"must return \d+ finite weights .* of shape \(3,\)"),
        ({**RAW, "irl": lambda problem: "w"}, "must return .* finite weights"),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, sentence):
    with pytest.raises(InputError, match=sentence):
        relm.train(**{"scenes": one_hot_rooms(), "config": replace(CONFIG, siamese=SMALL), "frames": 64} | arguments)


@pytest.mark.slow  # compiles the whole agent
def test_the_mapping_agent_in_listed_rooms():
    config = overlay(CONFIG, {"map": {"weights": "package"}, "tasks": {"cap": 8}}, "test")
    train, unseen = (relm.rooms(f"bathroom-{number}", size="tiny", image_size=32) for number in (0, 7))
    trained = relm.train(train, "map", config=config)
    seen = relm.evaluate(trained, "I", episodes=4)
    new = relm.evaluate(trained, "III", unseen=unseen, episodes=4)
    assert [(row.scene, row.agent) for row in (*seen.rows, *new.rows)] == [("bathroom-0", "map"), ("bathroom-7", "map")]
    assert seen.encoder == new.encoder == "none"


def test_own_weights_are_what_the_agent_is_paid():
    rooms, agent, problems = one_hot_rooms(), NoAgent(), []

    def weights_of(problem):
        problems.append(problem)
        psi = relative_features(problem.features, problem.expert.target)
        return np.linalg.lstsq(psi, -np.arange(len(psi), dtype=float), rcond=None)[0]  # any numbers

    config = overlay(CONFIG, {"irl": {"dimension": 0, "minimum_cost": 0.0, "sub_trajectories": False}}, "test")
    relm.train(rooms, agent, "irl", 64, irl=weights_of, config=config)
    split = draw_split(rooms, (), config.tasks, 0)
    assert [problem.expert.target for problem in problems] == [target.state for target in split.training]
    learned = agent.problems[0].reward
    theirs = NoAgent()
    relm.train(rooms, theirs, "irl", 64, config=config)
    assert not np.allclose(learned.weights, theirs.problems[0].reward.weights)
    expected = [weights_of(problem) for problem in tuple(problems)]
    pairs = list(zip(problems[: len(expected)], expected, strict=True))
    largest = [np.abs(reward_of_states(p.features, p.expert.target, w)).max() for p, w in pairs]
    np.testing.assert_allclose(
        np.asarray(learned.weights)[: len(expected)], np.asarray(expected) / np.asarray(largest)[:, None], rtol=1e-4
    )


def test_results_that_were_not_measured_alike_are_not_compared(tmp_path):
    rooms = one_hot_rooms()
    options = {"scenes": rooms, "config": CONFIG}
    first = relm.evaluate("random", "I", **options)
    other = relm.evaluate("random", "I", name="other", **options)
    relm.compare(first, other).save(tmp_path / "both.json")
    assert {row.method for row in relm.compare(tmp_path / "both.json").results.rows} == {"random", "other"}
    with pytest.raises(InputError, match="random is in both"):
        relm.compare(first, first)
    with pytest.raises(InputError, match="task is I in one and II"):
        relm.compare(first, relm.evaluate("random", "II", name="other", **options))
    with pytest.raises(InputError, match="only one of them has 40 episodes in bathroom-0 with seed 0"):
        relm.compare(first, relm.evaluate("random", "I", [1], name="other", **options))
    with pytest.raises(InputError, match="there is nothing to compare"):
        relm.compare()
    with pytest.raises(InputError, match="cannot be read"):
        relm.compare(tmp_path / "neither.json")
    assert isinstance(relm.compare(first), Comparison)


def test_listed_rooms_are_encoded_as_rooms():
    listed = relm.rooms("bathroom-0", size="tiny")
    assert listed[0].views.shape[1:] == (64, 64, 3)
    assert config_of(listed, None).encoder.weights == "rooms"
    random = overlay(Config(), {"encoder": {"weights": "random"}}, "test")
    assert config_of(listed, random).encoder.weights == "random"
    assert config_of(one_hot_rooms(), None).encoder.weights == "auto"  # they have features


def test_rooms_and_folders_are_loaded():
    assert [room.name for room in relm.rooms("bedroom-1", "bathroom-0", size="tiny", image_size=32)] == [
        "bedroom-1",
        "bathroom-0",
    ]
    with pytest.raises(InputError, match="'attic-0' is no built-in room"):
        relm.rooms("attic-0")
    with pytest.raises(InputError, match="/nowhere"):
        relm.load_scenes("/nowhere")
