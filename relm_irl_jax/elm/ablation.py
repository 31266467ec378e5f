"""The paper's ablation of the ELM (section 5.6, Figures 7 to 10): functions from data to arrays.

X holds the features of start and target of each pair, T its reward weights w. Accuracy is the coefficient of
determination R², averaged over outputs. The paper does not define its accuracy; R² is also 1 for a perfect prediction.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Float64, Int
from sklearn.base import clone
from sklearn.metrics import r2_score

from relm_irl_jax.elm.regressor import ELMRegressor

PAPER_SIZES = (1, 10, 50, 100, *range(200, 1801, 200), 1950, 2400, 3000, 4000, 4700, 6000, 8000)
"""Numbers of neurons of Figure 7, denser where the paper's curve bends."""

ALL_NEURONS: dict[str, Any] = {"ordering": "none", "selection": "none"}
"""Parameters of `ELMRegressor` that keep every neuron."""

SELECTIONS: dict[str, tuple[dict[str, Any], bool]] = {
    "all neurons": (ALL_NEURONS, False),
    "MRSR, PRESS leaves out pairs": ({}, False),
    "MRSR, PRESS leaves out targets": ({}, True),
    "all neurons, ridge by PRESS of pairs": ({**ALL_NEURONS, "ridge": "press"}, False),
    "all neurons, ridge by PRESS of targets": ({**ALL_NEURONS, "ridge": "press"}, True),
}
"""Methods to select neurons and ridge penalty: parameters of `ELMRegressor`, and whether PRESS leaves out all pairs of
a target together. The second method is the paper's."""


@dataclass(frozen=True)
class Pairs:
    """Inputs and targets of a regression.

    Attributes:
        X: inputs, one row per pair.
        T: targets, one row per pair.
        target: number of each pair's target, a group label for PRESS.
    """

    X: Float[np.ndarray, "pairs inputs"]
    T: Float64[np.ndarray, "pairs outputs"]
    target: Int[np.ndarray, "pairs"]


@dataclass(frozen=True)
class SizeCurve:
    """Figure 7: accuracy of an ELM without selection against its number of neurons.

    Attributes:
        sizes: numbers of hidden neurons.
        test_r2: R² on the test pairs.
        train_r2: R² on the training pairs.
    """

    sizes: Int[np.ndarray, "sizes"]
    test_r2: Float64[np.ndarray, "sizes"]
    train_r2: Float64[np.ndarray, "sizes"]


@dataclass(frozen=True)
class Regularisation:
    """Figures 8 to 10: one hidden layer before and after MRSR and PRESS.

    Attributes:
        truth: the test pairs' targets.
        elm: predictions of all neurons.
        relm: predictions of the neurons that MRSR and PRESS select.
        elm_r2: R² of `elm`.
        relm_r2: R² of `relm`.
        kept: number of selected neurons.
        press_curve: mean squared leave-one-out error of the first 1, 2, … neurons in MRSR order.
    """

    truth: Float64[np.ndarray, "pairs outputs"]
    elm: Float64[np.ndarray, "pairs outputs"]
    relm: Float64[np.ndarray, "pairs outputs"]
    elm_r2: float
    relm_r2: float
    kept: int
    press_curve: Float64[np.ndarray, "neurons"]


@dataclass(frozen=True)
class SelectionResult:
    """Result of one method to select neurons and ridge penalty.

    Attributes:
        accuracy: R² on the test pairs.
        accuracy_in_unseen_scenes: R² on pairs of scenes that no pair to fit is of; NaN without such pairs.
        kept: number of selected neurons.
        ridge: penalty on the output weights.
    """

    accuracy: float
    accuracy_in_unseen_scenes: float
    kept: int
    ridge: float


def accuracy_by_size(train: Pairs, test: Pairs, sizes: Sequence[int] = PAPER_SIZES, **parameters: Any) -> SizeCurve:
    """Accuracy without selection for several numbers of neurons (Figure 7).

    Args:
        train: pairs to fit.
        test: pairs to predict.
        sizes: numbers of hidden neurons.
        parameters: of `ELMRegressor`, for example `activation`, `ridge`, `random_state`.

    Returns:
        The curve.
    """
    scores = []
    for size in sizes:
        model = ELMRegressor(size).set_params(**{**parameters, **ALL_NEURONS}).fit(train.X, train.T)
        scores.append([r2_score(pairs.T, model.predict(pairs.X)) for pairs in (test, train)])
    test_r2, train_r2 = np.array(scores).T
    return SizeCurve(np.asarray(sizes), test_r2, train_r2)


def compare_regularisation(train: Pairs, test: Pairs, n_hidden: int = 1950, **parameters: Any) -> Regularisation:
    """Predictions of one hidden layer before and after MRSR and PRESS (Figures 8 to 10).

    Args:
        train: pairs to fit.
        test: pairs to predict.
        n_hidden: number of neurons before selection.
        parameters: of `ELMRegressor`; `random_state` is 0 unless given, and both models have the same neurons.

    Returns:
        The predictions, their accuracy, and the leave-one-out curve.
    """
    base = ELMRegressor(n_hidden, random_state=0).set_params(**parameters)
    elm = clone(base).set_params(**ALL_NEURONS).fit(train.X, train.T)
    relm = clone(base).set_params(selection="press").fit(train.X, train.T)
    before, after = elm.predict(test.X), relm.predict(test.X)
    assert relm.press_curve_ is not None
    return Regularisation(
        truth=test.T,
        elm=before,
        relm=after,
        elm_r2=r2_score(test.T, before),
        relm_r2=r2_score(test.T, after),
        kept=relm.n_selected_,
        press_curve=relm.press_curve_,
    )


def accuracy_by_selection(
    train: Pairs, test: Pairs, unseen: Pairs | None = None, **parameters: Any
) -> dict[str, SelectionResult]:
    """Results of all `SELECTIONS` with the same hidden layer.

    Args:
        train: pairs to fit.
        test: pairs to predict, of other targets.
        unseen: pairs to predict, of other scenes.
        parameters: of `ELMRegressor`; `random_state` is 0 unless given.

    Returns:
        The results, by the names of `SELECTIONS`.
    """
    results = {}
    for name, (selection, by_target) in SELECTIONS.items():
        model = ELMRegressor(random_state=0).set_params(**{**parameters, **selection})
        model.fit(train.X, train.T, train.target if by_target else None)
        accuracy, elsewhere = (
            float("nan") if pairs is None else r2_score(pairs.T, model.predict(pairs.X)) for pairs in (test, unseen)
        )
        results[name] = SelectionResult(accuracy, elsewhere, model.n_selected_, model.ridge_)
    return results
