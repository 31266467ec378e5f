import itertools
from dataclasses import replace

import numpy as np
import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import expert_from_policy, shortest_path_expert
from relm_irl_jax.irl import (
    MaxMarginProblem,
    MaxMarginSettings,
    Status,
    max_margin,
    reference_max_margin,
    relative_features,
    reward,
    row_generation,
    solve_many,
)
from relm_irl_jax.irl.convex_program import ConvexProgram, DualVariables, convex_program
from relm_irl_jax.irl.feature_factorisation import factorise
from relm_irl_jax.irl.interior_point import solve_by_interior_point
from relm_irl_jax.irl.margins import margin_rows
from relm_irl_jax.irl.solver import solve_program
from relm_irl_jax.scenes.scene import successors

from .problems import pooled_problem, ring, smooth_features

SCENE = ring()


def problem_of(dimension: int) -> MaxMarginProblem:
    """With 6 features a dense program of full column rank, with 50 any reward of the 32 states can be expressed."""
    return pooled_problem(SCENE, smooth_features(SCENE, dimension, seed=0), 7, (0, 17, 30))


@pytest.mark.parametrize(
    ("form", "variant", "penalty", "dimension"),
    list(itertools.product(("cost", "free"), ("lp", "lp-l2", "lp-l1"), (1.0, 2.0), (6, 50))),
)
def test_agrees_with_the_paper_s_statement_in_cvxpy(form, variant, penalty, dimension):
    problem = problem_of(dimension)
    settings = MaxMarginSettings(form=form, variant=variant, penalty=penalty, discount=0.95)
    fast, reference = max_margin(problem, settings), reference_max_margin(problem, settings)
    assert fast.status is Status.OPTIMAL
    assert reference.status is Status.OPTIMAL
    assert fast.objective == pytest.approx(reference.objective, rel=1e-6)
    np.testing.assert_array_equal(fast.states, reference.states)
    if variant == "lp-l2":
        np.testing.assert_allclose(fast.w, reference.w, atol=1e-3 * np.abs(reference.w).max())


@pytest.mark.parametrize(("form", "variant"), list(itertools.product(("cost", "free"), ("lp", "lp-l2"))))
def test_the_bounds_of_a_few_states_give_the_same_optimum(monkeypatch, form, variant):
    problem, settings = problem_of(6), MaxMarginSettings(form=form, variant=variant, discount=0.95)
    whole = max_margin(problem, settings)
    sizes = []

    def solve(program):
        sizes.append(len(program.lower))
        return solve_by_interior_point(program)

    monkeypatch.setattr(row_generation, "MANY_STATES", 10)
    monkeypatch.setattr(row_generation, "FIRST_STATES", 8)
    monkeypatch.setattr(row_generation, "ADDED_STATES", 3)
    monkeypatch.setattr(row_generation, "solve_by_interior_point", solve)
    few = max_margin(problem, settings)
    assert sizes[0] == 8
    assert sizes[1] > 8
    assert max(sizes) < 31
    assert few.status is whole.status is Status.OPTIMAL
    assert few.objective == pytest.approx(whole.objective, rel=1e-7)
    if variant == "lp-l2":
        np.testing.assert_allclose(few.w, whole.w, atol=1e-5 * np.abs(whole.w).max())


