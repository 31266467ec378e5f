"""Feature expectations of a deterministic policy (the paper's Eq. 3): V(s) = Σ_t γᵗ φ(s_t) along its path from s.

The policy maps each state to the next one, so P has a single 1 in each row, and (I − γP)⁻¹Φ can be computed by path
doubling. Let V_k(s) be the sum of the first 2ᵏ terms and n_k(s) the state 2ᵏ steps after s. Then

    V_{k+1}(s) = V_k(s) + γ^(2ᵏ) V_k(n_k(s)),    n_{k+1}(s) = n_k(n_k(s)).

About log₂(37 / (1 − γ)) doublings, each a gather and a sum, reach the precision of float64.
"""

from math import ceil, log, log2

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64, Int, Int32, Integer, Real


def feature_expectations(
    features: Real[np.ndarray, "states d"], next_state: Int32[np.ndarray, "states"], discount: float
) -> Float64[np.ndarray, "states d"]:
    """Compute the feature expectations of every state, in float64.

    The sum is infinite: a state that leads to itself, such as an absorbing target, counts at every later step. With
    `relative_features`, the target contributes nothing.

    Args:
        features: φ(s) of all states.
        next_state: the state that follows each state under the policy, for example `Expert.next_state`.
        discount: γ, in (0, 1).

    Returns:
        V(s) of all states, (I − γP)⁻¹Φ.
    """
    terms = log(np.finfo(np.float64).eps * (1.0 - discount)) / log(discount)
    doublings = max(1, ceil(log2(max(terms, 2.0))))
    with jax.enable_x64(True):
        exact = jnp.asarray(np.asarray(features, np.float64))
        arguments = jnp.asarray(next_state), jnp.asarray(discount, jnp.float64), jnp.asarray(doublings, jnp.int32)
        return np.asarray(_double(exact, *arguments))


def mean_feature_expectations(
    features: Real[np.ndarray, "states d"],
    next_state: Int32[np.ndarray, "states"],
    discount: float,
    starts: Integer[np.ndarray, "starts"],
) -> Float64[np.ndarray, "d"]:
    """Compute μ, the feature expectations averaged over start states.

    Args:
        features: φ(s) of all states.
        next_state: the state that follows each state under the policy.
        discount: γ, in (0, 1).
        starts: the start states.

    Returns:
        μ.
    """
    return feature_expectations(features, next_state, discount)[starts].mean(axis=0)


@jax.jit
def _double(
    features: Float[Array, "states d"],
    next_state: Int[Array, "states"],
    discount: Float[Array, ""],
    doublings: Int[Array, ""],
) -> Float[Array, "states d"]:
    """Path doubling, see the module's docstring."""

    def step(_, carry):
        value, later, factor = carry
        return value + factor * value[later], later[later], factor * factor

    value, _, _ = jax.lax.fori_loop(0, doublings, step, (features, next_state, discount))
    return value
