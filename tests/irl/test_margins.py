import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from relm_irl_jax.experts import NO_ACTION, Expert
from relm_irl_jax.irl import MaxMarginProblem
from relm_irl_jax.irl.margins import margin_rows, margins_under

from .problems import corridor


@given(seed=st.integers(0, 2**32 - 1), discount=st.floats(0.1, 0.99), include_better=st.booleans())
@settings(deadline=None, max_examples=50)
def test_rows_are_differences_of_values_on_any_graph_under_any_policy(seed, discount, include_better):
    generator = np.random.default_rng(seed)
    n, target = 7, 2
    next_states = generator.integers(0, n, (n, 4)).astype(np.int32)
    action = generator.integers(0, 4, n).astype(np.int32)
    action[target] = NO_ACTION
    next_state = np.where(np.arange(n) == target, target, next_states[np.arange(n), action]).astype(np.int32)
    suboptimal, better = generator.random((2, n, 4)) < 0.3
    better &= ~suboptimal
    states = generator.integers(0, n, 4).astype(np.int32)
    features = generator.normal(size=(n, 3))
    problem = MaxMarginProblem(features, next_states, Expert(target, action, next_state, suboptimal, better), states)
    rows = margin_rows(problem, discount, include_better=include_better)

    relative = features - features[target]
    value = np.linalg.solve(np.eye(n) - discount * np.eye(n)[next_state], relative)
    compared = suboptimal | better if include_better else suboptimal
    expected, owners = [], []
    for state in np.unique(states):
        for other in np.flatnonzero(compared[state]):
            expected.append(value[next_state[state]] - value[next_states[state, other]])
            owners.append(state)
    found = rows.coefficients @ relative
    np.testing.assert_allclose(found, np.reshape(expected, (-1, 3)), atol=1e-9 / (1 - discount))
    np.testing.assert_array_equal(rows.states[rows.margin_index], owners)


def test_margins_of_the_corridor_under_a_step_cost():
    # γ = ½ and −1 a step: V = −1.75, −1.5, −1, 0. Going right beats staying by V(s+1) − V(s), the smaller gap.
    states, margin = margins_under(corridor(np.eye(4)), np.array([-1.0, -1.0, -1.0, 0.0]), 0.5)
    np.testing.assert_array_equal(states, [0, 1, 2])
    np.testing.assert_allclose(margin, [0.25, 0.5, 1.0])
