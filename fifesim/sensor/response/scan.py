"""
Scans across the track: geometry on a sphere, sweeps of several lines, orbits, and footprints turned against the grid.

The track is a great circle, and a ground point is seen when the instrument is abeam of it. Scan angles are positive to
the right of the flight direction. Geodetic latitudes are used as latitudes on the sphere, with an error of 0.3 % of a
distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array

from fifesim.base.arguments import check_fields
from fifesim.base.arrays import compiled, jitable
from fifesim.base.geometry import check_place

# Mean radius of the earth [m].
EARTH_RADIUS = 6.371e6

# Gravitational parameter of the earth [m3 s-2] and its rotation [rad s-1], WGS 84.
_GRAVITY = 3.986004418e14
_ROTATION = 7.292115e-5


@dataclass(frozen=True)
class Track:
    """
    Ground track of an instrument: a point and a direction.

    Parameters
    ----------
    latitude, longitude : float
        Coordinates of a point on the track. [degree]
    heading : float
        Direction of flight there over the ground, clockwise from north. [degree]

    Raises
    ------
    ValueError
        If the latitude is out of range, or a number is not finite.

    Examples
    --------
    >>> from fifesim.sensor import Track
    >>> Track(latitude=39.1, longitude=-96.6, heading=190.0).heading
    190.0
    """

    latitude: float
    longitude: float
    heading: float

    def __post_init__(self):
        check_fields(self)
        check_place(self.latitude, self.longitude)
        if abs(self.latitude) == 90:
            raise ValueError(f"the latitude of a track must be in (-90, 90) degrees, got {self.latitude}")
        if not np.isfinite(self.heading):
            raise ValueError(f"heading must be finite degrees, got {self.heading}")

    @classmethod
    def from_inclination(
        cls, latitude: float, longitude: float, inclination: float, altitude: float, *, ascending: bool = False
    ) -> Self:
        r"""
        The track of a circular orbit over the turning earth.

        .. math::

            \tan \alpha = \frac{\cos i - (\omega / n) \cos^2 \varphi}{\sqrt{\cos^2 \varphi - \cos^2 i}},
            \qquad n = \sqrt{\mu / (R + h)^3}

        for the ascending half; the descending one has :math:`\pi - \alpha`.

        Parameters
        ----------
        latitude, longitude : float
            Coordinates of a point on the track. [degree]
        inclination : float
            Inclination of the orbit. [degree]
        altitude : float
            [m]
        ascending : bool, optional
            Whether it flies north.

        Returns
        -------
        track : Track

        Raises
        ------
        ValueError
            If the orbit does not reach the latitude.

        References
        ----------
        [Capderou2014]_, chapter 5

        Examples
        --------
        Landsat descends west of south:

        >>> round(Track.from_inclination(39.0, -96.5, 98.2, 705e3).heading, 1)
        193.6
        """
        check_place(latitude, longitude)
        cos_i, cos_phi = np.cos(np.radians(inclination)), np.cos(np.radians(latitude))
        if cos_phi <= abs(cos_i):
            raise ValueError(f"an orbit of inclination {inclination:g} degrees does not reach latitude {latitude:g}")
        mean_motion = np.sqrt(_GRAVITY / (EARTH_RADIUS + altitude) ** 3)
        east = cos_i - _ROTATION / mean_motion * cos_phi**2
        north = np.sqrt(cos_phi**2 - cos_i**2)
        heading = np.degrees(np.arctan2(east, north if ascending else -north))
        return cls(latitude, longitude, float(heading % 360))

    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unit vectors to the point, along the flight and to its right, each of shape (3,)."""
        point, east, north = frame(self.latitude, self.longitude)
        along = np.cos(np.radians(self.heading)) * north + np.sin(np.radians(self.heading)) * east
        return point, along, np.cross(along, point)


def view_from_scan(scan_angle, altitude):
    r"""
    Intersection of a line of sight at a scan angle with the ground.

    .. math:: \sin \theta_v = \frac{R + h}{R} \sin \theta, \qquad \gamma = \theta_v - \theta

    Parameters
    ----------
    scan_angle : array
        From nadir, at the instrument. [degree]
    altitude : float
        [m]

    Returns
    -------
    vza : array
        At the ground, with the sign of the scan angle; NaN where the line misses the earth. [degree]
    central_angle : array
        Between the point and the track, at the earth's centre, with the same sign. [degree]
    """
    sine = (EARTH_RADIUS + altitude) / EARTH_RADIUS * np.sin(np.radians(scan_angle))
    vza = np.degrees(np.arcsin(np.where(np.abs(sine) < 1, sine, np.nan)))
    return vza, vza - scan_angle


