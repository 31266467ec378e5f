"""The regularised extreme learning machine as a scikit-learn estimator (sections 3.2 and 4.3).

A hidden layer with random, fixed weights maps inputs to H (Equation 14); the output weights are the least-squares
solution of Hβ + b = T (Equation 17). MRSR orders the neurons, PRESS gives the leave-one-out error of every prefix of
that order, and the model keeps the prefix with the smallest error. The intercept b is fitted together with β and never
penalised; the leave-one-out errors account for it. They treat the standardisation of inputs as fixed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Literal, no_type_check

import numpy as np
from jaxtyping import Float64, Int
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data  # pyrefly: ignore[missing-module-attribute]

from relm_irl_jax.elm.hidden_layer import ACTIVATIONS, Activation, draw_hidden_layer
from relm_irl_jax.elm.least_squares import solve_output_weights
from relm_irl_jax.elm.mrsr import MRSRPath, mrsr_path
from relm_irl_jax.elm.press import PressPath, press_path, press_path_of_basis
from relm_irl_jax.elm.ridge_press import press_of_penalties
from relm_irl_jax.errors import InputError

RIDGE_GRID = (0.0, *(10.0**exponent for exponent in range(-8, 2)))
"""Candidate penalties for `ridge="press"`, as multiples of the mean squared norm of the centred neurons."""


@dataclass(frozen=True)
class Diagnostics:
    """Special cases of the fit, and errors for comparison.

    Attributes:
        rank: number of independent neurons; None if neither MRSR nor PRESS of prefixes ran.
        dependent: indices of neurons that are constant or depend on those before them; None if `rank` is None.
        unit_leverage: number of samples whose leverage is one in the chosen model, so that their error is that of a
            smaller prefix; None without a curve.
        null_error: leave-one-out error of the intercept alone, for comparison with the curve; None without a curve.
        ridge_errors: smallest leave-one-out error for each candidate penalty.
    """

    rank: int | None
    dependent: Int[np.ndarray, "dependent"] | None
    unit_leverage: int | None
    null_error: float | None
    ridge_errors: dict[float, float]


class ELMRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator):
    """Extreme learning machine with MRSR ordering and PRESS selection.

    Args:
        n_hidden: number of random neurons before selection, 1950 in the paper; ignored by the activation `linear`.
        activation: `tanh`, `sigmoid`, `relu`, `rbf` or `linear`, which passes the standardised inputs through.
        ordering: `mrsr`, or `none` to keep the neurons in their random order.
        norm: norm of MRSR's cumulative correlation, 1 (the paper's) or 2.
        selection: `press` keeps the prefix with the smallest leave-one-out error, an integer keeps that many neurons,
            and `none` keeps all.
        ridge: penalty λ ≥ 0 on the output weights, or `press` to choose it from a grid by leave-one-out error.
        random_state: seed or generator of the hidden weights.

    Attributes:
        order_: indices of the neurons in the order of the curve.
        press_curve_: mean squared leave-one-out error of the first 1, 2, … neurons; None unless `selection` is `press`.
        n_selected_: number of selected neurons.
        ridge_: penalty of the fitted model.
        hidden_: hidden layer of the selected neurons, in order.
        coef_: output weights β, one row for each selected neuron.
        intercept_: b.
        diagnostics_: special cases of the fit, and errors for comparison.
    """

    @no_type_check  # scikit-learn's estimators check their parameters when they are fitted
    def __init__(
        self,
        n_hidden: int = 200,
        activation: Activation = "tanh",
        ordering: Literal["mrsr", "none"] = "mrsr",
        norm: Literal[1, 2] = 1,
        selection: Literal["press", "none"] | int = "press",
        ridge: float | Literal["press"] = 0.0,
        *,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.n_hidden = n_hidden
        self.activation = activation
        self.ordering = ordering
        self.norm = norm
        self.selection = selection
        self.ridge = ridge
        self.random_state = random_state

    def fit(
        self, X: Any, y: Any, groups: Any = None, *, progress: Callable[[int], None] = lambda entered: None
    ) -> "ELMRegressor":
        """Draw the hidden layer, order and select neurons, and solve for the output weights.

        Args:
            X: inputs, one row per sample.
            y: targets, one row or one number per sample.
            groups: one label for each sample; PRESS leaves out all samples of a label together, which estimates the
                error for new labels. None leaves out one sample at a time.
            progress: called with the number of neurons that MRSR ordered since the last call.

        Returns:
            The estimator itself.
        """
        self._check_parameters()
        X, y = validate_data(self, X, y, multi_output=True, y_numeric=True, dtype=np.float64, ensure_min_samples=2)
        T = np.asarray(y, np.float64)
        self._single_output = T.ndim == 1
        T = T.reshape(len(T), -1)
        layer = draw_hidden_layer(X, self.n_hidden, self.activation, check_random_state(self.random_state))
        H = layer(X)
        count = H.shape[1]

        path = mrsr_path(H, T, self.norm, progress=progress) if self.ordering == "mrsr" else None
        self.order_ = np.arange(count) if path is None else path.order
        press, ridge_errors = self._leave_one_out(H[:, self.order_], T, path, groups)
        self.press_curve_ = None if press is None else press.curve
        self.ridge_ = float(self.ridge) if self.ridge != "press" else min(ridge_errors, key=ridge_errors.__getitem__)
        self.n_selected_ = self._fixed_size(count) if press is None else press.best_size
        selected = self.order_[: self.n_selected_]
        self.hidden_ = layer.select(selected)
        self.coef_, self.intercept_ = solve_output_weights(H[:, selected], T, self.ridge_)
        self.diagnostics_ = Diagnostics(
            rank=path.entered if path else press.rank if press else None,
            dependent=path.dependent if path else press.dependent if press else None,
            unit_leverage=None if press is None else int(press.unit_leverage[self.n_selected_ - 1]),
            null_error=None if press is None else press.null_error,
            ridge_errors=ridge_errors,
        )
        return self

    def predict(self, X: Any) -> Float64[np.ndarray, "..."]:
        """Predict targets, one row per sample; a vector if `y` was a vector in `fit`.

        Args:
            X: inputs, one row per sample.

        Returns:
            Hβ + b.
        """
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        T = self.hidden_(X) @ self.coef_ + self.intercept_
        return T[:, 0] if self._single_output else T

    def _leave_one_out(
        self,
        H: Float64[np.ndarray, "samples neurons"],
        T: Float64[np.ndarray, "samples outputs"],
        path: MRSRPath | None,
        groups: Any,
    ) -> tuple[PressPath | None, dict[float, float]]:
        """Errors of the prefixes, None unless PRESS selects, and the smallest error for each candidate penalty."""
        if self.ridge == "press":
            scale = np.square(H - H.mean(axis=0)).sum(axis=0).mean()
            penalties = [float(share * scale) for share in RIDGE_GRID]
        else:
            penalties = [float(self.ridge)]
        if self.selection != "press":
            if self.ridge != "press":
                return None, {}
            errors = press_of_penalties(H[:, : self._fixed_size(H.shape[1])], T, penalties, groups)
            return None, dict(zip(penalties, errors.tolist(), strict=True))
        # MRSR's basis spans the same prefixes, unless the path ended early because nothing remained to explain.
        complete = path is not None and path.entered + len(path.dependent) == H.shape[1]
        presses = [
            press_path_of_basis(path.basis, T, H.shape[1], groups)
            if path is not None and complete and not ridge
            else press_path(H, T, ridge, intercept=True, groups=groups)
            for ridge in penalties
        ]
        best = min(presses, key=lambda press: press.curve.min())
        return best, {press.ridge: float(press.curve.min()) for press in presses}

    def _fixed_size(self, count: int) -> int:
        """Number of neurons to keep out of `count`, if PRESS does not select it."""
        return count if isinstance(self.selection, str) else min(int(self.selection), count)

    def _check_parameters(self) -> None:
        """Raise an InputError that names the first invalid parameter."""

        def positive_integer(value: Any) -> bool:
            return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= 1

        def non_negative(value: Any) -> bool:
            return isinstance(value, Real) and not isinstance(value, bool) and 0 <= float(value) < np.inf

        selects = self.selection in ("press", "none") or positive_integer(self.selection)
        valid = {
            "n_hidden": (positive_integer(self.n_hidden), "an integer of at least 1"),
            "activation": (self.activation in ACTIVATIONS, "one of " + ", ".join(ACTIVATIONS)),
            "ordering": (self.ordering in ("mrsr", "none"), "mrsr or none"),
            "norm": (self.norm in (1, 2), "1 or 2"),
            "selection": (selects, "press, none or an integer of at least 1"),
            "ridge": (self.ridge == "press" or non_negative(self.ridge), "press or a finite number of at least 0"),
        }
        for name, (is_valid, requirement) in valid.items():
            if not is_valid:
                raise InputError(f"{name} must be {requirement}, not {getattr(self, name)!r}.")
