"""Files of fitted regressors."""

import numpy as np
import pytest
from safetensors.numpy import save_file
from sklearn.base import clone

from relm_irl_jax.elm import ELMRegressor, load_elm, save_elm
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays


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


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"predict": np.ones(3)}, "`predict` is no attribute of a fitted regressor"),
        ({"__class__": np.ones(3)}, "`__class__` is no attribute"),
        ({"coef_": None}, "`coef_` is missing"),
        ({"coef_": np.full((2, 1), np.nan)}, "`coef_` is not finite"),
        ({"coef_": np.ones((7, 7))}, "contradict each other"),
        ({"hidden_.weights": np.ones((1, 1))}, "contradict each other|contains no whole regressor"),
        ({"intercept_": np.ones(1, np.int64)}, "not in double precision"),
    ],
)
def test_tensors_that_do_not_belong_to_a_model(data, tmp_path, changes, said):
    """The file's checksum is right: another program wrote it."""
    X, T = data
    path = tmp_path / "model.safetensors"
    save_elm(ELMRegressor(20, random_state=0).fit(X, T), path)
    tensors, metadata = load_arrays_and_metadata(path)
    changed = {name: value for name, value in (tensors | changes).items() if value is not None}
    save_arrays(path, changed, metadata)
    with pytest.raises(InputError, match=said) as refusal:
        load_elm(path)
    assert str(refusal.value).startswith(f"{path}: ")


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