def view_from_ground(central_angle, altitude):
    r"""
    View of a point at an angle from the track.

    .. math:: \tan \theta = \frac{R \sin \gamma}{R + h - R \cos \gamma}, \qquad \theta_v = \theta + \gamma

    Parameters
    ----------
    central_angle : array
        Between the point and the track, at the earth's centre, positive to the right. [degree]
    altitude : float
        [m]

    Returns
    -------
    vza, scan_angle : array
        With the sign of the central angle; NaN beyond the instrument's horizon. [degree]
    """
    gamma = np.radians(central_angle)
    orbit = EARTH_RADIUS + altitude
    theta = np.arctan2(EARTH_RADIUS * np.sin(gamma), orbit - EARTH_RADIUS * np.cos(gamma))
    visible = np.cos(gamma) > EARTH_RADIUS / orbit
    scan_angle = np.where(visible, np.degrees(theta), np.nan)
    return scan_angle + central_angle, scan_angle


def growth(scan_angle, altitude):
    r"""
    Growth of a footprint relative to nadir.

    .. math:: \frac{\rho}{h}, \quad \frac{\rho}{h \cos \theta_v}, \qquad \rho = R \, \frac{\sin \gamma}{\sin \theta}

    Parameters
    ----------
    scan_angle : array
        From nadir, at the instrument. [degree]
    altitude : float
        [m]

    Returns
    -------
    along, across : array
        Along and across the track. [1]
    """
    vza, _ = view_from_scan(scan_angle, altitude)
    mu_v = np.cos(np.radians(vza))
    orbit = EARTH_RADIUS + altitude
    # The difference of two legs, which stays defined at nadir.
    slant = orbit * np.cos(np.radians(scan_angle)) - EARTH_RADIUS * mu_v
    return slant / altitude, slant / altitude / mu_v


def ground_of_detector(track_angle, scan_angle, altitude):
    r"""
    Ground point that a detector sees whose line of sight leaves the plane of the scan.

    .. math::

        u &= (\cos \beta \cos \theta, \; \cos \beta \sin \theta, \; \sin \beta) \\
        \rho &= (R + h) u_1 - \sqrt{R^2 - (R + h)^2 (1 - u_1^2)}

    with the components of the line of sight u downward, to the right and forward, and its length :math:`\rho` to the
    ground. Lines that are swept together therefore move apart toward the ends of the scan (bow-tie).

    Parameters
    ----------
    track_angle : array
        Angle beta of the line of sight forward of the plane of the scan. [degree]
    scan_angle : array
        Angle theta within that plane, from nadir. [degree]
    altitude : float
        [m]

    Returns
    -------
    distance : array
        Along the track, forward of the point below the instrument. [m]
    central_angle : array
        Between the point and the track, at the earth's centre, with the sign of the scan angle. [degree]

    References
    ----------
    [Ichoku2005]_ gives the sizes of pixels for small beta
    """
    beta, theta = np.radians(track_angle), np.radians(scan_angle)
    down, right, forward = np.cos(beta) * np.cos(theta), np.cos(beta) * np.sin(theta), np.sin(beta)
    orbit = EARTH_RADIUS + altitude
    square = EARTH_RADIUS**2 - orbit**2 * (1 - down**2)
    slant = orbit * down - np.sqrt(np.where(square >= 0, square, np.nan))
    distance = EARTH_RADIUS * np.arctan2(slant * forward, orbit - slant * down)
    return distance, np.degrees(np.arcsin(slant * right / EARTH_RADIUS))


class Zone(NamedTuple):
    """Zone of a scan on one side of nadir: samples of a line, elementary samples in each, lines deleted at each end."""

    samples: int
    aggregation: int
    deleted: int


