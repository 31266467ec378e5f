import numpy as np

from relm_irl_jax.irl import MaxMarginSettings
from relm_irl_jax.irl.weight_stability import measure_weight_stability

from .problems import ring, smooth_features


def test_the_strictly_convex_program_changes_no_more_than_the_linear_one():
    scene = ring()
    settings = [MaxMarginSettings(variant=variant, regularisation=1e-2) for variant in ("lp", "lp-l2")]
    linear, convex = measure_weight_stability(
        scene, smooth_features(scene, 20, seed=0), settings, trajectories=6, seed=0
    )
    assert linear.solved == convex.solved == 1.0
    assert linear.share_of_lp == 1.0
    assert convex.margin_median <= linear.margin_median
    assert 0.0 < convex.share_of_lp <= 1.0 + 1e-6
    assert all(np.isfinite([convex.start_median, convex.start_p90, convex.margin_p90]))
