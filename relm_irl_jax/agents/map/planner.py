"""Which way to search: shortest optimistic paths, and the path that most likely finds the target soon.

*Paths.* Entering place p costs

    c(p) = 1 + β · max(0, −logit p_free(p))    not stood on;    1  stood on;    ∞  a collision showed it to be blocked

and a turn costs 1. The least cost d(g) of reaching pose g from the current one is the fixed point of

    d(g) = min_{g' → g} d(g') + c(g' → g),    d(current) = 0

which `sweeps` computes. It is optimistic: what is not known to be blocked may be free.

*Search.* Of the posterior P over the target's pose, a path g_1, g_2, … discovers Σ_i γ^{d(g_i)} P(g_i), each pose
counting with the discount of the moment at which it is reached. Among shortest paths, the best one to each pose obeys

    U(g) = γ^{d(g)} P(g) + max_{g' : d(g') + c = d(g)} U(g')

and the agent takes the first action of the path to the pose with the greatest U; it plans anew after every step.

Arrays have the batch as their last axis, so that every shift is a copy of contiguous memory.

Sources: Stone, "Theory of optimal search" (1975), and Bourgault et al., "Optimal search for a lost target in a Bayesian
world" (2003), for the discounted probability of discovery; Chaplot et al. (2020) for planning on partial maps.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32

from relm_irl_jax.agents.map.geometry import FORWARD
from relm_irl_jax.agents.map.sweeps import NEVER, TOLERANCE, discoveries, from_lines, least_costs, small_gain, to_lines


class Plan(NamedTuple):
    """What the agent intends.

    Attributes:
        action: the first action.
        goal: number of the pose at the end of the path, (heading · side + z) · side + x in a square of `side` rows.
        distance: d of every pose.
        value: U of every pose.
    """

    action: Int32[Array, "batch"]
    goal: Int32[Array, "batch"]
    distance: Float32[Array, "4 z x batch"]
    value: Float32[Array, "4 z x batch"]


def place_costs(
    free: Float32[Array, "z x batch"],
    stood: Bool[Array, "z x batch"],
    blocked: Bool[Array, "z x batch"],
    caution: Float32[Array, ""],
) -> Float32[Array, "z x batch"]:
    """Cost of entering each place.

    Args:
        free: log odds that the place is free.
        stood: whether the agent stood there.
        blocked: whether a collision showed it to be blocked.
        caution: β.

    Returns:
        c.
    """
    cost = 1 + caution * jax.nn.relu(-free)
    return jnp.where(blocked, NEVER, jnp.where(stood, 1.0, cost))


def _first_action(
    goal: Int32[Array, "batch"],
    value: Float32[Array, "4 z x batch"],
    distance: Float32[Array, "4 z x batch"],
    cost: Float32[Array, "z x batch"],
) -> Int32[Array, "batch"]:
    """Follow the best path back from its end to its first action."""
    lanes, side = jnp.arange(len(goal)), len(cost)
    step = jnp.asarray(FORWARD)
    heading, z, x = goal // side**2, goal // side % side, goal % side

    def at(values, h, z, x, fill):
        inside = (z >= 0) & (z < side) & (x >= 0) & (x < side)
        return jnp.where(inside, values[h, jnp.clip(z, 0, side - 1), jnp.clip(x, 0, side - 1), lanes], fill)

    def back(carry):
        heading, z, x, action, _, count = carry
        here = distance[heading, z, x, lanes]
        entering = cost[z, x, lanes]
        sources = [
            (heading, z - step[heading, 1], x - step[heading, 0], entering),
            ((heading - 1) % 4, z, x, jnp.ones_like(entering)),
            ((heading + 1) % 4, z, x, jnp.ones_like(entering)),
            (heading, z + step[heading, 1], x + step[heading, 0], entering),
        ]
        worth = jnp.stack(
            [
                jnp.where(at(distance, h, zz, xx, NEVER) + paid < here + TOLERANCE, at(value, h, zz, xx, -1.0), -2.0)
                for h, zz, xx, paid in sources
            ]
        )
        best = worth.argmax(0).astype(jnp.int32)
        pick = lambda values: jnp.take_along_axis(jnp.stack(values), best[None], 0)[0]  # noqa: E731
        moving = here > TOLERANCE
        heading = jnp.where(moving, pick([s[0] for s in sources]), heading)
        z = jnp.where(moving, pick([s[1] for s in sources]), z)
        x = jnp.where(moving, pick([s[2] for s in sources]), x)
        return heading, z, x, jnp.where(moving, best, action), moving.any(), count + 1

    nothing = jnp.zeros_like(goal)
    carry = (heading, z, x, nothing, jnp.bool_(True), jnp.int32(0))
    return jax.lax.while_loop(lambda carry: carry[4] & (carry[5] < 4 * side**2), back, carry)[3]


def plan(
    posterior: Float32[Array, "4 z x batch"],
    cost: Float32[Array, "z x batch"],
    pose: Int32[Array, "3 batch"],
    discount: Float32[Array, ""],
) -> Plan:
    """Choose the path with the largest discounted probability of discovery.

    Args:
        posterior: P.
        cost: cost of entering each place.
        pose: current heading, z and x.
        discount: γ.

    Returns:
        The plan. Where no pose can be reached, it turns right.
    """
    lines = least_costs(cost, pose)
    along_z, along_x = (
        jnp.where(reach < NEVER, discount**reach * likely, 0.0)
        for reach, likely in zip(lines, to_lines(posterior), strict=True)
    )
    distance, value = from_lines(lines), from_lines(discoveries((along_z, along_x), lines, cost))
    # Of equally valuable poses, the nearest: the path's end adds nothing beyond its last likely pose.
    nearer = small_gain(value.max((0, 1, 2))) * distance
    worth = jnp.where((distance < NEVER) & (distance > 0), value - nearer, -1.0)
    goal = worth.reshape(-1, worth.shape[-1]).argmax(0).astype(jnp.int32)
    stuck = worth.max((0, 1, 2)) < 0
    action = jnp.where(stuck, 1, _first_action(goal, value, distance, cost))
    return Plan(action, goal, distance, value)
