"""Downscaling of labelled maps of leaf area to the cells of a ground scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import lcm
from typing import Annotated, NamedTuple, TypeAlias

import dask.array as da
import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import Chunks, Kind, LaiDistribution, WholeNumber
from fifesim.base.caches import cached
from fifesim.base.lattice import assemble, check_seed
from fifesim.base.messages import warn
from fifesim.grids import cf, projection, windows
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date
from fifesim.grids.grid import north_up
from fifesim.grids.source import one_layer
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.landscape import downscaling
from fifesim.ground.landscape.autoregression import check_streaming_arp, window_field
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.landscape.lai_labels import distribution_name

# Cells along a fixed tile, and pixels at least.
_TILE, _FEWEST_PIXELS = 504, 8

PIXEL_MARGIN = 12  # pixels read around a tile: the weight of one beyond them is below 3e-5

# Tolerance for the alignment of pixels with cells. [cell]
_OFF = 1e-2

_CURE = "make the grid from the map: lai.odc.geobox.zoom_out(1 / 3) has 3 x 3 cells a pixel"


class PixelLattice(NamedTuple):
    """Position of map pixels on a grid of cells, counted from the origin of the CRS, southward and eastward."""

    ratio: tuple[int, int]  # cells in a pixel
    pixel: tuple[int, int]  # place of the map's first pixel
    cell: tuple[int, int]  # place of the grid's first cell, counted from the corner of the pixel at 0
    shift: tuple[int, int]  # position of that corner in cells

    @property
    def tile(self):
        """Edge of a tile. [cell]"""
        step = lcm(*self.ratio)
        return max(_TILE // step, -(-_FEWEST_PIXELS * max(self.ratio) // step)) * step

    @property
    def pixels(self):
        """Pixels in a tile, down and across."""
        return tuple(self.tile // number for number in self.ratio)

    def tiles(self, cells, axis):
        """Tiles that a range of rows or columns of the grid touches."""
        start, stop = (self.cell[axis] + end for end in (cells.start, cells.stop))
        return range(start // self.tile, -(-stop // self.tile))

    def window(self, tiles, axis):
        """Pixels of the map that some tiles read; the slice may exceed the map."""
        size, first = self.pixels[axis], self.pixel[axis]
        return slice(tiles.start * size - PIXEL_MARGIN - first, tiles.stop * size + PIXEL_MARGIN - first)


class PixelReads(NamedTuple):
    """Pixels that each chunk of cells reads from a map: the pixels of its tiles and around them."""

    array: np.ndarray | da.Array  # shape (y, x)
    lattice: PixelLattice

    def window(self, rows, columns):
        """Slices of the pixels that some cells of the grid read."""
        lattice = self.lattice
        return tuple(lattice.window(lattice.tiles(each, axis), axis) for axis, each in enumerate((rows, columns)))


class FieldReads(NamedTuple):
    """Cells of a field on the grid of `field_grid` that each chunk of cells reads."""

    array: np.ndarray | da.Array  # shape (y, x)
    lattice: PixelLattice
    first: tuple[int, int]  # row and column of its first tile

    def window(self, rows, columns):
        """Slices of the field that some cells of the grid read."""
        tile, found = self.lattice.tile, []
        for axis, cells in enumerate((rows, columns)):
            tiles = self.lattice.tiles(cells, axis)
            start, stop = ((each - self.first[axis]) * tile for each in (tiles.start, tiles.stop))
            found.append(slice(start, stop + 2 * PIXEL_MARGIN * self.lattice.ratio[axis]))
        return tuple(found)


def field_grid(lattice, grid):
    """Grid of all tiles that a grid touches and the pixels around them, and the row and column of its first tile."""
    spans = [lattice.tiles(slice(0, size), axis) for axis, size in enumerate(grid.shape)]
    margins = [PIXEL_MARGIN * number for number in lattice.ratio]
    top, left = (
        span.start * lattice.tile - margin - cell
        for span, margin, cell in zip(spans, margins, lattice.cell, strict=True)
    )
    shape = tuple(len(span) * lattice.tile + 2 * margin for span, margin in zip(spans, margins, strict=True))
    return GeoBox(shape, grid.affine * Affine.translation(left, top), grid.crs), tuple(span.start for span in spans)


def pixel_lattice(pixels, grid):
    """Alignment of the pixels of a map with the cells of a grid."""
    source = grids.geobox(pixels)
    if source.crs != grid.crs:
        raise ValueError(
            f"the map is in {projection.name_of(source.crs.proj)} and the grid in {projection.name_of(grid.crs.proj)}: "
            f"{_CURE}; or bring the map to pixels in the grid's CRS first, with .rio.reproject"
        )
    ratio = _cells_in_a_pixel(source, grid)
    first = _corner(source, grid)
    ends = tuple(start + size * number for start, size, number in zip(first, source.shape, ratio, strict=True))
    if not all(start < cells and end > 0 for start, end, cells in zip(first, ends, grid.shape, strict=True)):
        raise ValueError(
            f"the map does not overlap the grid, which spans {grids.extent(grid)}: it spans {grids.extent(source)}; "
            f"{_CURE}"
        )
    pixel = grids.lattice_position(source)
    cell = tuple(place * number - start for place, number, start in zip(pixel, ratio, first, strict=True))
    shift = tuple(place - start for place, start in zip(grids.lattice_position(grid), cell, strict=True))
    return PixelLattice(ratio, pixel, cell, shift)


def _cells_in_a_pixel(source, grid):
    a, b = source.affine, grid.affine
    ratio = a.e / b.e, a.a / b.a
    whole = tuple(max(round(each), 1) for each in ratio)
    drift = [abs(each - near) * size for each, near, size in zip(ratio, whole, source.shape, strict=True)]
    if max(drift) > _OFF or whole == (1, 1):
        raise ValueError(
            f"the map has pixels of {-a.e:g} x {a.a:g} m and the grid cells of {-b.e:g} x {b.a:g} m: a pixel must be "
            f"a whole number of cells, 2 or more; {_CURE}"
        )
    return whole


def _corner(source, grid):
    """Row and column of the grid at which the map begins."""
    a, b = source.affine, grid.affine
    corner = (a.f - b.f) / b.e, (a.c - b.c) / b.a
    off = [abs(each - round(each)) for each in corner]
    if max(off) > _OFF:
        raise ValueError(
            f"the corners of the map's pixels are {off[0]:.2f} rows and {off[1]:.2f} columns of cells away from "
            f"those of the grid's cells: {_CURE}"
        )
    return tuple(map(round, corner))


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
    Downscale a map of leaf area index to cells that vary within its pixels.

    Parameters
    ----------
    lai : xarray.DataArray, dims ([time], y, x)
        Pixel means; NaN for no data. [m2 m-2]
    grid : odc.geo.geobox.GeoBox
        Grid of the cells, in the CRS of the map, with a whole number of cells per pixel: ``lai.odc.geobox.zoom_out(1 /
        3)`` has 3 x 3.
    arp : float, optional
        Autoregressive parameter of the cells, in [0, 0.2498]. [1]
    distribution : str, path or frozen scipy distribution, optional
        Distribution of LAI over all cells, as in `fifesim.ground.lai_distribution`.
    cv : float or callable, optional
        Coefficient of variation of the cells within a pixel, or a function of an array of pixel means. The default
        follows FIFE's grass: a standard deviation of 0.4 within pixels, limited to 0.6 times the mean. [1]
    seed : int, optional
        Seed of the random field, in [0, 2**63).
    chunks : mapping or int, optional
        Chunks of a lazy result. The result is also lazy if the map is.

    Returns
    -------
    lai : xarray.DataArray, dims ([time], y, x)
        NaN in NaN pixels and outside the map, 0 in pixels of 0. A window equals a slice of the whole. The attribute
        ``cv_within_pixels`` is the realised coefficient of variation [1], for results in memory. [m2 m-2]

    Warns
    -----
    UserWarning
        If ``cv`` is given, and the realised value differs by more than 5 % and more than three standard errors. A lazy
        result is checked by chunk when it is computed.

    Raises
    ------
    ValueError
        If a pixel is not a whole number of cells, the map does not overlap the grid, both distribution and cv are
        given, or a number is out of range; when computed, if values of the map are not valid LAI or outside the
        distribution.
    TypeError
        If the seed is not an integer, or cv is neither a number nor a function.

    Notes
    -----
    The mean of the cells of each pixel is exact to rounding (1e-12), and no cell is negative. For a map of means of the
    model, semivariances over one and two cells agree with the model within 0.3 % (0.7 % for a cv of 0.4), and errors
    increase for wider distributions. The model is a log-normal field for `cv`, and a transformed normal field for
    `distribution`; cells may exceed the ends of a distribution by 0.1 %. If the map is smoother than the model, cells
    vary less.

    The field of cells is the field of `fifesim.lai_scene` for the same seed. Pixels of 150 x 150 cells take 1.7 GB.

    References
    ----------
    [Friedl1995]_, Fig. 2; [Kyriakidis2004]_; [KyriakidisYoo2005]_

    See Also
    --------
    fifesim.learn_landscape, fifesim.ground.Landscape.condition

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
    check_streaming_arp(arp)
    pixels, reads = pixel_reads(lai, grid)
    lattice = reads.lattice
    model = _model(float(arp), distribution, cv, lattice.ratio)

    def kernel(rows, columns, known):
        made = cells_within(model, seed, lattice, rows, columns, known)
        _realised_variation(made, lattice, (rows.start, columns.start), cv)
        return made

    lazy = chunks is not None or isinstance(reads.array, da.Array)
    sizes = windows.chunk_sizes(grid, "auto" if chunks is None else chunks, tile=lattice.tile) if lazy else None
    made = chunking.windows(kernel, [reads], tuple(grid.shape), sizes)
    cells = xr.DataArray(made, dims=("y", "x"), coords=chunking.other_coordinates(pixels))
    cells_in_a_pixel = f"{lattice.ratio[0]} x {lattice.ratio[1]} cells a pixel"
    history = f"downscale: {cells_in_a_pixel}, {model.words}, arp {arp:g}, seed {seed}"
    words = {"arp": float(arp), "rng_seed": str(seed), "lai_distribution": model.words, "method": "downscaled"}
    if not lazy:
        words["cv_within_pixels"] = _realised_variation(made, lattice, (0, 0))
    return cf.label(grids.place(cells, grid), "lai", history=history, source=lai, **words, references=_REFERENCES)


def pixel_reads(lai, grid):
    """Layer of a map of leaf area, and its pixels as cells of a grid read them."""
    pixels = one_layer(north_up(lai), "lai")
    cf.check_quantity(pixels, "lai")
    lattice = pixel_lattice(pixels, grid)
    return pixels, PixelReads(chunking.pointwise(check_map, pixels).transpose("y", "x").data, lattice)


def _realised_variation(cells, lattice, first, wanted=None):
    """Coefficient of variation of cells within whole pixels; a significant deviation from ``wanted`` is a warning."""
    # The root of the mean of variance over squared mean. Significant: more than 5 % and more than three standard
    # errors.
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
    if wanted is not None:
        asked = np.broadcast_to(wanted(means[means > 0]) if callable(wanted) else wanted, squares.shape)
        _warn_of_variation(float(np.sqrt(np.mean(asked**2))), found, error)
    return found


def _warn_of_variation(wanted, found, error):
    """Warn if the realised variation deviates from the wanted one by more than 5 % and three standard errors."""
    if abs(found - wanted) <= max(0.05 * wanted, 3 * error):
        return
    if found < wanted:
        cure = (
            f"the map is smoother than cells of this arp, use a smaller arp or a cv {wanted / found:.2f} times larger"
        )
    else:
        cure = "pixels of the map differ more than such cells allow, use a larger cv"
    warn(f"cv={wanted:.4g} was requested, but the realised value is {found:.3g}: {cure}")


@dataclass(frozen=True, eq=False)
class CellModel:
    """Model of the variation of cells within pixels."""

    arp: float | downscaling.SplineFields
    transform: downscaling.LogNormal | downscaling.Marginal
    variation: object  # a function of the means of pixels, or None where deviations are the same in all
    table: tuple | None  # from `_table`
    same: tuple | None
    words: str

    def deviations(self, pixels):
        """Deviations of the field of cells, in units of levels, and of a process whose means vary as the levels."""
        if self.variation is None:
            return self.same
        found = np.asarray(self.variation(np.where(pixels > 0, pixels, 1.0)), float)
        return _of_variation(np.broadcast_to(found, pixels.shape), self.table)


def _model(arp, distribution, cv, ratio):
    if distribution is not None and cv is not None:
        raise ValueError(
            "give distribution= of the cells over the scene or cv= within pixels, not both: each determines the other"
        )
    if distribution is not None:
        transform = downscaling.Marginal.of(lai_distribution(distribution), downscaling.kept_variance(arp, ratio))
        same = 1.0, float(downscaling.level_deviations(transform, [1.0], arp, ratio)[0])
        return CellModel(arp, transform, None, None, same, distribution_name(distribution))
    table = _table(arp, ratio)
    variation = downscaling.fife_variation if cv is None else cv
    if callable(variation):
        _of_variation(np.asarray(variation(np.ones((1, 1))), float), table)
        words = "log-normal, cv of FIFE's grass" if cv is None else "log-normal, cv by the mean"
        return CellModel(arp, downscaling.LogNormal(), variation, table, None, words)
    same = tuple(map(float, _of_variation(np.asarray(cv, float), table)))
    return CellModel(arp, downscaling.LogNormal(), None, None, same, f"log-normal, cv {cv:g}")


@cached(4, "deviations of downscaled cells")
def _table(arp, ratio):
    """Coefficients of variation within pixels, and the deviations of log-normal cells and of levels for them."""
    variations, deviations = downscaling.deviation_table(arp, ratio)
    return variations, deviations, downscaling.level_deviations(downscaling.LogNormal(), deviations, arp, ratio)


def _of_variation(values, table):
    """Deviations of cells and of levels for coefficients of variation within pixels, which must be in the table."""
    largest = float(table[0][-1])
    wrong = ~((values >= 0) & (values <= largest))
    if np.any(wrong):
        raise ValueError(
            f"cv must be in [0, {largest:.3g}] for this arp and these pixels, got {values[wrong].flat[0]:g}: it is the "
            "standard deviation of the cells in a pixel over their mean, such as 0.3; bound a function by numpy.minimum"
        )
    return tuple(np.interp(values, table[0], deviations) for deviations in table[1:])


def cells_within(model, seed, lattice, rows, columns, known, field=None):
    """Cells of a window, from the pixels and the field that its tiles read; by default the autoregressive field."""
    spans = [lattice.tiles(each, axis) for axis, each in enumerate((rows, columns))]
    down, across = lattice.pixels

    def make_tile(row, column):
        top, left = (row - spans[0].start) * down, (column - spans[1].start) * across
        part = known[top : top + down + 2 * PIXEL_MARGIN, left : left + across + 2 * PIXEL_MARGIN]
        own = None
        if field is not None:
            starts = [(at - span.start) * lattice.tile for at, span in zip((row, column), spans, strict=True)]
            cut = tuple(slice(at, at + size * n) for at, size, n in zip(starts, part.shape, lattice.ratio, strict=True))
            own = field[cut].tobytes()
        return _tile(model, seed, lattice, row, column, part.astype(float).tobytes(), own)

    shape = rows.stop - rows.start, columns.stop - columns.start
    return assemble(make_tile, lattice.tile, lattice.cell[0] + rows.start, lattice.cell[1] + columns.start, shape)


# Chunks that do not match the tiles need some tiles more than once. Eight tiles of 504 cells take 16 MB, and as keys,
# fields of learned landscapes 21 MB and more.
@cached(8, "tiles of downscaled cells")
def _tile(model, seed, lattice, row, column, pixels, field):
    """One tile of cells, from the bytes of its pixels, the surrounding pixels and the field of all of them."""
    shape = tuple(size + 2 * PIXEL_MARGIN for size in lattice.pixels)
    size = tuple(count * number for count, number in zip(shape, lattice.ratio, strict=True))
    pixels, outside = np.frombuffer(pixels).reshape(shape), np.False_
    inside = tuple(slice(PIXEL_MARGIN, PIXEL_MARGIN + size) for size in lattice.pixels)
    if field is not None:
        field = np.frombuffer(field).reshape(size)
        outside = np.isnan(field)
        pixels, field = downscaling.filled_field(pixels, field)
    if not (pixels[inside] > 0).any():
        return downscaling.by_pixel(np.where(pixels[inside] == 0, 0.0, np.nan), lattice.ratio)
    if field is None:
        first = [
            place * lattice.tile - PIXEL_MARGIN * number + shift
            for place, number, shift in zip((row, column), lattice.ratio, lattice.shift, strict=True)
        ]
        field = window_field(seed, model.arp, *first, size)
    known, (deviations, of_levels) = pixels > 0, model.deviations(pixels)
    # Pixels without leaves have no level; use the level of the largest mean.
    levels = model.transform.level(np.where(known, pixels, pixels[known].max()))
    trend = downscaling.map_trend(levels, known, of_levels, model.arp, lattice.ratio)
    cells = downscaling.downscaled(
        pixels, field, _kriging(model.arp, trend, lattice.ratio, shape), model.transform, deviations
    )
    cut = tuple(slice(PIXEL_MARGIN * number, -PIXEL_MARGIN * number) for number in lattice.ratio)
    tile = downscaling.without_cells(cells, pixels, outside)[cut].copy()
    tile.flags.writeable = False
    return tile


_kriging = cached(8, "kriging weights")(downscaling.Kriging.of)
