"""Clouds on labelled rasters: the field of a sky, and its cells toward the sensor, the sun and the zenith."""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.atmosphere import coupling, engines
from fifesim.atmosphere.clouds import COVER, HEIGHT, LENGTH, THICKNESS, layer
from fifesim.atmosphere.clouds.field import PERIOD, CloudCover, cloud_displacement, cloud_thickness
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import Chunks, Kind, Pair, Range, Time, Times, WholeNumber, check_number
from fifesim.base.caches import cached
from fifesim.base.geometry import ANGLES
from fifesim.base.lattice import check_seed
from fifesim.base.messages import warn
from fifesim.base.times import utc
from fifesim.grids import cf, chunks, directions, windows
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date, joined
from fifesim.grids.directions import Directions
from fifesim.grids.grid import with_crs_of
from fifesim.grids.reductions import computed, extremes
from fifesim.grids.sites import one_or_several

_LOWEST_TOP = 50.0  # lower clouds are fog, or a height in km [m]
LOWEST_SUN = 85.0  # zenith angle beyond which shadows have no end [degree]
LEAST = 0.1  # optical thickness from which a cell counts as cloud; sensors miss thinner clouds [1]
DEEPEST_GROUND = 500.0  # ground below the altitude of the atmosphere that the margin of relief allows for [m]
_TILE = 1008

# Jet streams stay below. [m s-1]
_FASTEST = 150.0
_MOST_LAYERS = 64  # of clouds at different heights

COLUMNS = ("optical_thickness", "shadow_thickness", "overhead_thickness")
"""Variables of `cast_clouds` that `to_toa` reads: clouds toward the sensor, toward the sun and overhead."""


Clouds: TypeAlias = Annotated[
    xr.Dataset, Kind("an xarray.Dataset of clouds, as fifesim.cloud_field(grid, cover=0.3) gives it")
]


def cloud_field(
    grid: GeoBox,
    cover: Annotated[float, COVER] = 0.4,
    *,
    thickness: Pair = 8.0,
    length: Annotated[float, LENGTH] = 2000.0,
    height: Pair = 1500.0,
    seed: WholeNumber = 0,
    drift: Annotated[Pair, Kind("two speeds, eastward and northward, such as (5.0, 0.0)")] = (0.0, 0.0),
    time: Annotated[
        Times | float | None, Kind("a time such as '1987-06-06T16:35Z', a list of times, or seconds")
    ] = None,
    margin: Annotated[float, Range("m", 0, 200_000)] = 0.0,
    chunks: Chunks | None = None,
) -> xr.Dataset:
    """
    Simulate a field of water clouds as a function of seed and place.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Grid of the ground cells, in a projected CRS.
    cover : float, optional
        Cloud cover, 0 to 1. It holds exactly on each square of 100 km, after which the field repeats. [1]
    thickness : float or (float, float), optional
        Mean optical thickness within clouds, or mean and standard deviation; by default the standard deviation equals
        the mean, as in broken clouds. Clouds thicker than 100 are cut to 100. [1]
    length : float, optional
        Distance at which the correlation has fallen to 0.05, 100 to 20000. [m]
    height : float or (float, float), optional
        Height of the clouds above the ground, or of base and top, up to 20000. Relief is measured from the altitude of
        the atmosphere. [m]
    seed : int, optional
        Seed, in [0, 2**63).
    drift : (float, float), optional
        Speed of the clouds eastward and northward. [m s-1]
    time : str, datetime, sequence or float, optional
        Time by which the clouds have drifted: seconds, or dates and times. Each date in UTC has an independent sky that
        drifts from midnight on. A list adds the dimension time, whose coordinate is the dates or the seconds.
    margin : float, optional
        Distance by which the field extends beyond the grid on every side, for clouds whose shadow or image falls on the
        grid: height times the sum of the tangents of the zenith angles of sun and sensor. [m]
    chunks : mapping or int or "auto", optional
        Chunks of a lazy field.

    Returns
    -------
    clouds : xarray.Dataset, dims (y, x)
        ``optical_thickness`` [1], lognormal within clouds and 0 between them, and the numbers ``base`` and ``top`` [m].
        Identical for any chunks, window and cell size. A Dataset of the same variables from other sources serves as
        well.

    Raises
    ------
    ValueError
        If cover, thickness, length, height, drift, time or seed is out of range, or the base is above the top.

    Warns
    -----
    UserWarning
        If the height is less than 50 m, which may be in km.

    References
    ----------
    [Cahalan1989]_, spectrum; [Barker1996]_, distribution of thickness

    See Also
    --------
    fifesim.atmosphere.cast_clouds, fifesim.to_toa

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, width=100000, height=100000, cell=500)
    >>> sky = fifesim.cloud_field(grid, cover=0.3, seed=7)
    >>> round(float((sky.optical_thickness > 0).mean()), 2)
    0.3
    """
    time = one_or_several(time)
    if np.ndim(time):
        options = {"thickness": thickness, "length": length, "height": height, "seed": seed, "drift": drift}
        moments = [one if isinstance(one, int | float | np.number) else utc(one)[0] for one in time]
        each = [cloud_field(grid, cover, **options, time=one, margin=margin, chunks=chunks) for one in moments]
        cells = [
            sky["optical_thickness"].assign_coords(time=sky.coords.get("time", one))
            for sky, one in zip(each, moments, strict=True)
        ]
        return each[0].assign(optical_thickness=joined(cells))
    grid = grids.check_grid(grid)
    base, top = _base_and_top(height)
    mean, deviation = _pair(thickness)
    check_number("mean of thickness", mean, THICKNESS)
    check_number("deviation of thickness", deviation, THICKNESS._replace(highest=np.inf))
    day, seconds = _day_and_seconds(time)
    if np.shape(drift) != (2,) or not np.all(np.abs(drift) <= _FASTEST):
        raise ValueError(
            f"drift must be two speeds, eastward and northward, of at most {_FASTEST:g} m s-1, such as (5.0, 0.0), "
            f"got {drift}"
        )
    sky = CloudCover(float(cover), (mean, deviation), float(length), check_seed(seed), day)
    around = [int(np.ceil(margin / size - 1e-9)) for size in grids.cell_size(grid)]
    grid = grids.on_lattice(grid.pad(around[1], around[0]))
    moved = [round(float(speed) * seconds * 1000) % PERIOD for speed in drift]
    northing, easting = (np.round(each * 1000).astype(np.int64) for each in grids.centres_of(grid))
    kernel = partial(_cells, sky, northing, easting, moved)
    cells = windows.tiles(kernel, grid, chunks, tile=_TILE)
    text = f"cloud_field: cover {cover:g}, thickness {mean:g} ({deviation:g}), length {length:g} m, seed {seed}"
    cells = cf.label(cells, "optical_thickness", history=text, rng_seed=str(seed))
    numbers = {name: ((), each, cf.attributes(f"cloud_{name}")) for name, each in (("base", base), ("top", top))}
    clouds = xr.Dataset({"optical_thickness": cells, **numbers})
    return clouds if time is None or isinstance(time, int | float | np.number) else directions.dated(clouds, time)


