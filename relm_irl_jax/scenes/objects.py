"""Objects in views: the state with the best view of each category."""

from relm_irl_jax.scenes.scene import Scene

MINIMUM_SHARE = 0.01
"""Smallest share of a view at which an object counts as visible."""


def best_views(scene: Scene) -> dict[str, int]:
    """Find the state whose view shows the largest share of each category.

    Args:
        scene: a scene; one without labels gives an empty dictionary.

    Returns:
        State by category, in the order of `scene.categories`; the first state if several have equal shares. Categories
        that cover less than `MINIMUM_SHARE` of every view are left out.
    """
    if scene.visible_object is None:
        return {}
    return {
        category: int(share.argmax())
        for category, share in zip(scene.categories, scene.visible_object.T, strict=True)
        if share.max() >= MINIMUM_SHARE
    }
