"""PPO in one file of JAX, in the manner of CleanRL and PureJaxRL, from training to its row in the table.

    python experiments/examples/ppo_jax.py --frames 2000000 --tasks I II

trains on the training targets of seed 0 with environment and agent in one compiled program, and prints a table for
each task, whose rows it saves as `runs/examples/ppo-TASK.json`. The agent is a plain network on the views' features,
without the paper's siamese layer or its heads for room types.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
import optax

import relm_irl_jax as relm
from relm_irl_jax.gym import TaskVectorEnv, functional_env

ROWS = Path(__file__).resolve().parents[2] / "runs" / "examples"

ENVS, STEPS, EPOCHS, MINIBATCHES = 256, 16, 2, 4
GAMMA, LAMBDA, CLIP, ENTROPY = 0.99, 0.95, 0.2, 0.01


class Network(nn.Module):
    @nn.compact
    def __call__(self, observation):
        x = jnp.concatenate([observation["view"], observation["target"]], -1)
        x = nn.relu(nn.Dense(256)(x))
        x = nn.relu(nn.Dense(256)(x))
        return nn.Dense(4, kernel_init=nn.initializers.orthogonal(0.01))(x), nn.Dense(1)(x)[..., 0]


class Step(NamedTuple):
    observation: dict
    action: jax.Array
    log_probability: jax.Array
    value: jax.Array
    reward: jax.Array
    done: jax.Array
    success: jax.Array


def make_train(environment, params, scale, updates):
    network = Network()
    optimiser = optax.chain(
        optax.clip_by_global_norm(0.5), optax.adam(optax.linear_schedule(1e-3, 0.0, updates * EPOCHS * MINIBATCHES))
    )

    def scaled(observation):
        return {name: (view - scale[0]) / scale[1] for name, view in observation.items()}

    def act(carry, key):
        theta, observation, state = carry
        action_key, *step_keys = jax.random.split(key, ENVS + 1)
        logits, value = network.apply(theta, observation)
        action = jax.random.categorical(action_key, logits).astype(jnp.int32)
        log_probability = jax.nn.log_softmax(logits)[jnp.arange(ENVS), action]
        seen, state, reward, done, facts = jax.vmap(environment.step, in_axes=(0, 0, 0, None))(
            jnp.stack(step_keys), state, action, params
        )
        step = Step(observation, action, log_probability, value, reward / 10, done, facts["terminated"])
        return (theta, scaled(seen), state), step

    def loss(theta, batch, advantage, target):
        logits, value = network.apply(theta, batch.observation)
        log_probabilities = jax.nn.log_softmax(logits)
        chosen = jnp.take_along_axis(log_probabilities, batch.action[:, None], 1)[:, 0]
        ratio = jnp.exp(chosen - batch.log_probability)
        normal = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        gain = jnp.minimum(ratio * normal, jnp.clip(ratio, 1 - CLIP, 1 + CLIP) * normal).mean()
        entropy = -(jnp.exp(log_probabilities) * log_probabilities).sum(-1).mean()
        return -gain + 0.5 * jnp.square(value - target).mean() - ENTROPY * entropy

    def update(carry, key):
        theta, moments, observation, state = carry
        act_key, shuffle_key = jax.random.split(key)
        (_, observation, state), steps = jax.lax.scan(
            act, (theta, observation, state), jax.random.split(act_key, STEPS)
        )
        last = network.apply(theta, observation)[1]

        def advantage_of(carry, step):
            following, advantage = carry
            alive = 1.0 - step.done
            delta = step.reward + GAMMA * following * alive - step.value
            advantage = delta + GAMMA * LAMBDA * alive * advantage
            return (step.value, advantage), advantage

        _, advantage = jax.lax.scan(advantage_of, (last, jnp.zeros(ENVS)), steps, reverse=True)
        target = advantage + steps.value
        flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), (steps, advantage, target))

        def minibatch(carry, rows):
            theta, moments = carry
            gradient = jax.grad(loss)(theta, *jax.tree.map(lambda x: x[rows], flat))
            change, moments = optimiser.update(gradient, moments)
            return (optax.apply_updates(theta, change), moments), None

        rows = jnp.concatenate(
            [jax.random.permutation(k, ENVS * STEPS) for k in jax.random.split(shuffle_key, EPOCHS)]
        ).reshape(EPOCHS * MINIBATCHES, -1)
        (theta, moments), _ = jax.lax.scan(minibatch, (theta, moments), rows)
        success = steps.success.sum() / jnp.maximum(steps.done.sum(), 1)
        return (theta, moments, observation, state), success

    @jax.jit
    def train(key):
        init_key, reset_key, key = jax.random.split(key, 3)
        seen, state = jax.vmap(environment.reset, in_axes=(0, None))(jax.random.split(reset_key, ENVS), params)
        observation = scaled(seen)
        theta = network.init(init_key, observation)
        carry = (theta, optimiser.init(theta), observation, state)
        carry, success = jax.lax.scan(update, carry, jax.random.split(key, updates))
        return carry[0], success

    def policy_of(theta):
        logits_of = jax.jit(lambda observation: network.apply(theta, scaled(observation))[0])
        generator = np.random.default_rng(0)

        def policy(observation):
            logits = np.asarray(logits_of(observation))
            return (logits + generator.gumbel(size=logits.shape)).argmax(-1)

        return policy

    return train, policy_of


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=2_000_000)
    parser.add_argument("--tasks", choices=("I", "II", "III"), nargs="+", default=["I", "II"])
    arguments = parser.parse_args()
    environment, params = functional_env(TaskVectorEnv(1, seed=0, split="train").problem)
    features = params.world.features
    scale = features.mean(0), features.std(0) + 1e-6
    train, policy_of = make_train(environment, params, scale, arguments.frames // (ENVS * STEPS))
    theta, success = train(jax.random.key(0))
    print(f"success rate of the last 20 updates: {float(success[-20:].mean()):.2f}")
    ROWS.mkdir(parents=True, exist_ok=True)
    for task in arguments.tasks:
        table = relm.compare(relm.evaluate("random", task), relm.evaluate(policy_of(theta), task, name="PPO"))
        table.save(ROWS / f"ppo-{task}.json")
        print(table)
