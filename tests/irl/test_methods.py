"""Every method on gridworlds whose reward is known: −1 a step, and 0 at the target."""

from dataclasses import replace

import numpy as np
import pytest

from relm_irl_jax.experts import Expert, shortest_path_expert
from relm_irl_jax.irl import MaxMarginProblem, MaxMarginSettings, MethodSettings, Status, learn, reward
from relm_irl_jax.irl.apprenticeship import ApprenticeshipSettings
from relm_irl_jax.irl.control import expected_value_difference, optimal_policy, policy_walk
from relm_irl_jax.scenes.scene import successors

from .scenes import grid_scene

METHODS = [
    MethodSettings(method="max-margin", program=MaxMarginSettings(discount=0.95)),
    MethodSettings(method="max-margin", program=MaxMarginSettings(discount=0.95, form="free")),
    MethodSettings(method="apprenticeship", program=MaxMarginSettings(discount=0.95)),
    MethodSettings(
        method="apprenticeship",
        program=MaxMarginSettings(discount=0.95),
        apprenticeship=ApprenticeshipSettings(variant="max-margin"),
    ),
    MethodSettings(method="planning", program=MaxMarginSettings(discount=0.95)),
    MethodSettings(method="maxent", program=MaxMarginSettings(discount=0.95)),
]


def gridworld(target: int) -> MaxMarginProblem:
    scene = grid_scene(4, 3, holes=((1, 1),))
    states = np.delete(np.arange(scene.n_states, dtype=np.int32), target)
    expert = shortest_path_expert(scene, target)
    return MaxMarginProblem(np.eye(scene.n_states), successors(scene.graph), expert, states, f"target {target}")


@pytest.mark.parametrize("settings", METHODS, ids=lambda s: f"{s.method}-{s.program.form}-{s.apprenticeship.variant}")
@pytest.mark.parametrize("target", [7, 30])
def test_planning_under_the_learned_reward_is_the_expert(settings, target):
    problem = gridworld(target)
    (solution,) = learn([problem], settings, processes=1)
    assert solution.solved, solution
    true = -np.ones(len(problem.features))
    true[target] = 0.0
    assert abs(expected_value_difference(problem, solution.w, true, 0.95)) <= 1e-3
    learned = reward(problem.features, target, solution.w)
    assert learned[target] == 0.0
    assert np.abs(learned).max() <= (2.0 if settings.program.form == "free" else 1.0) + 1e-6
    action = optimal_policy(np.repeat(learned[:, None], 4, axis=1), problem.successors, target, 0.95)
    # The expert's action or one that ties with it, at every state.
    chosen = problem.expert.suboptimal[np.arange(len(action)), action]
    assert not chosen[problem.states].any()


@pytest.mark.parametrize("method", ["apprenticeship", "planning", "maxent"])
def test_a_problem_that_cannot_be_stated_is_kept_apart(method):
    good = gridworld(7)
    bad = replace(good, states=np.asarray([99], np.int32), name="bad")
    solutions = learn([bad, good], MethodSettings(method=method, program=MaxMarginSettings(discount=0.9)))
    assert solutions[0].status is Status.INVALID
    assert "bad" in solutions[0].message
    assert solutions[1].solved


def corridor(features) -> MaxMarginProblem:
    """States 0-1-2-3 in a line with the target at the right end; action 0 goes right, 3 left, turns do
    nothing."""
    following = np.array([[1, 0, 0, 0], [2, 1, 1, 0], [3, 2, 2, 1], [3, 3, 3, 2]], np.int32)
    suboptimal = np.zeros((4, 4), bool)
    suboptimal[:3, 1:] = True
    expert = Expert(
        target=3,
        action=np.array([0, 0, 0, -1], np.int32),
        next_state=np.array([1, 2, 3, 3], np.int32),
        suboptimal=suboptimal,
        better=np.zeros((4, 4), bool),
    )
    return MaxMarginProblem(np.asarray(features, float), following, expert, np.array([0, 1, 2], np.int32), "corridor")


@pytest.mark.parametrize("form", ["cost", "free"])
def test_the_corridor_s_answer_is_known_by_hand(form):
    # γ = ½, full-rank φ. Staying instead of going right costs, at states 0, 1 and 2: with u_s = r(s) − r(g),
    # V(2) = u2, V(1) = u1 + u2/2, V(0) = u0 + u1/2 + u2/4. Margins of staying: V(s+1) − V(s); of going left
    # from 1: V(2) − V(0), from 2: V(3) − V(1) = −V(1).
    # cost: u ∈ [−1, 0]. All −1: V = −1.75, −1.5, −1, 0; margins min: 0.25, min(0.5, 0.75), min(1, 1.5) →
    # 1.75.
    problem = corridor(np.eye(4))
    (solution,) = learn([problem], MethodSettings(program=MaxMarginSettings(form=form, variant="lp", discount=0.5)))
    # The sum of the staying margins is V(3) − V(0) = −V(0) = −u0 − u1/2 − u2/4, greatest at the bounds.
    width = 1.0 if form == "cost" else 2.0
    assert solution.objective == pytest.approx(1.75 * width, rel=1e-6)
    np.testing.assert_allclose(solution.margin, np.array([0.25, 0.5, 1.0]) * width, atol=1e-5)
    np.testing.assert_allclose(reward(problem.features, 3, solution.w), [-width] * 3 + [0.0], atol=1e-5)


@pytest.mark.parametrize("settings", METHODS, ids=lambda s: f"{s.method}-{s.program.form}-{s.apprenticeship.variant}")
def test_nobody_loiters_in_the_corridor(settings):
    # Every reward w·φ may be positive here: φ has a constant part. Counted as it is, with a return of 0 at
    # the target, loitering at state 2 would be optimal; counted relative to the target's, walking on is.
    problem = corridor(np.array([[1.0, 0.1], [1.0, 0.2], [1.0, 0.3], [1.0, 1.0]]))
    (solution,) = learn([problem], settings, processes=1)
    assert solution.solved, solution
    learned = reward(problem.features, 3, solution.w)
    action = optimal_policy(np.repeat(learned[:, None], 4, axis=1), problem.successors, 3, 0.95)
    np.testing.assert_array_equal(policy_walk(problem.successors, 3, action), [1, 2, 3, 3])
    np.testing.assert_array_equal(action[:3], [0, 0, 0])
