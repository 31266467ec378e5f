"""Training on imagined targets: what is drawn and paid by hand, and a small room in which every target is learned."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from interruption import assert_same, interrupt, resume
from tiny import SMALL, problem, two_rooms

from relm_irl_jax.agents.actor_critic import LossWeights, Outputs
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.forward import evaluate, tabulate
from relm_irl_jax.agents.siamese.imagined_targets import draw_targets, evaluate_drawn
from relm_irl_jax.agents.siamese.imagined_training import prepare_imagined
from relm_irl_jax.agents.siamese.imagined_update import (
    LONGEST_WALK,
    TRACE_DECAY,
    Steps,
    loss_of_pairs,
    near_starts,
    returns_of,
    run_imagined_updates,
    walk,
)
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.imagined import constant_rewards
from relm_irl_jax.tasks import Target, TaskSplit
from relm_irl_jax.types import TrainingLog
from relm_irl_jax.world import build_targets

SETTINGS = dataclasses.replace(SMALL, imagine="told", targets_at_once=2, workers=20, t_max=3)
SPLIT = TaskSplit((Target(0, 3), Target(1, 20)), (Target(0, 5),), (Target(1, 7),), ())
STATES = [np.array([3, *range(5), *range(6, 16)]), np.array([20, *range(7), *range(8, 20), 21, 22, 23])]

# Step by step, each of their operations would be compiled alone.
drawing = jax.jit(draw_targets)
walking = jax.jit(walk, static_argnums=4)
tabulated = jax.jit(evaluate_drawn, static_argnums=0)


def imagining(**changes):
    """The two small rooms with a constant cost of 1 for a step."""
    one = problem(cap=20)
    scenes = [grid_scene(2, 2, name="bathroom-0"), grid_scene(3, 2, name="bedroom-0")]
    targets = constant_rewards(scenes, SPLIT, STATES, step=-1.0, target=0.0, collision=np.inf, told=True)
    return dataclasses.replace(one, imagined=dataclasses.replace(targets, **changes))


def drawn_as(inputs, targets):
    """An update's pairs with given targets."""
    drawn = drawing(jax.random.key(1), inputs.pairs, inputs.given_share)
    return dataclasses.replace(drawn, target=targets)


@pytest.fixture(scope="module")
def prepared():
    return prepare_imagined(jax.random.key(0), imagining(), SETTINGS)


def test_pairs_move_like_states(prepared):
    _, inputs, _ = prepared
    drawn, successor = drawing(jax.random.key(1), inputs.pairs, inputs.given_share), np.asarray(inputs.world.successor)
    assert inputs.pairs.first_pair == (0, 32, 80)
    np.testing.assert_array_equal(drawn.in_world, np.arange(40))
    for state in (0, 7, 15, 16, 39):
        for slot in (0, 1):
            np.testing.assert_array_equal(drawn.successor[state * 2 + slot], successor[state] * 2 + slot)


def test_workers_start_in_every_state_of_their_scene(prepared):
    _, inputs, _ = prepared
    pairs, drawn = inputs.pairs, drawing(jax.random.key(1), inputs.pairs, inputs.given_share)
    first = np.asarray(pairs.worker_first)
    assert set(first.tolist()) == {0, 1, 32, 33}
    np.testing.assert_array_equal(drawn.start(pairs, jnp.zeros(len(first))), first)
    last = np.asarray(drawn.start(pairs, jnp.full(len(first), 1 - 2**-24)))
    np.testing.assert_array_equal(last, np.where(first < 32, 30, 78) + first % 2)


