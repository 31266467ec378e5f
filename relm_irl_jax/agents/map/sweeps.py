"""Shortest paths over poses, and the most that is gained along them, by sweeps along lines.

A pose of heading 0 or 2 moves along z, one of heading 1 or 3 along x; in both directions, since the agent also walks
back. So each of them lies on a *line* of poses of its heading, which it leaves by turning only. What a line's poses
cost, given what it costs to turn into each of them, takes one sweep forwards and one backwards:

    d(p) ← min(d(p), d(p − 1) + c(p))  for p = 0 … n,    then    d(p) ← min(d(p), d(p + 1) + c(p))  for p = n … 0

Sweeping the lines along z and along x in turn, each after the turns from the other, is Bellman–Ford with the updates in
an order (Gauss–Seidel) that needs as many rounds as the longest of all shortest paths has turns, instead of as many as
it has steps. The sums of gains along shortest paths are swept in the same way.

Lines are arrays [place along the line, heading, line, batch]: headings 0 and 2 with lines by x, headings 1 and 3 with
lines by z. The batch comes last, so that one step of a sweep goes over contiguous memory.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32

from relm_irl_jax.agents.map.geometry import Extent

NEVER = 1e6
"""Cost of what cannot be reached."""

TOLERANCE = 1e-3
"""Difference below which two paths cost the same."""

Lines = Float32[Array, "place 2 line batch"]
"""A value for each pose of two opposite headings."""

LineCosts = Float32[Array, "place 1 line batch"]
"""Cost of entering each place of each line, the same for both headings."""

Along = tuple[Lines, Lines]
"""A value for each pose: of headings 0 and 2, whose lines run along z, and of headings 1 and 3, along x."""


def to_lines(values: Float32[Array, "4 z x batch"]) -> Along:
    """Arrange values of poses by lines.

    Args:
        values: one value for each pose.

    Returns:
        The lines along z and along x.
    """
    return values[0::2].transpose(1, 0, 2, 3), values[1::2].transpose(2, 0, 1, 3)


def from_lines(lines: Along) -> Float32[Array, "4 z x batch"]:
    """Arrange values by heading, z and x: the inverse of `to_lines`.

    Args:
        lines: the lines along z and along x.

    Returns:
        One value for each pose.
    """
    along_z, along_x = lines[0].transpose(1, 0, 2, 3), lines[1].transpose(1, 2, 0, 3)
    return jnp.stack([along_z[0], along_x[0], along_z[1], along_x[1]])


def costs_of_lines(cost: Float32[Array, "z x batch"]) -> tuple[LineCosts, LineCosts]:
    """The cost of entering the places of each line.

    Args:
        cost: cost of entering each place.

    Returns:
        It for the lines along z and along x.
    """
    return cost[:, None], cost.swapaxes(0, 1)[:, None]


def least_costs(cost: Float32[Array, "z x batch"], pose: Int32[Array, "3 batch"]) -> Along:
    """Least cost of reaching every pose.

    Args:
        cost: cost of entering each place; a turn costs 1.
        pose: current heading, z and x.

    Returns:
        d; `NEVER` or more where there is no way.
    """
    radius = Extent.of_side(len(cost)).radius
    start = jnp.full((4, *cost.shape), NEVER)
    start = start.at[pose[0], pose[1] + radius, pose[2] + radius, jnp.arange(cost.shape[-1])].set(0.0)
    cost_z, cost_x = costs_of_lines(cost)

    def relax(carry):
        along_z, before, _ = carry
        along_z = _move(_turn(along_z, before), cost_z)
        along_x = _move(_turn(before, along_z), cost_x)
        return along_z, along_x, (along_x < before - TOLERANCE).any()

    carry = (*to_lines(start), jnp.bool_(True))
    along_z, along_x, _ = jax.lax.while_loop(lambda carry: carry[2], relax, carry)
    return _turn(along_z, along_x), along_x


def _crossing(lines: Lines) -> Lines:
    """The values of lines that run the other way, at the places of these."""
    return lines.transpose(2, 1, 0, 3)


def _turn(lines: Lines, others: Lines) -> Lines:
    """Least costs after turns: one from the headings of the other lines, two from the opposite heading."""
    beside, opposite = _crossing(others).min(1, keepdims=True), lines.min(1, keepdims=True)
    return jnp.minimum(lines, jnp.minimum(beside + 1, opposite + 2))


def _move(lines: Lines, cost: LineCosts) -> Lines:
    """Least costs after moves along the lines."""

    def step(last, row):
        here = jnp.minimum(row[0], last + row[1])
        return here, here

    never = jnp.full(lines.shape[1:], NEVER)
    _, forwards = jax.lax.scan(step, never, (lines, cost))
    return jax.lax.scan(step, never, (forwards, cost), reverse=True)[1]


class _Parents(NamedTuple):
    """Whether poses are reached along a shortest path from the line's last place, its next one, and by each turn."""

    last: Bool[Array, "place 2 line batch"]
    next: Bool[Array, "place 2 line batch"]
    turns: tuple[Bool[Array, "place 2 line batch"], Bool[Array, "place 2 line batch"]]


