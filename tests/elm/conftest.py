"""A source of random problems.

Problems of up to 64 samples and columns, and 2 to 16 outputs, are padded to one shape: most functions are compiled once
for all of them. What is not padded (singular value and QR decompositions) is tested on few shapes.
"""

import numpy as np
import pytest


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def data(rng):
    X = rng.standard_normal((60, 4))
    T = np.stack([np.sin(2 * X[:, 0]), X[:, 1] * X[:, 2], X[:, 3]], axis=1)
    return X, T + 0.1 * rng.standard_normal(T.shape)
