"""Optics of the components of the aerosol, from tables that Mie theory made."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fifesim.base import datasets

COMPONENTS = ("dust", "water_soluble", "oceanic", "soot")


@dataclass(frozen=True, eq=False)
class Component:
    """
    Optics of some particles, as tables.

    Parameters
    ----------
    log_wavelength : array, shape (wavelength,)
        Of micrometres, increasing.
    log_extinction, log_scattering : array, shape (wavelength,)
        Of the cross sections.
    asymmetry : array, shape (wavelength,)
        Mean cosine of the scattering angle. [1]
    angle : array, shape (angle,)
        Scattering angle, from 0 to 180. [degree]
    log_phase : array, shape (angle, wavelength)
        Of the phase function, whose mean over the sphere is 1.
    polarization : array, shape (angle, wavelength)
        Degree of linear polarization of natural light scattered once. [1]
    """

    log_wavelength: np.ndarray
    log_extinction: np.ndarray
    log_scattering: np.ndarray
    asymmetry: np.ndarray
    angle: np.ndarray
    log_phase: np.ndarray
    polarization: np.ndarray


def cross_sections(component, wavelength):
    """
    Cross sections of the particles of a component, for a unit of their volume.

    Parameters
    ----------
    component : str or Component
        One of `COMPONENTS`, or tables of one's own.
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
    table, logarithm = tabulated(component), np.log(wavelength)
    extinction = np.exp(np.interp(logarithm, table.log_wavelength, table.log_extinction))
    scattering = np.exp(np.interp(logarithm, table.log_wavelength, table.log_scattering))
    return extinction, scattering, scattering * np.interp(logarithm, table.log_wavelength, table.asymmetry)


def phase(component, scattering_cosine, wavelength):
    """
    Phase function of a component.

    Parameters
    ----------
    component : str or Component
        One of `COMPONENTS`, or tables of one's own.
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
    tables = tabulated(component)
    log_phase = _by_angle(tables.angle, tables.log_phase, scattering_cosine)
    return _by_wavelength(tables, lambda column: np.exp(log_phase(column)), wavelength)


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
    tables = tabulated(component)
    log_phase = _by_angle(tables.angle, tables.log_phase, scattering_cosine)
    degree = _by_angle(tables.angle, tables.polarization, scattering_cosine)
    return _by_wavelength(tables, lambda column: np.exp(log_phase(column)) * degree(column), wavelength)


def phase_moments(component, wavelength, count):
    """
    Legendre moments of the phase function of a component.

    Parameters
    ----------
    component : str or Component
        One of `COMPONENTS`, or tables of one's own.
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
    tables = tabulated(component)
    column, share = _place(tables.log_wavelength, np.log(np.asarray(wavelength, float)))
    table, share = _tabulated_moments(tables, count), share[:, None]
    return table[column] * (1 - share) + table[column + 1] * share


def sphere(angle):
    """
    Quadrature over the directions into which light is scattered.

    Parameters
    ----------
    angle : array, shape (n,)
        Scattering angles of a table, from 0 to 180. [degree]

    Returns
    -------
    cosine, weights : array, shape (4 (n - 1),)
        Four Gauss points between neighbours; the weights, by solid angle, add up to 1. [1]

    Examples
    --------
    >>> _, weights = sphere([0.0, 90.0, 180.0])
    >>> round(float(weights.sum()), 6)
    1.0
    """
    points, weights = np.polynomial.legendre.leggauss(4)
    nodes, half = np.asarray(angle)[:-1, None], np.diff(angle)[:, None] / 2
    between = np.radians(nodes + half * (1 + points)).ravel()
    return np.cos(between), (np.radians(half) * weights).ravel() * np.sin(between) / 2


def phase_on_sphere(angle, log_phase):
    """
    Phase function of a table on the cosines of `sphere`.

    Parameters
    ----------
    angle : array, shape (angle,)
        [degree]
    log_phase : array, shape (angle, wavelength)
        As in `Component`.

    Returns
    -------
    phase : array, shape (4 (angle - 1), wavelength)
        [1]
    """
    cosine, _ = sphere(angle)
    return np.exp(_by_angle(angle, log_phase, cosine[:, None])(np.arange(log_phase.shape[1])))


def _by_angle(angle, table, scattering_cosine):
    """Values between the angles of a table, for the number of a column."""
    row, low = _place(angle, np.degrees(np.arccos(np.clip(scattering_cosine, -1, 1))))
    return lambda column: table[row, column] * (1 - low) + table[row + 1, column] * low


def _by_wavelength(tables, values, wavelength):
    """Values between the wavelengths of the tables, from those of the columns."""
    column, share = _place(tables.log_wavelength, np.log(wavelength))
    return values(column) * (1 - share) + values(column + 1) * share


def _place(nodes, values):
    """Node before each value, and the share of the next."""
    before = np.clip(np.searchsorted(nodes, values) - 1, 0, nodes.size - 2)
    return before, (values - nodes[before]) / (nodes[before + 1] - nodes[before])


def tabulated(component):
    """
    Tables of a component.

    Parameters
    ----------
    component : str or Component
        One of `COMPONENTS`, or tables of one's own.

    Returns
    -------
    tables : Component

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    >>> tabulated("soot").asymmetry.shape
    (20,)
    """
    return component if isinstance(component, Component) else _from_data(component)


@lru_cache
def _from_data(component):
    """Those of the data folder, the phase function scaled so that the mean of what is read from it is 1."""
    table = datasets.table("aerosol_optics.csv").query("component == @component")
    wavelength, extinction, scattering, directed = table.drop(columns="component").to_numpy(float).T
    angle, phase_function = _by_scattering_angle("aerosol_phase.csv", component)
    _, polarization = _by_scattering_angle("aerosol_polarization.csv", component)
    _, weights = sphere(angle)
    log_phase = np.log(phase_function)
    log_phase = log_phase - np.log(weights @ phase_on_sphere(angle, log_phase))
    optics = np.log(wavelength), np.log(extinction), np.log(scattering), directed / scattering
    return Component(*optics, angle, log_phase, polarization)


def _by_scattering_angle(name, component):
    """Angles of a table, and its values by angle and wavelength."""
    table = datasets.table(name).query("component == @component").drop(columns="component")
    return table["angle"].to_numpy(float), table.drop(columns="angle").to_numpy(float)


@lru_cache
def _tabulated_moments(tables, count):
    """Legendre moments at the tabulated wavelengths, shape (wavelength, count)."""
    cosine, weights = sphere(tables.angle)
    scattered = phase_on_sphere(tables.angle, tables.log_phase) * weights[:, None]
    return scattered.T @ np.polynomial.legendre.legvander(cosine, count - 1)