def _parents(distance: Lines, others: Lines, cost: LineCosts) -> _Parents:
    never = jnp.full((1, *distance.shape[1:]), NEVER)
    beside = _crossing(others)
    sources = (
        jnp.concatenate([never, distance[:-1]]) + cost,
        jnp.concatenate([distance[1:], never]) + cost,
        beside[:, :1] + 1,
        beside[:, 1:] + 1,
    )
    last, following, one, other = ((source < distance + TOLERANCE) & (distance < NEVER) for source in sources)
    return _Parents(last, following, (one, other))


def small_gain(largest: Float32[Array, "batch"]) -> Float32[Array, "batch"]:
    """A gain that makes no difference: 1e-7, or less where all that may be gained is discounted by a long way.

    Args:
        largest: the largest gain.

    Returns:
        It.
    """
    return jnp.minimum(1e-7, 1e-3 * largest)


def discoveries(gain: Along, distance: Along, cost: Float32[Array, "z x batch"]) -> Along:
    """The largest sum of gains along a shortest path to every pose.

    A path that moves along a line never turns back on it, so that both directions are swept apart.

    Args:
        gain: γ^d P of each pose.
        distance: d of each pose, as `least_costs` gives it.
        cost: cost of entering each place.

    Returns:
        U.
    """
    cost_z, cost_x = costs_of_lines(cost)
    parents_z, parents_x = _parents(*distance, cost_z), _parents(*distance[::-1], cost_x)
    small = small_gain(jnp.maximum(*(lines.max((0, 1, 2)) for lines in gain)))

    def extend(carry):
        _, before, _ = carry
        along_z = _collect(gain[0], before, parents_z)
        along_x = _collect(gain[1], along_z, parents_x)
        return along_z, along_x, (along_x > before * (1 + 1e-4) + small).any()

    _, along_x, _ = jax.lax.while_loop(lambda carry: carry[2], extend, (*gain, jnp.bool_(True)))
    return _collect(gain[0], along_x, parents_z), along_x


def _collect(gain: Lines, others: Lines, parents: _Parents) -> Lines:
    """Sums of gains after turns from the other lines and moves along these."""
    beside = _crossing(others)
    turned = jnp.maximum(
        jnp.where(parents.turns[0], beside[:, :1], 0.0), jnp.where(parents.turns[1], beside[:, 1:], 0.0)
    )

    def step(last, row):
        gained, entered, moved = row
        here = gained + jnp.maximum(entered, jnp.where(moved, last, 0.0))
        return here, here

    nothing = jnp.zeros(gain.shape[1:])
    _, forwards = jax.lax.scan(step, nothing, (gain, turned, parents.last))
    _, backwards = jax.lax.scan(step, nothing, (gain, turned, parents.next), reverse=True)
    return jnp.maximum(forwards, backwards)