@dataclass(frozen=True)
class ScanPattern:
    """
    Lines and samples that an instrument takes in one sweep across the track.

    Samples count from nadir, to the left with negative numbers; sample n has its centre at position n + 1/2.
    """

    track_interval: float  # angle between lines along the track [rad]
    scan_interval: float  # angle between elementary samples across it [rad]
    lines: int = 1  # that are swept together
    zones: tuple[Zone, ...] = ()  # from nadir outward on either side; by default each sample is elementary

    def track_angle(self):
        """Angles of the lines forward of the plane of the scan, shape (lines,). [degree]"""
        return np.degrees((np.arange(self.lines) - (self.lines - 1) / 2) * self.track_interval)

    def scan_angle(self, position):
        """Scan angle at a position on the line, which counts samples from nadir. [degree]"""
        if not self.zones:
            return np.degrees(np.asarray(position) * self.scan_interval)
        positions, angles = self._limits()
        return np.sign(position) * np.interp(np.abs(position), positions, angles)

    def position(self, scan_angle):
        """Position on the line at a scan angle, the inverse of `scan_angle`; the ends of the line beyond them. [1]"""
        if not self.zones:
            return np.radians(scan_angle) / self.scan_interval
        positions, angles = self._limits()
        return np.sign(scan_angle) * np.interp(np.abs(scan_angle), angles, positions)

    def _limits(self):
        """Limits of the zones as positions on the line and as scan angles [degree]."""
        samples = np.array([zone.samples for zone in self.zones])
        sums = np.array([zone.aggregation for zone in self.zones])
        edges = [np.concatenate([[0], np.cumsum(each)]) for each in (samples, samples * sums)]
        return edges[0], np.degrees(edges[1] * self.scan_interval)

    def zone_of(self, sample):
        """Number of the zone that samples lie in, 0 at nadir."""
        if not self.zones:
            return np.zeros(np.shape(sample), int)
        limits = self._limits()[0][1:-1]
        return np.searchsorted(limits, np.abs(np.asarray(sample) + 0.5))

    def is_deleted(self, line, sample):
        """Whether the instrument deletes lines of the image at samples, because the next sweep sees the same ground."""
        if not self.zones:
            return np.zeros(np.broadcast_shapes(np.shape(line), np.shape(sample)), bool)
        deleted = np.array([zone.deleted for zone in self.zones])[self.zone_of(sample)]
        detector = np.asarray(line) % self.lines
        return np.minimum(detector, self.lines - 1 - detector) < deleted


def swath_width(altitude, max_angle):
    r"""
    Width of the swath along the sphere.

    .. math:: s = 2 R \gamma

    Parameters
    ----------
    altitude : float
        Altitude of the instrument. [m]
    max_angle : float
        Largest scan angle from nadir. [degree]

    Returns
    -------
    width : float
        NaN where the line of sight misses the earth. [m]
    """
    return float(2 * EARTH_RADIUS * np.radians(view_from_scan(max_angle, altitude)[1]))


def place_beside(track, latitude, longitude):
    """Distance along a track [m] and central angle from it, positive to the right [degree], of points."""
    point, along, right = track.axes()
    there = frame(latitude, longitude)[0]
    distance = EARTH_RADIUS * np.arctan2(there @ along, there @ point)
    return distance, np.degrees(np.arcsin(np.clip(there @ right, -1, 1)))


def place_of(track, distance, central_angle):
    """Latitude and longitude of points in the frame of a track, the inverse of `place_beside`. [degree]"""
    point, along, right = track.axes()
    turn, aside = np.asarray(distance)[..., None] / EARTH_RADIUS, np.radians(central_angle)[..., None]
    there = np.cos(aside) * (np.cos(turn) * point + np.sin(turn) * along) + np.sin(aside) * right
    x, y, z = np.moveaxis(there, -1, 0)
    return np.degrees(np.arcsin(np.clip(z, -1, 1))), np.degrees(np.arctan2(y, x))


def view_components(track, latitude, longitude, altitude):
    r"""
    Horizontal components of the unit vector from the ground to the sensor.

    They are smooth where the track is crossed, while the azimuth turns round.

    .. math:: e = \sin \theta_v \sin \varphi_v, \qquad n = \sin \theta_v \cos \varphi_v

    Parameters
    ----------
    track : Track
    latitude, longitude : array
        [degree]
    altitude : float
        Altitude of the sensor. [m]

    Returns
    -------
    east, north : array
        NaN beyond the instrument's horizon. [1]
    """
    _, _, right = track.axes()
    there, to_east, to_north = frame(latitude, longitude)
    sine = there @ right
    vza, _ = view_from_ground(np.degrees(np.arcsin(np.clip(sine, -1, 1))), altitude)
    # Horizontal component of `right`, normalized to unit length.
    length = np.sin(np.radians(vza)) / np.sqrt(1 - sine**2)
    return -length * (to_east @ right), -length * (to_north @ right)


