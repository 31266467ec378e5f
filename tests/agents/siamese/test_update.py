"""Updates of the actor-critic: optimiser by hand, forms that agree, what is traced, what is refused."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny import CHUNK, SMALL, problem

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.training import optimizer_numbers, prepare_training, run_updates, update_form
from relm_irl_jax.agents.siamese.update import make_optimizer
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import TrainingLog


@pytest.fixture(scope="module")
def prepared():
    """Steps of workers are summed, which tells a sum from a mean; every frame is one pair of 88 or of 256 frames."""
    settings = dataclasses.replace(SMALL, optimizer="rmsprop", learning_rate=0.01, gradient="sum", t_max=12)
    return settings, *prepare_training(jax.random.key(1), problem(cap=13), settings)


def test_an_update_by_pairs_is_one_by_frames(prepared):
    """The same steps, and the same parameters up to rounding."""
    _, state, inputs, form = prepared
    assert inputs.pairs is not None
    frames = dataclasses.replace(inputs, pairs=None)
    (one, sums), (other, others) = (run_updates(state, own, form=form, updates=3) for own in (frames, inputs))
    assert one.workers.episode.state.tolist() == other.workers.episode.state.tolist()
    np.testing.assert_allclose(sums.reward, others.reward, rtol=1e-6)
    moved = jax.tree.map(lambda a, b: np.abs(a - b).max(), one.parameters, state.parameters)
    assert all(move > 1e-5 for move in jax.tree.leaves(moved))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=2e-6), one.parameters, other.parameters)


def test_changing_a_number_compiles_nothing_again(prepared):
    settings, state, inputs, form = prepared
    run_updates(state, inputs, form=form, updates=3)
    compiled = run_updates._cache_size()
    changed = dataclasses.replace(
        settings,
        learning_rate=0.5,
        discount=0.1,
        entropy_weight=0.5,
        value_weight=2.0,
        decay="none",
        gradient_clip=1.0,
    )
    again, own, same_form = prepare_training(jax.random.key(1), problem(cap=17), changed)
    assert same_form == form
    result, _ = run_updates(again, own, form=same_form, updates=3)
    assert run_updates._cache_size() == compiled
    assert jax.tree.all(jax.tree.map(jnp.array_equal, again.parameters, state.parameters))
    before, _ = run_updates(state, inputs, form=form, updates=3)
    assert not jax.tree.all(jax.tree.map(jnp.allclose, result.parameters, before.parameters))


def test_memory_of_metrics_does_not_grow_with_updates(prepared):
    _, state, inputs, form = prepared
    one, many = (
        jax.make_jaxpr(lambda s, i, n=updates: run_updates(s, i, form=form, updates=n))(state, inputs).out_avals
        for updates in (1, 100_000)
    )
    assert one == many


def test_pairs_are_for_one_view_and_many_frames():
    def pairs(**changes):
        settings = dataclasses.replace(SMALL, **changes)
        return prepare_training(jax.random.key(0), problem(cap=50), settings)[1].pairs

    assert pairs(workers=14, t_max=4) is not None  # 56 pairs and frames
    assert pairs(workers=12, t_max=4) is None
    assert pairs(workers=14, t_max=40, history=2) is None


@pytest.mark.parametrize(
    ("changes", "cap", "message"),
    [
        ({"t_max": 16}, 10, r"siamese\.t_max: 16 exceeds the cap of 10 steps"),
        ({"workers": 1}, 50, r"siamese\.workers: 1 workers are too few for 2 heads"),
    ],
)
def test_settings_that_cannot_work_are_refused(changes, cap, message):
    with pytest.raises(InputError, match=message):
        SiameseAgent(dataclasses.replace(SMALL, **changes)).train(
            jax.random.key(0), problem(cap=cap, frames=CHUNK), TrainingLog()
        )


def optimizer_of(settings):
    return make_optimizer(update_form(settings, 2), optimizer_numbers(settings, 60))


def test_the_original_optimizer_by_hand():
    """ε lies inside the root, the mean square begins at 1, and the bound counts once for each summed worker."""
    settings = SiameseSettings(
        optimizer="rmsprop", gradient="sum", workers=3, gradient_clip=2.0, learning_rate=0.5, decay="none"
    )
    optimizer = optimizer_of(settings)
    parameters = {"w": jnp.zeros(2)}
    state = optimizer.init(parameters)
    mean_square = np.ones(2)
    for gradient, clipped in [([3.0, 4.0], [3.0, 4.0]), ([-6.0, 8.0], [-3.6, 4.8])]:
        change, state = optimizer.update({"w": jnp.asarray(gradient)}, state, parameters)
        mean_square = 0.99 * mean_square + 0.01 * np.square(clipped)
        np.testing.assert_allclose(change["w"], -0.5 * np.asarray(clipped) / np.sqrt(mean_square + 0.1), rtol=1e-5)


def test_the_step_size_falls_linearly():
    """Four updates of 3 workers and 5 steps."""
    settings = SiameseSettings(optimizer="rmsprop", gradient="sum", workers=3, t_max=5, learning_rate=0.5)
    optimizer = optimizer_of(settings)
    parameters = {"w": jnp.zeros(1)}
    state = optimizer.init(parameters)
    steps = []
    for _ in range(5):
        change, state = optimizer.update({"w": jnp.ones(1)}, state, parameters)
        steps.append(float(change["w"][0]))
    np.testing.assert_allclose(steps, -0.5 * np.array([1, 0.75, 0.5, 0.25, 0]) / np.sqrt(1.1), rtol=1e-5)
