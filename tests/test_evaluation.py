"""The paper's metrics against hand computation, and episodes under policies whose outcome is known."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from jaxtyping import Array

from relm_irl_jax.agents.random_agent import RandomPolicy
from relm_irl_jax.agents.siamese.forward import evaluate_pairs, tabulate
from relm_irl_jax.agents.siamese.network import SiameseActorCritic
from relm_irl_jax.agents.siamese.policy import PairPolicy, SeveralViewsPolicy
from relm_irl_jax.agents.siamese.state_target_pairs import state_target_pairs
from relm_irl_jax.agents.siamese.training import init_parameters
from relm_irl_jax.episode_runner import distinct_cases, lanes_within_memory
from relm_irl_jax.evaluation import Episodes, compute_metrics, draw_episodes, evaluate
from relm_irl_jax.experts import shortest_path_expert
from relm_irl_jax.tasks import Target
from relm_irl_jax.types import NO_MEMORY
from relm_irl_jax.world import build_targets, build_world


def test_metrics_by_hand():
    """Shortest paths 4 and 10: reached in 5, and cut at 100."""
    episodes = Episodes(
        target=np.zeros((1, 2), np.int32),
        start=np.zeros((1, 2), np.int32),
        length=np.asarray([[5, 100]], np.int32),
        shortest=np.asarray([[4, 10]], np.int32),
        success=np.asarray([[True, False]]),
    )
    measured = compute_metrics(episodes, 0)
    assert measured.episodes == 2
    assert measured.success_rate == 0.5
    assert measured.path_length_error == pytest.approx((1 + 90) / 2)
    assert measured.spl == pytest.approx(0.5 * 4 / 5)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TablePolicy:
    """Takes the action that a table names for target and state."""

    action: Array

    def init(self, shape):
        return NO_MEMORY

    def act(self, key, memory, observation, target):
        return memory, self.action[target, observation.view]


def scenes_and_targets():
    scenes = [
        grid_scene(2, 3, features=np.zeros((24, 2), np.float32)),
        grid_scene(4, 3, features=np.zeros((48, 2), np.float32)),
    ]
    targets = [Target(0, 5), Target(0, 20), Target(1, 33)]
    return scenes, targets, build_world(scenes), build_targets(scenes, targets)


def test_the_expert_is_perfect():
    scenes, targets, world, tables = scenes_and_targets()
    action = np.zeros((3, 72), np.int32)
    for row, target in enumerate(targets):
        offset = (0, 24)[target.scene]
        decided = shortest_path_expert(scenes[target.scene], target.state).action
        action[row, offset : offset + len(decided)] = np.maximum(decided, 0)
    episodes = evaluate(jax.random.key(0), TablePolicy(jnp.asarray(action)), world, tables, 50, 64)
    for number in range(2):
        measured = compute_metrics(episodes, number)
        assert (measured.success_rate, measured.path_length_error, measured.spl) == (1.0, 0.0, 1.0)
    assert set(episodes.target[0].tolist()) == {0, 1}
    assert set(episodes.target[1].tolist()) == {2}


def test_turning_for_ever_fails_at_the_cap():
    _, _, world, tables = scenes_and_targets()
    turning = TablePolicy(jnp.ones((3, 72), jnp.int32))
    episodes = evaluate(jax.random.key(0), turning, world, tables, 7, 200)
    failed = ~episodes.success
    assert failed.mean() > 0.7
    assert (episodes.length[failed] == 7).all()
    assert (episodes.length[~failed] <= 3).all()  # the target is at the start's own place


def test_random_is_as_good_as_its_markov_chain():
    """Success within the cap, averaged over starts, from powers of the uniform policy's transition matrix."""
    scene = grid_scene(2, 2, features=np.zeros((16, 2), np.float32))
    world, tables = build_world([scene]), build_targets([scene], [Target(0, 6)])
    following = np.asarray(world.successor)
    chain = np.zeros((16, 16))
    for action in range(4):
        chain[np.arange(16), following[:, action]] += 0.25
    chain[6] = np.eye(16)[6]
    exact = np.linalg.matrix_power(chain, 12)[:, 6][np.arange(16) != 6].mean()
    episodes = evaluate(jax.random.key(2), RandomPolicy(), world, tables, 12, 20_000)
    assert compute_metrics(episodes, 0).success_rate == pytest.approx(
        exact, abs=4 * np.sqrt(exact * (1 - exact) / 20_000)
    )


