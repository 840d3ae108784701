"""Time, sun and view of a Sentinel-2 tile as its metadata describe them (``MTD_TL.xml``)."""

import re
from dataclasses import dataclass

import numpy as np
import pyproj

from fifesim.base.foreign import shown
from fifesim.base.geometry import angle_between
from fifesim.base.metadata import naming, read_xml, utc_time
from fifesim.sensor.products.metadata_checks import CURE, check_sun
from fifesim.sensor.products.scaling import direction_angles, mean_direction
from fifesim.sensor.products.sentinel2_files import number_of, part_of, text_of

# Dates of launch. ESA, Sentinel-2 mission. No Sentinel-2 image is older than the first.
_LAUNCHED = {"Sentinel-2A": "2015-06-23", "Sentinel-2B": "2017-03-07"}

# Edge of a tile [m].
_TILE = 109_800.0

# Largest angle between the mean sun of a tile and the mean of its grid. Products agree within 0.05. [degree]
_SUN = 1.0


@dataclass(frozen=True)
class Sentinel2Tile:
    """
    Time and directions of a tile.

    Parameters
    ----------
    time : numpy.datetime64
        UTC.
    sza, saa : float
        Means over the tile. [degree]
    views : dict of str to (float, float)
        Mean zenith and azimuth of the view, by number of band. [degree]
    corner : (float, float)
        Easting and northing of the first node of the grids of angles. [m]
    step : float
        Between their nodes. [m]
    sun : array, shape (2, n, m)
        Zenith and azimuth. [degree]
    view_grids : dict of str to array, shape (detector, 2, n, m)
        The same by number of band, NaN where a detector does not see. [degree]
    """

    time: np.datetime64
    sza: float
    saa: float
    views: dict[str, tuple[float, float]]
    corner: tuple[float, float]
    step: float
    sun: np.ndarray
    view_grids: dict[str, np.ndarray]


def sentinel2_tile(path, spacecraft="Sentinel-2A"):
    """
    A tile from its metadata.

    Parameters
    ----------
    path : str or path
        Path of ``MTD_TL.xml``.
    spacecraft : str, optional
        Satellite that took it.

    Returns
    -------
    tile : Sentinel2Tile

    Raises
    ------
    ValueError
        If something is missing or has a wrong value, or the sun does not belong to time and place; the message begins
        with the name of the file.
    """
    root = read_xml(path)
    with naming(path):
        return _tile(root, _LAUNCHED.get(spacecraft, min(_LAUNCHED.values())))


def _tile(root, launch):
    views = {
        each.get("bandId"): (number_of(each, "ZENITH_ANGLE"), number_of(each, "AZIMUTH_ANGLE") % 360.0)
        for each in root.findall(".//Mean_Viewing_Incidence_Angle_List/Mean_Viewing_Incidence_Angle")
        if text_of(each, "ZENITH_ANGLE") != "NaN"
    }
    grids = {}
    for each in root.findall(".//Viewing_Incidence_Angles_Grids"):
        grids.setdefault(each.get("bandId"), []).append(_grid(each))
    time = utc_time(text_of(root, ".//SENSING_TIME"), "SENSING_TIME", launch)
    corner = number_of(root, ".//Geoposition/ULX"), number_of(root, ".//Geoposition/ULY")
    sun = _grid(part_of(root, ".//Sun_Angles_Grid"))
    sza, saa = _mean_sun(root, sun)
    check_sun(f"Mean_Sun_Angle of zenith {sza:g} and azimuth {saa:g}", sza, saa, time, _centre(root, corner))
    return Sentinel2Tile(
        time=time,
        sza=sza,
        saa=saa,
        views=views,
        corner=corner,
        step=number_of(root, ".//Sun_Angles_Grid/Zenith/ROW_STEP"),
        sun=sun,
        view_grids={band: np.stack(detectors) for band, detectors in grids.items()},
    )


def _mean_sun(root, grid):
    """Mean solar zenith and azimuth angles of the tile: those stated, or the mean of the grid for NaN [degree]."""
    of_grid = tuple(float(angle) for angle in direction_angles(mean_direction(*grid.reshape(2, -1))))
    keys = [f".//Mean_Sun_Angle/{name}_ANGLE" for name in ("ZENITH", "AZIMUTH")]
    # Tiles that reach across the antimeridian have NaN.
    if "NaN" in [text_of(root, key) for key in keys]:
        if not np.isfinite(of_grid).all():
            raise ValueError("Mean_Sun_Angle and Sun_Angles_Grid are NaN: nothing says where the sun stands")
        return of_grid
    stated = number_of(root, keys[0]), number_of(root, keys[1]) % 360.0
    if angle_between(*stated, *of_grid) > _SUN:
        raise ValueError(
            f"Mean_Sun_Angle of zenith {stated[0]:g} and azimuth {stated[1]:g} contradicts Sun_Angles_Grid, whose mean "
            f"is {of_grid[0]:.1f} and {of_grid[1]:.1f} degrees: {CURE}"
        )
    return stated


def _centre(root, corner):
    """Latitude and longitude of the middle of the tile [degree]."""
    code = text_of(root, ".//HORIZONTAL_CS_CODE")
    if not re.fullmatch(r"EPSG:32[67](0[1-9]|[1-5]\d|60)", code):
        raise ValueError(f"HORIZONTAL_CS_CODE must be a UTM zone such as EPSG:32629, got {shown(code)}")
    to_degrees = pyproj.Transformer.from_crs(code, "EPSG:4326", always_xy=True)
    longitude, latitude = to_degrees.transform(corner[0] + _TILE / 2, corner[1] - _TILE / 2)
    return latitude, longitude


def _grid(element):
    """Zenith and azimuth at the nodes of a grid of angles."""
    angles = []
    for name in ("Zenith", "Azimuth"):
        rows = [(each.text or "").split() for each in element.findall(f"{name}/Values_List/VALUES")]
        try:
            angles.append(np.array(rows, float))
        except ValueError:
            raise ValueError(f"a grid of {name} is no table of numbers: are the metadata whole?") from None
    if angles[0].ndim != 2 or min(angles[0].shape) < 2 or angles[0].shape != angles[1].shape:
        raise ValueError("a grid of angles has not two rows and columns of zenith and azimuth: are the metadata whole?")
    return np.stack(angles)
