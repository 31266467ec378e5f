"""Where the target's pose may be, given the map.

The target's view gives a kernel k: what its view region should look like. Laid on the map at pose (h, p), it scores

    s(h, p) = Σ_y ⟨R_h k(y), m(p + y)⟩                  cross-correlation at four headings h

with R_h turning the view region by h right angles, which is the same as turning map and pose back. The score stands for
a sum over cells of log-likelihood ratios of "seen from there" against "not seen yet", which is 0 where the map is
empty. With the prior of a pose, the posterior is

    log P(h, p) = s(h, p) + log p_free(p) + π(|p|) + const       over poses not yet stood on, −∞ on the others

where π is a learned profile over the distance from the start. A policy may divide s by a temperature: neighbouring
cells do not err independently, and what a search has left over is what the score was wrong about.

*Correlation by Fourier transforms.* With period N, the rows of the grid, no pose of the square wraps around, and the
spectrum of s is conj(k̂) m̂. Transforms are products with matrices of cosines and sines: at the N = 56 of rooms they are
faster than an FFT on CPUs and accelerators, only the 33 × 33 poses of interest are transformed back, and their gradient
is another product.

Sources: Henriques and Vedaldi (2018), localisation by correlation; Stone, "Theory of optimal search" (1975), for the
posterior over places after unsuccessful search.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int32

from relm_irl_jax.agents.map.geometry import REACH, SPAN, VIEW_CELLS, Extent
from relm_irl_jax.agents.map.network import turn_features

EXCLUDED = -1e9
"""Log probability of a pose that cannot be the target's."""

N_BINS = 24
"""Number of bins of the profiles over the distance from the start, one for each distance in a room's extent. What lies
farther is in the last one, so that the same weights serve every extent."""

_KERNEL = np.arange(-REACH, REACH + 1)


def _waves(places: np.ndarray, frequencies: int, period: int) -> Float32[np.ndarray, "place frequency 2"]:
    """Cosines and sines of each place and frequency."""
    phase = 2 * np.pi / period * np.outer(places, np.arange(frequencies))
    return np.stack([np.cos(phase), np.sin(phase)], -1).astype(np.float32)


def _rotation(waves: Float32[np.ndarray, "place frequency 2"], sign: int) -> Float32[np.ndarray, "2 place 2 frequency"]:
    """The product with exp(sign · i · phase) as a matrix on real and imaginary parts."""
    cos, sin = waves[..., 0], sign * waves[..., 1]
    return np.stack([np.stack([cos, sin], 1), np.stack([-sin, cos], 1)])


Spectrum = Float32[Array, "2 frequency frequency_x ..."]
"""Real and imaginary part of a Fourier transform, for each item and channel. Items and channels come last, so that each
step of a transform is one product of large matrices, and what it moves about lies in one piece."""


def _frequencies(period: int) -> int:
    """Frequencies along x; the others are their conjugates."""
    return period // 2 + 1


def _transform(
    image: Float[Array, "z x *items"], places: np.ndarray, period: int
) -> Float32[Array, "2 frequency frequency_x *items"]:
    """Transform images whose rows and columns lie at the given places."""
    flat = image.reshape(*image.shape[:2], -1)
    along_x = jnp.asarray(_waves(places, _frequencies(period), period) * np.array([1, -1], np.float32))
    rows = jnp.einsum("xfr,zxn->frzn", along_x, flat)
    spectrum = jnp.einsum("rzsg,frzn->sgfn", jnp.asarray(_rotation(_waves(places, period, period), -1)), rows)
    return spectrum.reshape(*spectrum.shape[:3], *image.shape[2:])


def _back(spectrum: Float32[Array, "2 frequency frequency_x *items"]) -> Float32[Array, "z x *items"]:
    """Transform a product of spectra back, at the poses of interest."""
    flat, period = spectrum.reshape(*spectrum.shape[:3], -1), spectrum.shape[1]
    extent = Extent.of_grid(period)
    poses = np.arange(extent.side) - extent.radius
    along_z = _rotation(_waves(poses, period, period), 1).transpose(2, 1, 0, 3)
    rows = jnp.einsum("szrg,rgfn->szfn", jnp.asarray(along_z), flat)
    twice = np.full(_frequencies(period), 2.0)
    twice[[0, -1]] = 1.0
    along_x = _waves(poses, _frequencies(period), period) * np.array([1, -1]) * twice[:, None] / period**2
    image = jnp.einsum("xfs,szfn->xzn", jnp.asarray(along_x.astype(np.float32)), rows)
    return image.swapaxes(0, 1).reshape(extent.side, extent.side, *spectrum.shape[3:])


def memory_spectrum(seen: Float[Array, "*items grid grid kernel"]) -> Spectrum:
    """Transform what the memory says, as it lies before an agent at each of the four headings.

    It turns about the start, against the heading. The spectrum of half a turn is the conjugate, so that only two
    headings are transformed.

    Args:
        seen: features of each cell, as `summarise` gives them.

    Returns:
        m̂, its items [*items, 4].
    """
    grid = seen.shape[-2]
    quarter = jnp.roll(jnp.rot90(seen, 1, (-2, -3)), 1, -2)  # of period N: the start stays where it is
    both = jnp.moveaxis(jnp.stack([seen, quarter], -2), (-4, -3), (0, 1))
    real, imaginary = _transform(both, np.arange(grid) - Extent.of_grid(grid).half, grid)
    spectrum = jnp.stack([jnp.concatenate([real, real], -2), jnp.concatenate([imaginary, -imaginary], -2)])
    return jnp.stack([turn_features(spectrum[..., h, :], -h) for h in range(4)], -2)


