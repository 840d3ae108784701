"""Leaf area of the ground scene on labelled rasters: simulated or from the user's map, and its growth over a season."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import psutil
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import Chunks, LaiDistribution, Range, Times, WholeNumber
from fifesim.base.lattice import check_seed
from fifesim.base.times import utc
from fifesim.grids import cf, windows
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.inputs import FileOrRaster
from fifesim.grids.sites import made_on_site, one_or_several
from fifesim.grids.source import open_source
from fifesim.grids.warp import onto_grid
from fifesim.ground.canopy.leaf_area import check_map, check_source, warn_of_integers, warn_of_large
from fifesim.ground.landscape.autoregression import FIELD_TILE, check_arp, periodic_field, streaming_field
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table, rank_map

_REFERENCE = "Friedl et al. (1995), doi:10.1016/0034-4257(95)00156-5"


def lai_scene(
    grid: GeoBox,
    distribution: LaiDistribution = "burned-grazed",
    *,
    arp: float = 0.15,
    seed: WholeNumber = 0,
    method: Literal["streaming", "periodic"] = "streaming",
    chunks: Chunks | None = None,
) -> xr.DataArray:
    """
    Simulate leaf area index as a random field.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Grid of the ground cells, in a projected CRS.
    distribution : str, path or frozen scipy distribution, optional
        Distribution of LAI, as in `lai_distribution`.
    arp : float, optional
        Autoregressive parameter in [0, 0.25). [1]
    seed : int, optional
        Seed of the random field, in [0, 2**63).
    method : {"streaming", "periodic"}, optional
        ``streaming`` depends only on seed and position, so a window equals a slice of the whole, for any chunks.
        ``periodic`` is the method of the paper: one Fourier transform of the whole scene, in memory, and exact ranks.
    chunks : mapping or int, optional
        Chunks of a lazy scene, for the streaming method.

    Returns
    -------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]

    Raises
    ------
    ValueError
        If the grid, arp, seed, distribution or method is invalid.
    TypeError
        If the seed is not an integer.

    References
    ----------
    [Friedl1995]_, Fig. 2

    See Also
    --------
    fifesim.landscape, fifesim.open_lai, fifesim.ground.treatments

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
    >>> lai.dims, lai.shape
    (('y', 'x'), (90, 90))
    >>> lai.isel(y=slice(2), x=slice(3)).round(2).values
    array([[1.31, 0.57, 0.5 ],
           [0.58, 0.28, 1.76]])
    """
    grids.check_grid(grid)
    check_arp(arp)
    seed = check_seed(seed)
    density = lai_distribution(distribution)
    if method == "streaming":
        cells = _streaming_cells(grid, density, arp, seed)
        # A first window raises errors of streaming_field before anything lazy is built.
        cells(0, 0, (0, 0))
        lai = windows.tiles(cells, grid, chunks, tile=FIELD_TILE)
    else:
        field = xr.DataArray(_periodic_cells(grid, density, arp, seed), dims=("y", "x"))
        lai = grids.place(field if chunks is None else field.chunk(chunks), grid)
    history = f"lai_scene: {method} autoregressive field, arp {arp:g}, seed {seed}"
    made = {"arp": float(arp), "rng_seed": str(seed), "lai_distribution": distribution_name(distribution)}
    made |= made_on_site(grid)
    return cf.label(lai, "lai", history=history, **made, method=method, references=_REFERENCE)


def open_lai(
    path_or_raster: FileOrRaster, grid: GeoBox, chunks: Chunks | None = None, *, allow_remote: bool = False
) -> xr.DataArray:
    """
    Resample a map of leaf area index to a grid.

    Parameters
    ----------
    path_or_raster : str, path or xarray.DataArray
        Map of LAI in any CRS and orientation: a raster file or an array. From several bands, the one described as LAI
        is used. Scaled integers (e.g. MODIS) are converted with ``scale_factor``. [m2 m-2]
    grid : odc.geo.geobox.GeoBox
        Grid of the ground cells. Cells no larger than the map cells are interpolated bilinearly; larger cells are
        means.
    chunks : mapping or int, optional
        Chunks of a lazy result; in memory by default.
    allow_remote : bool, optional
        Also open remote files and formats that refer to other files. Use this only for trusted files.

    Returns
    -------
    lai : xarray.DataArray, dims (y, x)
        NaN for no data. [m2 m-2]

    Raises
    ------
    ValueError
        If the file is missing, has an unsupported format or no CRS, does not overlap the grid, or needs a datum
        transformation of unknown accuracy; if there is no data on the grid (checked for results in memory); if name,
        description or units indicate another quantity; and, when computed, if LAI on or next to the grid is negative or
        above 20.

    Warns
    -----
    UserWarning
        If the map holds integers without a scale; when computed, if the mean LAI of a chunk exceeds 8.

    Examples
    --------
    A map of 10 m on cells of 5 m:

    >>> import fifesim
    >>> site = fifesim.fife_site(10, window=((0, 30), (0, 30)))
    >>> map_10m = fifesim.lai_scene(site, seed=7)
    >>> lai = fifesim.open_lai(map_10m, fifesim.fife_site(5, window=((0, 60), (0, 60))))
    >>> lai.shape, bool(abs(lai.mean() - map_10m.mean()) < 1e-3)
    ((60, 60), True)
    """
    lai = lai_window(path_or_raster, grid, chunks, allow_remote=allow_remote)
    if lai.chunks is None and not np.isfinite(lai.values).any():
        raise ValueError(
            f"{lai.attrs['lai_distribution']} has no data on the grid, which spans {grids.extent(grid)}: all cells are "
            "marked as no data; check the nodata value with gdalinfo -stats"
        )
    return lai


def double_logistic(day, green_up, senescence, width):
    r"""
    Relative leaf area over a season.

    .. math:: f = \frac{1}{1 + e^{-(t - s) / w}} + \frac{1}{1 + e^{(t - e) / w}} - 1

    Parameters
    ----------
    day : array
        Day of the year, :math:`t`. [day]
    green_up, senescence : float
        Days of half of the growth and half of the decline, :math:`s, e`. [day]
    width : float
        Time constant of both, :math:`w`. [day]

    Returns
    -------
    growth : array, shape of day
        0 in winter, almost 1 in summer. [1]

    References
    ----------
    [Beck2006]_, Eq. 3

    Examples
    --------
    >>> double_logistic(np.array([0.0, 130.0, 205.0, 280.0]), 130.0, 280.0, 10.0).round(2).tolist()
    [0.0, 0.5, 1.0, 0.5]
    """
    day = np.asarray(day, float)
    return 1 / (1 + np.exp(-(day - green_up) / width)) + 1 / (1 + np.exp((day - senescence) / width)) - 1


def phenology(
    time: Times,
    *,
    green_up: float,
    senescence: float,
    width: Annotated[float, Range("day", 0, np.inf, ends="()")] = 10.0,
    winter: Annotated[float, Range("1", 0, 1)] = 0.0,
) -> xr.DataArray:
    """
    Growth by date, to be multiplied with a raster of the largest leaf area.

    Parameters
    ----------
    time : sequence of str or datetime
        Dates.
    green_up, senescence : float
        Days of the year of half of the growth and of half of the decline. [day]
    width : float, optional
        Time constant of both. [day]
    winter : float, optional
        Growth outside of the season, 0 to 1. [1]

    Returns
    -------
    growth : xarray.DataArray, dims (time)
        From ``winter`` to 1. [1]

    Raises
    ------
    ValueError
        If senescence is not after green-up, the width is not positive, or winter is out of range.

    See Also
    --------
    fifesim.lai_scene, fifesim.ground.treatments

    Examples
    --------
    >>> import fifesim
    >>> dates = ["1987-03-01T16:35Z", "1987-07-10T16:35Z"]
    >>> fifesim.ground.phenology(dates, green_up=125, senescence=280, winter=0.1).values.round(2).tolist()
    [0.1, 1.0]
    """
    if not senescence > green_up:
        raise ValueError(
            f"senescence must be after green_up, got {senescence:g} and {green_up:g}: give days of the year"
        )
    times = one_or_several(time)
    stamps = [utc(one)[0] for one in (times if np.ndim(times) else [times])]
    day = np.array([stamp.day_of_year + stamp.hour / 24 for stamp in stamps])
    values = winter + (1 - winter) * double_logistic(day, green_up, senescence, width)
    dates = np.array([stamp.tz_localize(None).to_datetime64() for stamp in stamps])
    return xr.DataArray(
        values, {"time": ("time", dates, cf.TIME_ATTRIBUTES)}, ("time",), "growth",
        {"long_name": "growth of leaf area", "units": "1"},
    )  # fmt: skip


def lai_window(path_or_raster, grid, chunks=None, *, allow_remote=False):
    """Map of leaf area index on a grid, possibly without data, dims (y, x). [m2 m-2]"""
    source = open_source(path_or_raster, "lai", allow_remote)
    # GDAL assigns the height unit of a compound CRS to bands without a unit.
    cf.check_words(source.name, source.words, "lai", "" if source.height_units else source.units)
    if source.counts:
        warn_of_integers(source.name)
    lai = chunking.pointwise(_plausible, onto_grid(source, grid, chunks, check=check_source))
    history = f"open_lai: {source.name}"
    return cf.label(grids.place(lai, grid), "lai", history=history, lai_distribution=source.name)


def _plausible(lai):
    return warn_of_large(check_map(lai))


def scene_cells(grid, distribution, arp, seed, method="streaming"):
    """Cells of a scene in memory, without labels, shape (y, x). [m2 m-2]"""
    density = lai_distribution(distribution)
    if method == "periodic":
        return _periodic_cells(grid, density, arp, seed)
    return _streaming_cells(grid, density, arp, seed)(0, 0, tuple(grid.shape))


def _streaming_cells(grid, density, arp, seed):
    """Kernel that computes cells of a scene from their row and column."""
    row, column = grids.lattice_position(grid)
    table = quantile_table(density)

    def cells(first_row, first_column, shape):
        field = streaming_field(seed, arp, row + first_row, column + first_column, shape)
        return quantile_map(field, table)

    return cells


def _periodic_cells(grid, density, arp, seed):
    # Noise, spectrum, field, ranks, quantiles and result are in memory at the same time.
    needed, free = 48 * grid.shape.x * grid.shape.y, psutil.virtual_memory().available
    if needed > free:
        raise ValueError(
            f"a periodic field of {grid.shape.y} x {grid.shape.x} cells needs {needed / 1e9:.1f} GB of memory, "
            f'{free / 1e9:.1f} GB are free: use method="streaming", whose memory does not grow with the scene'
        )
    return rank_map(periodic_field(seed, arp, tuple(grid.shape)), density)


def distribution_name(source):
    """Name of a distribution of leaf area for attributes."""
    if hasattr(source, "dist"):
        return f"{source.dist.name}({', '.join(f'{value:g}' for value in [*source.args, *source.kwds.values()])})"
    return Path(source).name
