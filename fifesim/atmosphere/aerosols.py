"""Amount and optics of the aerosol."""

from functools import lru_cache

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from fifesim import datasets

MODELS = ("continental",)

# Extinction per particle at 0.55 um with which the number profiles give the visibility at the ground. [km-1 cm3]
_EXTINCTION_PER_PARTICLE = 5.6032e-5


def aerosol_optical_thickness(visibility):
    r"""
    Aerosol optical thickness at 0.55 um of the whole atmosphere.

    .. math::

        \tau = \sigma \sum_i \sqrt{N_i N_{i+1}} \, \Delta z_i, \qquad N(z, V) = \frac{a(z)}{V} + b(z)

    Parameters
    ----------
    visibility : float
        Meteorological range at the ground, :math:`V`. [km]

    Returns
    -------
    aot : float
        [1]

    Notes
    -----
    :math:`a` and :math:`b` make the number profile pass through the two tabulated ones, for 5 and 23 km.
    The column stands on the ground, whatever its altitude.

    References
    ----------
    [McClatchey1972]_, number profiles; [Tanre1990]_

    Examples
    --------
    >>> aerosol_optical_thickness(10.0) > aerosol_optical_thickness(50.0)
    True
    """
    levels = datasets.table("aerosol_profile.csv")
    hazy, clear = levels["visibility_5km"].to_numpy(), levels["visibility_23km"].to_numpy()
    slope = (hazy - clear) / (1 / 5 - 1 / 23)
    number = clear + slope * (1 / visibility - 1 / 23)
    layers = np.sqrt(number[1:] * number[:-1]) * np.diff(levels["altitude"])
    return float(_EXTINCTION_PER_PARTICLE * layers.sum())


def aerosol_optics(model, wavelength):
    """
    Optical properties of an aerosol model.

    Parameters
    ----------
    model : str
        One of `MODELS`.
    wavelength : array, shape (n,)
        0.35 to 3.75. [um]

    Returns
    -------
    extinction : array, shape (n,)
        Relative to 0.55 um; a power law between the tabulated wavelengths. [1]
    single_scattering_albedo : array, shape (n,)
        [1]
    asymmetry : array, shape (n,)
        Mean cosine of the scattering angle. [1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    >>> [float(values) for values in aerosol_optics("continental", 0.55)][0]
    1.0
    """
    table = datasets.table("aerosol_optics.csv").query("model == @model")
    log_nodes, log_wavelength = np.log(table["wavelength"].to_numpy()), np.log(wavelength)
    extinction = np.exp(np.interp(log_wavelength, log_nodes, np.log(table["extinction"])))
    albedo = np.interp(log_wavelength, log_nodes, table["single_scattering_albedo"])
    asymmetry = np.interp(log_wavelength, log_nodes, table["asymmetry"])
    return extinction, albedo, asymmetry


def aerosol_phase(model, scattering_cosine, wavelength):
    """
    Phase function of an aerosol model.

    Parameters
    ----------
    model : str
        One of `MODELS`.
    scattering_cosine : array, broadcastable with wavelength
        Cosine of the scattering angle. [1]
    wavelength : array
        0.35 to 3.75. [um]

    Returns
    -------
    phase : array, shape of the broadcast inputs
        Its mean over the sphere is 1; its logarithm is linear in the angle and in log wavelength. [1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    >>> bool(aerosol_phase("continental", 1.0, 0.55) > aerosol_phase("continental", 0.0, 0.55))
    True
    """
    angle = np.degrees(np.arccos(np.clip(scattering_cosine, -1, 1)))
    points = np.stack(np.broadcast_arrays(angle, np.log(wavelength)), axis=-1)
    return np.exp(_log_phase(model)(points))


@lru_cache
def _log_phase(model):
    table = datasets.table("aerosol_phase.csv").query("model == @model").drop(columns="model").set_index("angle")
    axes = table.index.to_numpy(float), np.log(table.columns.to_numpy(float))
    return RegularGridInterpolator(axes, np.log(table.to_numpy()))
