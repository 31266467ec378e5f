"""Random hidden layers: drawn once, then fixed.

A neuron is g(w·x + b) on standardised inputs x. Weights are normal with variance `gain`²/d, so that pre-activations
have standard deviation `gain` whatever the number d of inputs. An RBF neuron is exp(-‖x - w‖²/(2·width²)) around a
centre w; its width grows with √d for the same reason.
"""

import operator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float64, Int

from relm_irl_jax.elm.linear import float64

Activation = Literal["tanh", "sigmoid", "relu", "rbf", "linear"]
ACTIVATIONS: tuple[Activation, ...] = ("tanh", "sigmoid", "relu", "rbf", "linear")
"""Kinds of neuron; `linear` passes the standardised inputs through."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Projection:
    """All that neurons take from inputs x. It is a sum over the inputs: parts of them may be projected apart and added.

    Attributes:
        product: w·x of every neuron.
        square: ‖x‖², which RBF neurons take.
        centre: ‖w‖² of every neuron, likewise.
    """

    product: Float[Array, "samples neurons"]
    square: Float[Array, "samples"]
    centre: Float[Array, "neurons"]

    def __add__(self, other: "Projection") -> "Projection":
        """The projection of both parts side by side."""
        return jax.tree.map(operator.add, self, other)

    def __getitem__(self, samples: Int[np.ndarray, "chosen"]) -> "Projection":
        """The projection of some of the samples."""
        return Projection(self.product[samples], self.square[samples], self.centre)


@dataclass(frozen=True)
class HiddenLayer:
    """A hidden layer with its input standardisation.

    Attributes:
        activation: one of `ACTIVATIONS`.
        mean: subtracted from the inputs.
        scale: divides the inputs after that.
        weights: w of every neuron, or its centre.
        bias: b of every neuron, or 1/(2·width²).
        linear: which neurons are w·x + b, whatever the activation: those that pass an input through.
    """

    activation: Activation
    mean: Float64[np.ndarray, "inputs"]
    scale: Float64[np.ndarray, "inputs"]
    weights: Float64[np.ndarray, "inputs neurons"]
    bias: Float64[np.ndarray, "neurons"]
    linear: Bool[np.ndarray, "neurons"]

    def __call__(self, X: Float64[np.ndarray, "samples inputs"]) -> Float64[np.ndarray, "samples neurons"]:
        """Outputs H of the neurons."""
        return self.outputs(self.project(X))

    def project(self, X: Float64[np.ndarray, "samples part"], first: int = 0) -> Projection:
        """Project some of the inputs, standardised.

        Args:
            X: consecutive inputs.
            first: number of the first of them.

        Returns:
            Their share of the projection.
        """
        part = slice(first, first + X.shape[1])
        with float64():
            return _project(X, self.mean[part], self.scale[part], self.weights[part])

    def outputs(self, projection: Projection) -> Float64[np.ndarray, "samples neurons"]:
        """Outputs H of the neurons for projected inputs.

        Args:
            projection: of all inputs.

        Returns:
            H.
        """
        with float64():
            H = _activate(projection, self.bias, self.linear, activation=self.activation)
        return np.asarray(H)

    def take(self, neurons: Int[np.ndarray, "kept"]) -> "HiddenLayer":
        """The layer with these neurons alone, in this order."""
        kept = self.weights[:, neurons], self.bias[neurons], self.linear[neurons]
        return HiddenLayer(self.activation, self.mean, self.scale, *kept)


def neuron_outputs(
    X: Float[Array, "samples inputs"],
    weights: Float[Array, "inputs neurons"],
    bias: Float[Array, "neurons"],
    linear: Bool[Array, "neurons"],
    activation: Activation,
) -> Float[Array, "samples neurons"]:
    """Outputs of a layer on standardised inputs; pure, for `jax.jit` and `jax.vmap`."""
    return _activate(_project(X, 0.0, 1.0, weights), bias, linear, activation=activation)


@jax.jit
def _project(X, mean, scale, weights):
    Z = (X - mean) / scale
    return Projection(Z @ weights, jnp.sum(Z**2, axis=1), jnp.sum(weights**2, axis=0))


@partial(jax.jit, static_argnames="activation")
def _activate(projection, bias, linear, activation: Activation):
    """Outputs of neurons from their projection."""
    product = projection.product
    match activation:
        case "tanh":
            H = jnp.tanh(product + bias)
        case "sigmoid":
            H = jax.nn.sigmoid(product + bias)
        case "relu":
            H = jax.nn.relu(product + bias)
        case "rbf":
            square = projection.square[:, None] - 2 * product + projection.centre
            H = jnp.exp(-bias * jnp.maximum(square, 0))
        case "linear":
            H = product + bias
    return jnp.where(linear, product + bias, H)


def draw_hidden(
    X: Float64[np.ndarray, "samples inputs"],
    n_hidden: int,
    activation: Activation,
    rng: np.random.RandomState,
    *,
    gain: float = 1.0,
    pass_through: bool = False,
) -> HiddenLayer:
    """Draw a layer for inputs like X.

    Args:
        X: inputs, whose means and standard deviations standardise.
        n_hidden: number of random neurons; `linear` has one per input instead.
        activation: one of `ACTIVATIONS`.
        rng: where the weights come from.
        gain: standard deviation of the pre-activations; for RBF the inverse of the width in units of √d.
        pass_through: add one neuron per input that passes it through; `linear` is these alone.

    Returns:
        The layer.
    """
    inputs = X.shape[1]
    random = 0 if activation == "linear" else n_hidden
    through = inputs if pass_through or activation == "linear" else 0
    mean, scale = X.mean(axis=0), X.std(axis=0)
    scale = np.where(scale > 10 * np.finfo(np.float64).eps * np.abs(X).max(axis=0), scale, 1.0)
    weights = rng.standard_normal((inputs, random))
    if activation == "rbf":
        bias = np.full(random, gain**2 / (2 * inputs))
    else:
        weights *= gain / np.sqrt(inputs)
        bias = gain * rng.standard_normal(random)
    return HiddenLayer(
        activation=activation,
        mean=mean,
        scale=scale,
        weights=np.hstack([weights, np.eye(inputs, through)]),
        bias=np.hstack([bias, np.zeros(through)]),
        linear=np.arange(random + through) >= random,
    )
