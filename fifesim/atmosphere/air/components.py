"""Optics of the components of the aerosol, from tables that Mie theory made."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fifesim.base import datasets

COMPONENTS = ("dust", "water_soluble", "oceanic", "soot")


def cross_sections(component, wavelength):
    """
    Cross sections of the particles of a component, for a unit of their volume.

    Parameters
    ----------
    component : str
        One of `COMPONENTS`.
    wavelength : array
        0.35 to 3.75. [um]

    Returns
    -------
    extinction, scattering : array, shape of wavelength
        Power laws between the tabulated wavelengths. [um-1]
    directed : array, shape of wavelength
        Scattering times the asymmetry, which is linear in the logarithm of the wavelength. [um-1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    >>> extinction, scattering, _ = cross_sections("soot", 0.55)
    >>> bool(extinction > scattering)
    True
    """
    table, logarithm = _optics(component), np.log(wavelength)
    extinction = np.exp(np.interp(logarithm, table.log_wavelength, table.log_extinction))
    scattering = np.exp(np.interp(logarithm, table.log_wavelength, table.log_scattering))
    return extinction, scattering, scattering * np.interp(logarithm, table.log_wavelength, table.asymmetry)


def phase(component, scattering_cosine, wavelength):
    """
    Phase function of a component.

    Parameters
    ----------
    component : str
        One of `COMPONENTS`.
    scattering_cosine : array, broadcastable with wavelength
        Cosine of the scattering angle. [1]
    wavelength : array
        0.35 to 3.75. [um]

    Returns
    -------
    phase : array, shape of the broadcast inputs
        Linear in the logarithm of the wavelength, which keeps its mean of 1 over the sphere; its logarithm is linear in
        the angle. [1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    >>> bool(phase("dust", 1.0, 0.55) > 100 * phase("soot", 1.0, 0.55))
    True
    """
    row, low = _angle_place(scattering_cosine)
    column, share = _wavelength_place(wavelength)
    table = _log_phase(component)
    near, far = (np.exp(table[row, at] * (1 - low) + table[row + 1, at] * low) for at in (column, column + 1))
    return near * (1 - share) + far * share


def polarized_phase(component, scattering_cosine, wavelength):
    """
    Element 12 of the phase matrix of a component, with the sign changed.

    Parameters
    ----------
    component : str
        One of `COMPONENTS`.
    scattering_cosine : array, broadcastable with wavelength
        Cosine of the scattering angle. [1]
    wavelength : array
        0.35 to 3.75. [um]

    Returns
    -------
    second : array, shape of the broadcast inputs
        Positive where scattered natural light vibrates across the plane of scattering. [1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    Straight on and straight back no direction is preferred:

    >>> float(polarized_phase("dust", 1.0, 0.55)), float(polarized_phase("dust", -1.0, 0.55))
    (0.0, 0.0)
    """
    row, low = _angle_place(scattering_cosine)
    column, share = _wavelength_place(wavelength)
    tables = _log_phase(component), _by_angle("aerosol_polarization.csv", component)
    near, far = (
        np.exp(first) * degree
        for first, degree in (
            [table[row, at] * (1 - low) + table[row + 1, at] * low for table in tables] for at in (column, column + 1)
        )
    )
    return near * (1 - share) + far * share


def phase_moments(component, wavelength, count):
    r"""
    Legendre moments of the phase function of a component.

    .. math:: \chi_l = \frac{1}{2} \int_{-1}^{1} P(\mu) P_l(\mu) \, \mathrm{d}\mu

    Parameters
    ----------
    component : str
        One of `COMPONENTS`.
    wavelength : array, shape (n,)
        0.35 to 3.75. [um]
    count : int
        Number of moments, from :math:`\chi_0 = 1` on. [1]

    Returns
    -------
    moments : array, shape (n, count)
        Those of `phase`. [1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    >>> bool(abs(phase_moments("dust", [0.55], 1)[0, 0] - 1) < 1e-12)
    True
    """
    column, share = _wavelength_place(np.asarray(wavelength, float))
    table, share = _tabulated_moments(component, count), share[:, None]
    return table[column] * (1 - share) + table[column + 1] * share


def _angle_place(scattering_cosine):
    """Row of the angle tables before each scattering angle, and the share of the next."""
    nodes = _angles()
    angle = np.degrees(np.arccos(np.clip(scattering_cosine, -1, 1)))
    row = np.clip(np.searchsorted(nodes, angle) - 1, 0, nodes.size - 2)
    return row, (angle - nodes[row]) / (nodes[row + 1] - nodes[row])


def _wavelength_place(wavelength):
    """Column of the tables before each wavelength, and the share of the next."""
    nodes = _optics(COMPONENTS[0]).log_wavelength
    logarithm = np.log(wavelength)
    column = np.clip(np.searchsorted(nodes, logarithm) - 1, 0, nodes.size - 2)
    return column, (logarithm - nodes[column]) / (nodes[column + 1] - nodes[column])


class _Optics(NamedTuple):
    """Optics of a component at the tabulated wavelengths, shape (wavelength,)."""

    log_wavelength: np.ndarray
    log_extinction: np.ndarray
    log_scattering: np.ndarray
    asymmetry: np.ndarray


@lru_cache
def _optics(component):
    table = datasets.table("aerosol_optics.csv").query("component == @component")
    wavelength, extinction, scattering, directed = table.drop(columns="component").to_numpy(float).T
    return _Optics(np.log(wavelength), np.log(extinction), np.log(scattering), directed / scattering)


@lru_cache
def _by_angle(name, component):
    """Table by angle and wavelength."""
    return datasets.table(name).query("component == @component").drop(columns=["component", "angle"]).to_numpy(float)


@lru_cache
def _angles():
    """Scattering angles of the tables [degree]."""
    return datasets.table("aerosol_phase.csv").query("component == @COMPONENTS[0]")["angle"].to_numpy(float)


@lru_cache
def _quadrature():
    """Angles, and weights by solid angle that add up to 1: four Gauss points between neighbours of the tables."""
    points, weights = np.polynomial.legendre.leggauss(4)
    nodes, half = _angles()[:-1, None], np.diff(_angles())[:, None] / 2
    angle = np.radians(nodes + half * (1 + points)).ravel()
    return np.cos(angle), (np.radians(half) * weights).ravel() * np.sin(angle) / 2


def _on_quadrature(log_phase):
    cosine, _ = _quadrature()
    row, low = _angle_place(cosine)
    low = low[:, None]
    return np.exp(log_phase[row] * (1 - low) + log_phase[row + 1] * low)


@lru_cache
def _log_phase(component):
    """Logarithm of the phase function, scaled so that the mean of what is read from the table is 1."""
    table = np.log(_by_angle("aerosol_phase.csv", component))
    _, weights = _quadrature()
    return table - np.log(weights @ _on_quadrature(table))


@lru_cache
def _tabulated_moments(component, count):
    """Legendre moments at the tabulated wavelengths, shape (wavelength, count)."""
    cosine, weights = _quadrature()
    phase_function = _on_quadrature(_log_phase(component))
    return (phase_function * weights[:, None]).T @ np.polynomial.legendre.legvander(cosine, count - 1)
