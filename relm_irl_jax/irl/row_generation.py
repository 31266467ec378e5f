"""Row generation: programs of many states are solved with the bounds of a few of them.

A program of 64 coordinates has about as many active bounds, and a scene of 20,000 states has 40,000 bounds in all, each
of which costs time in every Newton step. So the program is solved with the bounds of some states, those that its
solution violates most are added, and so on until there are none. What is then optimal for the part is optimal for the
whole program, and its dual variables, with 0 for all other states, certify it.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from relm_irl_jax.irl.convex_program import ConvexProgram, DualVariables
from relm_irl_jax.irl.interior_point import solve_by_interior_point

MANY_STATES = 2000
"""States from which this is faster; no built-in room has as many."""

FIRST_STATES, ADDED_STATES = 1000, 1000
"""States whose bounds are in the first program, and most that are added at a time."""

MAX_ROUNDS = 50
"""Programs that are solved before giving up; the certificate judges the last point."""

VIOLATION = 1e-8
"""Violation of a bound, relative to the largest one, from which it is added."""


def suits(program: ConvexProgram) -> bool:
    """Whether a program is one for row generation.

    Args:
        program: the program.

    Returns:
        Whether it has many states, few coordinates, and no penalty on the rewards of all states.
    """
    return program.basis is not None and len(program.lower) >= MANY_STATES and program.l1_weight == 0.0


def solve_by_row_generation(program: ConvexProgram) -> tuple[Float64[np.ndarray, "rank"], DualVariables]:
    """Solve a program by the interior-point method, with the bounds that matter.

    Args:
        program: a program that `suits`.

    Returns:
        The point c and the dual variables of the whole program.
    """
    assert program.basis is not None
    n = len(program.lower)
    chosen = np.unique(np.linspace(0, n - 1, min(n, FIRST_STATES)).astype(int))
    limit = VIOLATION * float(np.abs([program.lower, program.upper]).max())
    for _ in range(MAX_ROUNDS):
        part = replace(program, basis=program.basis[chosen], lower=program.lower[chosen], upper=program.upper[chosen])
        point, duals = solve_by_interior_point(part)
        reward = program.reward(point)
        outside = np.maximum(reward - program.upper, program.lower - reward)
        outside[chosen] = 0.0
        worst = np.argsort(-outside)[:ADDED_STATES]
        added = worst[outside[worst] > limit]
        if not len(added):
            break
        chosen = np.concatenate([chosen, added])
    of_states = np.zeros(n)
    of_states[chosen[: len(duals.rewards)]] = duals.rewards
    return point, DualVariables(margins=duals.margins, rewards=of_states)
