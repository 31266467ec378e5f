import numpy as np

from relm_irl_jax.irl import MaxMarginSettings
from relm_irl_jax.irl.stability import stability_study

from .scenes import grid_scene, smooth_features


def test_the_strictly_convex_variant_moves_no_further_than_the_pure_one():
    scene = grid_scene(4, 4)
    features = smooth_features(scene, 24, seed=0)
    ways = [MaxMarginSettings(variant=variant, regularisation=1e-2) for variant in ("lp", "lp-l2")]
    pure, convex = stability_study(scene, features, ways, trajectories=8, seed=0)
    assert pure.solved == convex.solved == 1.0
    assert pure.share == 1.0 or np.isclose(pure.share, 1.0, atol=1e-6)
    assert convex.margin_median <= pure.margin_median
    assert convex.share <= 1.0 + 1e-6
