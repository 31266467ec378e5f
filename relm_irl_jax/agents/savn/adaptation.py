"""How the network changes its own weights during an episode (Wortsman et al., Learning to Learn How to Learn, 2019).

Each episode has a change Δ of some of the network's weights, 0 at its start. After every K steps, at most N times,

    ℓ = ‖ leaky ReLU( Σ_k [m_k, π_k] F_k + f ) ‖,     Δ ← Δ − α ∂ℓ/∂Δ

where m_k is what the head was given in the last K steps, and π_k the policy in these steps under the current weights. ℓ
is the interaction loss: F and f are learned, no reward enters. The meta-gradient differentiates the loss of all later
actions with respect to θ, F and f through these steps; it is what teaches F to be a loss whose descent helps.

Δ belongs to the policy alone. The value is a baseline, which may stay as it is.

All episodes are adapted at once. Axes are `groups batch`, with the last K steps before them.
"""

from dataclasses import dataclass, field
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int32

from relm_irl_jax import env
from relm_irl_jax.scenes.scene import ACTIONS
from relm_irl_jax.types import Parameters

INTERACTION = "interaction"
"""Name of F and f among the parameters."""

FILTERS = 16
"""Number of outputs of the temporal filters F."""

SLOPE = 0.01
"""Slope of the leaky ReLU below 0."""

SMALLEST = 1e-12
"""Added to the squared norm, which has no gradient at 0."""

Change = dict[str, Float[Array, "..."]]
"""Change of some of the head's weights, by their names; [groups, batch, ...]."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Adaptation:
    """How an episode's weights change.

    Attributes:
        inner_steps: N, the largest number of changes in an episode.
        rate: α, the step size.
        adapted: the weights that change: the `policy` layer, or also the hidden layer below it (`top`). Static.
        interval: K, the number of steps after which, and from which, weights change. Static.
        first_order: whether the meta-gradient takes ∂ℓ/∂Δ as independent of θ. Static.
    """

    inner_steps: Int32[Array, ""]
    rate: Float[Array, ""]
    adapted: Literal["policy", "top"] = field(metadata={"static": True})
    interval: int = field(metadata={"static": True})
    first_order: bool = field(metadata={"static": True})

    def unchanged(self, shape: tuple[int, ...], memory: int) -> Change:
        """Δ at the start of episodes.

        Args:
            shape: groups and batch.
            memory: units of the memory.

        Returns:
            Zeros.
        """
        sizes = {"policy_kernel": (len(ACTIONS), memory), "policy_bias": (len(ACTIONS),)}
        if self.adapted == "top":
            sizes |= {"head_kernel": (memory, memory), "head_bias": (memory,)}
        return {name: jnp.zeros((*shape, *size), jnp.float32) for name, size in sizes.items()}


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Window:
    """Consecutive steps of all episodes.

    Attributes:
        hidden: what the heads are given.
        below: the head's hidden layer before its ReLU, with unchanged weights.
    """

    hidden: Float[Array, "*time groups batch memory"]
    below: Float[Array, "*time groups batch memory"]


def init_interaction(key: Array, interval: int, memory: int) -> dict[str, Float[Array, "..."]]:
    """Draw the parameters of the interaction loss.

    Args:
        key: source of randomness.
        interval: K.
        memory: units of the memory.

    Returns:
        F and f.
    """
    shape = (interval, memory + len(ACTIONS), FILTERS)
    filters = jax.random.normal(key, shape, jnp.float32) / jnp.sqrt(jnp.float32(shape[0] * shape[1]))
    return {"filters": filters, "bias": jnp.zeros(FILTERS, jnp.float32)}


def policy_logits(
    parameters: Parameters,
    window: Window,
    change: Change,
    head: Int32[Array, "groups"],
    changed: Bool[Array, "*time groups batch"] | None = None,
) -> Float[Array, "*time groups batch 4"]:
    """Logits of the policy with changed weights.

    Args:
        parameters: θ.
        window: one or several steps.
        change: Δ.
        head: head of each group.
        changed: the steps with changed weights; None for all.

    Returns:
        Action logits.
    """
    weights, top = parameters["params"], window.below

    def added(term: Array) -> Array:
        return term if changed is None else jnp.where(changed[..., None], term, 0.0)

    if "head_kernel" in change:
        product = jnp.einsum("...gbm,gbmn->...gbn", window.hidden, change["head_kernel"])
        top = top + added(product + change["head_bias"])
    top = jax.nn.relu(top)
    base = jnp.einsum("...gbn,gon->...gbo", top, weights["policy_kernel"][head]) + weights["policy_bias"][head]
    product = jnp.einsum("...gbn,gbon->...gbo", top, change["policy_kernel"])
    return base + added(product + change["policy_bias"])


def interaction_loss(
    interaction: dict[str, Float[Array, "..."]],
    hidden: Float[Array, "time groups batch memory"],
    policy: Float[Array, "time groups batch 4"],
) -> Float[Array, "groups batch"]:
    """The learned loss ℓ of each episode.

    Args:
        interaction: F and f.
        hidden: what the heads were given in the last K steps.
        policy: probabilities of the actions in these steps.

    Returns:
        ℓ.
    """
    filters, memory = interaction["filters"], hidden.shape[-1]
    filtered = interaction["bias"] + sum(
        hidden[k] @ filters[k, :memory] + policy[k] @ filters[k, memory:] for k in range(len(filters))
    )
    return jnp.sqrt((jax.nn.leaky_relu(filtered, SLOPE) ** 2).sum(-1) + SMALLEST)


def inner_step(
    parameters: Parameters, window: Window, change: Change, head: Int32[Array, "groups"], adaptation: Adaptation
) -> Change:
    """One step down the interaction loss, for every episode.

    Args:
        parameters: θ, with F and f.
        window: the last K steps.
        change: Δ.
        head: head of each group.
        adaptation: how weights change.

    Returns:
        The next Δ.
    """
    network, at, seen = parameters, change, window
    if adaptation.first_order:
        network, at, seen = jax.lax.stop_gradient((parameters, change, window))

    def loss(change: Change) -> Array:
        policy = jax.nn.softmax(policy_logits(network, seen, change, head))
        return interaction_loss(parameters[INTERACTION], seen.hidden, policy).sum()

    return jax.tree.map(lambda old, slope: old - adaptation.rate * slope, change, jax.grad(loss)(at))


def adapt_where(
    due: Bool[Array, "groups batch"],
    parameters: Parameters,
    window: Window,
    change: Change,
    head: Int32[Array, "groups"],
    adaptation: Adaptation,
) -> Change:
    """One inner step for some episodes; nothing is computed if there is none.

    Args:
        due: the episodes.
        parameters: θ, with F and f.
        window: the last K steps.
        change: Δ.
        head: head of each group.
        adaptation: how weights change.

    Returns:
        The next Δ.
    """

    def adapt() -> Change:
        return env.select(due, inner_step(parameters, window, change, head, adaptation), change)

    return jax.lax.cond(due.any(), adapt, lambda: change)
