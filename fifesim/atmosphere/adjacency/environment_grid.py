"""
The environment of a scene on a coarse grid of blocks of its cells.

The mean of the ground around a target varies slowly. It is computed for the centres of the blocks, with the point
spread of `adjacency.environment`. Outside of the scene lies what its surroundings are said to be; cells that are NaN
are left out.
"""

from typing import NamedTuple

import numpy as np
from scipy import fft

from fifesim.atmosphere.adjacency import environment as adjacency

_CONVERGED = 1e-12  # of the environment's reflectance
_ITERATIONS = 3000
_DUST = 1e-9  # a block's share of missing cells is at least one cell's, or rounding


class Spread(NamedTuple):
    """What carries a field on blocks to its mean around those of the scene, and one more on either side."""

    spectrum: np.ndarray  # of the point spread, shape of a real transform
    margin: tuple[int, int]  # blocks of the field around the scene, above as below and left as right
    inside: np.ndarray  # share of each block that lies in the scene, shape (y, x) of the scene's blocks [1]

    def __call__(self, field):
        """Mean around each block of the scene and a ring, from a field on the scene's blocks and the margin."""
        size = 2 * (self.spectrum.shape[1] - 1)
        spectrum = fft.rfft2(field, (self.spectrum.shape[0], size))
        spectrum *= self.spectrum
        around = fft.irfft2(spectrum, (self.spectrum.shape[0], size), overwrite_x=True)
        window = (slice(m - 1, m + n + 1) for m, n in zip(self.margin, self.inside.shape, strict=True))
        return around[tuple(window)]


def spread_over(along_y, along_x, cell, margin, vza, weight_molecules, weight_aerosol):
    """
    Point spread over the blocks of a scene.

    Parameters
    ----------
    along_y, along_x : Blocks
    cell : (float, float)
        Size of the scene's cells, down and across. [m]
    margin : (int, int)
        Blocks around the scene on which the field is known, at least 1.
    vza : float
        [degree]
    weight_molecules, weight_aerosol : float
        As `adjacency.environment_weights` gives them. [1]

    Returns
    -------
    spread : Spread
    """
    block = tuple(along.cells * size for along, size in zip((along_y, along_x), cell, strict=True))
    # Half the transform: the farthest blocks that see each other must not do so around the back.
    half = [fft.next_fast_len(along.count + m + 1) for along, m in zip((along_y, along_x), margin, strict=True)]
    quadrant = adjacency.point_spread([size + 1 for size in half], block, vza, weight_molecules, weight_aerosol)
    # The cosine transform is the real transform of the quadrant and its mirror images.
    spectrum = fft.dctn(quadrant, type=1, overwrite_x=True)
    spectrum = np.concatenate([spectrum, spectrum[-2:0:-1]])
    return Spread(spectrum, margin, np.multiply.outer(along_y.inside, along_x.inside))


def environment(sums, surroundings, spread):
    r"""
    Mean reflectance around each block.

    .. math::

        \langle \rho \rangle = \rho_\mathrm{out}
            + \frac{K * \left[ m (\rho - \rho_\mathrm{out}) \right]}{1 - K * (i - m)}

    with K the point spread, i what lies inside of the scene and m what of it is valid.

    Parameters
    ----------
    sums : array, shape (2, 1, 1, y, x)
        Of the scene's reflectance, from `block_sums`.
    surroundings : None, float or array, shape (y, x) with the margins
        :math:`\rho_\mathrm{out}`: the scene's mean, a number, or that of the blocks with their mean beyond them. [1]
    spread : Spread

    Returns
    -------
    environment : array, shape (y + 2, x + 2)
        NaN if there is no valid cell to tell :math:`\rho_\mathrm{out}`. [1]

    References
    ----------
    [Tanre1981]_; [Knutsson1993]_, normalized convolution
    """
    valid = sums[1, 0, 0]
    return _around(sums[0, 0, 0], valid, surroundings, spread, _known_share(valid, spread))


def _known_share(valid, spread):
    """Share of the environment that is not missing, 1 where none is."""
    hole = spread.inside - valid
    hole[hole < _DUST] = 0.0
    return 1 - spread(_padded(spread, hole)) if hole.any() else 1.0


def _padded(spread, field):
    """Field on the scene's blocks with zeros on the margin."""
    return np.pad(field, [(size, size) for size in spread.margin])


def _around(total, valid, surroundings, spread, known):
    number = valid.sum()
    if surroundings is None:
        far = total.sum() / number if number else np.nan
    elif np.ndim(surroundings):
        found = ~np.isnan(surroundings)
        far = surroundings[found].mean() if found.any() else np.nan
    else:
        far = surroundings
    field = _padded(spread, total - valid * far)
    if np.ndim(surroundings):
        field += (1 - _padded(spread, spread.inside)) * np.where(found, surroundings - far, 0.0)
    return far + spread(field) / known


def environment_of_target(moments, surroundings, spread, terms):
    r"""
    Mean reflectance around each block, from apparent reflectance.

    The reflectance of the cells follows from the environment's at the cells, and this from that. Both are linear, and
    the block sums of the one follow from the other at the blocks without loss. This is solved by damped iteration.

    Parameters
    ----------
    moments : array, shape (2, 3, 3, y, x)
        Of the apparent reflectance, from `block_sums` with ``linear``.
    surroundings : None, float or array
        As in `environment`. [1]
    spread : Spread
    terms : coupling.TargetTerms
        Each a float. [1]

    Returns
    -------
    environment : array, shape (y + 2, x + 2)
        That of which `coupling.target_reflectance` makes a scene with this environment, within 1e-12. [1]

    Raises
    ------
    RuntimeError
        If the iteration does not converge, for want of direct light.
    """
    path, down, direct, diffuse, albedo, gas = terms
    total, valid = moments.sum(axis=(1, 2))
    bare = (total / gas - path * valid) / (down * direct)
    slope = moments[0] * (albedo / (down * direct * gas))
    slope += moments[1] * ((diffuse - albedo * path / down) / direct)
    # The operator's eigenvalues lie between 1 and this above it.
    largest = np.divide(slope.sum(axis=(0, 1)), valid, out=np.zeros_like(valid), where=valid > 0).max(initial=0.0)
    known = _known_share(valid, spread)
    around = np.zeros([size + 2 for size in valid.shape])
    for _ in range(_ITERATIONS):
        change = _around(bare - _weighted(slope, around), valid, surroundings, spread, known) - around
        around += change / (1 + largest / 2)
        if not np.max(np.abs(change)) > _CONVERGED:
            return around
    raise RuntimeError(
        f"the environment did not converge in {_ITERATIONS} steps: of the light of a target {direct:g} comes to the "
        "sensor unscattered, which is too little to tell it; use a clearer atmosphere"
    )


def _weighted(slope, around):
    """Sums over cells of what is interpolated from blocks, times the moments in these."""
    rows, columns = slope.shape[2:]
    return sum(slope[k, m] * around[k : k + rows, m : m + columns] for k, m in np.ndindex(slope.shape[:2]))
