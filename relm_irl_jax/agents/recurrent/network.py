"""The siamese actor-critic with recurrent memory.

    z(x)   = ReLU(x W + b)                       shared by current and target view
    u      = ReLU(z(s) U + z(g) V + e E + c)     fusion; e says which action was taken last, and whether it collided
    m'     = GRU(m, u G + g)   or   LSTM(m, u G + g)
    k      = ReLU((m' + u) H_i + d_i)            layer of head i, one for each room type or scene
    logits = k P_i + p_i,   value = k q_i + r_i

The head sees u beside the memory: without it, nothing can be learned before the memory has learned to hand it on.
Only the memory m depends on earlier steps. The layers below it are computed for all steps of a rollout in a few large
products, the layers above it likewise; learning goes through time in the product m R alone.
"""

from dataclasses import dataclass
from functools import partial
from typing import Literal

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int32

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.scenes.scene import ACTIONS

NO_ACTION = -1
"""Last action before the first one of an episode."""

EVENTS = 2 * len(ACTIONS)
"""Each action, with and without a collision."""

KEPT = 1.0
"""Bias of the gate that keeps the memory: with 0, memory fades before it is known what for (Gers et al., 2000)."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Recurrent:
    """Recurrent state.

    Attributes:
        hidden: output of the cell.
        cell: the LSTM's cell state; None for a GRU.
    """

    hidden: Float[Array, "*batch memory"]
    cell: Float[Array, "*batch memory"] | None


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Seen:
    """What an agent observes in a step, with its own last action.

    Attributes:
        view: state whose view is observed.
        target: row of the targets.
        last_action: the last action; `NO_ACTION` at the start of an episode.
        collided: whether it collided.
    """

    view: Int32[Array, "*batch"]
    target: Int32[Array, "*batch"]
    last_action: Int32[Array, "*batch"]
    collided: Bool[Array, "*batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Tables:
    """Layers of single views, computed once for each update; exactly one of the first two is present.

    Attributes:
        state: z(s) U + c for every state.
        features: encoded views, if there is no table over states.
        target: z(g) V for every target.
    """

    state: Float[Array, "states memory"] | None
    features: Float[Array, "states feature"] | None
    target: Float[Array, "targets memory"]


class RecurrentActorCritic(nn.Module):
    """Policy and value of every head, with memory.

    Attributes:
        n_heads: number of heads.
        width: units of the shared layer.
        memory: units of the layers after it: fusion layer, recurrent cell, hidden layer of a head.
        cell: kind of the recurrent cell.
    """

    n_heads: int
    width: int = 512
    memory: int = 256
    cell: Literal["gru", "lstm"] = "gru"

    def setup(self) -> None:
        """Declare the layers."""
        gates = self.memory * (3 if self.cell == "gru" else 4)
        he, half = nn.initializers.he_normal(), nn.initializers.lecun_normal()
        draw = partial(
            nn.initializers.variance_scaling, distribution="truncated_normal", mode="fan_in", batch_axis=(0,)
        )
        # Kernels with few outputs have these as rows, which makes the gradient three times as fast.
        draw_rows = partial(draw, in_axis=-1, out_axis=-2)
        zeros, shape = nn.initializers.zeros, (self.n_heads, 1)
        self.shared = nn.Dense(self.width, kernel_init=he)
        self.fusion_state = nn.Dense(self.memory, kernel_init=half)
        self.fusion_target = nn.Dense(self.memory, use_bias=False, kernel_init=half)
        self.event = self.param("event", nn.initializers.normal(1.0), (EVENTS, self.memory))
        self.input = nn.Dense(gates, kernel_init=half)
        self.recurrent_kernel = self.param("recurrent_kernel", nn.initializers.lecun_normal(), (self.memory, gates))
        if self.cell == "gru":
            self.candidate_bias = self.param("candidate_bias", zeros, (self.memory,))
        self.head_kernel = self.param("head_kernel", draw(2.0), (self.n_heads, self.memory, self.memory))
        self.head_bias = self.param("head_bias", zeros, (*shape, self.memory))
        self.policy_kernel = self.param("policy_kernel", draw_rows(1e-4), (self.n_heads, len(ACTIONS), self.memory))
        self.policy_bias = self.param("policy_bias", zeros, (*shape, len(ACTIONS)))
        self.value_kernel = self.param("value_kernel", draw_rows(2.0), (*shape, self.memory))
        self.value_bias = self.param("value_bias", zeros, (*shape, 1))

    def __call__(
        self,
        features: Float[Array, "states feature"],
        target_state: Int32[Array, "targets"],
        seen: Seen,
        head: Int32[Array, "groups"],
    ) -> Outputs:
        """Policy and value of the first step of episodes.

        Args:
            features: encoded view of every state.
            target_state: state of every target.
            seen: what is observed; fields are [groups, batch].
            head: head of each group.

        Returns:
            Action logits and values.
        """
        inputs = self.inputs(self.tables(features, target_state, every_state=False), seen)
        return self.outputs(self.recall(self.step(self.initial(seen.view.shape), inputs), inputs), head)

    def initial(self, shape: tuple[int, ...]) -> Recurrent:
        """The recurrent state at the start of episodes.

        Args:
            shape: leading axes.

        Returns:
            Zeros.
        """
        zeros = jnp.zeros((*shape, self.memory), jnp.float32)
        return Recurrent(zeros, zeros if self.cell == "lstm" else None)

    def tables(
        self, features: Float[Array, "states feature"], target_state: Int32[Array, "targets"], *, every_state: bool
    ) -> Tables:
        """Compute the layers of single views.

        Args:
            features: encoded view of every state.
            target_state: state of every target.
            every_state: whether to compute a table over all states, or only over targets. Static.

        Returns:
            The tables.
        """
        if every_state:
            encoded = nn.relu(self.shared(features))
            return Tables(self.fusion_state(encoded), None, self.fusion_target(encoded[target_state]))
        return Tables(None, features, self.fusion_target(nn.relu(self.shared(features[target_state]))))

    def inputs(self, tables: Tables, seen: Seen) -> Float[Array, "groups batch gates"]:
        """The layers below the memory.

        Args:
            tables: the tables.
            seen: what is observed; fields are [groups, batch].

        Returns:
            The cell's inputs u G + g, and u.
        """
        if tables.state is not None:
            half = tables.state[seen.view]
        else:
            assert tables.features is not None
            half = self.fusion_state(nn.relu(self.shared(tables.features[seen.view])))
        number = 2 * seen.last_action + seen.collided.astype(jnp.int32)  # negative, and nothing, for `NO_ACTION`
        # Rows in one axis: the gradient of a product over two axes at once is slow.
        event = jax.nn.one_hot(number.reshape(-1), EVENTS, dtype=half.dtype) @ self.event
        fusion = nn.relu(half + tables.target[seen.target] + event.reshape(half.shape))
        return jnp.concatenate([self.input(fusion), fusion], -1)

    def step(self, before: Recurrent, inputs: Float[Array, "groups batch gates"]) -> Recurrent:
        """One step of the memory.

        Args:
            before: the recurrent state before the step.
            inputs: the cell's inputs.

        Returns:
            The recurrent state after the step.
        """
        recurrent, inputs = before.hidden @ self.recurrent_kernel, inputs[..., : -self.memory]
        if self.cell == "lstm":
            assert before.cell is not None
            enter, keep, out, candidate = jnp.split(inputs + recurrent, 4, -1)
            cell = nn.sigmoid(keep + KEPT) * before.cell + nn.sigmoid(enter) * jnp.tanh(candidate)
            return Recurrent(nn.sigmoid(out) * jnp.tanh(cell), cell)
        enters, recurs = jnp.split(inputs, 3, -1), jnp.split(recurrent, 3, -1)
        reset, keep = nn.sigmoid(enters[0] + recurs[0]), nn.sigmoid(enters[1] + recurs[1] + KEPT)
        candidate = jnp.tanh(enters[2] + reset * (recurs[2] + self.candidate_bias))
        return Recurrent((1.0 - keep) * candidate + keep * before.hidden, None)

    def recall(
        self, after: Recurrent, inputs: Float[Array, "*time groups batch gates"]
    ) -> Float[Array, "*time groups batch memory"]:
        """What the heads are given: the memory, and the fusion layer beside it.

        Args:
            after: the recurrent state after the step.
            inputs: the cell's inputs, with the fusion layer.

        Returns:
            m' + u.
        """
        return after.hidden + inputs[..., -self.memory :]

    def outputs(self, hidden: Float[Array, "groups batch memory"], head: Int32[Array, "groups"]) -> Outputs:
        """The layers above the memory.

        Args:
            hidden: what `recall` returns.
            head: head of each group.

        Returns:
            Action logits and values.
        """
        top = nn.relu(hidden @ self.head_kernel[head] + self.head_bias[head])
        project = partial(jnp.einsum, "gbw,gow->gbo", top)
        logits = project(self.policy_kernel[head]) + self.policy_bias[head]
        value = project(self.value_kernel[head]) + self.value_bias[head]
        return Outputs(logits, value[..., 0])
