"""Acting with many workers: episodes are counted, reset, redrawn, and memories with them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from tiny import SMALL, problem

from relm_irl_jax.agents.rollout import rollout, sample_action
from relm_irl_jax.agents.siamese.training import prepare_training
from relm_irl_jax.agents.siamese.update import initial_memory, observe_views


def test_actions_are_drawn_from_the_softmax():
    logits = jnp.log(jnp.asarray([0.1, 0.2, 0.3, 0.4])) + 5.0
    drawn = sample_action(jax.random.key(0), jnp.broadcast_to(logits, (40_000, 4)))
    np.testing.assert_allclose(np.bincount(drawn, minlength=4) / 40_000, [0.1, 0.2, 0.3, 0.4], atol=0.01)


def test_rollout_counts_every_episode_and_redraws_start_and_target():
    """Of an indifferent agent that observes three views."""
    settings = dataclasses.replace(SMALL, workers=64, history=3)
    state, inputs, _ = prepare_training(jax.random.key(0), problem(cap=30), settings)
    task, memory = inputs.task, initial_memory(inputs.task.target_range.first.shape, 3)

    def act(key, memory, observation, target):
        memory, views = observe_views(memory, observation)
        return memory, sample_action(key, jnp.zeros((*target.shape, 4))), (views, observation.collided)

    run = jax.jit(lambda key, workers: rollout(key, act, workers, task, memory, 40))
    _, experience, sums = run(jax.random.key(3), state.workers)
    done = np.asarray(experience.terminated | experience.truncated)
    assert int(sums.episodes) == done.sum()
    assert int(sums.successes) == np.asarray(experience.terminated).sum()
    states, next_states, target = (np.asarray(x) for x in (experience.state, experience.next_state, experience.target))
    continues = ~done[:-1]
    assert (states[1:][continues] == next_states[:-1][continues]).all()
    assert (target[1:][continues] == target[:-1][continues]).all()
    views, collided = (np.asarray(x) for x in experience.output)
    assert (views[..., 0] == states).all()
    assert (views[1:, ..., 1:][continues] == views[:-1, ..., :-1][continues]).all()
    assert (views[1:][~continues] == states[1:][~continues][:, None]).all()  # a new episode has seen its start alone
    assert (views[0] == states[0][..., None]).all()
    assert (collided[1:][continues] == (next_states == states)[:-1][continues]).all()
    assert not collided[1:][~continues].any()
    new = done[:-1, 0]  # workers of the head with two targets
    assert set(target[1:, 0][new]) == {0, 1}
    assert len(set(states[1:, 0][new])) > 8
    assert (np.asarray(task.world.scene)[states] == np.arange(2)[:, None]).all()
    assert not (np.asarray(experience.terminated) & np.asarray(experience.truncated)).any()
