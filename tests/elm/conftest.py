"""Random problems with known shape and rank."""

import numpy as np
import pytest


@pytest.fixture
def rng():
    return np.random.default_rng(0)