def test_a_network_evaluated_on_all_pairs_acts_as_one_evaluated_step_by_step():
    generator = np.random.default_rng(0)
    features = generator.normal(size=(3, 36, 8)).astype(np.float32)
    scenes = [grid_scene(3, 3, name=f"room-{n}", features=features[n]) for n in range(3)]
    world = build_world(scenes)
    targets = build_targets(scenes, [Target(0, 3), Target(1, 20), Target(2, 9), Target(2, 11)])
    network = SiameseActorCritic(n_heads=2, width=16, uniform=True)
    parameters = init_parameters(jax.random.key(0), network, world)
    parameters = jax.tree.map(lambda p: p + 0.3 * generator.normal(size=p.shape).astype(np.float32), parameters)
    head = np.asarray([1, 0, 1])
    pairs = state_target_pairs(world, targets, head, 2)
    outputs = jax.jit(lambda theta: evaluate_pairs(network, theta, world, targets, pairs))(parameters)
    tables = tabulate(network, parameters, world, targets)
    policies = (
        PairPolicy(outputs, pairs, world),
        SeveralViewsPolicy(parameters, tables, jnp.asarray(head, jnp.int32), network),
    )
    one, other = (evaluate(jax.random.key(1), policy, world, targets, 30, 50) for policy in policies)
    assert (one.length == other.length).all()
    assert 1 < one.length.mean() < 30


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class CountingPolicy:
    """Moves ahead as long as it remembers no collision, then turns right, and back to moving after two turns."""

    def init(self, shape):
        return jnp.zeros(shape, jnp.int32)

    def act(self, key, memory, observation, target):
        memory = jnp.where(observation.collided, 2, memory)
        return jnp.maximum(memory - 1, 0), jnp.where(memory > 0, 1, 0)


def test_episodes_that_follow_one_another_in_a_lane_are_those_side_by_side(monkeypatch):
    _, _, world, tables = scenes_and_targets()
    reports = []
    together = evaluate(jax.random.key(3), CountingPolicy(), world, tables, 30, 40, advance=reports.append)
    assert sum(reports) == 80
    monkeypatch.setattr("relm_irl_jax.episode_runner.MEMORY_BYTES", 2 * 4 * 7)
    assert lanes_within_memory(CountingPolicy(), 2, 40) == 7
    in_turn = evaluate(jax.random.key(3), CountingPolicy(), world, tables, 30, 40)
    for name, values in vars(together).items():
        np.testing.assert_array_equal(getattr(in_turn, name), values)
    assert 0 < together.success.mean() < 1


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class DeterministicCountingPolicy(CountingPolicy):
    """The same, which says that it draws nothing at random."""

    @property
    def deterministic(self):
        return True


@pytest.mark.parametrize("lanes", [7, 400])
def test_equal_episodes_of_a_deterministic_policy_are_run_once(monkeypatch, lanes):
    """With the same outcome for each drawn episode; 400 episodes have 23, 23 and 47 pairs of start and target."""
    _, _, world, tables = scenes_and_targets()
    every = evaluate(jax.random.key(3), CountingPolicy(), world, tables, 30, 400)
    cases = distinct_cases(draw_episodes(jax.random.key(3), tables, 2, 400)[0])
    assert cases.count.tolist() == [46, 47]
    assert cases.times.sum(1).tolist() == [400, 400]
    monkeypatch.setattr("relm_irl_jax.episode_runner.MEMORY_BYTES", 2 * 4 * lanes)
    reports = []
    once = evaluate(jax.random.key(3), DeterministicCountingPolicy(), world, tables, 30, 400, advance=reports.append)
    assert sum(reports) == 800
    for name, values in vars(every).items():
        np.testing.assert_array_equal(getattr(once, name), values)
    assert 0 < once.success.mean() < 1
