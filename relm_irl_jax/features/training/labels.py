"""What is known of the views of a scene, and groups of views for one update.

Of a single view: which objects it shows, with their shares, and how many steps are free ahead, to the right and to the
left. Of a pair of views: the pose of the second in the frame of the first, as odometry tells it; and, only for encoders
that learn shortest paths, the best first actions from the first to the second and the number of actions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, Int32, UInt8

from relm_irl_jax.errors import InputError
from relm_irl_jax.features.convnet import VIEW
from relm_irl_jax.features.encoder import crop_and_scale
from relm_irl_jax.scenes.objects import MINIMUM_SHARE
from relm_irl_jax.scenes.scene import COLLISION, GRID_STEP, UNREACHABLE, Scene, grid_poses, successors

MAX_FREE = 8
"""Free steps are counted up to this number."""

NEAR = 8
"""Half of a group lies within this number of actions from its first view."""

SCALING_BATCH = 64
"""Views that are scaled at once."""


@dataclass(frozen=True)
class LabelledScene:
    """A scene as training needs it.

    Attributes:
        views: view of each state.
        share: share of the view that each category covers; 0 without labels.
        labelled: whether the scene has labels of objects.
        free: free steps ahead, to the right and to the left, up to `MAX_FREE`.
        pose: heading, z and x of each state, in right angles and steps.
        successor: next state for each action; a collision leads back.
        distance: least number of actions between states, or `UNREACHABLE`.
    """

    views: UInt8[np.ndarray, "states 64 64 3"]
    share: Float32[np.ndarray, "states categories"]
    labelled: bool
    free: Int32[np.ndarray, "states 3"]
    pose: Int32[np.ndarray, "states 3"]
    successor: Int32[np.ndarray, "states 4"]
    distance: Int32[np.ndarray, "states states"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ViewGroups:
    """Groups of views of one scene each, and what is known of them and of their pairs; or one group.

    Attributes:
        views: the views.
        share: share of the view that each category covers.
        labelled: whether the group's scene has labels of objects.
        free: free steps ahead, to the right and to the left.
        heading: heading of the second view relative to the first, in right angles.
        displacement: place of the second view in the frame of the first, in steps: ahead, to the right.
        best: the actions with which shortest paths from the first to the second begin; none where there is no path.
        distance: least number of actions from the first to the second; 0 where there is no path.
    """

    views: UInt8[np.ndarray | Array, "*groups members height width 3"]
    share: Float32[np.ndarray | Array, "*groups members categories"]
    labelled: Bool[np.ndarray | Array, "*groups"]
    free: Int32[np.ndarray | Array, "*groups members 3"]
    heading: Int32[np.ndarray | Array, "*groups members members"]
    displacement: Float32[np.ndarray | Array, "*groups members members 2"]
    best: Bool[np.ndarray | Array, "*groups members members 4"]
    distance: Int32[np.ndarray | Array, "*groups members members"]


def label_scene(scene: Scene, categories: Sequence[str]) -> LabelledScene:
    """Take from a scene what training needs.

    Args:
        scene: a scene with views.
        categories: the categories of all training scenes.

    Returns:
        The scene with its views scaled to `VIEW` pixels.

    Raises:
        InputError: the scene has no views, or its states lie on no grid.
    """
    cells = (scene.location - scene.location.min(0)) / GRID_STEP
    if np.abs(cells - np.rint(cells)).max() > 0.1:
        raise InputError(f"{scene.name}: states lie on no grid of {GRID_STEP} m; encoders are trained on grids.")
    share = np.zeros((scene.n_states, len(categories)), np.float32)
    if scene.visible_object is not None:
        for column, category in enumerate(scene.categories):
            if category in categories:
                share[:, categories.index(category)] = scene.visible_object[:, column]
    return LabelledScene(
        views=small_views(scene.views),
        share=share,
        labelled=scene.visible_object is not None,
        free=free_steps(scene),
        pose=grid_poses(scene),
        successor=successors(scene.graph),
        distance=scene.shortest_path_distance,
    )


def small_views(views: UInt8[np.ndarray, "states height width 3"]) -> UInt8[np.ndarray, "states 64 64 3"]:
    """Scale views to the network's size, if they have another one.

    Args:
        views: views of one size.

    Returns:
        The views at `VIEW` × `VIEW` pixels.
    """
    if views.shape[1:3] == (VIEW, VIEW):
        return views
    scaled = [
        np.asarray(jnp.rint(crop_and_scale(jnp.asarray(views[start : start + SCALING_BATCH]), VIEW)).astype(jnp.uint8))
        for start in range(0, len(views), SCALING_BATCH)
    ]
    return np.concatenate(scaled)


def free_steps(scene: Scene) -> Int32[np.ndarray, "states 3"]:
    """Count the free steps ahead, to the right and to the left of each state.

    Args:
        scene: a scene.

    Returns:
        The numbers of steps, at most `MAX_FREE`.
    """
    counts = np.zeros((scene.n_states, 3), np.int32)
    states = np.arange(scene.n_states)
    turned = (states, scene.graph[:, 1], scene.graph[:, 2])
    for column, state in enumerate(turned):
        moving = state != COLLISION
        for _ in range(MAX_FREE):
            state = np.where(moving, scene.graph[state, 0], COLLISION)
            moving = state != COLLISION
            counts[:, column] += moving
    return counts


def draw_groups(
    scenes: Sequence[LabelledScene], generator: np.random.Generator, *, groups: int, members: int
) -> ViewGroups:
    """Draw the views of one update.

    Args:
        scenes: the scenes; each group's is drawn uniformly, without repetition as long as there are enough.
        generator: source of randomness.
        groups: number of groups.
        members: views of a group: the first at random, half of them within `NEAR` actions from it, the others at
            random.

    Returns:
        The groups.
    """
    order = np.concatenate([generator.permutation(len(scenes)) for _ in range(-(-groups // len(scenes)))])
    drawn = [_draw_group(scenes[number], generator, members) for number in order[:groups]]
    return jax.tree.map(lambda *parts: np.stack(parts), *drawn)


def _draw_group(scene: LabelledScene, generator: np.random.Generator, members: int) -> ViewGroups:
    first = int(generator.integers(len(scene.views)))
    away = scene.distance[first]
    near = generator.choice(np.flatnonzero((away >= 0) & (away <= NEAR)), members // 2 - 1)
    far = generator.integers(len(scene.views), size=members - 1 - len(near))
    return group_of(scene, np.concatenate([[first], near, far]))


def group_of(scene: LabelledScene, states: np.ndarray) -> ViewGroups:
    """What is known of some states of a scene.

    Args:
        scene: the scene.
        states: the states.

    Returns:
        One group, without the leading axis of `ViewGroups`.
    """
    pose = scene.pose[states]
    heading, delta = pose[:, 0], pose[None, :, 1:] - pose[:, None, 1:]
    cosine, sine = np.array([1, 0, -1, 0])[heading][:, None], np.array([0, 1, 0, -1])[heading][:, None]
    ahead = cosine * delta[..., 0] + sine * delta[..., 1]
    right = cosine * delta[..., 1] - sine * delta[..., 0]
    distance = scene.distance[states[:, None], states[None]]
    following = scene.distance[scene.successor[states][:, None, :], states[None, :, None]]
    return ViewGroups(
        views=scene.views[states],
        share=scene.share[states],
        labelled=np.asarray(scene.labelled),
        free=scene.free[states],
        heading=(heading[None] - heading[:, None]) % 4,
        displacement=np.stack([ahead, right], -1).astype(np.float32),
        best=(following == distance[..., None] - 1) & (distance[..., None] > 0),
        distance=np.where(distance == UNREACHABLE, 0, distance),
    )


def shows(share: Float32[np.ndarray, "*views categories"]) -> Bool[np.ndarray, "*views categories"]:
    """Whether views show objects of each category: at least `MINIMUM_SHARE` of the view."""
    return share >= MINIMUM_SHARE
