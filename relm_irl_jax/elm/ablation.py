"""The paper's ablation of the ELM (Figures 7 to 10), as functions of the data that return arrays.

X holds features of start and target, T the reward weights w of each pair. Accuracy is the coefficient of determination
R², averaged over outputs: the paper does not define its "accuracy", and R² too is 1 for a perfect prediction.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int
from sklearn.metrics import r2_score

from relm_irl_jax.elm.regressor import ELMRegressor

PAPER_SIZES = (
    1,
    10,
    50,
    100,
    200,
    400,
    600,
    800,
    1000,
    1200,
    1400,
    1600,
    1800,
    1950,
    2400,
    3000,
    4000,
    4700,
    6000,
    8000,
)
"""Numbers of neurons along the axis of Figure 7, closer where the paper's curve bends."""


@dataclass(frozen=True)
class SizeCurve:
    """Figure 7: accuracy of an ELM without selection against its number of neurons.

    Attributes:
        sizes: numbers of hidden neurons.
        test: R² on the test pairs.
        train: R² on the training pairs.
    """

    sizes: Int[np.ndarray, "sizes"]
    test: Float64[np.ndarray, "sizes"]
    train: Float64[np.ndarray, "sizes"]


@dataclass(frozen=True)
class LeaveOneOutCurve:
    """Figure 9: leave-one-out error against the number of neurons, in MRSR order.

    Attributes:
        error: mean squared error of the first 1, 2, … neurons.
        best: number with the least.
    """

    error: Float64[np.ndarray, "neurons"]
    best: int


@dataclass(frozen=True)
class Predictions:
    """Figures 8 and 10: test targets and what the ELM predicts before and after regularisation.

    Attributes:
        truth: the test pairs' targets.
        plain: predictions of all neurons.
        regularised: predictions of the neurons that MRSR and PRESS keep.
        plain_accuracy: R² of the former.
        regularised_accuracy: R² of the latter.
        kept: number of neurons kept.
    """

    truth: Float64[np.ndarray, "samples outputs"]
    plain: Float64[np.ndarray, "samples outputs"]
    regularised: Float64[np.ndarray, "samples outputs"]
    plain_accuracy: float
    regularised_accuracy: float
    kept: int


def accuracy_by_size(
    X: Float64[np.ndarray, "samples inputs"],
    T: Float64[np.ndarray, "samples outputs"],
    X_test: Float64[np.ndarray, "test inputs"],
    T_test: Float64[np.ndarray, "test outputs"],
    sizes: Sequence[int] = PAPER_SIZES,
    **parameters: Any,
) -> SizeCurve:
    """Accuracy without selection for several numbers of neurons.

    Args:
        X, T: training pairs.
        X_test, T_test: test pairs.
        sizes: numbers of hidden neurons.
        parameters: of `ELMRegressor`, for example `activation`, `ridge`, `random_state`.

    Returns:
        Figure 7.
    """
    settings: dict[str, Any] = {**parameters, "ordering": "none", "selection": "none"}
    scores = []
    for size in sizes:
        model = ELMRegressor(size, **settings).fit(X, T)
        scores.append((r2_score(T_test, model.predict(X_test)), r2_score(T, model.predict(X))))
    test, train = np.array(scores).T
    return SizeCurve(np.asarray(sizes), test, train)


def leave_one_out_curve(model: ELMRegressor) -> LeaveOneOutCurve:
    """Figure 9 of a model fitted with `selection="press"`.

    Args:
        model: fitted.

    Returns:
        The curve and its minimum.
    """
    assert model.press_curve_ is not None, "fit with selection='press'"
    return LeaveOneOutCurve(model.press_curve_, int(np.argmin(model.press_curve_)) + 1)


def before_and_after(
    X: Float64[np.ndarray, "samples inputs"],
    T: Float64[np.ndarray, "samples outputs"],
    X_test: Float64[np.ndarray, "test inputs"],
    T_test: Float64[np.ndarray, "test outputs"],
    n_hidden: int = 1950,
    **parameters: Any,
) -> tuple[Predictions, ELMRegressor]:
    """Predictions of one hidden layer before and after MRSR and PRESS.

    Args:
        X, T: training pairs.
        X_test, T_test: test pairs.
        n_hidden: number of neurons before selection.
        parameters: of `ELMRegressor`; `random_state` is 0 unless given, and both have the same neurons.

    Returns:
        Figures 8 and 10, and the regularised model, whose curve is Figure 9.
    """
    settings: dict[str, Any] = {"random_state": 0, **parameters}
    everything: dict[str, Any] = {**settings, "ordering": "none", "selection": "none"}
    regularised: dict[str, Any] = {"ordering": "mrsr", **settings, "selection": "press"}
    plain = ELMRegressor(n_hidden, **everything).fit(X, T)
    model = ELMRegressor(n_hidden, **regularised).fit(X, T)
    before, after = (m.predict(X_test).reshape(len(X_test), -1) for m in (plain, model))
    truth = np.asarray(T_test, np.float64).reshape(len(X_test), -1)
    return (
        Predictions(truth, before, after, r2_score(truth, before), r2_score(truth, after), model.n_selected_),
        model,
    )


@dataclass(frozen=True)
class Choice:
    """One way to choose neurons and penalty.

    Attributes:
        accuracy: R² on the test pairs.
        kept: number of neurons kept.
        ridge: penalty on the output weights.
    """

    accuracy: float
    kept: int
    ridge: float


ALL: dict[str, Any] = {"ordering": "none", "selection": "none"}
WAYS: dict[str, tuple[dict[str, Any], bool]] = {
    "all neurons": (ALL, False),
    "MRSR, PRESS leaves out pairs": ({}, False),
    "MRSR, PRESS leaves out targets": ({}, True),
    "all neurons, ridge by PRESS of pairs": ({**ALL, "ridge": "press"}, False),
    "all neurons, ridge by PRESS of targets": ({**ALL, "ridge": "press"}, True),
}
"""Ways to choose neurons and penalty: parameters of `ELMRegressor`, and whether it is told which pairs share a target.
The second is the paper's."""


def accuracy_by_choice(
    X: Float64[np.ndarray, "samples inputs"],
    T: Float64[np.ndarray, "samples outputs"],
    X_test: Float64[np.ndarray, "test inputs"],
    T_test: Float64[np.ndarray, "test outputs"],
    groups: Int[np.ndarray, "samples"],
    **parameters: Any,
) -> dict[str, Choice]:
    """What each of `WAYS` is worth, with the same hidden layer.

    Args:
        X, T: training pairs.
        X_test, T_test: test pairs, of other targets.
        groups: number of each training pair's target.
        parameters: of `ELMRegressor`; `random_state` is 0 unless given.

    Returns:
        The choices, by the names of `WAYS`.
    """
    found = {}
    for name, (way, grouped) in WAYS.items():
        settings: dict[str, Any] = {"random_state": 0, **parameters, **way}
        model = ELMRegressor(**settings).fit(X, T, groups if grouped else None)
        found[name] = Choice(r2_score(T_test, model.predict(X_test)), model.n_selected_, model.ridge_)
    return found
