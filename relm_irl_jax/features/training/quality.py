"""How well labels are read from features, on scenes that training did not see."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, UInt8
from sklearn.metrics import average_precision_score

from relm_irl_jax.features.convnet import VIEW, ConvNet, fold_batch_norms
from relm_irl_jax.features.encoder import normalise
from relm_irl_jax.features.training.heads import Heads, Readings
from relm_irl_jax.features.training.labels import LabelledScene, draw_groups, shows
from relm_irl_jax.features.training.train import TrainState, Variables

GROUPS = 24
"""Groups of views that are read at once."""

MEMBERS = 8
"""Views of a group; half of them lie near the first."""

BATCHES = 20
"""Batches of groups that are read."""


@dataclass(frozen=True)
class Quality:
    """How well labels are read from features.

    Attributes:
        shown: mean average precision over the categories that some view shows; NaN without labels.
        free: share of numbers of free steps that are right.
        heading: share of relative headings that are right.
        displacement: median distance between read and true place of the second view, in steps.
        near_displacement: the same for pairs of views at most four actions apart.
        action: share of pairs for which the most probable action begins a shortest path; NaN if it was not learned.
        distance: median of |log((1 + read distance) / (1 + distance))|; NaN if it was not learned.
    """

    shown: float
    free: float
    heading: float
    displacement: float
    near_displacement: float
    action: float
    distance: float


@partial(jax.jit, static_argnames="categories")
def _read(
    network: Variables, heads: Variables, views: UInt8[Array, "groups members 64 64 3"], categories: int
) -> Readings:
    images = normalise(views.reshape(-1, VIEW, VIEW, 3).astype(jnp.float32))
    features = ConvNet().bind({"params": network})(images).reshape(*views.shape[:2], -1)
    return Heads(categories).bind({"params": heads})(features)


def measure_quality(
    state: TrainState, scenes: Sequence[LabelledScene], *, paths: bool, batches: int = BATCHES, seed: int = 0
) -> Quality:
    """Read labels of views drawn from scenes.

    Args:
        state: a trained state.
        scenes: the scenes.
        paths: whether shortest paths were learned.
        batches: number of batches to draw.
        seed: seed of the draws.

    Returns:
        The quality.
    """
    network = fold_batch_norms({"params": state.parameters["network"], "batch_stats": state.statistics})
    generator = np.random.default_rng([seed, 3])
    categories = scenes[0].share.shape[1]
    drawn = [draw_groups(scenes, generator, groups=GROUPS, members=MEMBERS) for _ in range(batches)]
    read = [_read(network, state.parameters["heads"], jnp.asarray(groups.views), categories) for groups in drawn]
    groups = jax.tree.map(lambda *parts: np.concatenate(parts), *drawn)
    readings = jax.tree.map(lambda *parts: np.concatenate([np.asarray(part) for part in parts]), *read)

    truth = shows(groups.share[groups.labelled]).reshape(-1, categories)
    score = readings.shown[groups.labelled].reshape(-1, categories)
    precision = [average_precision_score(truth[:, c], score[:, c]) for c in np.flatnonzero(truth.any(0))]
    error = np.linalg.norm(readings.displacement - groups.displacement, axis=-1)
    away = groups.distance > 0
    chosen = np.take_along_axis(groups.best, readings.action.argmax(-1)[..., None], -1)[..., 0]
    ratio = np.abs(readings.log_distance - np.log1p(groups.distance))
    return Quality(
        shown=float(np.mean(precision)) if precision else float("nan"),
        free=float((readings.free.argmax(-1) == groups.free).mean()),
        heading=float((readings.heading.argmax(-1) == groups.heading)[away].mean()),
        displacement=float(np.median(error[away])),
        near_displacement=float(np.median(error[away & (groups.distance <= 4)])),
        action=float(chosen[away].mean()) if paths else float("nan"),
        distance=float(np.median(ratio[away])) if paths else float("nan"),
    )
