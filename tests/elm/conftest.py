"""A source of random problems.

Most tests use 17 to 64 samples and columns, and 2 to 16 outputs: such problems are padded to one shape, so that every
function is compiled once for all of them.
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
