"""The maximum-margin problem of inverse reinforcement learning (the paper's Eq. 1-8): data and settings.

The reward is linear in the features of a state, r(s) = w·φ(s) (Eq. 1). Let V(s) be the feature expectations of the
expert's policy from s (Eq. 3, see `expectations.py`), a* the expert's action in s, and s'_a the state that action a
leads to. The margin of a state is the advantage of the expert's action over the best of its suboptimal actions,

    m(s) = min over suboptimal a of  w·(V(s'_a*) − V(s'_a)).

The problem is to maximise Σ_{s ∈ S₀} p(m(s)), minus a regulariser, over all w whose reward stays within bounds on
every state of the scene (Eq. 7 and 8). The paper has p(x) = x; Ng and Russell (2000) weigh negative margins by 2.

**The absorbing target.** The expert stays at its target g forever, so its values contain an infinite sum of w·φ(g).
An agent's episode ends at g with a return of 0 instead. The two agree if the reward is relative to the target's:
w·ψ(s) with ψ(s) = φ(s) − φ(g), which is 0 at g. This shifts all values by the same constant w·φ(g)/(1 − γ), so margins
and optimal policies do not change. `relative_features` computes ψ; every method of this package, and every user of its
weights, uses ψ instead of φ.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, Real

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import NO_ACTION, Expert
from relm_irl_jax.irl.settings import MaxMarginSettings


@dataclass(frozen=True)
class MaxMarginProblem:
    """An expert in a scene, and the states at which its action should beat the alternatives.

    Problems of one scene should share their `features` array, which is factorised once.

    Attributes:
        features: φ(s) of all states of the scene.
        successors: next state for each action, see `scenes.scene.successors`.
        expert: the expert's decision at every state.
        states: S₀, the states along one trajectory or along all trajectories to a target; duplicates count once.
        name: name of the problem in messages.
    """

    features: Real[np.ndarray, "states d"]
    successors: Int32[np.ndarray, "states 4"]
    expert: Expert
    states: Int32[np.ndarray, "visited"]
    name: str = ""


def relative_features(features: Real[np.ndarray, "states d"], target: int) -> Float64[np.ndarray, "states d"]:
    """Features relative to the target's, ψ(s) = φ(s) − φ(g).

    Args:
        features: φ(s) of all states.
        target: g.

    Returns:
        ψ(s) of all states; zero at the target.
    """
    exact = np.asarray(features, np.float64)
    return exact - exact[target]


def start_distribution(problem: MaxMarginProblem) -> Float64[np.ndarray, "states"]:
    """The uniform distribution over S₀, in which repeated states count once.

    Args:
        problem: the problem.

    Returns:
        Probability of each state.
    """
    states = np.unique(problem.states)
    distribution = np.zeros(len(problem.features))
    distribution[states] = 1.0 / len(states)
    return distribution


def reward(
    features: Real[np.ndarray, "states d"], target: int, w: Float64[np.ndarray, "d"]
) -> Float64[np.ndarray, "states"]:
    """Reward of every state under w (Eq. 1), relative to the target's and therefore 0 there.

    Args:
        features: φ(s) of all states.
        target: g, the state at which an episode ends.
        w: weights.

    Returns:
        w·(φ(s) − φ(g)).
    """
    return relative_features(features, target) @ w


def check_problem(problem: MaxMarginProblem, settings: MaxMarginSettings | None = None) -> None:
    """Check that a problem is well posed.

    Args:
        problem: the problem.
        settings: settings of the maximum-margin problem; None for methods that accept suboptimal experts.

    Raises:
        InputError: the problem is ill posed.
    """
    name, expert = problem.name or f"the problem of target {problem.expert.target}", problem.expert
    states = np.unique(problem.states)
    if len(states) and not 0 <= states[0] <= states[-1] < len(problem.features):
        raise InputError(f"{name}: `states` must be numbers of the scene's states, 0 to {len(problem.features) - 1}.")
    stuck = states[(expert.action[states] == NO_ACTION) & (states != expert.target)]
    if len(stuck):
        raise InputError(
            f"{name}: the expert cannot reach the target {expert.target} from state {stuck[0]}; "
            "leave out trajectories that do not arrive."
        )
    index, action = np.nonzero(expert.better[states])
    if len(index) and settings is not None and settings.penalty == 1.0:
        raise InputError(
            f"{name}: at state {states[index[0]]} action {action[0]} is better than the expert's action "
            f"{expert.action[states[index[0]]]}; for experts that are not optimal set the penalty to 2."
        )
