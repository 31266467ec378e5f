"""Files of fitted regressors."""

import numpy as np
import pytest
from safetensors.numpy import save_file
from sklearn.base import clone

from relm_irl_jax.elm import ELMRegressor, load_elm, save_elm


@pytest.mark.parametrize(
    "parameters",
    [{}, {"ridge": "press", "ordering": "none", "selection": "none"}, {"selection": 3, "activation": "rbf"}],
)
def test_a_file_gives_the_same_model(parameters, data, tmp_path):
    X, T = data
    model = ELMRegressor(20, random_state=0, **parameters).fit(X, T)
    save_elm(model, tmp_path / "model.safetensors")
    loaded = load_elm(tmp_path / "model.safetensors")
    assert loaded.get_params() == model.get_params()
    assert np.array_equal(loaded.predict(X), model.predict(X))
    assert loaded.diagnostics_.ridge_errors == model.diagnostics_.ridge_errors
    for name, value in vars(model).items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(getattr(loaded, name), value)
    for name, value in vars(model.hidden_).items():
        assert np.array_equal(getattr(loaded.hidden_, name), value)
    assert clone(loaded).get_params() == model.get_params()


def test_files_that_hold_no_model(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        load_elm(tmp_path / "none")
    (tmp_path / "text").write_text("hello")
    with pytest.raises(ValueError, match="cannot be read"):
        load_elm(tmp_path / "text")
    save_file({"a": np.ones(1)}, tmp_path / "other")
    with pytest.raises(ValueError, match="contains no regressor"):
        load_elm(tmp_path / "other")
    save_file({"a": np.ones(1)}, tmp_path / "later", metadata={"format": "relm-irl-jax/elm", "version": "99"})
    with pytest.raises(ValueError, match="version 99"):
        load_elm(tmp_path / "later")