def test_targets_are_drawn_among_the_given_and_all(prepared):
    _, inputs, _ = prepared

    @jax.jit
    def draw(seed, share):
        return draw_targets(jax.random.key(seed), inputs.pairs, share)

    def states(share):
        return np.stack([draw(seed, jnp.float32(share)).target for seed in range(200)])

    given, mixed, any_of = (states(share) for share in (1.0, 0.5, 0.0))
    assert set(given[:, 0].ravel().tolist()) == {3}
    assert set(given[:, 1].ravel().tolist()) == {20}
    assert 0.4 < (mixed[:, 0] == 3).mean() < 0.7
    for number in (0, 1):
        assert set(any_of[:, number].ravel().tolist()) == set(STATES[number].tolist())
    drawn = draw(0, jnp.float32(0.5))
    arrived = np.flatnonzero(drawn.arrived).tolist()
    assert arrived == sorted((np.asarray(drawn.target) * 2 + [[0, 1], [32, 33]]).reshape(-1).tolist())
    np.testing.assert_array_equal(drawn.reward, np.where(drawn.arrived, 0.0, -1.0))


def test_the_table_of_pairs_is_the_network(prepared):
    state, inputs, form = prepared
    targets = jnp.asarray([[3, 8], [20, 5]], jnp.int32)
    table = tabulated(form.network, state.parameters, inputs.world, inputs.pairs, drawn_as(inputs, targets))
    given = build_targets(two_rooms(), [Target(0, 3), Target(0, 8), Target(1, 20), Target(1, 5)])
    views, rows = jnp.asarray([[[7]], [[30]]], jnp.int32), jnp.asarray([[1], [2]], jnp.int32)

    @jax.jit
    def by_tables(parameters):
        tables = tabulate(form.network, parameters, inputs.world, given)
        return evaluate(form.network, parameters, tables, views, rows, jnp.arange(2))

    expected = by_tables(state.parameters)
    index = jnp.asarray([7 * 2 + 1, 30 * 2 + 0])
    np.testing.assert_allclose(table.logits[index], expected.logits[:, 0], atol=1e-6)
    np.testing.assert_allclose(table.value[index], expected.value[:, 0], atol=1e-6)


def test_near_starts_are_a_few_actions_from_the_target(prepared):
    _, inputs, _ = prepared
    drawn = drawing(jax.random.key(1), inputs.pairs, inputs.given_share)
    near = np.asarray(jax.jit(near_starts)(jax.random.key(2), drawn))
    np.testing.assert_array_equal(near % 2, np.asarray(inputs.pairs.worker_first) % 2)
    np.testing.assert_array_equal(near < 32, np.asarray(inputs.pairs.worker_first) < 32)
    assert LONGEST_WALK >= 1


@pytest.mark.parametrize("told", [True, False])
def test_only_agents_that_are_told_stop_at_targets(prepared, told):
    _, inputs, _ = prepared
    inputs = dataclasses.replace(inputs, told=jnp.asarray(told), collision=jnp.float32(-3.0))
    drawn = drawing(jax.random.key(1), inputs.pairs, inputs.given_share)
    steps = walking(jax.random.key(2), jnp.zeros((80, 4)), inputs, drawn, 60)
    reached = np.asarray(drawn.arrived)[steps.next_pair]
    assert reached.any()
    np.testing.assert_array_equal(steps.terminated, reached & told)
    collided = np.asarray(steps.next_pair == steps.pair)
    np.testing.assert_array_equal(steps.reward, np.where(collided, -3.0, np.where(reached, 0.0, -1.0)))
    goes_on = ~np.asarray(steps.terminated)[:-1]
    np.testing.assert_array_equal(np.asarray(steps.pair)[1:][goes_on], np.asarray(steps.next_pair)[:-1][goes_on])


def weights(**changes):
    numbers = {"discount": 0.5, "value": 0.3, "entropy": 0.1, "return_scale": 2.0} | changes
    return LossWeights(**{name: jnp.float32(number) for name, number in numbers.items()})


