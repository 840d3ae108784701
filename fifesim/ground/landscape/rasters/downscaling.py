"""A map of leaf area made a ground scene: cells within its pixels, on labelled rasters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, TypeAlias

import dask.array as da
import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.annotations import Chunks, LaiDistribution, WholeNumber
from fifesim.base.kinds import Kind
from fifesim.base.lattice import assemble
from fifesim.base.seeds import check_seed
from fifesim.base.warned import warn
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP, check_arp
from fifesim.ground.landscape.block_kriging import by_pixel
from fifesim.ground.landscape.dispersion import deviation_table, kept_variance, level_deviations
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.landscape.downscaling import LogNormal, Marginal, downscaled, fife_variation
from fifesim.ground.landscape.field import window_field
from fifesim.ground.landscape.map_trends import map_trend
from fifesim.ground.landscape.raster import distribution_name, one_layer
from fifesim.ground.landscape.rasters.pixels import MARGIN, PixelReads, pixel_lattice
from fifesim.ground.landscape.skewed_residuals import Kriging
from fifesim.rasters import cf, places
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.axes import north_up
from fifesim.rasters.dates import by_date
from fifesim.rasters.packed import unpacked

_REFERENCES = (
    "Friedl et al. (1995), doi:10.1016/0034-4257(95)00156-5; Kyriakidis (2004), doi:10.1111/j.1538-4632.2004.tb01135.x"
)


Variation: TypeAlias = Annotated[
    float | Callable[[np.ndarray], np.ndarray],
    Kind("a number, or a function of the means of pixels, such as lambda mean: 0.5 / (1 + mean)"),
]


@by_date
def downscale(
    lai: xr.DataArray,
    grid: GeoBox,
    *,
    arp: float = 0.15,
    distribution: LaiDistribution | None = None,
    cv: Variation | None = None,
    seed: WholeNumber = 0,
    chunks: Chunks | None = None,
) -> xr.DataArray:
    """
    Leaf area index of the cells below the pixels of a map.

    Parameters
    ----------
    lai : xarray.DataArray, dims ([time], y, x)
        Means over pixels; NaN where unknown. [m2 m-2]
    grid : odc.geo.geobox.GeoBox
        Of cells in the map's CRS, of which a whole number fills a pixel: ``lai.odc.geobox.zoom_out(1 / 3)`` has 3 x 3.
    arp : float, optional
        Autoregressive parameter of the cells, in [0, 0.2498]. [1]
    distribution : str, path or frozen scipy distribution, optional
        Of the cells, as `fifesim.lai_distribution` takes it: what the map is a mean of is a scene of this distribution.
    cv : float or callable, optional
        Coefficient of variation of the cells within a pixel, or a function of an array of means of pixels. By default
        that of FIFE's grass: a standard deviation of 0.4 within pixels, and at most 0.6 of the mean. [1]
    seed : int, optional
        In [0, 2**63).
    chunks : mapping or int, optional
        Makes the result lazy, as it is without where the map is.

    Returns
    -------
    lai : xarray.DataArray, dims ([time], y, x)
        NaN in pixels that are NaN and beyond the map, 0 in pixels of 0. A function of the map, the seed and the place:
        a window is a slice of the whole, and chunks change nothing. The attribute ``cv_within_pixels`` has the realised
        coefficient of variation [1]; a lazy result has none. [m2 m-2]

    Warns
    -----
    UserWarning
        If ``cv`` is a number, and the cells within pixels have one that is off by more than 5 % and by more than three
        standard errors; by chunk, when it computes, if lazy.

    Raises
    ------
    ValueError
        If a pixel is no whole number of cells, the map lies elsewhere, both distribution and cv are given, or a number
        is not allowed; when computed, if the map has values that are no leaf area or that the distribution cannot have.
    TypeError
        If the seed is no whole number, or cv neither a number nor a function.

    Notes
    -----
    Exact: the mean of the cells of each pixel, within rounding (1e-12), and that none is negative. Approximate: where
    the map holds the means of a scene of the model, semivariances over one and two cells are the model's within 0.3 %,
    with a cv of 0.4 within 0.7 %, inside of pixels and across their borders alike; wider distributions leave more. The
    model is a field whose logarithm is normal for `cv`, which is then the root of the mean of variance over squared
    mean of its pixels, and quantiles of a normal field for `distribution`; cells may pass the end of a distribution by
    0.1 %. What a map has beside that is a trend, as strong as second differences of its pixels say in the surroundings
    of each tile, which is interpolated. A map that is smoother than the model leaves cells less room: of a uniform map,
    in pixels of 3 x 3 cells of a cv of 0.1, neighbours across a border have 0.88, 0.80 and 0.53 times the model's
    semivariance at arp 0, 0.15 and 0.24, those in a pixel 1.00, 0.97 and 0.72 times.

    The field of cells is that of `fifesim.lai_scene`, whose seed gives the same ups and downs. A tile of cells holds at
    least 8 pixels along an axis and reads 12 around: pixels of 150 x 150 cells take 1.7 GB, and many times the time
    of a cell in a pixel of 3 x 3.

    References
    ----------
    [Friedl1995]_, Fig. 2; [Kyriakidis2004]_; [KyriakidisYoo2005]_

    See Also
    --------
    fifesim.ground.landscape.downscaling.downscaled, fifesim.ground.landscape.block_kriging.kriging_filter,
    fifesim.ground.landscape.skewed_residuals.residual_shift, fifesim.ground.landscape.map_trends.map_trend

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> map_10m = fifesim.lai_scene(fifesim.fife_site(10, window=((0, 30), (0, 30))), seed=7)
    >>> grid = fifesim.fife_site(10 / 3, window=((0, 90), (0, 90)))
    >>> cells = map_10m.fifesim.downscale(grid, cv=0.4, seed=7)
    >>> bool(np.allclose(cells.fifesim.aggregate(10), map_10m, atol=1e-6))
    True
    """
    grid, seed = grids.check_grid(grid), check_seed(seed)
    check_arp(arp)
    if arp > LARGEST_STREAMING_ARP:
        raise ValueError(
            f"arp must be at most {LARGEST_STREAMING_ARP}, got {arp:g}: use larger cells for a longer range"
        )
    pixels = one_layer(unpacked(north_up(lai)))
    cf.check_quantity(pixels, "lai")
    lattice = pixel_lattice(pixels, grid)
    model = _model(float(arp), distribution, cv, lattice.ratio)
    reads = PixelReads(chunking.pointwise(check_map, pixels).transpose("y", "x").data, lattice)

    number = None if callable(cv) else cv

    def kernel(rows, columns, known):
        made = _cells(model, seed, lattice, rows, columns, known)
        _realised_variation(made, lattice, (rows.start, columns.start), number)
        return made

    lazy = chunks is not None or isinstance(reads.array, da.Array)
    sizes = places.chunk_sizes(grid, "auto" if chunks is None else chunks, tile=lattice.tile) if lazy else None
    made = chunking.windows(kernel, [reads], tuple(grid.shape), sizes)
    cells = xr.DataArray(made, dims=("y", "x"), coords=chunking.other_coordinates(pixels))
    said = f"downscale: {lattice.ratio[0]} x {lattice.ratio[1]} cells a pixel, {model.words}, arp {arp:g}, seed {seed}"
    words = {"arp": float(arp), "rng_seed": str(seed), "lai_distribution": model.words, "method": "downscaled"}
    if not lazy:
        words["cv_within_pixels"] = _realised_variation(made, lattice, (0, 0))
    return cf.label(grids.place(cells, grid), "lai", history=said, source=lai, **words, references=_REFERENCES)


def _realised_variation(cells, lattice, first, wanted=None):
    """
    Coefficient of variation of the cells within whole pixels, the root of the mean of variance over squared mean.

    With ``wanted``, a value that is off by more than 5 %, and by more than three standard errors, is warned of.
    """
    down, across = lattice.ratio
    top, left = (-(place + at) % size for place, at, size in zip(lattice.cell, first, lattice.ratio, strict=True))
    rows, columns = (cells.shape[0] - top) // down, (cells.shape[1] - left) // across
    if min(rows, columns) < 1 or down * across < 2:
        return np.nan
    whole = cells[top : top + rows * down, left : left + columns * across].reshape(rows, down, columns, across)
    means = whole.mean(axis=(1, 3))
    with np.errstate(invalid="ignore", divide="ignore"):
        squares = (whole.var(axis=(1, 3)) / means**2)[means > 0]
    if not squares.size:
        return np.nan
    found = float(np.sqrt(squares.mean()))
    # By the delta method: half the standard error of the mean of the squares, over the root of that mean.
    error = squares.std() / np.sqrt(squares.size) / (2 * found) if found else 0.0
    if wanted and abs(found - wanted) > max(0.05 * wanted, 3 * error):
        warn(
            f"cv={wanted:g} was asked for, and the cells within pixels have {found:.3g}: at this arp, neighbours in a "
            "pixel are too much alike for the texture of the map; use a smaller arp, or accept the lower cv"
        )
    return found


@dataclass(frozen=True, eq=False)
class _Model:
    """How cells vary within pixels."""

    arp: float
    transform: LogNormal | Marginal
    variation: object  # a function of the means of pixels, or None where deviations are the same in all
    table: tuple | None  # from `_table`
    same: tuple | None
    words: str

    def deviations(self, pixels):
        """Of the field of cells, in units of levels, and of a process whose means vary as the levels."""
        if self.variation is None:
            return self.same
        found = np.asarray(self.variation(np.where(pixels > 0, pixels, 1.0)), float)
        return _of_variation(_checked_variation(np.broadcast_to(found, pixels.shape), self.table), self.table)


def _model(arp, distribution, cv, ratio):
    if distribution is not None and cv is not None:
        raise ValueError(
            "give distribution= of the cells over the scene or cv= within pixels, not both: each decides the other"
        )
    if distribution is not None:
        transform = Marginal.of(lai_distribution(distribution), kept_variance(arp, ratio))
        same = 1.0, float(level_deviations(transform, [1.0], arp, ratio)[0])
        return _Model(arp, transform, None, None, same, distribution_name(distribution))
    table = _table(arp, ratio)
    variation = fife_variation if cv is None else cv
    if callable(variation):
        _checked_variation(np.asarray(variation(np.ones((1, 1))), float), table)
        words = "log-normal, cv of FIFE's grass" if cv is None else "log-normal, cv by the mean"
        return _Model(arp, LogNormal(), variation, table, None, words)
    _checked_variation(np.asarray(cv, float), table)
    same = tuple(map(float, _of_variation(cv, table)))
    return _Model(arp, LogNormal(), None, None, same, f"log-normal, cv {cv:g}")


@lru_cache(maxsize=4)
def _table(arp, ratio):
    """Coefficients of variation within pixels, and by these the deviations of log-normal cells and of levels."""
    variations, deviations = deviation_table(arp, ratio)
    return variations, deviations, level_deviations(LogNormal(), deviations, arp, ratio)


def _of_variation(values, table):
    return tuple(np.interp(values, table[0], each) for each in table[1:])


def _checked_variation(values, table):
    largest = float(table[0][-1])
    wrong = ~((values >= 0) & (values <= largest))
    if np.any(wrong):
        raise ValueError(
            f"cv must be in [0, {largest:.3g}] for this arp and these pixels, got {values[wrong].flat[0]:g}: it is the "
            "standard deviation of the cells in a pixel over their mean, such as 0.3; bound a function by numpy.minimum"
        )
    return values


def _cells(model, seed, lattice, rows, columns, known):
    """Cells of a window, from the pixels that its tiles read."""
    spans = [lattice.tiles(each, axis) for axis, each in enumerate((rows, columns))]
    down, across = lattice.pixels

    def make_tile(row, column):
        top, left = (row - spans[0].start) * down, (column - spans[1].start) * across
        part = known[top : top + down + 2 * MARGIN, left : left + across + 2 * MARGIN]
        return _tile(model, seed, lattice, row, column, part.astype(float).tobytes())

    shape = rows.stop - rows.start, columns.stop - columns.start
    return assemble(make_tile, lattice.tile, lattice.cell[0] + rows.start, lattice.cell[1] + columns.start, shape)


# Chunks smaller than tiles, or cut elsewhere, ask for a tile more than once. Eight tiles of 504 cells are 16 MB.
@lru_cache(maxsize=8)
def _tile(model, seed, lattice, row, column, pixels):
    """One tile of cells, from the bytes of its pixels and of those around."""
    shape = tuple(size + 2 * MARGIN for size in lattice.pixels)
    pixels = np.frombuffer(pixels).reshape(shape)
    inside = tuple(slice(MARGIN, MARGIN + size) for size in lattice.pixels)
    if not (pixels[inside] > 0).any():
        return by_pixel(np.where(pixels[inside] == 0, 0.0, np.nan), lattice.ratio)
    first = [
        place * lattice.tile - MARGIN * number + shift
        for place, number, shift in zip((row, column), lattice.ratio, lattice.shift, strict=True)
    ]
    size = tuple(count * number for count, number in zip(shape, lattice.ratio, strict=True))
    field = window_field(seed, model.arp, *first, size)
    known, (deviations, of_levels) = pixels > 0, model.deviations(pixels)
    # Of pixels without leaves no level is asked.
    levels = model.transform.level(np.where(known, pixels, pixels[known].max()))
    trend = map_trend(levels, known, of_levels, model.arp, lattice.ratio)
    cells = downscaled(pixels, field, _kriging(model.arp, trend, lattice.ratio, shape), model.transform, deviations)
    cut = tuple(slice(MARGIN * number, -MARGIN * number) for number in lattice.ratio)
    tile = cells[cut].copy()
    tile.flags.writeable = False
    return tile


_kriging = lru_cache(maxsize=8)(Kriging.of)
