"""MRSR against LARS, sign enumeration, hpelm, and the property that defines it."""

import importlib
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from references import correlation, mrsr_by_enumeration, replay, standardise
from sklearn.linear_model import lars_path

from relm_irl_jax.elm import mrsr, mrsr_path

NORMS = (1, 2)


def assert_equal_correlations(H, T, path, tolerance=1e-9):
    """After every step active columns tie, and no inactive column exceeds them."""
    for X, active, residual in replay(H, T, path):
        c = correlation(residual, X, path.norm)
        scale = path.correlation[0] * tolerance
        np.testing.assert_allclose(c[active], c[active[0]], rtol=0, atol=scale)
        assert c.max() <= c[active[0]] + scale


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6, 7, 8])
def test_one_output_on_an_iid_design_is_least_angle_regression(seed, norm):
    rng = np.random.default_rng(seed)
    H, t = rng.standard_normal((60, 25)), rng.standard_normal(60)
    X, t = standardise(H), t - t.mean()
    _, active, path = lars_path(X, t, method="lar")
    flips = np.flatnonzero((path[:, 1:] * path[:, :-1] < 0).any(axis=0))
    # Once a coefficient has changed its sign, scikit-learn's active correlations no longer tie.
    compared = len(active) if len(flips) == 0 else flips[0] + 1
    assert mrsr(H, t, norm).tolist()[:compared] == list(active)[:compared]
    assert (len(flips) > 0) == (seed in (0, 2, 6, 8))
    if len(flips):
        c = np.abs(X.T @ (t - X @ path[:, -3]))[active[:-3]]
        assert c.max() > 1.1 * c.min()


@pytest.mark.parametrize("p", range(1, 9))
def test_norm_1_is_what_enumerating_signs_gives(p):
    rng = np.random.default_rng(p)
    H = rng.standard_normal((40, 18)) @ rng.standard_normal((18, 18))
    T = rng.standard_normal((40, p)) + H[:, :1]
    assert mrsr(H, T).tolist() == mrsr_by_enumeration(H, T)


@pytest.mark.parametrize("p", [1, 2, 5, 7])
def test_norm_1_agrees_with_hpelm(p, rng):
    peer = pytest.importorskip("hpelm.modules.mrsr", reason="hpelm, an optional peer, is not installed")
    H, T = rng.standard_normal((60, 18)), rng.standard_normal((60, p))
    assert mrsr(H, T).tolist() == peer.mrsr(standardise(H), standardise(T), 18).tolist()


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize("p", [1, 2, 8])
def test_correlations_tie_after_every_step(p, norm, rng):
    H = np.tanh(rng.standard_normal((60, 6)) @ rng.standard_normal((6, 50)))  # correlated, as an ELM's neurons are
    T = rng.standard_normal((60, p))
    path = mrsr_path(H, T, norm)
    assert path.entered == 50
    assert_equal_correlations(H, T, path)
    assert path.step[-1] == 1


@pytest.mark.parametrize("norm", NORMS)
def test_the_basis_spans_every_prefix(norm, rng):
    H = rng.standard_normal((40, 35))
    H[:, 4] = H[:, 9] - H[:, 2]
    path = mrsr_path(H, rng.standard_normal((40, 2)), norm)
    assert path.basis.shape == (34, 40)
    np.testing.assert_allclose(path.basis @ path.basis.T, np.eye(34), atol=1e-13)
    columns = (H - H.mean(axis=0))[:, path.order[:34]]
    products = path.basis @ columns
    np.testing.assert_allclose(path.basis.T @ products, columns, atol=1e-12)
    np.testing.assert_allclose(np.tril(products, -1), 0, atol=1e-12)


def test_norm_2_does_not_change_with_a_rotation_of_the_outputs_and_norm_1_does(rng):
    H, T = rng.standard_normal((50, 20)), standardise(rng.standard_normal((50, 4)))
    # Columns that stay standardised under the rotation, so that the rotation is all that changes.
    T = np.linalg.qr(T)[0]
    rotation = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    assert mrsr(H, T, 2).tolist() == mrsr(H, T @ rotation, 2).tolist()
    assert mrsr(H, T, 1).tolist() != mrsr(H, T @ rotation, 1).tolist()


@pytest.mark.parametrize("norm", NORMS)
def test_scale_and_shift_do_not_matter(norm, rng):
    H, T = rng.standard_normal((50, 20)), rng.standard_normal((50, 3))
    scaled = H * 10.0 ** rng.uniform(-6, 6, 20) + rng.standard_normal(20)
    assert mrsr(scaled, 7 - 3 * T, norm).tolist() == mrsr(H, T, norm).tolist()


@pytest.mark.parametrize("norm", NORMS)
def test_dependent_columns_are_skipped_and_reported(norm, rng):
    H = rng.standard_normal((40, 20))
    H[:, 3] = H[:, 7]
    H[:, 5] = 2.5
    H[:, 8] = H[:, 0] - 2 * H[:, 1] + 4
    path = mrsr_path(H, rng.standard_normal((40, 3)), norm)
    assert path.entered == 17
    assert sorted(path.order) == list(range(20))
    assert set(path.order[17:]) == set(path.dependent)
    assert 5 in path.dependent
    assert len({3, 7} & set(path.dependent)) == 1
    assert len({0, 1, 8} & set(path.dependent)) == 1


@pytest.mark.parametrize("norm", NORMS)
def test_fewer_samples_than_columns(norm, rng):
    H, T = rng.standard_normal((20, 45)), rng.standard_normal((20, 3))
    path = mrsr_path(H, T, norm)
    assert path.entered == 19  # the mean takes one
    assert len(path.dependent) == 26
    assert_equal_correlations(H, T, path)


