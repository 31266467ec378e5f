"""Objects in views: which state sees each category best."""

from relm_irl_jax.scenes.scene import Scene

LEAST_SHARE = 0.01
"""Least share of the frame that an object covers to count as seen."""


def best_views(scene: Scene, least_share: float = LEAST_SHARE) -> dict[str, int]:
    """The state that sees most of each category.

    Args:
        scene: a scene with labels; one without gives no views.
        least_share: share of the frame that the category must cover there.

    Returns:
        The state by category, in the order of `scene.categories`; of states with equal shares the first. Categories
        that nowhere cover the least share are left out.
    """
    if scene.visible_object is None:
        return {}
    return {
        category: int(share.argmax())
        for category, share in zip(scene.categories, scene.visible_object.T, strict=True)
        if share.max() >= least_share
    }
