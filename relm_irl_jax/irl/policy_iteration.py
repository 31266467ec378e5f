"""Optimal deterministic policies under a known reward, by policy iteration on the graph of a scene."""

import numpy as np
from jaxtyping import Float64, Int32, Int64

from relm_irl_jax.irl.expectations import feature_expectations

GAIN_TOLERANCE = 1e-10
"""Improvements below this share of the largest value are ignored, so that rounding errors cannot cause a cycle."""


def optimal_policy(
    rewards: Float64[np.ndarray, "states"],
    successors: Int32[np.ndarray, "states 4"],
    target: int,
    discount: float,
) -> Int64[np.ndarray, "states"]:
    """Compute an optimal deterministic policy for episodes that end at the target with a return of 0.

    Args:
        rewards: reward of each state, received on leaving it.
        successors: next state for each action.
        target: the state at which episodes end.
        discount: γ.

    Returns:
        The action in every state; the target's action has no meaning.
    """
    states = np.arange(len(successors))
    absorbing_rewards = np.where(states == target, 0.0, rewards)
    action = np.zeros(len(successors), np.int64)
    while True:
        next_state = next_states(successors, target, action)
        value = feature_expectations(absorbing_rewards[:, None], next_state, discount)[:, 0]
        quality = rewards[:, None] + discount * value[successors]
        best = np.argmax(quality, axis=1)
        tolerance = GAIN_TOLERANCE * max(1.0, float(np.abs(value).max()))
        gains = quality[states, best] > quality[states, action] + tolerance
        gains[target] = False
        if not gains.any():
            return action
        action = np.where(gains, best, action)


def next_states(
    successors: Int32[np.ndarray, "states 4"], target: int, action: Int64[np.ndarray, "states"]
) -> Int32[np.ndarray, "states"]:
    """The state that follows each state under a deterministic policy; the target follows itself.

    Args:
        successors: next state for each action.
        target: the absorbing state.
        action: the policy.

    Returns:
        The next state of every state.
    """
    states = np.arange(len(successors))
    return np.where(states == target, target, successors[states, action]).astype(np.int32)