def test_returns_by_hand():
    """One worker: a step of cost 4, then one that reaches the target, and one in a new episode that is cut."""
    steps = Steps(
        pair=jnp.asarray([[0], [1], [2]], jnp.int32),
        action=jnp.zeros((3, 1), jnp.int32),
        reward=jnp.asarray([[-4.0], [-2.0], [-6.0]]),
        next_pair=jnp.asarray([[1], [3], [4]], jnp.int32),
        terminated=jnp.asarray([[False], [True], [False]]),
    )
    value = jnp.asarray([0.0, -7.0, 0.0, 50.0, -8.0])
    last = -3.0 + 0.5 * -8.0
    first = -2.0 + 0.5 * ((1 - TRACE_DECAY) * -7.0 + TRACE_DECAY * -1.0)
    np.testing.assert_allclose(returns_of(steps, value, weights())[:, 0], [first, -1.0, last], rtol=1e-6)


def test_the_loss_of_pairs_is_that_of_steps():
    """The same gradient as the mean of Equations 20-22 over all steps, of which several visit one pair."""
    generator = np.random.default_rng(0)
    pair, action = (jnp.asarray(generator.integers(0, n, (6, 4)), jnp.int32) for n in (5, 4))
    zeros = jnp.zeros((6, 4))
    steps = Steps(pair, action, zeros, pair, zeros.astype(bool))
    returns = jnp.asarray(generator.normal(size=(6, 4)), jnp.float32)
    outputs = Outputs(*(jnp.asarray(generator.normal(size=s), jnp.float32) for s in ((5, 4), (5,))))

    def of_steps(outputs):
        delta = returns - outputs.value[pair]
        log_policy = jax.nn.log_softmax(outputs.logits)[pair]
        chosen = jnp.take_along_axis(log_policy, action[..., None], -1)[..., 0]
        entropy = -(jnp.exp(log_policy) * log_policy).sum(-1)
        return (-chosen * jax.lax.stop_gradient(delta) + 0.3 * delta**2 - 0.1 * entropy).mean()

    own = jax.jit(jax.grad(lambda out: loss_of_pairs(out, steps, returns, weights())))(outputs)
    expected = jax.jit(jax.grad(of_steps))(outputs)
    np.testing.assert_allclose(own.logits, expected.logits, atol=1e-6)
    np.testing.assert_allclose(own.value, expected.value, atol=1e-6)


def test_initial_values_are_distances():
    settings = dataclasses.replace(SETTINGS, initialisation="distance", width=16)
    state, inputs, form = prepare_imagined(jax.random.key(0), imagining(), settings)
    targets = jnp.asarray([[3, 8], [20, 5]], jnp.int32)
    drawn = drawn_as(inputs, targets)
    value = np.asarray(tabulated(form.network, state.parameters, inputs.world, inputs.pairs, drawn).value)
    at_target = [3 * 2, 8 * 2 + 1, 32 + 20 * 2, 32 + 5 * 2 + 1]
    np.testing.assert_allclose(value[at_target], 0.0, atol=1e-6)
    assert (np.delete(value, at_target) < 0).all()


def trained(log):
    return SiameseAgent(SETTINGS).train(jax.random.key(5), imagining(), log)


def test_an_interrupted_training_ends_the_same(tmp_path):
    whole = trained(TrainingLog())
    assert np.isfinite(whole[1].success_rate).all()
    interrupt(tmp_path, trained)
    result, _ = resume(tmp_path, trained)
    assert_same(whole, result)


def test_agents_that_remember_views_are_refused():
    with pytest.raises(InputError, match=r"siamese\.history: imagined targets"):
        prepare_imagined(jax.random.key(0), imagining(), dataclasses.replace(SETTINGS, history=2))


@pytest.mark.slow
def test_targets_of_two_rooms_are_learned():
    """A random walk ends 0.6 of these episodes at the target, the shortest path 0.8; the others are cut."""
    settings = dataclasses.replace(
        SETTINGS, initialisation="distance", width=64, workers=160, t_max=8, learning_rate=3e-3, discount=0.95
    )
    state, inputs, form = prepare_imagined(jax.random.key(0), imagining(), settings)
    share = []
    for updates in (20, 400, 20):
        state, sums = run_imagined_updates(state, inputs, form=form, updates=updates)
        share.append(float(sums.successes / sums.episodes))
    assert share[0] < 0.65
    assert share[2] > 0.7
