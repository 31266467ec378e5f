"""Random hidden layers: weights are drawn once, then fixed (Equations 9 and 14).

A neuron is g(w·x + b) on standardised inputs x. Weights w are normal with variance 1/d for d inputs and biases b are
standard normal, so that w·x has unit variance for any d. An RBF neuron is exp(-‖x - w‖² / (2d)) around a standard
normal centre w.
"""

from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64, Int

from relm_irl_jax.elm.matrices import float64, padded_length

Activation = Literal["tanh", "sigmoid", "relu", "rbf", "linear"]
ACTIVATIONS: tuple[Activation, ...] = get_args(Activation)
"""Activation functions; `linear` has one neuron for each input, whose output is the standardised input."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Projection:
    """Inputs of the neurons before bias and activation.

    A projection is a sum over inputs: disjoint parts of the inputs can be projected separately and added.

    Attributes:
        product: w·x of every neuron.
        squared_norm: ‖x‖², which RBF neurons need.
        squared_centre_norm: ‖w‖² of every neuron, which RBF neurons need.
    """

    product: Float[Array, "samples neurons"] | Float[np.ndarray, "samples neurons"]
    squared_norm: Float[Array, "samples"] | Float[np.ndarray, "samples"]
    squared_centre_norm: Float[Array, "neurons"] | Float[np.ndarray, "neurons"]

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.product)

    def __getitem__(self, samples: Int[np.ndarray, "chosen"]) -> "Projection":
        """The projection of some of the samples."""
        return Projection(self.product[samples], self.squared_norm[samples], self.squared_centre_norm)

    def __add__(self, other: "Projection") -> "Projection":
        """The projection of both parts of the inputs together."""
        return Projection(
            self.product + other.product,
            self.squared_norm + other.squared_norm,
            self.squared_centre_norm + other.squared_centre_norm,
        )


@dataclass(frozen=True)
class HiddenLayer:
    """A hidden layer with the standardisation of its inputs.

    Attributes:
        activation: one of `ACTIVATIONS`.
        mean: mean of each input, which is subtracted.
        scale: standard deviation of each input, by which the difference is divided.
        weights: w of every neuron, or its centre.
        bias: b of every neuron; 1/(2d) for RBF.
    """

    activation: Activation
    mean: Float64[np.ndarray, "inputs"]
    scale: Float64[np.ndarray, "inputs"]
    weights: Float64[np.ndarray, "inputs neurons"]
    bias: Float64[np.ndarray, "neurons"]

    def __call__(self, X: Float64[np.ndarray, "samples inputs"]) -> Float64[np.ndarray, "samples neurons"]:
        """Outputs H of the neurons for inputs X (Equation 14)."""
        samples = len(X)
        X = np.pad(X, ((0, padded_length(samples) - samples), (0, 0)))
        with float64():
            H = _outputs(X, self.mean, self.scale, self.weights, self.bias, activation=self.activation)
        return np.asarray(H)[:samples]

    def project(self, X: Float64[np.ndarray, "samples part"], first: int = 0) -> Projection:
        """Project consecutive inputs: all of them, or a part.

        Args:
            X: the inputs.
            first: index of the first of these inputs.

        Returns:
            Their part of the projection.
        """
        part = slice(first, first + X.shape[1])
        with float64():
            projection = _project_jit(X, self.mean[part], self.scale[part], self.weights[part])
        return jax.tree.map(np.asarray, projection)

    def activate(self, projection: Projection) -> Float64[np.ndarray, "samples neurons"]:
        """Outputs H of the neurons for projected inputs.

        Args:
            projection: projection of all inputs.

        Returns:
            H.
        """
        with float64():
            return np.asarray(_activate_jit(projection, self.bias, activation=self.activation))

    def select(self, neurons: Int[np.ndarray, "kept"]) -> "HiddenLayer":
        """A layer of some of the neurons.

        Args:
            neurons: indices of the neurons, in the order of the new layer.

        Returns:
            The smaller layer.
        """
        return HiddenLayer(self.activation, self.mean, self.scale, self.weights[:, neurons], self.bias[neurons])


def draw_hidden_layer(
    X: Float64[np.ndarray, "samples inputs"], n_hidden: int, activation: Activation, rng: np.random.RandomState
) -> HiddenLayer:
    """Draw the weights of a layer for inputs like X.

    Args:
        X: inputs, which give the means and standard deviations.
        n_hidden: number of neurons; ignored by `linear`, which has one for each input.
        activation: one of `ACTIVATIONS`.
        rng: source of the weights.

    Returns:
        The layer.
    """
    inputs = X.shape[1]
    mean, scale = X.mean(axis=0), X.std(axis=0)
    scale = np.where(scale > 10 * np.finfo(np.float64).eps * np.abs(X).max(axis=0), scale, 1.0)
    if activation == "linear":
        return HiddenLayer(activation, mean, scale, np.eye(inputs), np.zeros(inputs))
    weights = rng.standard_normal((inputs, n_hidden))
    if activation == "rbf":
        return HiddenLayer(activation, mean, scale, weights, np.full(n_hidden, 1 / (2 * inputs)))
    return HiddenLayer(activation, mean, scale, weights * (1 / np.sqrt(inputs)), rng.standard_normal(n_hidden))


def _project(X, mean, scale, weights) -> Projection:
    Z = (X - mean) / scale
    return Projection(Z @ weights, jnp.sum(Z**2, axis=1), jnp.sum(weights**2, axis=0))


def _activate(projection: Projection, bias, activation: Activation):
    match activation:
        case "tanh":
            return jnp.tanh(projection.product + bias)
        case "sigmoid":
            return jax.nn.sigmoid(projection.product + bias)
        case "relu":
            return jax.nn.relu(projection.product + bias)
        case "linear":
            return projection.product + bias
        case "rbf":
            squared_norm = projection.squared_norm[:, None]
            distance = squared_norm - 2 * projection.product + projection.squared_centre_norm
            return jnp.exp(-bias * jnp.maximum(distance, 0))


@partial(jax.jit, static_argnames="activation")
def _outputs(X, mean, scale, weights, bias, *, activation: Activation):
    return _activate(_project(X, mean, scale, weights), bias, activation)


_project_jit = jax.jit(_project)
_activate_jit = jax.jit(_activate, static_argnames="activation")
