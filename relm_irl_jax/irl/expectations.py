"""Feature expectations of a deterministic policy: V(s) = Σ_t γᵗ φ(s_t), the sum along its walk from s.

The policy is a map from each state to the next, so γP is a scaled permutation-like matrix and (I − γP)⁻¹Φ can
be had by path doubling: with V_k(s) the sum of the first 2ᵏ terms and n_k(s) the state 2ᵏ steps on,

    V_{k+1}(s) = V_k(s) + γ^(2ᵏ) V_k(n_k(s)),    n_{k+1}(s) = n_k(n_k(s)).

About log₂(37 / (1 − γ)) doublings reach float64's precision, each one gather and one sum.
"""

from functools import partial
from math import ceil, log, log2

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64, Int, Int32, Real


def feature_expectations(
    features: Real[np.ndarray, "states d"], next_state: Int32[np.ndarray, "states"], discount: float
) -> Float64[np.ndarray, "states d"]:
    """Feature expectations from every state, in float64.

    The policy never stops: a state that leads to itself, such as an absorbing target, is summed for ever.
    Give `problem.relative_features` to make the target's own tail vanish.

    Args:
        features: φ(s) for all states.
        next_state: the state that the policy leads to from each state, for example `Expert.next_state`.
        discount: γ, in (0, 1).

    Returns:
        V(s) for all states, (I − γP)⁻¹Φ.
    """
    terms = log(np.finfo(np.float64).eps * (1.0 - discount)) / log(discount)
    doublings = max(1, ceil(log2(max(terms, 2.0))))
    with jax.enable_x64(True):
        exact = jnp.asarray(np.asarray(features, np.float64))
        return np.asarray(_double(exact, jnp.asarray(next_state), jnp.asarray(discount, jnp.float64), doublings))


@partial(jax.jit, static_argnames="doublings")
def _double(
    features: Float[Array, "states d"],
    next_state: Int[Array, "states"],
    discount: Float[Array, ""],
    doublings: int,
) -> Float[Array, "states d"]:
    """The doubling of the module's docstring."""

    def step(_, carry):
        value, onward, factor = carry
        return value + factor * value[onward], onward[onward], factor * factor

    value, _, _ = jax.lax.fori_loop(0, doublings, step, (features, next_state, discount))
    return value
