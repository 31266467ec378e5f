"""Beliefs in the agent's own frame, laid over the true room, and their pictures."""

from dataclasses import replace

import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.agents.map.geometry import Extent
from relm_irl_jax.agents.map.walks import relative_pose
from relm_irl_jax.errors import InputError
from relm_irl_jax.report.searches import probability_of_target, search_columns, search_figure
from relm_irl_jax.saved_searches import load_searches, save_searches
from relm_irl_jax.scenes.scene import grid_poses
from relm_irl_jax.stages.episodes import EpisodePath
from relm_irl_jax.stages.searches import search_over_room, shown_moments
from relm_irl_jax.types import Belief

RADIUS, SIDE = Extent().radius, Extent().side
SCENE = grid_scene(4, 3)
SCENE = replace(SCENE, observation=np.zeros((SCENE.n_states, 2, 2, 3), np.uint8))
FRAME = (1, -2, 3)
"""Pose in the agent's frame at which the path begins: not its origin, as with a memory that begins filled."""


def certain_search(start, target):
    """A search that knows the target's pose, and that the place of the start is the only free one."""
    pose = grid_poses(SCENE)
    heading, z, x = relative_pose(pose[target], pose[start]).tolist()
    # From the start's own frame to one in which the start has the pose FRAME.
    turned = [(z, x), (-x, z), (-z, -x), (x, -z)][FRAME[0]]
    place = (FRAME[1] + turned[0] + RADIUS, FRAME[2] + turned[1] + RADIUS)
    probability, free = np.zeros((4, SIDE, SIDE), np.float32), np.full((SIDE, SIDE), -5, np.float32)
    probability[(heading + FRAME[0]) % 4, *place] = 1
    free[FRAME[1] + RADIUS, FRAME[2] + RADIUS] = 5
    belief = Belief(np.array(FRAME, np.int32), probability, free, np.ones_like(free))
    path = EpisodePath(np.array([start, target], np.int32), target, 1)
    return search_over_room(SCENE, path, [belief], [0], method="rl", seed=0, category="")


def test_a_certain_belief_lies_on_the_target_whatever_the_start():
    for start in range(SCENE.n_states):
        for target in (0, 13, 47):
            search = certain_search(start, target)
            assert probability_of_target(search, 0) == 1
            column, row = np.rint((SCENE.location[start] - search.origin) / 0.5).astype(int) + RADIUS
            assert search.free[0, row, column] == 5


def test_searches_are_read_back_and_drawn(tmp_path):
    searches = [certain_search(0, 13), certain_search(7, 40)]
    save_searches(tmp_path / "search.safetensors", searches)
    read = load_searches(tmp_path / "search.safetensors")
    for before, after in zip(searches, read, strict=True):
        for name in ("path", "steps", "origin", "probability", "free", "coverage", "views", "target_view", "target"):
            np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    assert search_columns(read)["probability_of_target"] == [1, 1]
    assert len(search_figure(read).axes) == 4


def test_moments_that_do_not_fit_are_refused():
    search = certain_search(0, 13)
    for wrong in ({"free": search.free[:, 1:]}, {"steps": np.array([2], np.int32)}, {"views": search.views[:0]}):
        with pytest.raises(InputError, match="do not fit"):
            replace(search, **wrong)


def test_moments_are_spread_over_the_path():
    path = lambda n: EpisodePath(np.zeros(n, np.int32), 0, 1)  # noqa: E731
    assert shown_moments(path(10)) == [0, 2, 4, 6, 8]
    assert shown_moments(path(2)) == [0]
