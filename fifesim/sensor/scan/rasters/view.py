"""View angles of a scan over a grid."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np
import pyproj
import xarray as xr
from odc.geo.geobox import GeoBox
from scipy.interpolate import RectBivariateSpline

from fifesim.base.annotations import Chunks
from fifesim.rasters import cf, places, projection
from fifesim.rasters import grid as grids
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.scan import track as scan
from fifesim.sensor.scan.track import Track

# Nodes along each axis between which the direction to the sensor is a cubic spline.
_NODES = 65

_TILE = 512


def scan_geometry(
    instrument: InstrumentLike,
    grid: GeoBox,
    track: Track | None = None,
    *,
    nadir_offset: float = 0.0,
    heading: float = 180.0,
    chunks: Chunks | None = None,
) -> xr.Dataset:
    """
    View zenith and azimuth of an instrument over a grid.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument
    grid : odc.geo.geobox.GeoBox
        Of cells or of pixels.
    track : fifesim.sensor.scan.track.Track, optional
        Ground track. By default it passes beside the middle of the grid.
    nadir_offset : float, optional
        Distance of the middle of the grid from the track, to the right of the flight. [m]
    heading : float, optional
        Direction of flight that goes with ``nadir_offset``, clockwise from north; southward by default, so that the
        right is the west. [degree]
    chunks : mapping or int or "auto", optional
        Makes the result lazy.

    Returns
    -------
    view : xarray.Dataset of ``vza`` and ``vaa``, dims (y, x)
        Azimuth toward the sensor, clockwise from true north; NaN where the instrument does not see the ground. Altitude
        and track are attributes. [degree]

    Raises
    ------
    ValueError
        If the grid is no grid, both ways of giving the track are used, or all of the grid lies outside of the swath.

    See Also
    --------
    fifesim.sensor.scan.track.view_components

    Examples
    --------
    >>> import fifesim
    >>> view = fifesim.scan_geometry("MODIS", fifesim.fife_site(500), nadir_offset=300_000)
    >>> view.vza.mean().round(0).item()
    26.0
    """
    description = find_instrument(instrument)
    grids.check_grid(grid)
    track = find_track(grid, track, nadir_offset, heading)
    _check_swath(description, grid, track)
    attrs = {"instrument": description.name, "altitude": description.altitude}
    attrs |= {f"track_{name}": value for name, value in vars(track).items()}
    out = {}
    for name in ("vza", "vaa"):
        kernel = partial(_view, name, grid, track, description.altitude, description.max_angle)
        array = places.tiles(kernel, grid, chunks, tile=_TILE)
        out[name] = cf.label(array, name, history=f"scan_geometry: {description.name}", instrument=description.name)
    return xr.Dataset(out, attrs=attrs)


def find_track(grid, track=None, nadir_offset=0.0, heading=180.0):
    """
    Ground track, as given or beside the middle of a grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
    track, nadir_offset, heading : optional
        As in `scan_geometry`.

    Returns
    -------
    track : fifesim.sensor.scan.track.Track

    Raises
    ------
    ValueError
        If both ways of giving the track are used.
    TypeError
        If the track is none.
    """
    if track is not None:
        if nadir_offset:
            raise ValueError("track and nadir_offset both say where the instrument flies: give one of them")
        if not isinstance(track, scan.Track):
            raise TypeError(f"track must be a fifesim.Track(latitude, longitude, heading), got {track!r}")
        return track
    latitude, longitude = degrees(grid, grid.shape.y / 2, grid.shape.x / 2)
    here = scan.Track(float(latitude), float(longitude), heading)
    aside = np.degrees(nadir_offset / scan.EARTH_RADIUS)
    # The great circle that keeps the distance there: its point is abeam to the left, its heading that of the parallel.
    latitude, longitude = scan.place_of(here, 0.0, -aside)
    _, along, _ = here.axes()
    _, east, north = scan.frame(float(latitude), float(longitude))
    return scan.Track(
        float(latitude), float(longitude), float(np.degrees(np.arctan2(along @ east, along @ north)) % 360)
    )


def degrees(grid, rows, columns):
    """
    Latitude and longitude of places in a grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
    rows, columns : array
        Counted from the upper left corner. [cell]

    Returns
    -------
    latitude, longitude : array
        [degree]
    """
    x, y = projection.transform_points(grid.affine, columns, rows)
    longitude, latitude = transformer(grid.crs.to_wkt()).transform(x, y)
    return latitude, longitude


@lru_cache(maxsize=8)
def transformer(crs):
    """
    From a CRS to its own longitudes and latitudes.

    Parameters
    ----------
    crs : str
        Well-known text.

    Returns
    -------
    transformer : pyproj.Transformer
    """
    projected = pyproj.CRS.from_wkt(crs)
    return pyproj.Transformer.from_crs(projected, projected.geodetic_crs, always_xy=True)


def scan_nodes(instrument, grid, track):
    """
    Nodes over a grid as a scan sees them.

    Parameters
    ----------
    instrument : fifesim.sensor.description.instruments.Instrument
    grid : odc.geo.geobox.GeoBox
    track : fifesim.sensor.scan.track.Track

    Returns
    -------
    distance, central_angle : array
        As `fifesim.sensor.scan.track.place_beside` gives them. [m], [degree]
    scan_angle : array
        NaN beyond the instrument's horizon. [degree]
    seen : array of bool
        Where the scan reaches.
    """
    distance, aside = scan.place_beside(track, *_nodes(grid)[2:])
    _, scan_angle = scan.view_from_ground(aside, instrument.altitude)
    return distance, aside, scan_angle, np.abs(scan_angle) <= instrument.max_angle


def _nodes(grid):
    """Rows and columns of nodes along the axes of a grid, and the latitudes and longitudes of all."""
    rows, columns = np.linspace(0, grid.shape.y, _NODES), np.linspace(0, grid.shape.x, _NODES)
    latitude, longitude = degrees(grid, *np.meshgrid(rows, columns, indexing="ij"))
    return rows, columns, latitude, longitude


@lru_cache(maxsize=4)
def _splines(grid, track, altitude):
    """Direction to the sensor over a grid, as splines of row and column."""
    rows, columns, latitude, longitude = _nodes(grid)
    east, north = scan.view_components(track, latitude, longitude, altitude)
    # Beyond the horizon, which a spline cannot hold: a direction that no limit passes.
    to_east = RectBivariateSpline(rows, columns, np.nan_to_num(east, nan=2.0))
    return to_east, RectBivariateSpline(rows, columns, np.nan_to_num(north, nan=2.0))


def _view(name, grid, track, altitude, limit, row, column, shape):
    """View zenith or azimuth of a block of cells."""
    rows, columns = row + np.arange(shape[0]) + 0.5, column + np.arange(shape[1]) + 0.5
    to_east, to_north = _splines(grid, track, altitude)
    east, north = to_east(rows, columns), to_north(rows, columns)
    sine = np.hypot(east, north)
    seen = sine < min(1.0, np.sin(np.radians(min(limit, 90.0))) * (1 + altitude / scan.EARTH_RADIUS) + 1e-12)
    if name == "vza":
        return np.where(seen, np.degrees(np.arcsin(np.minimum(sine, 1.0))), np.nan)
    return np.where(seen, np.degrees(np.arctan2(east, north)) % 360, np.nan)


def _check_swath(description, grid, track):
    _, aside, _, seen = scan_nodes(description, grid, track)
    if not seen.any():
        near = np.min(np.abs(aside)) * np.pi / 180 * scan.EARTH_RADIUS / 1000
        raise ValueError(
            f"{description.name} does not see the grid: it begins {near:.0f} km from the track, where the scan angle "
            f"is beyond {description.max_angle:g} degrees; give a nearer track or a smaller nadir_offset"
        )
