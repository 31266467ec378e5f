import jax
import jax.numpy as jnp
import numpy as np
import pytest

from relm_irl_jax.agents.map.geometry import N_CELLS, OFFSETS, Extent
from relm_irl_jax.agents.map.memory import grid_rows, turned
from relm_irl_jax.agents.map.network import CHANNELS, KERNEL, RECORD
from relm_irl_jax.agents.map.posterior import (
    all_scores,
    kernel_spectrum,
    log_posterior,
    memory_spectrum,
    scores,
    search_kernel,
)

ROOM = Extent()
GRID, HALF, RADIUS, SIDE = ROOM.grid, ROOM.half, ROOM.radius, ROOM.side


@pytest.fixture(scope="module")
def room():
    """A map with random features, and what a view at any pose of it shows."""
    generator = np.random.default_rng(0)
    grid = np.zeros((GRID, GRID, KERNEL), np.float32)
    grid[18:40, 18:40] = generator.normal(size=(22, 22, KERNEL))
    return grid


def kernel_at(grid, heading, z, x):
    """The view region that a camera at a pose would see, in its own frame."""
    cells = grid.reshape(-1, KERNEL)[np.asarray(grid_rows(jnp.array([heading, z, x]), ROOM))]
    return np.asarray(turned(jnp.asarray(cells), jnp.int32((4 - heading) % 4)))


def test_record_and_kernel_share_their_layout():
    assert RECORD == KERNEL == CHANNELS + 2


def test_score_is_the_sum_over_cells(room):
    kernel = np.random.default_rng(1).normal(size=(2, N_CELLS, KERNEL)).astype(np.float32)
    spectrum = memory_spectrum(jnp.asarray(room[None]))
    score = jax.jit(all_scores)(spectrum, kernel_spectrum(jnp.asarray(kernel), ROOM))
    for heading, z, x in ((0, 0, 0), (1, 3, -4), (2, -16, 5), (3, 16, -16)):
        cells = OFFSETS[heading] + (HALF + x, HALF + z)
        laid = np.asarray(turned(jnp.asarray(kernel[1]), jnp.int32(heading)))
        direct = (laid * room[cells[:, 1], cells[:, 0]]).sum()
        np.testing.assert_allclose(score[0, 1, heading, z + RADIUS, x + RADIUS], direct, rtol=1e-3, atol=1e-2)


def test_posterior_peaks_at_the_true_pose(room):
    poses = [(0, 0, 0), (1, -3, 2), (2, 4, 4), (3, 5, -6)]
    kernel = jnp.asarray(np.stack([kernel_at(room, *pose) for pose in poses]))
    score = all_scores(memory_spectrum(jnp.asarray(room[None])), kernel_spectrum(kernel, ROOM))[0]
    free, profile = jnp.zeros((len(poses), SIDE, SIDE)), jnp.zeros((SIDE, SIDE))
    posterior = np.exp(log_posterior(score, free, profile, jnp.ones(score.shape, bool)))
    np.testing.assert_allclose(posterior.sum((1, 2, 3)), 1, rtol=1e-4)
    for found, (heading, z, x) in zip(posterior, poses, strict=True):
        assert np.unravel_index(found.argmax(), found.shape) == (heading, z + RADIUS, x + RADIUS)


def test_impossible_poses_have_no_probability(room):
    score = jnp.zeros((4, SIDE, SIDE))
    possible = jnp.zeros(score.shape, bool).at[2, 5, 6].set(True)
    posterior = np.exp(log_posterior(score, jnp.zeros((SIDE, SIDE)), jnp.zeros((SIDE, SIDE)), possible))
    assert posterior[2, 5, 6] == 1
    assert posterior.sum() == 1


def test_one_target_in_one_memory_scores_as_all_pairs_do(room):
    kernel = jnp.asarray(np.random.default_rng(2).normal(size=(2, N_CELLS, KERNEL)), jnp.float32)
    memory = jnp.asarray(np.stack([room, room[::-1]]))
    pairs = jax.jit(all_scores)(memory_spectrum(memory), kernel_spectrum(kernel, ROOM))
    transformed = search_kernel(kernel, ROOM)
    for number in range(2):
        one = jax.jit(scores)(memory[number], transformed[number])
        np.testing.assert_allclose(one, pairs[number, number], rtol=1e-3, atol=1e-2)