def _cells(sky, northing, easting, moved, row, column, shape):
    """Optical thickness of the cells of a window, shape (rows, columns). [1]"""
    rows, columns = northing[row : row + shape[0]], easting[column : column + shape[1]]
    return cloud_thickness(sky, rows - moved[1], columns - moved[0], layer.THICKEST)


def _day_and_seconds(time):
    """Number of the date and seconds from its midnight in UTC; seconds alone belong to day 0."""
    if time is None or isinstance(time, int | float | np.number):
        seconds = float(time or 0)
        if not np.isfinite(seconds):
            raise ValueError(f"time must be a finite number of seconds, got {seconds:g}")
        return 0, seconds
    stamp = utc(time)[0]
    return stamp.normalize().toordinal(), (stamp - stamp.normalize()).total_seconds()


def _pair(value):
    return tuple(map(float, value)) if np.ndim(value) else (float(value), float(value))


def _base_and_top(height):
    base, top = _pair(height)
    check_number("base", base, HEIGHT)
    check_number("top", top, HEIGHT)
    if base > top:
        raise ValueError(f"the base of clouds must not be above their top, got {base:g} and {top:g} m: swap them")
    if top < _LOWEST_TOP:
        warn(
            f"clouds {base:g} to {top:g} m above the ground are taken as fog: if their height is in km, multiply it by "
            "1000"
        )
    return base, top


