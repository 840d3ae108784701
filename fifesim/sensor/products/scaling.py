"""How agencies scale the digital numbers of their products: counts of reflectance, and angles of sun and sensor."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage


@dataclass(frozen=True)
class ProductBand:
    """
    A band of a product.

    Parameters
    ----------
    name : str
        Name of the instrument's band, such as ``"TM3"``.
    file : str
        Path below the folder of the metadata.
    gain, offset : float
        Reflectance of one count and of digital number 0. [1]
    largest : int
        Digital number of saturation.
    solar_irradiance : float or None
        Extraterrestrial, at one astronomical unit, by which the product is scaled; None where it is not said.
        [W m-2 um-1]
    flag : int, optional
        Bit of the raster of saturation that stands for the band; 0 where it has none.
    """

    name: str
    file: str
    gain: float
    offset: float
    largest: int
    solar_irradiance: float | None
    flag: int = 0


def product_reflectance(dn, gain, offset, largest, flag=0, flags=0, mu_s=1.0):
    r"""
    Reflectance of a product's digital numbers.

    .. math:: \rho = \frac{g \, DN + o}{\mu_s}

    Parameters
    ----------
    dn : array of unsigned integers
        0 is no data. [1]
    gain, offset : array, broadcastable
        Reflectance of one count and of digital number 0. [1]
    largest : array, broadcastable
        Digital number of what is saturated. [1]
    flag : array of unsigned integers, broadcastable, optional
        Bit that says in ``flags`` that the band is saturated.
    flags : array of unsigned integers, broadcastable, optional
    mu_s : array, broadcastable, optional
        Cosine of the solar zenith angle, where the product has it still in its reflectance. [1]

    Returns
    -------
    reflectance : array of float32
        NaN where there are no data, where the band is saturated, and where the sun is down. [1]

    References
    ----------
    USGS, Landsat 8-9 Collection 2 Level-1 data format control book (LSDS-1822), and Using the USGS Landsat Level-1
    data product; ESA, Sentinel-2 products specification document (S2-PDGS-TAS-DI-PSD), radiometric offset

    Examples
    --------
    >>> product_reflectance([0, 10000, 65535], 2e-5, -0.1, 65535, mu_s=0.5).astype(float).round(6).tolist()
    [nan, 0.2, nan]
    """
    dn = np.asarray(dn)
    usable = (dn != 0) & (dn < largest) & (np.bitwise_and(flags, flag) == 0)
    mu_s = np.where(np.asarray(mu_s) > 0, mu_s, np.nan)
    return np.where(usable, (dn * np.asarray(gain, float) + offset) / mu_s, np.nan).astype(np.float32)


def mask_bits(*masks):
    """
    Masks as the bits of one number, the first one as bit 0.

    Parameters
    ----------
    *masks : array of integers
        Not 0 where a mask holds.

    Returns
    -------
    bits : array of uint8

    Examples
    --------
    >>> mask_bits([0, 1, 0], [0, 1, 0], [0, 0, 1]).tolist()
    [0, 3, 4]
    """
    return sum((np.asarray(mask) != 0).astype(np.uint8) << bit for bit, mask in enumerate(masks)).astype(np.uint8)


def hundredths(angle, fill, turns=False):
    """
    Angle from whole hundredths of a degree.

    Parameters
    ----------
    angle : array of integers
        [0.01 degree]
    fill : array of bool
        Where there are no data.
    turns : bool, optional
        Whether it is an azimuth, which is then given from 0 to 360.

    Returns
    -------
    angle : array
        NaN where there are no data. [degree]

    Examples
    --------
    >>> hundredths([2850, -6150], [False, False], turns=True).tolist()
    [28.5, 298.5]
    """
    degrees = np.asarray(angle) / 100.0
    return np.where(fill, np.nan, degrees % 360.0 if turns else degrees)


def direction_vectors(zenith, azimuth):
    """
    Unit vectors toward directions.

    Parameters
    ----------
    zenith, azimuth : array
        [degree]

    Returns
    -------
    vectors : array, shape (3, ...)
        Toward north, east and the zenith. [1]

    Examples
    --------
    >>> direction_vectors(90.0, 90.0).round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return np.stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])


def direction_angles(vectors):
    """
    Directions of vectors, of whatever length.

    Parameters
    ----------
    vectors : array, shape (3, ...)
        Toward north, east and the zenith.

    Returns
    -------
    zenith, azimuth : array
        The azimuth from 0 to 360. [degree]

    Examples
    --------
    >>> [round(float(angle), 9) for angle in direction_angles(direction_vectors(30.0, 350.0))]
    [30.0, 350.0]
    """
    north, east, up = vectors
    return np.degrees(np.arctan2(np.hypot(north, east), up)), np.degrees(np.arctan2(east, north)) % 360.0


def mean_direction(zenith, azimuth):
    """
    Mean of some directions.

    Parameters
    ----------
    zenith, azimuth : array, shape (n, ...)
        NaN where one is not known. [degree]

    Returns
    -------
    vectors : array, shape (3, ...)
        Its vector; NaN where none is known. [1]

    Examples
    --------
    Azimuths on both sides of north have their mean in the north:

    >>> zenith, azimuth = direction_angles(mean_direction([8.0, 8.0], [350.0, 10.0]))
    >>> round(float(azimuth), 9) % 360
    0.0
    """
    vectors = direction_vectors(zenith, azimuth)
    known = np.isfinite(vectors).all(axis=0)
    total, count = np.where(known, vectors, 0.0).sum(axis=1), known.sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def filled(vectors):
    """
    Vectors on a coarse grid, with the nearest one where none is known.

    Parameters
    ----------
    vectors : array, shape (3, n, m)

    Returns
    -------
    vectors : array, shape (3, n, m)

    Raises
    ------
    ValueError
        If none is known.
    """
    missing = ~np.isfinite(vectors).all(axis=0)
    if missing.all():
        raise ValueError("the metadata have no direction of the view: open it with angles='centre'")
    nearest = ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    return vectors[:, *nearest]


def between_nodes(vectors, rows, columns):
    """
    Directions between the nodes of a coarse grid, by bilinear interpolation of their vectors.

    Parameters
    ----------
    vectors : array, shape (3, n, m)
        At nodes 0 to n - 1 and 0 to m - 1, without gaps.
    rows : array, shape (r,)
        Places in nodes from the first; beyond the last, as at the last. [node]
    columns : array, shape (c,)
        [node]

    Returns
    -------
    zenith, azimuth : array, shape (r, c)
        [degree]

    Examples
    --------
    >>> vectors = direction_vectors([[20.0, 20.0], [20.0, 20.0]], [[350.0, 10.0], [350.0, 10.0]])
    >>> round(float(between_nodes(vectors, [0.5], [0.5])[1][0, 0]), 9) % 360
    0.0
    """
    i, down = _nodes(rows, vectors.shape[1])
    j, right = _nodes(columns, vectors.shape[2])
    across = vectors[:, :, j] * (1 - right) + vectors[:, :, j + 1] * right
    down = down[:, None]
    return direction_angles([part[i] * (1 - down) + part[i + 1] * down for part in across])


def _nodes(places, count):
    """The node before each place, and the share of the one after."""
    places = np.clip(np.asarray(places, float), 0, count - 1)
    before = np.minimum(places.astype(int), count - 2)
    return before, places - before