def test_dropping_rows_of_settled_columns_changes_nothing(rng, monkeypatch):
    H, T = rng.standard_normal((60, 50)), rng.standard_normal((60, 3))
    H[:, 20] = H[:, 40]
    H[:, 7] = 1.0
    whole = mrsr_path(H, T)
    monkeypatch.setattr(importlib.import_module("relm_irl_jax.elm.mrsr"), "MIN_ROWS_TO_DROP", 40)
    dropped = mrsr_path(H, T)
    assert dropped.order.tolist() == whole.order.tolist()
    assert dropped.dependent.tolist() == whole.dependent.tolist()
    np.testing.assert_allclose(dropped.step, whole.step, rtol=1e-9)
    assert_equal_correlations(H, T, dropped)


@pytest.mark.parametrize(("norm", "p"), [(1, 16), (2, 500)])
def test_many_outputs(norm, p, rng):
    H, T = rng.standard_normal((17, 20)), rng.standard_normal((17, p))
    path = mrsr_path(H, T, norm)
    assert path.entered == 16
    assert_equal_correlations(H, T, path)


@pytest.mark.parametrize("norm", NORMS)
def test_targets_of_low_rank(norm, rng):
    H = rng.standard_normal((60, 20))
    T = rng.standard_normal((60, 2)) @ rng.standard_normal((2, 9))
    T[:, 4] = 1.0
    path = mrsr_path(H, T, norm)
    assert path.entered == 20
    assert_equal_correlations(H, T, path)


@pytest.mark.parametrize("norm", NORMS)
def test_targets_that_few_columns_explain_exactly(norm, rng):
    H = np.linalg.qr(rng.standard_normal((60, 20)))[0]
    H = np.linalg.qr(H - H.mean(axis=0))[0]
    path = mrsr_path(H, H[:, [11, 4]] @ [[1.0, 2.0], [3.0, 1.0]], norm)
    assert set(path.order[:2]) == {4, 11}
    assert sorted(path.order) == list(range(20))


@pytest.mark.parametrize("norm", NORMS)
def test_constant_targets_order_nothing(norm, rng):
    path = mrsr_path(rng.standard_normal((30, 20)), np.ones((30, 1)), norm)
    assert path.entered == 0
    assert path.order.tolist() == list(range(20))


@settings(max_examples=30, deadline=None)
@example(samples=17, columns=33, outputs=4, rank=16, norm=2, seed=24)
@given(
    samples=st.sampled_from([3, 17, 40]),
    columns=st.sampled_from([1, 9, 33, 50]),
    outputs=st.sampled_from([1, 4]),
    rank=st.integers(1, 60),
    norm=st.sampled_from(NORMS),
    seed=st.integers(0, 99),
)
def test_any_shape_and_rank(samples, columns, outputs, rank, norm, seed):
    rng = np.random.default_rng(seed)
    rank = min(rank, samples - 1, columns)
    H = rng.standard_normal((samples, rank)) @ rng.standard_normal((rank, columns))
    T = rng.standard_normal((samples, outputs))
    path = mrsr_path(H, T, norm)
    assert sorted(path.order) == list(range(columns))
    assert path.entered == np.linalg.matrix_rank(standardise(H))
    # Columns that have not been examined when nothing is left to explain are in neither set.
    assert set(path.dependent) <= set(path.order[path.entered :])
    assert_equal_correlations(H, T, path, tolerance=1e-7)


def test_one_column_and_one_output(rng):
    path = mrsr_path(rng.standard_normal((9, 1)), rng.standard_normal(9))
    assert path.order.tolist() == [0]
    assert path.step.tolist() == [1.0]


def test_progress_counts_every_column(rng):
    counts = []
    path = mrsr_path(rng.standard_normal((60, 50)), rng.standard_normal((60, 3)), progress=counts.append)
    assert len(counts) > 1
    assert sum(counts) == path.entered == 50


def test_the_global_precision_stays(rng):
    before = jax.config.jax_enable_x64
    path = mrsr_path(rng.standard_normal((30, 20)), rng.standard_normal(30))
    assert jax.config.jax_enable_x64 == before
    assert path.step.dtype == np.float64
    assert jnp.ones(3).dtype == jnp.float32


def test_input_that_cannot_be_used(rng):
    H, T = rng.standard_normal((10, 4)), rng.standard_normal((10, 2))
    bad = H.copy()
    bad[3, 1] = np.nan
    with pytest.raises(ValueError, match="H contains NaN"):
        mrsr(bad, T)
    with pytest.raises(ValueError, match="T contains infinity"):
        mrsr(H, np.where(T[0, 0] == T, np.inf, T))
    with pytest.raises(ValueError, match="H has 10 rows but T has 9"):
        mrsr(H, T[:9])
    for empty in (H[:, :0], H[:0]):
        with pytest.raises(ValueError, match=r"H must be a finite matrix .* Found array with 0"):
            mrsr(empty, T)
    with pytest.raises(ValueError, match="T must be a finite matrix"):
        mrsr(H, T[None])
    with pytest.raises(ValueError, match="H must be a finite matrix"):
        mrsr("columns", T)
    with pytest.raises(ValueError, match="H must be a finite matrix"):
        mrsr(H + 1j, T)
    with pytest.raises(ValueError, match="norm must be 1 or 2"):
        mrsr(H, T, norm=3)


def test_no_warnings(rng):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mrsr(rng.standard_normal((20, 40)), np.zeros(20))