@by_date
def cast_clouds(
    scene: xr.DataArray,
    clouds: Clouds,
    *,
    dem: xr.DataArray | None = None,
    altitude: float | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    least: Annotated[float, Range("1", 0, np.inf, note="it is an optical thickness", ends="(]")] = LEAST,
) -> xr.Dataset:
    """
    Find the clouds toward the sensor, toward the sun and overhead of each ground cell.

    Parameters
    ----------
    scene : xarray.DataArray, dims (..., y, x)
        Raster on the cells of the ground, such as leaf area or reflectance.
    clouds : xarray.Dataset, dims (y, x)
        ``optical_thickness`` [1] of clouds, 0 without clouds and NaN where unknown, and ``base`` and ``top`` [m],
        numbers or rasters, from `cloud_field` or other sources. Its grid has the cells of the scene and may be larger.
    dem : xarray.DataArray, dims (y, x), optional
        Elevation, onto which images and shadows of the clouds fall; by default the ground is level. [m]
    altitude : float, optional
        Altitude from which the height of the clouds is measured above relief; by default the altitude of the atmosphere
        of the scene, or 0.4. [km]
    geometry, time : optional
        Directions of sun and sensor, as in `to_toa`; one direction for the scene.
    least : float, optional
        Optical thickness from which a cell counts as cloud or shadow, above 0. [1]

    Returns
    -------
    cells : xarray.Dataset, dims (y, x)
        ``cloud`` and ``shadow``, 1 or 0; their means over pixels are fractions. ``optical_thickness``,
        ``shadow_thickness`` and ``overhead_thickness`` of the clouds toward the sensor, toward the sun and overhead.
        [1]

    Raises
    ------
    ValueError
        If the clouds have other cells, base and top are invalid, `least` is not positive, the sun is lower than 5
        degrees, or directions vary within the scene.

    Warns
    -----
    UserWarning
        If clouds beyond the end of the field could shade or hide cells, with the missing distance. For a lazy `dem`,
        the distance is of level ground.

    Notes
    -----
    Clouds are a thin layer at the middle of base and top. Positions are right to half a cell. Rasters of base and top
    are divided into layers, at most 64, whose thicknesses add.

    See Also
    --------
    fifesim.cloud_field, fifesim.to_toa

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30, window=((0, 100), (0, 100)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> sky = fifesim.cloud_field(grid, cover=0.4, seed=3, margin=2000)
    >>> lai.fifesim.cast_clouds(sky).cloud.shape
    (100, 100)
    """
    geometry = directions.uniform_geometry(directions.given_geometry(geometry, scene, time), "clouds")
    if altitude is None:
        altitude = Atmosphere.parse(scene.attrs["atmosphere"]).altitude if "atmosphere" in scene.attrs else 0.4
    found = _cast(scene, clouds, dem, altitude, geometry)
    masks = zip(("cloud", "shadow"), COLUMNS, strict=False)
    made = {name: np.where(np.isnan(found[of]), np.nan, found[of] >= least) for name, of in masks} | found
    text = f"cast_clouds: from optical thickness {least:g}"
    grid, names = grids.geobox(scene), {"shadow": "cloud_shadow"}
    for name, data in made.items():
        # Toward nadir, the data are a window of the field.
        cells = grids.place(xr.DataArray(data, dims=("y", "x")), grid).copy()
        made[name] = cf.label(cells, names.get(name, name), history=text, source=clouds[COLUMNS[0]])
    return directions.with_geometry(xr.Dataset(made), geometry)


def _cast(scene, clouds, dem, altitude, geometry):
    """Optical thickness toward the sensor, toward the sun and overhead of each cell, by name, shape (y, x). [1]"""
    grids.check_axes(scene)
    if geometry.sza > LOWEST_SUN:
        raise ValueError(
            f"the sun must be at least 5 degrees above the horizon, got {90 - geometry.sza:.1f}: choose another time"
        )
    if not np.isfinite(altitude):
        raise ValueError(f"altitude must be a finite number [km], got {altitude:g}")
    grid, reference = grids.geobox(scene), 1000 * altitude
    ground = None if dem is None else with_crs_of(dem.transpose("y", "x"), scene)
    turned = directions.from_grid_north(geometry, grid)
    east, north, image_east, image_north = cloud_displacement(1.0, *(getattr(turned, name) for name in ANGLES))
    down, across = grids.cell_size(grid)
    ways = [(image_north / down, -image_east / across), (north / down, -east / across), (0.0, 0.0)]
    layers = _layers(*_checked(clouds, scene), np.abs(ways).max())
    highest = _highest(max(height for _, height in layers), grid, ground, reference)
    _warn_of_missing(grids.geobox(layers[0][0]), grid, ways, highest, ground is not None and ground.chunks is not None)
    sizes, found = _chunks_of(scene, layers[0][0], ground), {}
    # Toward nadir, the clouds toward the sensor are those overhead.
    for way in set(ways):
        seen = [_seen_along(way, cells, grid, height, ground, reference, sizes) for cells, height in layers]
        found[way] = seen[0] if len(seen) == 1 else np.minimum(sum(seen), layer.THICKEST)
    return {name: found[way] for name, way in zip(COLUMNS, ways, strict=True)}


