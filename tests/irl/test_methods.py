"""Every method on gridworlds whose reward is known: −1 a step, and 0 at the target."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic.dataclasses import dataclass as pydantic_dataclass

from relm_irl_jax.irl import IrlMethodSettings, MaxMarginSettings, Status, feature_expectations, learn_weights, reward
from relm_irl_jax.irl.apprenticeship import ApprenticeshipSettings
from relm_irl_jax.irl.policy_iteration import next_states, optimal_policy

from .problems import corridor, gridworld

METHODS = [
    IrlMethodSettings(method="max-margin", max_margin=MaxMarginSettings(discount=0.95)),
    IrlMethodSettings(method="max-margin", max_margin=MaxMarginSettings(discount=0.95, form="free")),
    IrlMethodSettings(method="apprenticeship", max_margin=MaxMarginSettings(discount=0.95)),
    IrlMethodSettings(
        method="apprenticeship",
        max_margin=MaxMarginSettings(discount=0.95),
        apprenticeship=ApprenticeshipSettings(variant="max-margin"),
    ),
    IrlMethodSettings(method="max-margin-planning", max_margin=MaxMarginSettings(discount=0.95)),
    IrlMethodSettings(method="max-entropy", max_margin=MaxMarginSettings(discount=0.95)),
]


each_method = pytest.mark.parametrize(
    "settings", METHODS, ids=lambda s: f"{s.method}-{s.max_margin.form}-{s.apprenticeship.variant}"
)


@each_method
@pytest.mark.parametrize("target", [7, 20])
def test_planning_under_the_learned_reward_is_the_expert(settings, target):
    problem = gridworld(target)
    (solution,) = learn_weights([problem], settings, processes=1)
    assert solution.solved, solution
    learned = reward(problem.features, target, solution.w)
    assert learned[target] == 0.0
    assert np.abs(learned).max() <= (2.0 if settings.max_margin.form == "free" else 1.0) + 1e-6
    action = optimal_policy(learned, problem.successors, target, 0.95)
    # The expert's action or one that ties with it, in every state, and so of the same value under the true reward.
    chosen = problem.expert.suboptimal[np.arange(len(action)), action]
    assert not chosen[problem.states].any()
    true = -np.ones((len(action), 1))
    true[target] = 0.0
    found = feature_expectations(true, next_states(problem.successors, target, action), 0.95)
    np.testing.assert_allclose(found, feature_expectations(true, problem.expert.next_state, 0.95), rtol=1e-9)


@pytest.mark.parametrize("method", ["apprenticeship", "max-margin-planning", "max-entropy"])
def test_a_problem_that_cannot_be_stated_is_kept_apart(method):
    good = gridworld(7)
    bad = replace(good, states=np.asarray([99], np.int32), name="bad")
    solutions = learn_weights([bad, good], IrlMethodSettings(method=method, max_margin=MaxMarginSettings(discount=0.9)))
    assert solutions[0].status is Status.INVALID
    assert "bad" in solutions[0].message
    assert solutions[1].solved


@pydantic_dataclass(frozen=True)
class WithTrajectories(IrlMethodSettings):
    """Settings as a user of this package has them: a default of its own, and a field of its own."""

    max_margin: MaxMarginSettings = MaxMarginSettings(variant="lp", discount=0.5)
    trajectories: int = 16


def test_settings_may_inherit_the_choice_of_method():
    (own,) = learn_weights([corridor(np.eye(4))], WithTrajectories(), processes=1)
    assert own.objective == pytest.approx(1.75, rel=1e-6)
    (other,) = learn_weights([corridor(np.eye(4))], WithTrajectories(method="max-margin-planning"), processes=1)
    np.testing.assert_allclose(np.abs(reward(np.eye(4), 3, other.w)).max(), 1.0)


@pytest.mark.parametrize("form", ["cost", "free"])
def test_the_corridor_s_answer_is_known_by_hand(form):
    # γ = ½, full-rank φ. Staying instead of going right costs, at states 0, 1 and 2: with u_s = r(s) − r(g),
    # V(2) = u2, V(1) = u1 + u2/2, V(0) = u0 + u1/2 + u2/4. Margins of staying: V(s+1) − V(s); of going left
    # from 1: V(2) − V(0), from 2: V(3) − V(1) = −V(1).
    # cost: u ∈ [−1, 0]. All −1: V = −1.75, −1.5, −1, 0; margins min: 0.25, min(0.5, 0.75), min(1, 1.5) →
    # 1.75.
    problem = corridor(np.eye(4))
    (solution,) = learn_weights(
        [problem], IrlMethodSettings(max_margin=MaxMarginSettings(form=form, variant="lp", discount=0.5))
    )
    # The sum of the staying margins is V(3) − V(0) = −V(0) = −u0 − u1/2 − u2/4, greatest at the bounds.
    width = 1.0 if form == "cost" else 2.0
    assert solution.objective == pytest.approx(1.75 * width, rel=1e-6)
    np.testing.assert_allclose(solution.margin, np.array([0.25, 0.5, 1.0]) * width, atol=1e-5)
    np.testing.assert_allclose(reward(problem.features, 3, solution.w), [-width] * 3 + [0.0], atol=1e-5)


@each_method
def test_nobody_loiters_in_the_corridor(settings):
    # Every reward w·φ may be positive here: φ has a constant part. Counted as it is, with a return of 0 at
    # the target, loitering at state 2 would be optimal; counted relative to the target's, walking on is.
    problem = corridor(np.array([[1.0, 0.1], [1.0, 0.2], [1.0, 0.3], [1.0, 1.0]]))
    (solution,) = learn_weights([problem], settings, processes=1)
    assert solution.solved, solution
    learned = reward(problem.features, 3, solution.w)
    action = optimal_policy(learned, problem.successors, 3, 0.95)
    np.testing.assert_array_equal(next_states(problem.successors, 3, action), [1, 2, 3, 3])
    np.testing.assert_array_equal(action[:3], [0, 0, 0])
