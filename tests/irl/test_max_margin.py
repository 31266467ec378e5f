import itertools
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import policy_expert, shortest_path_expert
from relm_irl_jax.irl import (
    MaxMarginProblem,
    MaxMarginSettings,
    Status,
    feature_expectations,
    max_margin,
    reference_max_margin,
    relative_features,
    reward,
    solve_many,
)
from relm_irl_jax.irl.coordinates import factorise
from relm_irl_jax.irl.problem import margin_rows
from relm_irl_jax.irl.program import Multipliers, Program, state_program
from relm_irl_jax.irl.solver import optimise
from relm_irl_jax.scenes.scene import successors

from .scenes import grid_scene, pooled_problem, smooth_features


def problem_of(dimension: int, target: int = 7, starts=(0, 30, 41)) -> MaxMarginProblem:
    scene = grid_scene(4, 3, holes=((1, 1),))
    return pooled_problem(scene, smooth_features(scene, dimension, seed=0), target, list(starts))


@pytest.mark.parametrize(
    ("form", "variant", "penalty", "dimension"),
    list(itertools.product(("cost", "free"), ("lp", "lp-l2", "lp-l1"), (1.0, 2.0), (6, 200))),
)
def test_agrees_with_the_paper_s_statement(form, variant, penalty, dimension):
    problem = problem_of(dimension)
    settings = MaxMarginSettings(form=form, variant=variant, penalty=penalty, discount=0.95)
    fast, reference = max_margin(problem, settings), reference_max_margin(problem, settings)
    assert fast.status is Status.OPTIMAL
    assert reference.status is Status.OPTIMAL
    assert fast.objective == pytest.approx(reference.objective, rel=1e-6)
    np.testing.assert_array_equal(fast.states, reference.states)
    if variant == "lp-l2":
        np.testing.assert_allclose(fast.w, reference.w, atol=1e-3 * np.abs(reference.w).max())


@pytest.mark.parametrize("form", ["cost", "free"])
@pytest.mark.parametrize("dimension", [6, 200])
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
    problem = problem_of(200)
    solution = max_margin(problem, MaxMarginSettings(variant="lp"))
    relative = relative_features(problem.features, problem.expert.target)
    least = np.linalg.pinv(relative) @ (relative @ solution.w)
    np.testing.assert_allclose(solution.w, least, atol=1e-8 * np.abs(least).max())


def test_full_rank_cost_is_a_pure_step_cost():
    problem = problem_of(200)
    solution = max_margin(problem, MaxMarginSettings(variant="lp"))
    found = reward(problem.features, problem.expert.target, solution.w)
    np.testing.assert_allclose(found[solution.states], -1.0, atol=1e-4)


def test_margin_rows_are_differences_of_expectations():
    problem = problem_of(6)
    settings = MaxMarginSettings(discount=0.9)
    rows = margin_rows(problem, settings)
    relative = relative_features(problem.features, problem.expert.target)
    value = feature_expectations(relative, problem.expert.next_state, 0.9)
    expected = [
        value[problem.expert.next_state[state]] - value[problem.successors[state, action]]
        for state in rows.states
        for action in np.flatnonzero(problem.expert.suboptimal[state])
    ]
    np.testing.assert_allclose(rows.weights @ relative, np.asarray(expected), atol=1e-9)


def test_many_problems_equal_each_alone_and_failures_are_kept_apart():
    scene = grid_scene(4, 3, holes=((1, 1),))
    features = smooth_features(scene, 6, seed=0)
    good = [pooled_problem(scene, features, target, [0, 30]) for target in (7, 12, 40)]
    broken = replace(good[0], features=np.full_like(features, np.nan), name="broken")
    nothing = replace(good[0], states=np.asarray([good[0].expert.target], np.int32), name="nothing")
    solutions = solve_many([good[0], broken, good[1], nothing, good[2]], processes=2)
    for problem, solution in zip(good, (solutions[0], solutions[2], solutions[4]), strict=True):
        alone = max_margin(problem)
        assert solution.status is Status.OPTIMAL
        assert solution.name == problem.name
        np.testing.assert_allclose(solution.w, alone.w, rtol=1e-9, atol=1e-12)
    assert [solutions[1].status, solutions[3].status] == [Status.INVALID, Status.NO_DECISION]
    assert np.isnan(solutions[1].w).all()
    assert solutions[1].w.shape == solutions[3].w.shape == (6,)
    assert "finite" in solutions[1].message


def test_infeasible_and_unbounded_programs_are_named():
    program = Program(
        basis=np.array([[1.0, 0.0], [1.0, 0.0]]),
        lower=np.array([-1.0, -1.0]),
        upper=np.array([0.0, 0.0]),
        rows=np.array([[1.0, 1.0]]),
        owner=np.array([0]),
        quadratic=None,
        absolute=0.0,
        penalty=1.0,
    )
    assert optimise(program).status is Status.UNBOUNDED
    apart = replace(program, rows=np.array([[1.0, 0.0]]), lower=np.array([-1.0, 0.5]), upper=np.array([0.0, 1.0]))
    assert optimise(apart).status is Status.INFEASIBLE


@pytest.mark.parametrize("form", ["cost", "free"])
@pytest.mark.parametrize("variant", ["lp", "lp-l2", "lp-l1"])
@pytest.mark.parametrize("dimension", [6, 200])
def test_no_multipliers_bound_the_objective_from_below_the_optimum(form, variant, dimension):
    problem = problem_of(dimension)
    settings = MaxMarginSettings(form=form, variant=variant, penalty=2.0)
    coordinates = factorise(problem.features, form)
    rows = margin_rows(problem, settings)
    program = state_program(rows, coordinates, problem.expert.target, settings, 1e-2)
    best = optimise(program)
    generator = np.random.default_rng(0)
    for _ in range(20):
        guess = Multipliers(
            margins=generator.uniform(size=2 * len(rows.owner)), rewards=generator.normal(size=len(program.lower))
        )
        point = best.point + 0.1 * generator.normal(size=len(best.point))
        assert program.bound(point, guess) >= best.objective - 1e-6


def test_an_expert_that_an_alternative_beats_is_named_unless_penalised():
    scene = grid_scene(4, 3, holes=((1, 1),))
    action = shortest_path_expert(scene, 3).action.copy()
    action[0] = 1  # Turning right three times instead of left once.
    detour = policy_expert(scene, 3, action)
    states = np.asarray([0, 5], np.int32)
    problem = MaxMarginProblem(smooth_features(scene, 6, 0), successors(scene.graph), detour, states, "detour")
    with pytest.raises(InputError, match="detour: at state 0 action 2 is better than the expert's action 1"):
        max_margin(problem)
    assert solve_many([problem], processes=1)[0].status is Status.INVALID
    assert max_margin(problem, MaxMarginSettings(penalty=2.0)).status is Status.OPTIMAL


def test_solver_processes_import_neither_jax_nor_the_main_module(tmp_path):
    # No main guard: a process that imported this file would try to start processes of its own.
    script = tmp_path / "script.py"
    script.write_text(
        "import jax, relm_irl_jax.irl.solver as solver\n"
        "expression = \"'%s' in __import__('sys').modules\"\n"
        "with solver.SolverPool(1) as pool:\n"
        "    pool.submit(solver.solve_many, []).result()\n"
        "    print([m for m in ('relm_irl_jax', 'jax', 'cvxpy') if pool.submit(eval, expression % m).result()])\n"
    )
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "['relm_irl_jax']"