def _checked(clouds, scene):
    """Optical thickness, base and top of a cloud field with the CRS of a scene."""
    quantities = {"optical_thickness": "optical_thickness", "base": "cloud_base", "top": "cloud_top"}
    if missing := [name for name in quantities if name not in clouds]:
        raise ValueError(
            f"clouds need the variables optical_thickness, base and top, {', '.join(missing)} is missing: see "
            "fifesim.cloud_field"
        )
    for name, quantity in quantities.items():
        if clouds[name].dtype.kind not in "iuf":
            example = f"clouds.assign({name}=1500.0)"
            raise ValueError(f"{name} of clouds must hold numbers, got {clouds[name].dtype}: type {example}")
        cf.check_units(clouds[name], quantity)
    fields = (clouds[name].astype(float, copy=False) for name in quantities)
    return [with_crs_of(each.transpose("y", "x"), scene) if each.ndim else each for each in fields]


def _layers(thickness, base, top, per_metre):
    """Optical thickness of thin layers, and their heights [m], from the displacement per metre of height [cell m-1]."""
    if not (np.ndim(base) or np.ndim(top)):
        return [(thickness, sum(_base_and_top((float(base), float(top)))) / 2)]
    lowest, highest, thinnest = (float(each) for each in computed(base.min(), top.max(), (top - base).min()))
    _base_and_top((lowest, max(highest, lowest)))
    if thinnest < 0:
        raise ValueError(f"the base of clouds must not be above their top, but is by up to {-thinnest:g} m: swap them")
    height = (base + top) / 2
    low, high = extremes(height)
    # Without displacement, the height does not matter.
    step = max(1 / per_metre if per_metre else HEIGHT.highest, (high - low) / (_MOST_LAYERS - 1))
    number = np.round((height.fillna(low) - low) / step)
    thickness = thickness.where(height.notnull() | (thickness == 0))
    return [(thickness.where(number == k, 0.0), low + k * step) for k in range(round((high - low) / step) + 1)]


def _chunks_of(scene, *others):
    """Chunks of the result, by rows and columns; None if all rasters are in memory."""
    if not any(each is not None and each.chunks is not None for each in (scene, *others)):
        return None
    if scene.chunks is not None:
        return scene.chunksizes["y"], scene.chunksizes["x"]
    return windows.chunk_sizes(grids.geobox(scene), "auto", tile=_TILE)


def _highest(height, grid, ground, reference):
    """Largest height of the clouds above the ground of a grid; above level ground if the elevation is lazy. [m]"""
    if ground is None or ground.chunks is not None:
        return height
    cells = zip(grids.lattice_offset(grids.geobox(ground), grid), grid.shape, strict=True)
    known = ground.values[tuple(slice(max(first, 0), max(first + size, 0)) for first, size in cells)]
    return max(height + reference - np.min(known[~np.isnan(known)], initial=height + reference), 0.0)


def _warn_of_missing(field, grid, ways, height, lazy):
    """Warn if the grid of a field ends within reach of the images and shadows on another grid."""
    missing, needed = [0.0], [0.0]
    for first, cells, known, size, shifts in zip(
        grids.lattice_offset(field, grid), grid.shape, field.shape, grids.cell_size(grid),
        zip(*ways, strict=True), strict=True,
    ):  # fmt: skip
        reach = [np.rint(shift * height) for shift in shifts]
        needed += [max(map(abs, reach)) * size]
        missing += [max(-min(reach) - first, first + max(reach) + cells - known) * size]
    if max(missing) > 0:
        level = ", for level ground because the elevation is lazy" if lazy else ""
        warn(
            f"the clouds end {max(missing):.0f} m too early{level}: beyond, the sky is taken as clear; give "
            f"cloud_field(..., margin={max(needed):.0f}) or more, or a larger raster"
        )


class _Way(NamedTuple):
    """Line of sight through a cloud field."""

    shifts: tuple[float, float]  # southward and eastward per metre of height [cell m-1]
    first: tuple[int, int]  # cell of the field at the first cell of the scene
    shape: tuple[int, int]  # of the field
    height: float  # of the clouds [m]
    reference: float  # altitude from which it is measured [m]

    def ends(self, relief):
        """Smallest and largest offset of cells along rows and columns, from the scene into the field."""
        heights = np.array([0.0, self.height + DEEPEST_GROUND] if relief else [self.height] * 2)
        return [
            first + np.sort(np.rint(shift * heights)).astype(int)
            for first, shift in zip(self.first, self.shifts, strict=True)
        ]