@pytest.mark.parametrize("form", ["cost", "free"])
@pytest.mark.parametrize("dimension", [6, 50])
def test_the_certificate_holds_for_w_itself(form, dimension):
    problem = problem_of(dimension)
    settings = MaxMarginSettings(form=form, variant="lp-l2", discount=0.95)
    solution = max_margin(problem, settings)
    found = problem.features @ solution.w
    if form == "cost":
        found = reward(problem.features, problem.expert.target, solution.w)
        assert found[problem.expert.target] == 0.0
    assert found.min() >= -1.0 - 1e-6
    assert found.max() <= (0.0 if form == "cost" else 1.0) + 1e-6
    assert solution.primal_residual <= 1e-6
    assert abs(solution.duality_gap) <= 1e-6
    assert 0.5 < solution.share_of_lp <= 1.0 + 1e-7
    # Brute force over the whole definition, from the linear solve.
    transition = np.eye(len(found))[problem.expert.next_state]
    value = np.linalg.solve(np.eye(len(found)) - 0.95 * transition, problem.features @ solution.w)
    total = 0.0
    for state, margin in zip(solution.states, solution.margin, strict=True):
        worse = [a for a in range(4) if problem.expert.suboptimal[state, a]]
        own = value[problem.expert.next_state[state]]
        expected = min(own - value[problem.successors[state, a]] for a in worse)
        assert margin == pytest.approx(expected, abs=1e-6)
        total += expected
    weight = 1e-3 * len(problem.states)
    assert solution.objective == pytest.approx(total - 0.5 * weight * solution.w @ solution.w, rel=1e-6)


def test_the_weights_are_the_ones_of_least_norm():
    problem = problem_of(50)
    solution = max_margin(problem, MaxMarginSettings(variant="lp"))
    relative = relative_features(problem.features, problem.expert.target)
    least = np.linalg.pinv(relative) @ (relative @ solution.w)
    np.testing.assert_allclose(solution.w, least, atol=1e-8 * np.abs(least).max())


def test_full_rank_cost_is_a_pure_step_cost():
    problem = problem_of(50)
    solution = max_margin(problem, MaxMarginSettings(variant="lp"))
    found = reward(problem.features, problem.expert.target, solution.w)
    np.testing.assert_allclose(found[solution.states], -1.0, atol=1e-4)


def test_infeasible_and_unbounded_programs_are_named():
    program = ConvexProgram(
        basis=np.array([[1.0, 0.0], [1.0, 0.0]]),
        lower=np.array([-1.0, -1.0]),
        upper=np.array([0.0, 0.0]),
        rows=np.array([[1.0, 1.0]]),
        margin_index=np.array([0]),
        quadratic=None,
        l1_weight=0.0,
        penalty=1.0,
    )
    assert solve_program(program).status is Status.UNBOUNDED
    apart = replace(program, rows=np.array([[1.0, 0.0]]), lower=np.array([-1.0, 0.5]), upper=np.array([0.0, 1.0]))
    assert solve_program(apart).status is Status.INFEASIBLE


@pytest.mark.parametrize("form", ["cost", "free"])
@pytest.mark.parametrize("variant", ["lp", "lp-l2", "lp-l1"])
@pytest.mark.parametrize("dimension", [6, 50])
def test_no_dual_variables_give_a_bound_below_the_optimum(form, variant, dimension):
    problem = problem_of(dimension)
    settings = MaxMarginSettings(form=form, variant=variant, penalty=2.0)
    factorised = factorise(problem.features, form)
    rows = margin_rows(problem, settings.discount, include_better=True)
    program = convex_program(rows, factorised, problem.expert.target, settings, 1e-2)
    best = solve_program(program)
    generator = np.random.default_rng(0)
    for _ in range(20):
        guess = DualVariables(
            margins=generator.uniform(size=2 * len(rows.margin_index)),
            rewards=generator.normal(size=len(program.lower)),
        )
        point = best.point + 0.1 * generator.normal(size=len(best.point))
        assert program.dual_bound(point, guess) >= best.objective - 1e-6


def test_an_expert_that_an_alternative_beats_is_named_unless_penalised():
    action = shortest_path_expert(SCENE, 3).action.copy()
    action[0] = 1  # Turning right three times instead of left once.
    detour = expert_from_policy(SCENE, 3, action)
    states = np.asarray([0, 5], np.int32)
    problem = MaxMarginProblem(smooth_features(SCENE, 6, 0), successors(SCENE.graph), detour, states, "detour")
    with pytest.raises(InputError, match="detour: at state 0 action 2 is better than the expert's action 1"):
        max_margin(problem)
    assert solve_many([problem], processes=1)[0].status is Status.INVALID
    assert max_margin(problem, MaxMarginSettings(penalty=2.0)).status is Status.OPTIMAL
