"""Returns, loss and gradients of the actor-critic against hand computation and the plain formulation."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from relm_irl_jax.agent.rollout import Experience, rollout, sample_action
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.frames import backward, forward, tabulate
from relm_irl_jax.agent.siamese.network import Activations, SiameseActorCritic
from relm_irl_jax.agent.siamese.train import begin, network_of, run_chunk, train, worker_lanes
from relm_irl_jax.agent.siamese.update import (
    Setting,
    actor_critic_loss,
    n_step_returns,
    optimiser_of,
    over_steps,
    values_behind,
)
from relm_irl_jax.rewards.model import ManualReward

from relm_irl_jax.errors import InputError
from relm_irl_jax.tasks import Target
from relm_irl_jax.world import build_targets, build_world

STEP_COST = ManualReward(jnp.float32(0.0), jnp.float32(-1.0), jnp.float32(-1.0))


def returns(reward, terminated, truncated, next_value, discount=0.5):
    as_float = [jnp.asarray(reward, jnp.float32), jnp.asarray(terminated), jnp.asarray(truncated)]
    return n_step_returns(*as_float, jnp.asarray(next_value, jnp.float32), discount).tolist()


def test_returns_bootstrap_behind_the_last_step():
    assert returns([1, 1, 1], [False] * 3, [False] * 3, [0, 0, 8]) == [2.75, 3.5, 5.0]


def test_termination_does_not_bootstrap():
    assert returns([1, 1, 1], [False, True, False], [False] * 3, [9, 9, 8]) == [1.5, 1.0, 5.0]


def test_truncation_bootstraps_with_the_state_behind_it():
    assert returns([1, 1, 1], [False] * 3, [False, True, False], [9, 4, 8]) == [2.5, 3.0, 5.0]


def room(n_features: int = 12):
    generator = np.random.default_rng(0)
    scenes = [
        grid_scene(2, 2, name="bathroom-0", features=generator.normal(size=(16, n_features)).astype(np.float32)),
        grid_scene(3, 2, name="bedroom-0", features=generator.normal(size=(24, n_features)).astype(np.float32)),
    ]
    return build_world(scenes, [0, 1]), build_targets(scenes, [Target(0, 3), Target(0, 9), Target(1, 20)])


@pytest.mark.parametrize("frames", [None, 12], ids=["tables", "frames alone"])
@pytest.mark.parametrize(("history", "also"), [(1, False), (4, False), (1, True), (4, True)])
def test_tables_and_recorded_activations_equal_the_plain_network(history, also, frames):
    """Outputs and gradients, against every frame through the whole network; `also` with products and rewards seen."""
    world, targets = room()
    network = SiameseActorCritic(n_heads=2, width=16, history=history, comparison=also, sees_reward=also)
    head = jnp.arange(2)
    state = jnp.asarray([[[1, 5, 5], [17, 20, 39]], [[2, 5, 0], [18, 20, 16]]])
    views = jnp.stack([state, (state + 1) % 40, state, 39 - state], -1)[..., :history]
    target = jnp.asarray([[[0, 1, 1], [2, 2, 2]], [[0, 1, 0], [2, 2, 2]]])
    wanted = world.features[targets.state[target]]
    predicted = -jnp.abs(jnp.sin(jnp.arange(120.0))).reshape(3, 40) if also else None
    seen = [predicted[target[t], views[t, ..., 0]] if also else None for t in range(2)]

    @jax.jit
    def drawn(key):
        parameters = network.init(key, world.features[views[0]], wanted[0], head, seen[0])
        return jax.tree.map(lambda p: p + 0.1 * jax.random.normal(jax.random.key(p.size), p.shape), parameters)

    parameters = drawn(jax.random.key(1))

    def loss(logits, value):
        return jnp.sin(logits).sum() + jnp.cos(value).sum()

    def plain(parameters):
        outputs = [network.apply(parameters, world.features[views[t]], wanted[t], head, seen[t]) for t in range(2)]
        logits, value = (jnp.stack(x) for x in zip(*outputs, strict=True))
        return loss(logits, value), (logits, value)

    @jax.jit
    def tabled(parameters):
        tabled = lambda theta: tabulate(network, theta, world.features, targets.state, frames, predicted)  # noqa: E731
        tables, pull_back = jax.vjp(tabled, parameters)
        recorded = [forward(network, parameters, tables, views[t], target[t], head) for t in range(2)]
        recorded = jax.tree.map(lambda *x: jnp.stack(x), *recorded)
        of_outputs = jax.grad(loss, argnums=(0, 1))(recorded.logits, recorded.value)
        of_heads, of_tables = backward(network, parameters, tables, views, target, head, recorded, *of_outputs)
        return recorded, jax.tree.map(jnp.add, of_heads, pull_back(of_tables)[0])

    (_, (logits, value)), gradient = jax.jit(jax.value_and_grad(plain, has_aux=True))(parameters)
    recorded, tabled_gradient = tabled(parameters)
    np.testing.assert_allclose(recorded.logits, logits, atol=1e-5, rtol=1e-5)
    np.testing.assert_allclose(recorded.value, value, atol=1e-5, rtol=1e-5)
    for path, a in jax.tree.leaves_with_path(tabled_gradient):
        b = np.asarray(dict(jax.tree.leaves_with_path(gradient))[path])
        assert np.abs(b).max() > 0, path
        np.testing.assert_allclose(a, b, atol=1e-5, rtol=1e-5)


def test_actions_are_drawn_from_the_softmax():
    logits = jnp.log(jnp.asarray([0.1, 0.2, 0.3, 0.4])) + 5.0
    drawn = sample_action(jax.random.key(0), jnp.broadcast_to(logits, (40_000, 4)))
    np.testing.assert_allclose(np.bincount(drawn, minlength=4) / 40_000, [0.1, 0.2, 0.3, 0.4], atol=0.01)


def setting_and_learner(settings):
    world, targets = room()
    network = network_of(settings, 2)
    lane = worker_lanes(targets, world, 2, settings.workers)
    learner = begin(jax.random.key(0), world, targets, lane, network, settings)
    return Setting(world, targets, lane, STEP_COST, jnp.float32(10.0)), learner, network


def indifferent(key, views, target):
    return sample_action(key, jnp.zeros((*target.shape, 4))), None


def indifferent_rollout(key, setting, learner, cap, length):
    run = jax.jit(
        lambda key, episode: rollout(
            key, indifferent, episode, setting.lane, setting.world, setting.targets, STEP_COST, jnp.int32(cap), length
        )
    )
    return run(key, learner.episode)


def test_rollout_counts_every_episode_and_redraws_start_and_target():
    settings = SiameseSettings(workers=64, t_max=40, width=8, history=3)
    setting, learner, _ = setting_and_learner(settings)
    _, experience, sums = indifferent_rollout(jax.random.key(3), setting, learner, 30, settings.t_max)
    done = np.asarray(experience.terminated | experience.truncated)
    assert int(sums.episodes) == done.sum()
    assert int(sums.successes) == np.asarray(experience.terminated).sum()
    state, next_state, target = (np.asarray(x) for x in (experience.state, experience.next_state, experience.target))
    goes_on = ~done[:-1]
    assert (state[1:][goes_on] == next_state[:-1][goes_on]).all()
    assert (target[1:][goes_on] == target[:-1][goes_on]).all()
    views, next_views = np.asarray(experience.views), np.asarray(experience.next_views)
    assert (views[1:][goes_on] == next_views[:-1][goes_on]).all()
    assert (next_views[..., 1:] == views[..., :-1]).all()
    assert (views[1:][~goes_on] == state[1:][~goes_on][:, None]).all()  # a fresh episode has seen its start alone
    assert (views[0] == state[0][..., None]).all()
    fresh = done[:-1, 0]  # workers of the head with two targets
    assert set(target[1:, 0][fresh]) == {0, 1}
    assert len(set(state[1:, 0][fresh])) > 8
    assert (np.asarray(setting.world.head)[state] == np.arange(2)[:, None]).all()
    assert not (np.asarray(experience.terminated) & np.asarray(experience.truncated)).any()


def test_loss_equals_a_hand_written_loop():
    """One worker that sees two views, four steps: truncated at the second, terminated at the third."""
    settings = SiameseSettings(discount=0.9, value_weight=0.5, entropy_weight=0.1, t_max=4)
    generator = np.random.default_rng(2)
    logits, value = generator.normal(size=(10, 4)), generator.normal(size=(10, 10))
    state, earlier, next_state = [0, 1, 2, 3], [0, 0, 2, 3], [1, 7, 8, 9]
    action, reward = [1, 0, 3, 2], [0.5, -1.0, 2.0, 0.25]
    column = lambda values, dtype: jnp.asarray(values, dtype).reshape(4, 1, 1)  # noqa: E731
    experience = Experience(
        state=column(state, jnp.int32),
        earlier=column(earlier, jnp.int32)[..., None],
        target=column([0, 0, 0, 0], jnp.int32),
        action=column(action, jnp.int32),
        reward=column(reward, jnp.float32),
        next_state=column(next_state, jnp.int32),
        terminated=column([False, False, True, False], bool),
        truncated=column([False, True, False, False], bool),
        record=Activations(
            current=None,
            fused=jnp.zeros((4, 1, 1, 0)),
            hidden=jnp.zeros((4, 1, 1, 0)),
            logits=jnp.asarray(logits[state], jnp.float32).reshape(4, 1, 1, 4),
            value=column(value[state, earlier], jnp.float32),
        ),
    )
    next_value = values_behind(lambda v, t: jnp.asarray(value, jnp.float32)[v[..., 0], v[..., 1]], experience)
    acting = experience.record
    loss = actor_critic_loss(acting.logits, acting.value, next_value, experience, jnp.float32(2.0), settings)

    last = 0.125 + 0.9 * value[9, 3]
    third = 1.0
    second = -0.5 + 0.9 * value[7, 1]
    first = 0.25 + 0.9 * second
    expected = 0.0
    for s, e, a, R in zip(state, earlier, action, [first, second, third, last], strict=True):
        probability = np.exp(logits[s]) / np.exp(logits[s]).sum()
        delta = R - value[s, e]
        entropy = -(probability * np.log(probability)).sum()
        expected += (-np.log(probability[a]) * delta + 0.5 * delta**2 - 0.1 * entropy) / 4
    assert float(loss) == pytest.approx(expected, rel=1e-5)


def test_gradient_over_workers_is_the_mean_of_single_workers():
    settings = SiameseSettings(workers=8, t_max=5, width=8)
    setting, learner, network = setting_and_learner(settings)
    world, targets = setting.world, setting.targets
    _, experience, _ = indifferent_rollout(jax.random.key(4), setting, learner, 7, settings.t_max)

    @jax.jit
    def gradient(experience):
        def loss(parameters):
            tables = tabulate(network, parameters, world.features, targets.state)
            at = lambda v, t: forward(network, parameters, tables, v, t, jnp.arange(2))  # noqa: E731
            acting = jax.vmap(at)(experience.views, experience.target)
            seen = dataclasses.replace(experience, record=acting)
            next_value = values_behind(lambda v, t: at(v, t).value, seen)
            return actor_critic_loss(acting.logits, acting.value, next_value, seen, jnp.float32(10.0), settings)

        return jax.grad(loss)(learner.parameters)

    together = gradient(experience)
    singles = [gradient(jax.tree.map(lambda x, i=i: x[:, :, i : i + 1], experience)) for i in range(4)]
    mean = jax.tree.map(lambda *g: sum(g) / 4, *singles)
    for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(mean), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6, rtol=1e-4)


def test_memory_of_metrics_does_not_grow_with_updates():
    settings = SiameseSettings(workers=4, t_max=2, width=4)
    setting, learner, network = setting_and_learner(settings)
    shapes = [
        jax.tree.map(
            lambda x: x.shape,
            jax.eval_shape(
                lambda carry, fixed, n=updates: run_chunk(
                    carry, fixed, network=network, settings=settings, cap=20, updates=n
                ),
                learner,
                setting,
            ),
        )
        for updates in (1, 100_000)
    ]
    assert shapes[0] == shapes[1]


def test_same_key_same_agent():
    settings = SiameseSettings(workers=8, t_max=4, width=8)
    world, targets = room()
    runs = [train(jax.random.key(5), world, targets, STEP_COST, 10.0, 2, settings, 20, 500) for _ in range(2)]
    for a, b in zip(jax.tree.leaves(runs[0][0]), jax.tree.leaves(runs[1][0]), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_small_room_is_learned():
    """A 2 × 2 and a 3 × 2 room with distinct views: the agent comes within a step of the shortest paths."""
    settings = SiameseSettings(workers=64, t_max=8, width=32, entropy_weight=0.003)
    world, targets = room(40)
    _, curve = train(jax.random.key(0), world, targets, STEP_COST, 10.0, 2, settings, 30, 160_000)
    assert curve.success_rate[-1] == 1.0
    assert curve.path_length_error[-1] < 1.0
    assert curve.path_length_error[0] > 3.0


@pytest.mark.parametrize(
    ("settings", "cap", "message"),
    [
        (SiameseSettings(t_max=16), 10, r"tasks\.cap: 10 is below siamese\.t_max"),
        (SiameseSettings(workers=1), 50, r"siamese\.workers: 1 workers cannot serve 2 heads"),
    ],
)
def test_settings_that_cannot_work_are_refused(settings, cap, message):
    world, targets = room()
    with pytest.raises(InputError, match=message):
        train(jax.random.key(0), world, targets, STEP_COST, 10.0, 2, settings, cap, 100)


def test_the_original_optimiser_by_hand():
    """ε lies inside the root, the mean square begins at 1, and the bound counts once for each summed worker."""
    settings = SiameseSettings(optimizer="rmsprop", gradient="sum", workers=3, gradient_clip=2.0, learning_rate=0.5)
    optimiser = optimiser_of(settings)
    parameters = {"w": jnp.zeros(2)}
    state = optimiser.init(parameters)
    mean_square = np.ones(2)
    for gradient, clipped in [([3.0, 4.0], [3.0, 4.0]), ([-6.0, 8.0], [-3.6, 4.8])]:
        change, state = optimiser.update({"w": jnp.asarray(gradient)}, state, parameters)
        mean_square = 0.99 * mean_square + 0.01 * np.square(clipped)
        np.testing.assert_allclose(change["w"], -0.5 * np.asarray(clipped) / np.sqrt(mean_square + 0.1), rtol=1e-5)


def test_the_step_size_falls_along_a_line():
    """Four updates of 3 workers and 5 steps."""
    settings = SiameseSettings(
        optimizer="rmsprop", gradient="sum", workers=3, t_max=5, learning_rate=0.5, decay_frames=60
    )
    optimiser = optimiser_of(settings)
    parameters = {"w": jnp.zeros(1)}
    state = optimiser.init(parameters)
    steps = []
    for _ in range(5):
        change, state = optimiser.update({"w": jnp.ones(1)}, state, parameters)
        steps.append(float(change["w"][0]))
    np.testing.assert_allclose(steps, -0.5 * np.array([1, 0.75, 0.5, 0.25, 0]) / np.sqrt(1.1), rtol=1e-5)


@pytest.mark.parametrize("comparison", [False, True])
def test_uniform_weights_lie_within_one_over_the_root_of_the_inputs(comparison):
    network = SiameseActorCritic(n_heads=2, width=64, history=4, comparison=comparison, uniform=True)
    view, target = jnp.zeros((2, 1, 4, 20)), jnp.zeros((2, 1, 20))
    weights = network.init(jax.random.key(0), view, target, jnp.arange(2))["params"]
    fused = [weights[name]["kernel"] for name in weights if name.startswith("fusion")]
    assert len(fused) == 2 + comparison
    inputs = [(weights["shared"]["kernel"], 80), *((part, len(fused) * 64) for part in fused)]
    inputs += [(weights[name], 64) for name in ("head_kernel", "policy_kernel", "value_kernel")]
    for weight, count in inputs:
        greatest = float(jnp.abs(weight).max())
        assert 0.95 / np.sqrt(count) < greatest <= 1 / np.sqrt(count)


def test_summed_gradients_are_as_many_times_the_mean():
    loss = jnp.asarray([[1.0, 2.0], [3.0, 6.0]])
    assert float(over_steps(loss, SiameseSettings())) == 3.0
    assert float(over_steps(loss, SiameseSettings(gradient="sum"))) == 12.0
