"""The regularised extreme learning machine as a scikit-learn estimator.

A hidden layer with random, fixed weights maps inputs to H; the output weights are the least-squares solution of
Hβ + b = T. MRSR orders the neurons, PRESS gives the leave-one-out error of every prefix of that order, and the model
keeps the prefix with the least error. The intercept b is fitted with β, never penalised, and part of what PRESS leaves
out; the standardisation of inputs and the random weights are fixed beforehand.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from numbers import Integral, Real
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array, Float, Float64, Int
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data  # pyrefly: ignore[missing-module-attribute]

from relm_irl_jax.elm.hidden import ACTIVATIONS, Activation, draw_hidden
from relm_irl_jax.elm.linear import centred, float64, rank_tolerance
from relm_irl_jax.elm.mrsr import MRSRPath, path_and_basis
from relm_irl_jax.elm.press import PressPath, basis_path, press_path
from relm_irl_jax.elm.ridge import penalty_errors
from relm_irl_jax.errors import InputError

RIDGE_GRID = (0.0, *(10.0**exponent for exponent in range(-8, 2)))
"""Penalties tried for `ridge="press"`, as shares of the mean squared norm of the centred neurons."""


@dataclass(frozen=True)
class Diagnostics:
    """What the fit met and handled.

    Attributes:
        rank: independent neurons among all, the intercept apart; None if neither MRSR nor PRESS's curve ran.
        dropped: neurons that depend on those before them or are constant, by index of drawing; None likewise.
        capped: samples whose leverage is one in the chosen model; their error is that of a smaller prefix.
            None without a curve.
        press_empty: leave-one-out error of the intercept alone, to compare the curve with; None without one.
        ridge_press: least leave-one-out error of each penalty tried.
    """

    rank: int | None
    dropped: Int[np.ndarray, "dropped"] | None
    capped: int | None
    press_empty: float | None
    ridge_press: dict[float, float]


@partial(jax.jit, static_argnames="penalised")
def _solve(
    H: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    ridge: Float[Array, ""] | float,
    penalised: bool,
):
    """Output weights of centred data by QR, and whether its triangle is well conditioned."""
    stacked = H
    if penalised:  # rows of zeros would make Householder's QR work on denormal numbers, thirty times as slowly
        stacked = jnp.concatenate([H, jnp.sqrt(ridge) * jnp.eye(H.shape[1], dtype=H.dtype)])
    Q, R = jnp.linalg.qr(stacked)
    diagonal = jnp.abs(jnp.diagonal(R))
    sound = diagonal.min() > rank_tolerance(*H.shape) * diagonal.max()
    return jax.scipy.linalg.solve_triangular(R, Q[: len(H)].T @ T), sound


def output_weights(
    H: Float64[np.ndarray, "samples neurons"], T: Float64[np.ndarray, "samples outputs"], ridge: float = 0.0
) -> tuple[Float64[np.ndarray, "neurons outputs"], Float64[np.ndarray, "outputs"]]:
    """Least-squares output weights and intercept; those of least norm where they are not unique.

    Args:
        H: hidden outputs.
        T: targets.
        ridge: penalty λ on the squared weights.

    Returns:
        β and b.
    """
    H_mean, T_mean = H.mean(axis=0), T.mean(axis=0)
    with float64():
        Hc, Tc = centred(jnp.asarray(H)), jnp.asarray(T - T_mean)
        beta, sound = None, False
        if H.shape[1] and (ridge > 0 or H.shape[1] < len(H)):
            beta, sound = _solve(Hc, Tc, ridge, penalised=ridge > 0)
    if not sound:
        # Centring took one direction away; rounding leaves a trace of it, which the default cut-off would keep.
        cut = rank_tolerance(*H.shape)
        beta = scipy.linalg.lstsq(np.asarray(Hc), np.asarray(Tc), cond=cut, check_finite=False)[0]
    beta = np.asarray(beta)
    return beta, T_mean - H_mean @ beta


class ELMRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator):
    """Extreme learning machine with MRSR ordering and PRESS selection.

    Args:
        n_hidden: random neurons before selection; the paper's is 1950. Activation `linear` has one per input instead.
        activation: `tanh`, `sigmoid`, `relu`, `rbf` or `linear`, which passes the standardised inputs through.
        ordering: `mrsr`, or `none` for the order of drawing.
        norm: norm of MRSR's cumulative correlation, 1 (the paper's) or 2.
        selection: `press` keeps the prefix of least leave-one-out error, an integer that many neurons, `none` all.
        ridge: penalty λ ≥ 0 on the output weights, or `press` to choose it from a grid by leave-one-out error.
        random_state: seed or generator of the hidden weights.
        gain: standard deviation of the neurons' pre-activations.
        pass_through: add the standardised inputs to the random neurons.

    Attributes:
        order_: neurons, by index of drawing, in the order of the curve.
        press_curve_: mean squared leave-one-out error of the first 1, 2, … of them; None unless it selects.
        n_selected_: number of neurons kept.
        ridge_: penalty used.
        hidden_: the neurons kept, in order.
        coef_: output weights, one row per kept neuron.
        intercept_: output of the model where all neurons are zero.
        mrsr_: the path of the ordering; None for ordering `none`.
        diagnostics_: what the fit met and handled.
    """

    def __init__(
        self,
        n_hidden: int = 200,
        activation: Activation = "tanh",
        ordering: Literal["mrsr", "none"] = "mrsr",
        norm: Literal[1, 2] = 1,
        selection: Literal["press", "none"] | int = "press",
        ridge: float | Literal["press"] = 0.0,
        random_state: int | np.random.RandomState | None = None,
        gain: float = 1.0,
        pass_through: bool = False,
    ):
        self.n_hidden = n_hidden
        self.activation = activation
        self.ordering = ordering
        self.norm = norm
        self.selection = selection
        self.ridge = ridge
        self.random_state = random_state
        self.gain = gain
        self.pass_through = pass_through

    def _check_parameters(self) -> None:
        """Refuse parameters that mean nothing, in one sentence that names them."""

        def whole(value: Any) -> bool:
            return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= 1

        def number(value: Any) -> bool:
            return isinstance(value, Real) and not isinstance(value, bool) and np.isfinite(float(value))

        allowed = {
            "n_hidden": (whole(self.n_hidden), "a whole number of at least 1"),
            "activation": (self.activation in ACTIVATIONS, "one of " + ", ".join(ACTIVATIONS)),
            "ordering": (self.ordering in ("mrsr", "none"), "mrsr or none"),
            "norm": (self.norm in (1, 2), "1 or 2"),
            "selection": (
                self.selection in ("press", "none") or whole(self.selection),
                "press, none or a whole number of at least 1",
            ),
            "ridge": (self.ridge == "press" or (number(self.ridge) and self.ridge >= 0), "press or a number ≥ 0"),
            "gain": (number(self.gain) and self.gain > 0, "a number > 0"),
        }
        for name, (valid, what) in allowed.items():
            if not valid:
                raise InputError(f"{name} must be {what}, not {getattr(self, name)!r}.")

    def fit(
        self, X: Any, y: Any, groups: Any = None, report: Callable[[int], None] = lambda entered: None
    ) -> "ELMRegressor":
        """Draw the hidden layer, order and select neurons, and solve for the output weights.

        Args:
            X: inputs, one row per sample.
            y: targets, one row or one number per sample.
            groups: one label per sample; PRESS leaves out samples of one label together, so that what it chooses is
                good for samples that have no like among those fitted. None leaves out one at a time.
            report: called with the number of neurons that MRSR ordered since its last call.

        Returns:
            Itself.
        """
        self._check_parameters()
        X, y = validate_data(self, X, y, multi_output=True, y_numeric=True, dtype=np.float64, ensure_min_samples=2)
        T = np.asarray(y, np.float64)
        self._single_output = T.ndim == 1
        T = T.reshape(len(T), -1)
        rng = check_random_state(self.random_state)
        layer = draw_hidden(X, self.n_hidden, self.activation, rng, gain=self.gain, pass_through=self.pass_through)
        H = layer(X)
        count = H.shape[1]

        path, basis = path_and_basis(H, T, self.norm, report) if self.ordering == "mrsr" else (None, None)
        self.mrsr_: MRSRPath | None = path
        self.order_ = np.arange(count) if path is None else path.order
        press, tried = self._choose(H[:, self.order_], T, path, basis, groups)
        self.press_curve_ = None if press is None else press.curve
        self.ridge_ = min(tried, key=lambda penalty: tried[penalty]) if tried else float(self.ridge)
        self.n_selected_ = self._size(press, count)
        kept = self.order_[: self.n_selected_]
        self.hidden_ = layer.take(kept)
        self.coef_, self.intercept_ = output_weights(H[:, kept], T, self.ridge_)
        self.diagnostics_ = Diagnostics(
            rank=path.entered if path else press.rank if press else None,
            dropped=path.dependent if path else press.dropped if press else None,
            capped=None if press is None else int(press.capped[self.n_selected_ - 1]),
            press_empty=None if press is None else press.empty,
            ridge_press=tried,
        )
        return self

    def predict(self, X: Any) -> Float64[np.ndarray, "..."]:
        """Outputs for inputs X, one row per sample; a vector if fitted on one."""
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        T = self.hidden_(X) @ self.coef_ + self.intercept_
        return T[:, 0] if self._single_output else T

    def _size(self, press: PressPath | None, count: int) -> int:
        """Number of neurons to keep of `count`."""
        if self.selection == "press":
            assert press is not None  # `_presses` made a curve
            return press.best
        return count if isinstance(self.selection, str) else min(int(self.selection), count)

    def _choose(
        self, H: np.ndarray, T: np.ndarray, path: MRSRPath | None, basis: Array | None, groups: Any
    ) -> tuple[PressPath | None, dict[float, float]]:
        """The leave-one-out curve to select neurons by, if they are, and the error of each penalty at its best size."""
        if self.ridge == "press":
            size = np.square(H - H.mean(axis=0)).sum(axis=0).mean()
            penalties = [float(share * size) for share in RIDGE_GRID]
        else:
            penalties = [float(self.ridge)]
        if self.selection != "press":
            if self.ridge != "press":
                return None, {}
            kept = H[:, : self._size(None, H.shape[1])]
            return None, dict(zip(penalties, penalty_errors(kept, T, penalties, groups).tolist(), strict=True))
        # MRSR's basis spans the same prefixes, standardised or not, unless it ended early with nothing left to explain.
        own = None
        if path is not None and basis is not None and path.entered + len(path.dependent) == H.shape[1]:
            own = basis[: path.entered]
        presses = [
            basis_path(own, T, H.shape[1], groups)
            if own is not None and not ridge
            else press_path(H, T, ridge, intercept=True, groups=groups)
            for ridge in penalties
        ]
        return min(presses, key=lambda press: press.curve.min()), {p.ridge: float(p.curve.min()) for p in presses}