def frame(latitude, longitude):
    """Unit vectors up, east and north at points of the sphere, shape (..., 3)."""
    phi, lam = np.radians(latitude), np.radians(longitude)
    phi, lam = np.broadcast_arrays(phi, lam)
    up = np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)], axis=-1)
    east = np.stack([-np.sin(lam), np.cos(lam), np.zeros_like(lam)], axis=-1)
    return up, east, np.cross(up, east)


# Orbit of Landsat 4 to 9: inclination [degree], altitude [m], and the rows of the Worldwide Reference System 2, counted
# along the orbit so that row 60 lies where it crosses the equator southward.
_INCLINATION, _ALTITUDE = 98.2, 705e3
ROWS, _EQUATOR = 248, 60


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

    Notes
    -----
    The orbit is circular and the Earth is a sphere, which costs 0.1 degree of the zenith angle. The azimuth is accurate
    within 1 degree between 60 degrees south and north.

    References
    ----------
    USGS, Landsat 8-9 Collection 2 Level-2 data format control book (LSDS-1328), ROLL_ANGLE: the description that Google
    Earth Engine repeats for the collection LANDSAT/LC08/C02/T1_L2. Scene LC08_L2SP_017036_20130419 agrees: at a roll of
    -11.7 degrees on the descending path 17, its centre lies 148 km west of the track, near path 18.
    """
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


DAY = 86400.0  # [s]


class Orbit(NamedTuple):
    """Nominal circular orbit whose plane follows the mean sun."""

    per_day: float  # revolutions [1]
    crossing: float  # mean local solar time of the stated node [h]
    ascending: bool  # whether this node is the ascending one
    inclination: float  # [degree]
    altitude: float  # [m]


def ground_track(orbit, seconds):
    r"""
    Place below a satellite at times since a passage of its ascending node over the prime meridian.

    .. math::

        \sin \varphi = \sin i \sin u, \qquad
        \lambda = \mathrm{atan2}(\cos i \sin u, \cos u) - 360° \, t / 1\,\mathrm{d}

    Parameters
    ----------
    orbit : Orbit
    seconds : array
        :math:`t`, with the argument of latitude :math:`u = 360° \, n t`. [s]

    Returns
    -------
    latitude, longitude : array, shape of seconds
        On a sphere. [degree]

    Notes
    -----
    Seen from the plane of a sun-synchronous orbit, the Earth turns once in a mean solar day.

    References
    ----------
    [Capderou2014]_, chapter 5
    """
    argument, inclination = 2 * np.pi * orbit.per_day * np.asarray(seconds, float) / DAY, np.radians(orbit.inclination)
    latitude = np.arcsin(np.sin(inclination) * np.sin(argument))
    turned = np.arctan2(np.cos(inclination) * np.sin(argument), np.cos(argument))
    longitude = np.degrees(turned) - 360 * np.asarray(seconds, float) / DAY
    return np.degrees(latitude), (longitude + 180) % 360 - 180


def passes(orbit, first, last, latitude, longitude, max_angle):
    """
    Closest approaches of a satellite to a place, within the swath.

    Parameters
    ----------
    orbit : Orbit
    first, last : float
        Time span, since a midnight in UTC at which a revolution begins. [s]
    latitude, longitude : float
        Place. [degree]
    max_angle : float
        Largest scan angle. [degree]

    Returns
    -------
    seconds, vza, vaa : array, shape (passes,)
        Times since this midnight [s], and view zenith and azimuth toward the satellite, clockwise from north [degree].
    ascending : array of bool, shape (passes,)

    Notes
    -----
    At the midnight the satellite is at its ascending node, at the longitude of the node's mean solar time.

    References
    ----------
    [Capderou2014]_, chapter 5
    """
    node = (orbit.crossing + (0 if orbit.ascending else 12)) * 15  # solar time of the ascending node [degree]
    samples = np.arange(first - 20.0, last + 40.0, 20.0)
    near = _closeness(orbit, node, samples, latitude, longitude)
    peak = np.flatnonzero((near[1:-1] >= near[:-2]) & (near[1:-1] > near[2:])) + 1
    # The cosine of the distance is a parabola at its maximum.
    left, middle, right = near[peak - 1], near[peak], near[peak + 1]
    seconds = samples[peak] + 20 * 0.5 * (left - right) / (left - 2 * middle + right)
    below = _below(orbit, node, seconds)
    toward = np.radians(np.array([latitude, longitude]))
    angle = np.arccos(np.clip(_closeness(orbit, node, seconds, latitude, longitude), -1, 1))
    scan = np.arctan2(EARTH_RADIUS * np.sin(angle), EARTH_RADIUS * (1 - np.cos(angle)) + orbit.altitude)
    lat, lon = np.radians(below)
    east = np.sin(lon - toward[1]) * np.cos(lat)
    north = np.cos(toward[0]) * np.sin(lat) - np.sin(toward[0]) * np.cos(lat) * np.cos(lon - toward[1])
    visible = (scan <= np.radians(max_angle)) & (angle < np.pi / 2) & (seconds >= first) & (seconds <= last)
    rising = np.cos(2 * np.pi * orbit.per_day * seconds / DAY) > 0
    found = seconds, np.degrees(scan + angle), np.degrees(np.arctan2(east, north)) % 360, rising
    return tuple(each[visible] for each in found)


def _below(orbit, node, seconds):
    """Latitude and longitude below the satellite, whose plane has the node at a solar time [degree]."""
    latitude, longitude = ground_track(orbit, seconds)
    return latitude, longitude + node


def _closeness(orbit, node, seconds, latitude, longitude):
    """Cosine of the distance of a place from the point below the satellite. [1]"""
    lat, lon = np.radians(_below(orbit, node, seconds))
    place = np.radians([latitude, longitude])
    return np.sin(place[0]) * np.sin(lat) + np.cos(place[0]) * np.cos(lat) * np.cos(lon - place[1])


# A cell is cut until its pieces are this share of the narrower response.
_PIECE = 1 / 16

# Nodes of the tabulated responses.
_NODES = 4097


@dataclass(frozen=True, eq=False)
class Footprints:
    """Pixels on a grid of cells: centres, and the steps of a cell in the frame of each."""

    row: np.ndarray  # of the centre, from the upper left corner of the grid, shape (..., n_pixels) [cell]
    column: np.ndarray
    # A step of a row and of a column (last axis) along and across the track, divided by the growth of the footprint.
    frame: np.ndarray  # shape (..., n_pixels, 2, 2) [m]
    along: object  # line spread functions at nadir
    across: object

    def reach(self):
        """Half height and half width of the bounding box of each footprint, shape (n_pixels,). [cell]"""
        back = np.linalg.inv(self.frame)
        half = np.array([self.along.half_width, self.across.half_width])
        # Pieces that touch the footprint from outside also have a weight.
        return np.moveaxis(np.abs(back) @ half, -1, 0) + 1

    def window(self, shape):
        """Rows and columns of the cells that the footprints touch, at least one of each."""
        half_row, half_column = self.reach()
        return _touched(self.row, half_row, shape[0]), _touched(self.column, half_column, shape[1])

    def __getitem__(self, pixels):
        """Footprints of some of the pixels, flattened."""
        frame = self.frame[pixels].reshape(-1, 2, 2)
        return Footprints(self.row[pixels].ravel(), self.column[pixels].ravel(), frame, self.along, self.across)


def footprint_operator(footprints, rows, columns):
    r"""
    Weights of the cells of a window in rotated footprints.

    .. math::

        w_{ij} \propto \sum_k
            &\left[ C_\mathrm{along}(u + \tfrac{a}{2}) - C_\mathrm{along}(u - \tfrac{a}{2}) \right] \\
            \cdot &\left[ C_\mathrm{across}(v + \tfrac{b}{2}) - C_\mathrm{across}(v - \tfrac{b}{2}) \right]

    over pieces k of cell j, which lie at u along and v across the track from the centre of pixel i. A piece stands for
    an upright rectangle of sides a and b with the second moments of the piece; on a grid along the track that is exact.

    Parameters
    ----------
    footprints : Footprints
        On one axis.
    rows, columns : slice
        Window of the grid; parts of footprints outside of it are lost.

    Returns
    -------
    operator : scipy.sparse.csr_array, shape (n_pixels, n_cells)
        Cells of the window row by row. A row sums to the share of the footprint that lies in the window.

    References
    ----------
    [Friedl1995]_, Eq. 3, the sensor's part
    """
    along, across = _table(footprints.along), _table(footprints.across)
    step = np.sqrt(np.abs(np.linalg.det(footprints.frame)))
    pieces = np.clip(np.ceil(step / (_PIECE * min(along.width, across.width))), 1, 64).astype(np.int64)
    half_row, half_column = footprints.reach()
    boxes = footprints.row, footprints.column, footprints.frame, half_row, half_column, pieces
    limit = np.sum((2 * half_row + 3).astype(np.int64) * (2 * half_column + 3).astype(np.int64))
    pointers = np.zeros(footprints.row.size + 1, np.int64)
    indices, weights = np.empty(limit, np.int64), np.empty(limit)
    window = np.array([rows.start, rows.stop, columns.start, columns.stop])
    used = _fill(boxes, along, across, window, pointers, indices, weights)
    shape = footprints.row.size, (rows.stop - rows.start) * (columns.stop - columns.start)
    return csr_array((weights[:used].copy(), indices[:used].copy(), pointers), shape=shape)


def apply_operator(operator, values, min_valid):
    """Means over the valid cells of footprints, NaN below ``min_valid``, shape (..., n_pixels)."""
    values = np.asarray(values, float)
    flat = values.reshape(-1, values.shape[-1])
    out = np.empty((flat.shape[0], operator.shape[0]))
    for layer, cells in enumerate(flat):
        valid = ~np.isnan(cells)
        share = operator @ valid.astype(float)
        total = operator @ np.where(valid, cells, 0.0)
        enough = (share > 0) & (share >= min_valid - 1e-9)
        out[layer] = np.where(enough, total / np.where(enough, share, 1.0), np.nan)
    return out.reshape(*values.shape[:-1], operator.shape[0])


def _touched(center, half, size):
    """Range of cells along an axis that boxes touch."""
    first = int(np.clip(np.floor(np.min(center - half)), 0, size - 1))
    return slice(first, int(np.clip(np.ceil(np.max(center + half)), first + 1, size)))


class _Table(NamedTuple):
    """Cumulative line spread function at even nodes, their half width, and their number per metre."""

    cumulative: np.ndarray
    half: float
    scale: float

    @property
    def width(self):
        """Width of a boxcar with the peak of the response. [m]"""
        return 2 * self.half / (self.cumulative.size - 1) / np.diff(self.cumulative).max()


def _table(spread):
    half = spread.half_width
    return _Table(spread.cumulative(np.linspace(-half, half, _NODES)), half, (_NODES - 1) / (2 * half))


@compiled
def _cumulative(table, x):
    place = min(max((x + table.half) * table.scale, 0.0), table.cumulative.size - 1.0)
    index = min(int(place), table.cumulative.size - 2)
    share = place - index
    return table.cumulative[index] * (1 - share) + table.cumulative[index + 1] * share


@compiled
def _share(table, x, reach):
    return _cumulative(table, x + reach) - _cumulative(table, x - reach)


@jitable
def _in_frame(frame, down, right):
    return frame[0, 0] * down + frame[0, 1] * right, frame[1, 0] * down + frame[1, 1] * right


@compiled
def _cell_weight(i, j, row, column, frame, n, a, b, along, across):
    # Most cells of the box lie outside the rotated footprint.
    u, v = _in_frame(frame, i + 0.5 - row, j + 0.5 - column)
    if abs(u) > along.half + 2 * n * a or abs(v) > across.half + 2 * n * b:
        return 0.0
    piece = 1.0 / n
    weight = 0.0
    for k in range(n):
        down = i + (k + 0.5) * piece - row
        for m in range(n):
            u, v = _in_frame(frame, down, j + (m + 0.5) * piece - column)
            if abs(u) < along.half + a and abs(v) < across.half + b:
                weight += _share(along, u, a) * _share(across, v, b)
    return weight


@compiled
def _fill(boxes, along, across, window, pointers, indices, weights):
    used = 0
    top, bottom, left, right = window
    # Half the box around each pixel, and into how many pieces a side of a cell is cut.
    rows, columns, frames, half_rows, half_columns, pieces = boxes
    for pixel in range(rows.size):
        start, total = used, 0.0
        row, column, frame, n = rows[pixel], columns[pixel], frames[pixel], pieces[pixel]
        half_row, half_column = half_rows[pixel], half_columns[pixel]
        # Half sides of a piece.
        a = np.hypot(frame[0, 0], frame[0, 1]) / (2 * n)
        b = np.hypot(frame[1, 0], frame[1, 1]) / (2 * n)
        for i in range(int(np.floor(row - half_row)), int(np.ceil(row + half_row))):
            for j in range(int(np.floor(column - half_column)), int(np.ceil(column + half_column))):
                weight = _cell_weight(i, j, row, column, frame, n, a, b, along, across)
                total += weight
                if weight != 0 and top <= i < bottom and left <= j < right:
                    indices[used] = (i - top) * (right - left) + j - left
                    weights[used] = weight
                    used += 1
        for k in range(start, used):
            weights[k] /= total
        pointers[pixel + 1] = used
    return used