def kernel_square(kernel: Float[Array, "targets cells kernel"]) -> Float[Array, "targets span span kernel"]:
    """Lay a target's view region on a square.

    Args:
        kernel: the kernels' projections.

    Returns:
        k, the agent in the middle at heading 0.
    """
    rows, columns = VIEW_CELLS[:, 1] + REACH, VIEW_CELLS[:, 0] + REACH
    return jnp.zeros((len(kernel), SPAN, SPAN, kernel.shape[-1]), kernel.dtype).at[:, rows, columns].set(kernel)


def kernel_spectrum(kernel: Float[Array, "targets cells kernel"], extent: Extent) -> Spectrum:
    """Transform targets' kernels.

    Args:
        kernel: the kernels' projections.
        extent: how far the map reaches.

    Returns:
        k̂, its items [targets].
    """
    return _transform(jnp.moveaxis(kernel_square(kernel), (1, 2), (0, 1)), _KERNEL, extent.grid)


def _conjugates(memory: Spectrum) -> Float32[Array, "2 2 frequency frequency_x ..."]:
    """For the real and the imaginary part of conj(k̂) m̂, what k̂'s two parts are multiplied by."""
    real, imaginary = memory
    return jnp.stack([jnp.stack([real, imaginary]), jnp.stack([imaginary, -real])])


def all_scores(memory: Spectrum, kernel: Spectrum) -> Float32[Array, "memories targets 4 z x"]:
    """Cross-correlate every target with every memory.

    Turning the memory instead of the kernel gives the score at the turned pose; there are fewer memories than targets.

    Args:
        memory: m̂, its items [memories, 4].
        kernel: k̂, its items [targets].

    Returns:
        s at every pose.
    """
    product = jnp.einsum("qrgfmhc,rgftc->qgfmth", _conjugates(memory), kernel)
    turned = jnp.moveaxis(_back(product), (0, 1), (3, 4))
    return jnp.stack([jnp.rot90(turned[:, :, h], -h, (-1, -2)) for h in range(4)], 2)


SearchKernel = Float32[Array, "*targets channel 4 2 frequencies"]
"""Fourier transform of targets' kernels for `scores`: channel, heading, real and imaginary part, frequency."""


def search_kernel(kernel: Float[Array, "targets cells kernel"], extent: Extent) -> SearchKernel:
    """Transform targets' kernels for acting.

    Args:
        kernel: the kernels' projections.
        extent: how far the map reaches.

    Returns:
        k̂, one row a target.
    """
    square = kernel_square(kernel)
    # Turning right by one: what lay at (u, v) comes to (v, −u) in (x, z).
    turned = [turn_features(jnp.rot90(square, -h, (2, 1)), h) for h in range(4)]
    squares = jnp.moveaxis(jnp.stack(turned, 1), -1, 1)
    spectrum = jnp.fft.rfft2(squares, (extent.grid, extent.grid)).reshape(*squares.shape[:3], -1)
    return jnp.stack([spectrum.real, spectrum.imag], -2)


def scores(
    seen: Float32[Array, "grid grid channel"], kernel: Float32[Array, "channel 4 2 frequencies"]
) -> Float32[Array, "4 z x"]:
    """Cross-correlate one target with one memory: what acting needs, where no gradient is asked for.

    The same as `all_scores` by fast Fourier transforms, with the sum over channels written out: for one memory at a
    time this is the fastest on CPUs, for many pairs and their gradients the other.

    Args:
        seen: features of each cell, as `summarise` gives them.
        kernel: k̂ of `search_kernel`.

    Returns:
        s at every pose.
    """
    extent = Extent.of_grid(len(seen))
    memory = jnp.fft.rfft2(jnp.moveaxis(seen, -1, 0)).reshape(seen.shape[-1], -1)
    real, imaginary = jnp.float32(0), jnp.float32(0)
    for a, b, target in zip(memory.real, memory.imag, kernel, strict=True):
        c, d = target[:, 0], target[:, 1]
        real, imaginary = real + a * c + b * d, imaginary + b * c - a * d
    product = jax.lax.complex(real, imaginary).reshape(4, extent.grid, -1)
    score = jnp.fft.irfft2(product, (extent.grid, extent.grid))
    # The kernel's first row lies REACH cells before the agent.
    inner = slice(extent.inner.start - REACH, extent.inner.stop - REACH)
    return score[:, inner, inner]


def distance_bins(extent: Extent) -> Int32[np.ndarray, "z x"]:
    """Distance of each place from the start, in whole cells, at most that of the last bin.

    Args:
        extent: how far the map reaches.

    Returns:
        Bin [z, x].
    """
    poses = np.arange(extent.side) - extent.radius
    return np.minimum(np.rint(np.hypot(poses[:, None], poses[None])), N_BINS - 1).astype(np.int32)


def log_posterior(
    score: Float32[Array, "*batch 4 z x"],
    free: Float32[Array, "*#batch z x"],
    profile: Float32[Array, "z x"],
    possible: Bool[Array, "*#batch 4 z x"],
) -> Float32[Array, "*batch 4 z x"]:
    """The posterior over the target's pose.

    Args:
        score: s.
        free: log odds that each place is free.
        profile: π of each place.
        possible: poses that may be the target's: not stood on, not known to be blocked.

    Returns:
        Its logarithm; `EXCLUDED` or less where it is 0.
    """
    logits = score + (jax.nn.log_sigmoid(free) + profile)[..., None, :, :]
    logits = jnp.where(possible, logits, EXCLUDED)
    flat = logits.reshape(*logits.shape[:-3], -1)
    return jax.nn.log_softmax(flat, -1).reshape(logits.shape)
