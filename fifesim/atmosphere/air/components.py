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
    scattering_cosine, wavelength : array, broadcastable
        As in `aerosols.aerosol_phase`. [1, um]

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
    log_phase = _by_angle(_log_phase(component), scattering_cosine)
    return _by_wavelength(lambda column: np.exp(log_phase(column)), wavelength)


def polarized_phase(component, scattering_cosine, wavelength):
    """
    Element 12 of the phase matrix of a component, with the sign changed.

    Parameters
    ----------
    component, scattering_cosine, wavelength
        As in `phase`.

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
    log_phase = _by_angle(_log_phase(component), scattering_cosine)
    degree = _by_angle(_table("aerosol_polarization.csv", component), scattering_cosine)
    return _by_wavelength(lambda column: np.exp(log_phase(column)) * degree(column), wavelength)


def phase_moments(component, wavelength, count):
    """
    Legendre moments of the phase function of a component.

    Parameters
    ----------
    component : str
        One of `COMPONENTS`.
    wavelength, count
        As in `aerosols.phase_moments`.

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


def _by_angle(table, scattering_cosine):
    """Values between the angles of a table, for the number of a column."""
    row, low = _place(_angles(), np.degrees(np.arccos(np.clip(scattering_cosine, -1, 1))))
    return lambda column: table[row, column] * (1 - low) + table[row + 1, column] * low


def _by_wavelength(values, wavelength):
    """Values between the wavelengths of the tables, from those of the columns."""
    column, share = _wavelength_place(wavelength)
    return values(column) * (1 - share) + values(column + 1) * share


def _wavelength_place(wavelength):
    """Column of the tables before each wavelength, and the share of the next."""
    return _place(_optics(COMPONENTS[0]).log_wavelength, np.log(wavelength))


def _place(nodes, values):
    """Node before each value, and the share of the next."""
    before = np.clip(np.searchsorted(nodes, values) - 1, 0, nodes.size - 2)
    return before, (values - nodes[before]) / (nodes[before + 1] - nodes[before])


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
def _table(name, component):
    """By angle and wavelength."""
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
    return np.exp(_by_angle(log_phase, cosine[:, None])(np.arange(log_phase.shape[1])))


@lru_cache
def _log_phase(component):
    """Logarithm of the phase function, scaled so that the mean of what is read from the table is 1."""
    table = np.log(_table("aerosol_phase.csv", component))
    _, weights = _quadrature()
    return table - np.log(weights @ _on_quadrature(table))


@lru_cache
def _tabulated_moments(component, count):
    """Legendre moments at the tabulated wavelengths, shape (wavelength, count)."""
    cosine, weights = _quadrature()
    phase_function = _on_quadrature(_log_phase(component))
    return (phase_function * weights[:, None]).T @ np.polynomial.legendre.legvander(cosine, count - 1)
