"""The mapping agent's policy: draw the map, locate the target, plan, act.

At every step the policy counts the last action, adds the view to its memory if the pose is new, computes the posterior
over the target's pose and takes the first action of the best path. At the start it looks around, at most three turns,
while no pose has `confident` probability.

It knows the row of the view in the world's table, only to look up what the network says about that view; whether the
last action collided; and its own memory. It is told no pose, no map and no distance.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.map.filled import FilledMaps
from relm_irl_jax.agents.map.geometry import Extent
from relm_irl_jax.agents.map.memory import (
    Odometry,
    add_view,
    free_logits,
    move,
    start_odometry,
    summarise,
)
from relm_irl_jax.agents.map.network import RECORD, Projections
from relm_irl_jax.agents.map.planner import Plan, place_costs, plan
from relm_irl_jax.agents.map.posterior import log_posterior, scores, search_kernel
from relm_irl_jax.agents.map.prior import Prior, place_prior
from relm_irl_jax.types import Belief, Observation, Parameters

LARGEST_CHUNK = 32
"""Episodes planned together: their arrays stay in the cache."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SearchSettings:
    """How the agent searches; every number is traced.

    Attributes:
        discount: γ of the probability of discovery.
        caution: β, the cost of a place per unit of log odds against its being free.
        confident: probability of a pose above which the agent stops looking around at the start.
        turns: turns at the start at most.
        temperature: scores are divided by it: above 1 where the evidence of many cells is less than independent.
    """

    discount: Float32[Array, ""] | float = 0.9
    caution: Float32[Array, ""] | float = 3.0
    confident: Float32[Array, ""] | float = 0.5
    turns: Int32[Array, ""] | int = 3
    temperature: Float32[Array, ""] | float = 1.7


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Memory:
    """What the agent remembers of an episode.

    Attributes:
        grid: sums of what the views said, by z, x.
        odometry: pose and poses seen.
        action: last action, -1 before the first.
        steps: actions taken.
    """

    grid: Float[Array, "*batch grid grid record"]
    odometry: Odometry
    action: Int32[Array, "*batch"]
    steps: Int32[Array, "*batch"]

    def after(self, action: Int32[Array, "*batch"]) -> "Memory":
        """The memory after an action is chosen."""
        return replace(self, action=action, steps=self.steps + 1)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MapPolicy:
    """The mapping agent, its tables computed for the views and targets at hand.

    Attributes:
        record: what each view of the world says about the cells of its region.
        kernel: spectrum of each target's kernel.
        prior: the learned profiles.
        search: how it searches.
        filled: maps with which memory begins, one for each scene of the world; None for empty memory.
    """

    record: Float[Array, "views cells record"]
    kernel: Float32[Array, "targets channel 4 2 frequencies"]
    prior: Prior
    search: SearchSettings
    filled: FilledMaps | None = None

    @property
    def extent(self) -> Extent:
        """How far the map reaches."""
        return Extent.of_side(self.prior.pose.shape[-1])

    @property
    def deterministic(self) -> bool:
        """It draws nothing at random."""
        return True

    def init(self, shape: tuple[int, ...]) -> Memory:
        """The memory at the start of an episode: empty, or filled with the map of the scene.

        Args:
            shape: scenes and episodes.

        Returns:
            The memory before the first view.
        """
        size, odometry = self.extent.grid, start_odometry(shape, self.extent)
        grid = jnp.zeros((*shape, size, size, RECORD), self.record.dtype)
        if self.filled is not None:
            grid = jnp.broadcast_to(self.filled.grid[:, None], grid.shape)
            blocked = jnp.broadcast_to(self.filled.blocked[:, None], odometry.blocked.shape)
            odometry = replace(odometry, blocked=blocked)
        return Memory(grid, odometry, jnp.full(shape, -1, jnp.int32), jnp.zeros(shape, jnp.int32))

    def act(
        self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[Memory, Int32[Array, "scenes batch"]]:
        """Draw the view into the map and choose an action.

        Args:
            key: not used; the policy is deterministic.
            memory: what is remembered.
            observation: what is seen.
            target: row of the target.

        Returns:
            The memory after the view, and the action.
        """
        del key
        memory = remember(self, memory, observation)
        choose = lambda memory, target: think(self, memory, target)[0]  # noqa: E731
        action = choose_where_running(choose, memory, target, observation.running)
        return memory.after(action), action

    def belief(self, memory: Memory, target: Int32[Array, "scenes batch"]) -> Belief:
        """Where it believes the target to be; see `relm_irl_jax.types.SearchingPolicy`.

        Args:
            memory: what is remembered, with the current view.
            target: row of the target.

        Returns:
            The belief, in the frame of the start, or of the scene's map if the memory began filled.
        """
        shape, n = target.shape, target.size
        flat = jax.tree.map(lambda x: x.reshape(n, *x.shape[len(shape) :]), memory)
        posterior, free = locate(self, flat, target.reshape(n))
        inner = self.extent.inner
        weight = flat.grid[:, inner, inner, -2].astype(jnp.float32)
        belief = Belief(flat.odometry.pose, posterior, free, weight / (1 + weight))
        return jax.tree.map(lambda x: x.reshape(*shape, *x.shape[1:]), belief)


def choose_where_running(
    choose: Callable[[Any, Int32[Array, "chunk"]], Int32[Array, "chunk"]],
    memory: Any,
    target: Int32[Array, "scenes batch"],
    running: Bool[Array, "scenes batch"] | None,
) -> Int32[Array, "scenes batch"]:
    """Choose actions, a chunk of episodes at a time, and skip chunks in which none runs.

    Args:
        choose: maps memories and targets of a chunk to actions.
        memory: memories of all episodes; every field is [scenes, batch, …].
        target: rows of the targets.
        running: which episodes run; None for all.

    Returns:
        The actions; 0 where an episode is skipped.
    """
    n, shape = target.size, target.shape
    flat, targets = jax.tree.map(lambda x: x.reshape(n, *x.shape[len(shape) :]), memory), target.reshape(n)
    # Episodes that run come first, so that the chunks behind them are skipped.
    runs = jnp.ones(n, bool) if running is None else running.reshape(n)
    order = jnp.argsort(~runs, stable=True)
    size = max(size for size in range(1, LARGEST_CHUNK + 1) if n % size == 0)

    def act_together(chunk: Int32[Array, "chunk"]) -> Int32[Array, "chunk"]:
        chosen = lambda: choose(jax.tree.map(lambda x: x[chunk], flat), targets[chunk])  # noqa: E731
        return jax.lax.cond(runs[chunk].any(), chosen, lambda: jnp.zeros_like(chunk))

    actions = jax.lax.map(act_together, order.astype(jnp.int32).reshape(-1, size)).reshape(n)
    return jnp.zeros(n, jnp.int32).at[order].set(actions).reshape(shape)


def remember(policy: MapPolicy, memory: Memory, observation: Observation) -> Memory:
    """Count the last action and add the view where its pose is new; a filled memory recognises the first view instead.

    Args:
        policy: the policy.
        memory: what is remembered.
        observation: what is seen.

    Returns:
        The memory with the view.
    """

    filled, radius = policy.filled, policy.extent.radius

    def one(grid, odometry, action, view, collided, steps):
        odometry = move(odometry, action, collided)
        if filled is not None:
            odometry = replace(odometry, pose=jnp.where(steps == 0, filled.pose[view], odometry.pose))
        heading, z, x = odometry.pose[0], odometry.pose[1] + radius, odometry.pose[2] + radius
        if filled is None:
            new = ~odometry.seen[heading, z, x]
            grid = add_view(grid, policy.record[view] * new.astype(grid.dtype), odometry.pose)
        return grid, replace(odometry, seen=odometry.seen.at[heading, z, x].set(True))

    for _ in observation.view.shape:
        one = jax.vmap(one)
    grid, odometry = one(
        memory.grid, memory.odometry, memory.action, observation.view, observation.collided, memory.steps
    )
    return Memory(grid, odometry, memory.action, memory.steps)


def locate(
    policy: MapPolicy,
    memory: Memory,
    target: Int32[Array, "batch"],
    prior: Float32[Array, "batch z x"] | None = None,
) -> tuple[Float32[Array, "batch 4 z x"], Float32[Array, "batch z x"]]:
    """The posterior over the target's pose, and the log odds that places are free.

    Args:
        policy: the policy.
        memory: what is remembered.
        target: row of the target.
        prior: further logarithms of the prior of each place; None for none.

    Returns:
        P and the log odds.
    """
    seen, evidence = summarise(memory.grid)
    free = free_logits(evidence, policy.prior.free, policy.prior.scale, memory.odometry)
    score = jax.lax.map(lambda lane: scores(lane[0], policy.kernel[lane[1]]), (seen, target))
    possible = ~memory.odometry.seen & ~memory.odometry.blocked[:, None]
    score = score / policy.search.temperature
    if prior is not None:
        score = score + prior[:, None]
    return jnp.exp(log_posterior(score, free, policy.prior.pose, possible)), free


def think(
    policy: MapPolicy,
    memory: Memory,
    target: Int32[Array, "batch"],
    *,
    prior: Float32[Array, "batch z x"] | None = None,
    price: Float32[Array, "batch z x"] | None = None,
) -> tuple[Int32[Array, "batch"], Float32[Array, "batch 4 z x"], Plan]:
    """Locate the target and plan.

    Args:
        policy: the policy.
        memory: what is remembered, with the current view.
        target: row of the target.
        prior: further logarithms of the prior of each place; None for none.
        price: what the cost of entering each place is multiplied by; None for 1.

    Returns:
        The action, the posterior and the plan.
    """
    posterior, free = locate(policy, memory, target, prior)
    odometry, search = memory.odometry, policy.search
    last = lambda x: jnp.moveaxis(x, 0, -1)  # noqa: E731
    cost = place_costs(last(free), last(odometry.seen.any(1)), last(odometry.blocked), jnp.float32(search.caution))
    if price is not None:
        cost = cost * last(price)
    chosen = plan(last(posterior), cost, odometry.pose.T, jnp.float32(search.discount))
    unsure = posterior.max((1, 2, 3)) < search.confident
    looking = (memory.steps < search.turns) & (odometry.pose[:, 1:] == 0).all(1) & unsure
    if policy.filled is not None:
        looking = jnp.zeros_like(looking)
    return jnp.where(looking, 1, chosen.action), posterior, chosen


def map_policy(
    parameters: Parameters,
    projections: Projections,
    target_views: np.ndarray,
    search: SearchSettings,
    extent: Extent,
    filled: FilledMaps | None = None,
) -> MapPolicy:
    """Prepare the policy for a world.

    Args:
        parameters: the agent's parameters.
        projections: what the network says about each view of the world.
        target_views: row of each target's view.
        search: how to search.
        extent: how far the map reaches.
        filled: maps with which memory begins; None for empty memory.

    Returns:
        The policy.
    """
    kernel = jax.jit(search_kernel, static_argnames="extent")(projections.kernel[jnp.asarray(target_views)], extent)
    prior = place_prior(parameters, extent)
    if filled is not None:  # the learned profile is one of distances from the start, which is not the map's origin here
        prior = replace(prior, pose=jnp.zeros_like(prior.pose))
    return MapPolicy(projections.record, kernel, prior, search, filled)
