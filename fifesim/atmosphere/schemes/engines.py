"""The engines by which light goes through the atmosphere, behind one function."""

from functools import lru_cache, partial

import numpy as np

from fifesim.atmosphere.air import aerosols
from fifesim.atmosphere.schemes import six_s
from fifesim.atmosphere.schemes.five_s import five_s_scattering
from fifesim.atmosphere.schemes.mixed_air import mixed_scattering
from fifesim.atmosphere.schemes.terms import BandTerms, band_means, nodes_of

LARGEST_ZENITH = 75.0  # the plane-parallel atmosphere holds to here [degree]

SCATTERING = {
    "5S": five_s_scattering,
    "successive-orders": mixed_scattering,
    "successive-orders-scalar": partial(mixed_scattering, polarized=False),
}


def band_terms(atmosphere, bands, sza, vza, raa, *, each=iter):
    """
    What the atmosphere does in each band, by its engine.

    Parameters
    ----------
    atmosphere : models.Atmosphere
    bands : sequence of Band, length (band,)
        Within 0.4 to 2.5 um.
    sza, vza : float
        0 to 75. [degree]
    raa : float
        0 has sun and sensor on the same side. [degree]
    each : callable, optional
        Goes through the runs of 6S, one for each band, such as with a progress bar.

    Returns
    -------
    terms : BandTerms
        Read-only arrays of shape (band,). [1]

    Raises
    ------
    ImportError
        If the engine is 6S and not installed.
    ValueError
        If a zenith angle is out of range, or a band reaches beyond the gas table or the aerosol's own.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> from fifesim.atmosphere.air.models import Atmosphere
    >>> from fifesim.base.bands import Band
    >>> blue, red = Band("blue", (0.45, 0.5), (1, 1)), Band("red", (0.62, 0.67), (1, 1))
    >>> terms = band_terms(Atmosphere(), (blue, red), 30.0, 0.0, 0.0)
    >>> bool(terms.path_reflectance[0] > terms.path_reflectance[1])
    True
    """
    check_zenith("sza", sza)
    check_zenith("vza", vza)
    if atmosphere.engine == "6S":
        return six_s.band_terms(atmosphere, bands, sza, vza, raa, each=each)
    return _band_terms(atmosphere, tuple(bands), float(sza), float(vza), float(raa))


def check_zenith(name, angle):
    """
    Refuse a zenith angle for which no engine holds.

    Parameters
    ----------
    name : str
        Of the angle, "sza" or "vza".
    angle : float
        [degree]

    Raises
    ------
    ValueError
        If it is below 0 or above 75 degrees, or no number.
    """
    if not 0 <= angle <= LARGEST_ZENITH:
        raise ValueError(
            f"{name} must be from 0 to {LARGEST_ZENITH:g} degrees, got {angle:g}: "
            "the plane-parallel atmosphere does not hold below"
        )


def check_aerosol(atmosphere, what, low, high):
    """
    Refuse wavelengths that the tables of an aerosol of one's own do not hold.

    Parameters
    ----------
    atmosphere : models.Atmosphere
    what : str
        Spans them.
    low, high : float
        [um]

    Raises
    ------
    ValueError
        If the tables begin or end inside them.
    """
    own = atmosphere.aot > 0 and not isinstance(atmosphere.aerosol, str)
    if own and not aerosols.covers(atmosphere.aerosol, low, high):
        first, last = aerosols.limits(atmosphere.aerosol)
        raise ValueError(
            f"{what} must lie within the wavelengths of the aerosol {atmosphere.aerosol}, {first:g} to {last:g} um, "
            f"got {low:g} to {high:g} um: add wavelengths to its tables, or choose other bands"
        )


def terms_at(atmosphere, bands, sza, vza, raa):
    """
    What the atmosphere does in each band for one sun and several views.

    Parameters
    ----------
    atmosphere : models.Atmosphere
    bands : tuple of Band
    sza : float
    vza, raa : array, shape (V,) and (R,)
        [degree]

    Returns
    -------
    terms : BandTerms
        Shapes (V or 1, R or 1, band). [1]

    Raises
    ------
    ValueError
        If a band reaches beyond the aerosol's wavelengths, or the gas table.
    """
    for band in bands:
        check_aerosol(atmosphere, f"band {band.name}", *band.limits)
    nodes = nodes_of(bands)
    return band_means(scattering(atmosphere, nodes, sza, vza, raa), nodes, atmosphere, bands, sza, vza)


def scattering(atmosphere, wavelength, sza, vza, raa):
    """
    What scattering does at some wavelengths, by the engine of the atmosphere.

    Parameters
    ----------
    atmosphere : models.Atmosphere
    wavelength : array, shape (n,)
        [um]
    sza : float
    vza, raa : array, shape (V,) and (R,)
        raa of 0 has sun and sensor on the same side. [degree]

    Returns
    -------
    scattering : terms.Scattering

    Raises
    ------
    ValueError
        If the engine is 6S, which knows whole bands only.
    """
    if atmosphere.engine not in SCATTERING:
        raise ValueError(f"engine must be one of {', '.join(SCATTERING)} here, got {atmosphere.engine!r}")
    return SCATTERING[atmosphere.engine](atmosphere, wavelength, sza, vza, raa)


@lru_cache(maxsize=256)
def _band_terms(atmosphere, bands, sza, vza, raa):
    found = terms_at(atmosphere, bands, sza, np.array([vza]), np.array([raa]))
    terms = BandTerms(*(values.squeeze((0, 1)) for values in found))
    for values in terms:
        values.flags.writeable = False
    return terms
