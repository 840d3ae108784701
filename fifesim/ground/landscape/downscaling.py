"""
Cells below the pixels of a map of leaf area: they vary as the autoregressive process, and their means are the map's.

The field of cells is conditioned on levels of the pixels by block kriging, and mapped to leaf area. Levels are found so
that means over pixels are those of the map, and residuals are shifted for what these means say of them. What is left of
some pixels shifts these by themselves, and a last factor, 0.999 to 1.001 as a rule, makes means exact.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from fifesim.ground.landscape.block_kriging import block_means, by_pixel, kriged
from fifesim.ground.landscape.quantiles import quantile_map, quantile_table
from fifesim.ground.landscape.skewed_residuals import residual_shift

# Towards the map's means before, between and after the two shifts of residuals. Each step makes what is left of the
# misfit five times smaller or more.
STEPS = (1, 1, 3)

SHIFTS = 8  # of single pixels

_FURTHEST = 8.5  # level of a distribution's ends, in standard deviations

# Of FIFE's three treatments: the standard deviations of their cells, 0.53, 0.34 and 0.57, of which 0.85 stays within
# pixels of 3 x 3 cells at arp 0.15, and the largest of 0.85 times 0.53 / 0.74, 0.34 / 1.41 and 0.57 / 1.18.
FIFE_DEVIATION = 0.4  # [m2 m-2]
FIFE_LARGEST_VARIATION = 0.6


def fife_variation(mean):
    r"""
    Coefficient of variation of cells within pixels of 10 m, as of FIFE's grass.

    .. math:: c = \min(0.4 / \bar l, 0.6)

    Parameters
    ----------
    mean : array
        Of pixels, above 0. [m2 m-2]

    Returns
    -------
    variation : array, shape of mean
        [1]

    Notes
    -----
    The standard deviation does not grow with the mean in the three treatments of ``lai_distributions.csv``.

    Examples
    --------
    >>> fife_variation(np.array([0.1, 2.0])).tolist()
    [0.6, 0.2]
    """
    return np.minimum(FIFE_DEVIATION / mean, FIFE_LARGEST_VARIATION)


@dataclass(frozen=True, eq=False)
class LogNormal:
    """Cells whose logarithm is the field; the level of a pixel is the logarithm of its mean."""

    def cells(self, field):
        """
        Leaf area of a field.

        Parameters
        ----------
        field : array

        Returns
        -------
        lai : array
            [m2 m-2]
        """
        return np.exp(field)

    def slopes(self, field):
        """
        First and second derivatives of leaf area by the field.

        Parameters
        ----------
        field : array

        Returns
        -------
        first, second : array, shape of field
            [m2 m-2]
        """
        lai = np.exp(field)
        return lai, lai

    def level(self, mean):
        """
        Level of the field in pixels of a mean.

        Parameters
        ----------
        mean : array
            Above 0. [m2 m-2]

        Returns
        -------
        level : array
        """
        return np.log(mean)

    def check(self, mean):
        """
        Refuse means that cells cannot have; here all above 0 pass.

        Parameters
        ----------
        mean : array
            [m2 m-2]
        """


@dataclass(frozen=True, eq=False)
class Marginal:
    """
    Cells of a distribution, whose standard normal deviates are the field.

    Parameters
    ----------
    table : array, shape (16385,)
        From `ground.landscape.quantiles.quantile_table`.
    levels, means : array, shape (n,)
        Mean of pixels by the level of their field.
    steep, bent : array, shape (n,)
        First and second derivatives of leaf area, by the level of a field that is known but for three quarters of the
        variance within pixels.
    """

    table: np.ndarray
    levels: np.ndarray
    means: np.ndarray
    steep: np.ndarray
    bent: np.ndarray

    @classmethod
    def of(cls, distribution, kept):
        """
        Of a distribution.

        Parameters
        ----------
        distribution : frozen scipy distribution
        kept : float
            Share of the variance of cells that means over pixels keep. [1]

        Returns
        -------
        marginal : Marginal
        """
        table = quantile_table(distribution)
        levels = np.linspace(-_FURTHEST, _FURTHEST, 1025)
        nodes, weights = np.polynomial.hermite_e.hermegauss(48)
        weights = weights / np.sqrt(2.0 * np.pi)
        around = quantile_map(levels[:, None] + np.sqrt(1.0 - kept) * nodes, table)
        # Halved residuals lack three quarters of their variance. Integrals by parts need no derivative of quantiles.
        lacking = np.sqrt(0.75 * (1.0 - kept))
        near = quantile_map(levels[:, None] + lacking * nodes, table)
        steep, bent = near @ (weights * nodes) / lacking, near @ (weights * (nodes**2 - 1.0)) / lacking**2
        return cls(table, levels, np.maximum.accumulate(around @ weights), steep, bent)

    def cells(self, field):
        """
        Leaf area of a field.

        Parameters
        ----------
        field : array, shape (y, x)

        Returns
        -------
        lai : array, shape (y, x)
            [m2 m-2]
        """
        return quantile_map(field, self.table)

    def slopes(self, field):
        """
        First and second derivatives of leaf area by the field, where half of the residuals is known.

        Parameters
        ----------
        field : array, shape (y, x)

        Returns
        -------
        first, second : array, shape (y, x)
            [m2 m-2]
        """
        return quantile_map(field, self.steep), quantile_map(field, self.bent)

    def level(self, mean):
        """
        Level of the field in pixels of a mean.

        Parameters
        ----------
        mean : array
            [m2 m-2]

        Returns
        -------
        level : array
            In standard deviations.
        """
        return np.interp(mean, self.means, self.levels)

    def check(self, mean):
        """
        Refuse means that cells cannot have.

        Parameters
        ----------
        mean : array
            [m2 m-2]

        Raises
        ------
        ValueError
            If a mean is not between the ends of the distribution.
        """
        lowest, highest = self.table[0], self.table[-1]
        wrong = mean[(mean <= lowest) | (mean >= highest)]
        if wrong.size:
            raise ValueError(
                f"the map has a pixel of mean LAI {wrong[0]:.4g}, which cells of a distribution from {lowest:.4g} to "
                f"{highest:.4g} cannot have: give a distribution= that reaches beyond all of the map, or cv= instead"
            )


def downscaled(pixels, field, kriging, transform, deviation):
    """
    Leaf area of the cells in a window of pixels.

    Parameters
    ----------
    pixels : array, shape (rows, columns)
        Means; NaN where unknown. [m2 m-2]
    field : array, shape (rows * down, columns * across)
        Standard normal field of the autoregressive process.
    kriging : fifesim.ground.landscape.skewed_residuals.Kriging
        For this shape of pixels.
    transform : LogNormal or Marginal
    deviation : float or array, shape of pixels
        Standard deviation of the field of the cells, in units of levels.

    Returns
    -------
    lai : array, shape of the field
        NaN in pixels that are NaN, 0 in pixels of 0; means of the others are those of the map within rounding. [m2 m-2]

    Raises
    ------
    ValueError
        If cells of the distribution cannot have a pixel's mean.

    Notes
    -----
    The filter wraps around, so that some pixels at the rim are to be dropped. Pixels that are NaN or 0 count as the
    nearest of the others in the estimate of these.
    """
    ratio = tuple(cells // size for cells, size in zip(field.shape, pixels.shape, strict=True))
    vegetated = pixels > 0
    if not vegetated.any():
        return by_pixel(np.where(pixels == 0, 0.0, np.nan), ratio)
    transform.check(pixels[vegetated])
    filled = _nearest(vegetated)
    means = pixels[filled]
    wanted = transform.level(means)
    if np.ndim(deviation):
        deviation = _between(deviation[filled], ratio).astype(np.float32)
    own = field * deviation

    def solved(known, own, steps):
        """Means of the field for those of leaf area."""
        means_of_own = block_means(own, ratio)
        for _ in range(steps):
            got = block_means(transform.cells(kriged(known - means_of_own, kriging.response, ratio) + own), ratio)
            known = known + (wanted - transform.level(got))[filled]
        return known

    known, shift = solved(wanted, own, STEPS[0]), np.float32(0.0)
    for steps in STEPS[1:]:
        shift = residual_shift(own, known, shift, kriging, transform, deviation)
        known = solved(known, own + shift, steps)
    own = own + shift
    cells = kriged(known - block_means(own, ratio), kriging.response, ratio) + own
    lai = _met(cells, wanted, means, vegetated, transform)
    lai *= by_pixel(np.where(vegetated, means / block_means(lai, ratio), np.where(pixels == 0, 0.0, np.nan)), ratio)
    return lai


def _met(field, wanted, means, vegetated, transform):
    """Leaf area of a field; pixels whose mean is off by more than a thousandth are shifted, each by itself."""
    lai = transform.cells(field).astype(float)
    (rows, columns), ratio = means.shape, tuple(np.floor_divide(field.shape, means.shape))
    off = np.nonzero(vegetated & (np.abs(block_means(lai, ratio) - means) > 1e-3 * means))
    if off[0].size:
        apart = rows, ratio[0], columns, ratio[1]
        part = field.reshape(apart)[off[0], :, off[1]].reshape(off[0].size, -1)
        for _ in range(SHIFTS):
            part += (wanted[off] - transform.level(transform.cells(part).mean(axis=1)))[:, None].astype(np.float32)
        lai.reshape(apart)[off[0], :, off[1]] = transform.cells(part).reshape(-1, *ratio)
    return lai


def _nearest(known):
    """Indices that give each pixel the value of the nearest known one."""
    if known.all():
        return np.s_[:, :]
    return tuple(ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True))


def _between(values, ratio):
    """Values of pixels at their centres, linear between these."""
    for axis, number in enumerate(ratio):
        size = values.shape[axis]
        place = np.clip((np.arange(size * number) + 0.5) / number - 0.5, 0, size - 1)
        lower = np.minimum(place.astype(int), max(size - 2, 0))
        share = np.expand_dims(place - lower, 1 - axis)
        upper = np.minimum(lower + 1, size - 1)
        values = np.take(values, lower, axis) * (1.0 - share) + np.take(values, upper, axis) * share
    return values
