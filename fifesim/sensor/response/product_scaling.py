"""Calibration of digital numbers that agencies scale by reflectance."""

import numpy as np

from fifesim.sensor.response.calibration import reflectance_to_radiance


def product_gain_offset(gain, offset, solar_irradiance, mu_s, earth_sun_distance=1.0):
    r"""
    Gain and offset in radiance of digital numbers that are scaled by reflectance.

    .. math:: L = \frac{E_s \, \mu_s}{\pi \, d^2} \, (g \, DN + o)

    Parameters
    ----------
    gain, offset : float
        Reflectance of one count and of digital number 0. [1]
    solar_irradiance : array
        Extraterrestrial, at one astronomical unit, by band. [W m-2 um-1]
    mu_s : float
        Cosine of the solar zenith angle that the reflectance has divided out; 1 where it has not. [1]
    earth_sun_distance : float, optional
        [astronomical unit]

    Returns
    -------
    gain, offset : array
        Radiance of one count and of digital number 0. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the irradiance, ``mu_s`` or the distance is not positive.

    References
    ----------
    USGS, Landsat 8-9 Collection 2 Level-1 data format control book (LSDS-1822); ESA, Sentinel-2 products specification
    document (S2-PDGS-TAS-DI-PSD); [Chander2009]_, Eq. 2

    Examples
    --------
    >>> gain, offset = product_gain_offset(1e-4, -0.1, np.pi, 0.5)
    >>> round(float(gain) * 3000 + float(offset), 12)
    0.1
    """
    radiances = [reflectance_to_radiance(each, solar_irradiance, mu_s, earth_sun_distance) for each in (gain, offset)]
    return np.asarray(radiances[0]), np.asarray(radiances[1])