def _seen_along(shifts, thickness, grid, height, ground, reference, sizes):
    """Optical thickness of the clouds along a line of sight from each cell, shape (y, x). [1]"""
    field = grids.geobox(thickness)
    way = _Way(shifts, grids.lattice_offset(field, grid), tuple(field.shape), height, reference)
    cells = [np.arange(size) for size in grid.shape]
    reach = [(at + low, at + high + 1) for at, (low, high) in zip(cells, way.ends(ground is not None), strict=True)]
    reads = [chunks.Reads(thickness.data, *reach)]
    if ground is not None:
        offset = grids.lattice_offset(grids.geobox(ground), grid)
        reads.append(chunks.margin_reads(ground.data, 0, offset=offset, shape=tuple(grid.shape)))
    return chunks.windows(partial(_along, way), reads, tuple(grid.shape), sizes)


def _along(way, rows, columns, cells, elevation=None):
    """Clouds along a line of sight from a block of cells, clear beyond the field, shape (rows, columns). [1]"""
    relief = elevation is not None
    starts = [block.start + low for block, (low, _) in zip((rows, columns), way.ends(relief), strict=True)]
    at = np.arange(rows.stop - rows.start)[:, None], np.arange(columns.stop - columns.start)
    if not relief:
        row, column = (first + along for first, along in zip(starts, at, strict=True))
        if min(row[0], column[0]) >= 0 and row[-1] < way.shape[0] and column[-1] < way.shape[1]:
            return cells
        inside = (row >= 0) & (row < way.shape[0]) & (column >= 0) & (column < way.shape[1])
        return np.where(inside, cells, 0.0)
    above = way.height + way.reference - elevation
    if (deep := np.nanmax(above, initial=0)) > way.height + DEEPEST_GROUND:
        raise ValueError(
            f"the ground lies {deep - way.height:.0f} m below {way.reference:g} m, from which the height of "
            "clouds is measured: give altitude= [km]"
        )
    shift = [np.rint(each * np.nan_to_num(np.maximum(above, 0))).astype(int) for each in way.shifts]
    row, column = (
        block.start + along + first + each
        for block, along, first, each in zip((rows, columns), at, way.first, shift, strict=True)
    )
    inside = (above > 0) & (row >= 0) & (row < way.shape[0]) & (column >= 0) & (column < way.shape[1])
    row, column = (np.where(inside, each - start, 0) for each, start in zip((row, column), starts, strict=True))
    return np.where(np.isnan(above), np.nan, np.where(inside, cells[row, column], 0.0))


def with_clouds(toa, clouds, atmosphere, bands, geometry, *, elevation=None):
    """Apparent reflectance of a scene with clouds, dims (band, y, x), from the reflectance without. [1]"""
    geometry = directions.uniform_geometry(geometry, "to_toa with clouds")
    if COLUMNS[1] not in clouds:
        columns = [
            xr.Variable(("y", "x"), each)
            for each in _cast(toa, clouds, elevation, atmosphere.altitude, geometry).values()
        ]
    else:
        for name in ANGLES:
            if name in clouds.coords and not np.isclose(float(clouds[name]), getattr(geometry, name)):
                raise ValueError(
                    f"the clouds were cast with {name} {float(clouds[name]):g}, the reflectance has "
                    f"{getattr(geometry, name):g}: cast them again with cast_clouds"
                )
        columns = [clouds[name].drop_vars([*ANGLES, "earth_sun_distance"], errors="ignore") for name in COLUMNS]
    sky = cloud_tables(atmosphere, tuple(bands), geometry)
    plain = toa.drop_vars(["band", *ANGLES], errors="ignore")
    # The reflectance without clouds is of no use to others, except in a graph of tasks.
    kernel = partial(layer.under_clouds, sky=sky, in_place=toa.chunks is None)
    out = chunks.pointwise(kernel, plain, *columns, bands=len(bands), dtype=toa.dtype)
    out = toa.copy(deep=False, data=out.transpose(*toa.dims).data)
    return cf.label(out, "toa_reflectance", source=toa, history="to_toa: with clouds")


@cached(16, "light of clouds by thickness")
def cloud_tables(atmosphere, bands, geometry):
    """Tables of `layer.under_clouds` for an atmosphere, bands and one direction of sun and sensor."""
    terms = engines.band_terms(atmosphere, bands, geometry.sza, geometry.vza, geometry.raa)
    return layer.sky_tables(
        [layer.band_drops(band) for band in bands],
        terms.gas_transmittance * terms.path_reflectance,
        terms.diffuse_fraction,
        [coupling.band_gas_transmittance(atmosphere, band, geometry, ("o3",)) for band in bands],
        geometry.sza, geometry.vza, geometry.raa,
    )  # fmt: skip
