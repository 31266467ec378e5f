"""Many random layers at once: draw, order and judge them by `jax.vmap` over seeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64, Int

from relm_irl_jax.elm.hidden import Activation, HiddenLayer, draw_hidden, neuron_outputs
from relm_irl_jax.elm.linear import centred, finite_pair, float64
from relm_irl_jax.elm.mrsr import mrsr_steps
from relm_irl_jax.elm.press import basis_errors
from relm_irl_jax.elm.regressor import output_weights


@dataclass(frozen=True)
class Ensemble:
    """Regularised ELMs that differ in their random layer; a prediction is their mean.

    Attributes:
        layers: the neurons each member keeps.
        coef: output weights of each member.
        intercept: intercept of each member.
        orders: MRSR order of each member.
        curves: leave-one-out error of every prefix, with intercept, of each member.
    """

    layers: tuple[HiddenLayer, ...]
    coef: tuple[Float64[np.ndarray, "kept outputs"], ...]
    intercept: tuple[Float64[np.ndarray, "outputs"], ...]
    orders: Int[np.ndarray, "members neurons"]
    curves: Float64[np.ndarray, "members neurons"]

    def members(self, X: Float64[np.ndarray, "samples inputs"]) -> Float64[np.ndarray, "members samples outputs"]:
        """Prediction of each member."""
        parts = zip(self.layers, self.coef, self.intercept, strict=True)
        return np.stack([layer(X) @ beta + b for layer, beta, b in parts])

    def predict(self, X: Float64[np.ndarray, "samples inputs"]) -> Float64[np.ndarray, "samples outputs"]:
        """Mean of the members' predictions."""
        return self.members(X).mean(axis=0)


@partial(jax.jit, static_argnames=("activation", "norm"))
def _orders_and_curves(Z, T, weights, bias, linear, activation, norm):
    """Hidden outputs, order and curve of every member."""

    def member(weights, bias):
        H = neuron_outputs(Z, weights, bias, linear, activation)
        steps = mrsr_steps(H, T, norm)
        Q = jnp.zeros(H.shape).at[:, : len(steps.basis)].set(steps.basis.T)
        errors = basis_errors(Q, centred(T), intercept=True, saturates=True)
        return H, steps.order, errors.curve / T.shape[1]

    return jax.vmap(member)(weights, bias)


def fit_ensemble(
    X: Any,
    T: Any,
    seeds: Sequence[int],
    n_hidden: int = 200,
    activation: Activation = "tanh",
    norm: Literal[1, 2] = 1,
    gain: float = 1.0,
) -> Ensemble:
    """Fit one regularised ELM per seed in one compiled call; `ELMRegressor(random_state=seed)` draws the same layer.

    Args:
        X: inputs, one row per sample.
        T: targets, one row per sample.
        seeds: one per member.
        n_hidden: neurons of each layer before selection.
        activation: kind of neuron.
        norm: norm of MRSR.
        gain: standard deviation of the pre-activations.

    Returns:
        The members.

    Raises:
        InputError: unusable X or T.
    """
    X, T = finite_pair(X, T)
    drawn = [draw_hidden(X, n_hidden, activation, np.random.RandomState(seed), gain=gain) for seed in seeds]
    first = drawn[0]
    with float64():
        H, orders, curves = _orders_and_curves(
            (X - first.mean) / first.scale,
            T,
            np.stack([layer.weights for layer in drawn]),
            np.stack([layer.bias for layer in drawn]),
            first.linear,
            activation=activation,
            norm=norm,
        )
    H, orders, curves = (np.asarray(array) for array in (H, orders, curves))
    kept = [order[: np.argmin(curve) + 1] for order, curve in zip(orders, curves, strict=True)]
    fits = [output_weights(h[:, neurons], T) for h, neurons in zip(H, kept, strict=True)]
    return Ensemble(
        layers=tuple(layer.take(neurons) for layer, neurons in zip(drawn, kept, strict=True)),
        coef=tuple(beta for beta, _ in fits),
        intercept=tuple(b for _, b in fits),
        orders=orders,
        curves=curves,
    )
