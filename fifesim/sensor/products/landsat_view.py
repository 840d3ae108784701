"""View of a Landsat scene that was acquired off nadir."""

import numpy as np

from fifesim.sensor.products.metadata_checks import CURE
from fifesim.sensor.scan.track import Track, place_of, view_components, view_from_scan

# Orbit of Landsat 4 to 9: inclination [degree], altitude [m], and the rows of the Worldwide Reference System 2, counted
# along the orbit so that row 60 lies where it crosses the equator southward.
_INCLINATION, _ALTITUDE = 98.2, 705e3
ROWS, _EQUATOR = 248, 60

# Largest roll that Landsat 8 and 9 fly is 15 degrees.
_LARGEST_ROLL = 20.0


def view_of_roll(roll, row):
    r"""
    View of a Landsat scene that was acquired off nadir.

    Row r of the Worldwide Reference System 2 lies at the angle u along the orbit, at the latitude :math:`\varphi`:

    .. math:: u = 360 \frac{r - 60}{248}, \qquad \sin \varphi = -\sin i \, \sin u

    Parameters
    ----------
    roll : float
        ROLL_ANGLE of the metadata, about the direction of the ground track by the right-hand rule: positive looks to
        the left of the track, negative to the right. [degree]
    row : int
        WRS_ROW of the metadata, 1 to 248; rows 123 to 245 are ascending.

    Returns
    -------
    vza, vaa : float
        View zenith and azimuth angles at the scene centre; the azimuth points toward the sensor. [degree]

    Raises
    ------
    ValueError
        If no Landsat rolls so far.

    Notes
    -----
    The orbit is circular and the Earth is a sphere, which costs 0.1 degree of the zenith angle. The azimuth is accurate
    within 1 degree between 60 degrees south and north.

    References
    ----------
    USGS, Landsat 8-9 Collection 2 Level-2 data format control book (LSDS-1328), ROLL_ANGLE: the description that Google
    Earth Engine repeats for the collection LANDSAT/LC08/C02/T1_L2. Scene LC08_L2SP_017036_20130419 agrees: at a roll of
    -11.7 degrees on the descending path 17, its centre lies 148 km west of the track, near path 18.

    Examples
    --------
    A descending pass that looks to its right, the west, is seen from the east-southeast:

    >>> [round(angle, 1) for angle in view_of_roll(-11.696, 36)]
    [13.0, 102.2]
    """
    if not abs(roll) <= _LARGEST_ROLL:
        raise ValueError(f"ROLL_ANGLE must be in [-{_LARGEST_ROLL:g}, {_LARGEST_ROLL:g}] degrees, got {roll:g}: {CURE}")
    turn = np.radians(360.0 * (row - _EQUATOR) / ROWS)
    latitude = np.degrees(np.arcsin(-np.sin(np.radians(_INCLINATION)) * np.sin(turn)))
    # At its turning points the orbit touches the highest latitude, where the track has no second solution.
    highest = 180.0 - _INCLINATION - 1e-6
    track = Track.from_inclination(
        float(np.clip(latitude, -highest, highest)), 0.0, _INCLINATION, _ALTITUDE, ascending=bool(np.cos(turn) < 0)
    )
    # Scan angles are positive to the right, rolls to the left.
    _, central_angle = view_from_scan(-roll, _ALTITUDE)
    east, north = view_components(track, *place_of(track, 0.0, central_angle), _ALTITUDE)
    vza = np.degrees(np.arcsin(np.hypot(east, north)))
    return float(vza), float(np.degrees(np.arctan2(east, north)) % 360.0)
