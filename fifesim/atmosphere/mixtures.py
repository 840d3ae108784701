"""Components of the aerosol with their Mie optics, and the named mixtures of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import PurePath

import numpy as np

from fifesim.base import files
from fifesim.base.caches import cached
from fifesim.base.messages import closest

COMPONENTS = ("dust", "water_soluble", "oceanic", "soot")


@dataclass(frozen=True, eq=False)
class Component:
    """Optics of some particles, as tables."""

    log_wavelength: np.ndarray  # logarithm of the wavelength in um, increasing, shape (wavelength,)
    log_extinction: np.ndarray  # logarithm of the cross section, shape (wavelength,)
    log_scattering: np.ndarray
    asymmetry: np.ndarray  # mean cosine of the scattering angle, shape (wavelength,) [1]
    angle: np.ndarray  # scattering angle, from 0 to 180, shape (angle,) [degree]
    log_phase: np.ndarray  # logarithm of the phase function, whose mean is 1, shape (angle, wavelength)
    polarization: np.ndarray  # degree of linear polarization of natural light scattered once, likewise [1]


def cross_sections(component, wavelength):
    """Extinction, scattering and scattering times asymmetry per unit volume of a component. [um-1]"""
    # Power laws between the tabulated wavelengths; [dAlmeida1991]_, micro-physics, by Mie theory.
    table, logarithm = tabulated(component), np.log(wavelength)
    extinction = np.exp(np.interp(logarithm, table.log_wavelength, table.log_extinction))
    scattering = np.exp(np.interp(logarithm, table.log_wavelength, table.log_scattering))
    return extinction, scattering, scattering * np.interp(logarithm, table.log_wavelength, table.asymmetry)


def phase(component, scattering_cosine, wavelength, *, polarized=False):
    """Phase function of a component, or element 12 of the phase matrix with reversed sign, by [dAlmeida1991]_. [1]"""
    # Linear in the logarithm of the wavelength, which keeps its mean of 1 over the sphere; its logarithm is linear in
    # the angle.
    tables = tabulated(component)
    column, share = _place(tables.log_wavelength, np.log(wavelength))
    angle = _place_of(tables.angle, scattering_cosine)

    def at(column):
        values = np.exp(_between(tables.log_phase, *angle, column))
        return values * _between(tables.polarization, *angle, column) if polarized else values

    return at(column) * (1 - share) + at(column + 1) * share


def component_phase_moments(component, wavelength, count):
    """Legendre moments of the phase function of a component, shape (n, count), by [dAlmeida1991]_. [1]"""
    tables = tabulated(component)
    column, share = _place(tables.log_wavelength, np.log(np.asarray(wavelength, float)))
    table, share = _tabulated_moments(tables, count), share[:, None]
    return table[column] * (1 - share) + table[column + 1] * share


def sphere(angle):
    """Cosines and solid-angle weights of a quadrature over scattering angles, shape (4 (n - 1),). [1]"""
    points, weights = np.polynomial.legendre.leggauss(4)
    nodes, half = np.asarray(angle)[:-1, None], np.diff(angle)[:, None] / 2
    between = np.radians(nodes + half * (1 + points)).ravel()
    return np.cos(between), (np.radians(half) * weights).ravel() * np.sin(between) / 2


def phase_on_sphere(angle, log_phase):
    """Phase function of a table at the cosines of `sphere`, shape (4 (angle - 1), wavelength). [1]"""
    cosine, _ = sphere(angle)
    return np.exp(_between(log_phase, *_place_of(angle, cosine[:, None]), np.arange(log_phase.shape[1])))


def normalized_log_phase(angle, log_phase):
    """Logarithm of a tabulated phase function, scaled to a mean of 1 over the sphere. [1]"""
    _, weights = sphere(angle)
    return log_phase - np.log(weights @ phase_on_sphere(angle, log_phase))


def _between(table, row, share, column):
    """Values of a table between two rows."""
    return table[row, column] * (1 - share) + table[row + 1, column] * share


def _place_of(angle, scattering_cosine):
    """Index of the scattering angle before each cosine, and the weight of the next angle."""
    return _place(angle, np.degrees(np.arccos(np.clip(scattering_cosine, -1, 1))))


def _place(nodes, values):
    """Index of the node before each value, and the weight of the next node."""
    before = np.clip(np.searchsorted(nodes, values) - 1, 0, nodes.size - 2)
    return before, (values - nodes[before]) / (nodes[before + 1] - nodes[before])


def tabulated(component):
    """Tables of a component, by Mie theory from the microphysics of [dAlmeida1991]_."""
    return component if isinstance(component, Component) else _from_data(component)


@cached(128, "optics of an aerosol component")
def _from_data(component):
    """Tables of a component from the data folder, with the phase function normalized to a mean of 1 over the sphere."""
    table = files.table("aerosol_optics.csv").query("component == @component")
    wavelength, extinction, scattering, directed = table.drop(columns="component").to_numpy(float).T
    # Rows by scattering angle, columns by wavelength.
    by_angle, polarization = (
        files.table(name).set_index(["component", "angle"]).loc[component]
        for name in ("aerosol_phase.csv", "aerosol_polarization.csv")
    )
    angle = by_angle.index.to_numpy(float)
    log_phase = normalized_log_phase(angle, np.log(by_angle.to_numpy(float)))
    polarization = polarization.to_numpy(float)
    optics = np.log(wavelength), np.log(extinction), np.log(scattering), directed / scattering
    return Component(*optics, angle, log_phase, polarization)


@cached(128, "Legendre moments of tabulated phase functions")
def _tabulated_moments(tables, count):
    """Legendre moments at the tabulated wavelengths, shape (wavelength, count)."""
    cosine, weights = sphere(tables.angle)
    scattered = phase_on_sphere(tables.angle, tables.log_phase) * weights[:, None]
    return scattered.T @ np.polynomial.legendre.legvander(cosine, count - 1)


# Volume fractions of the components. [1] World Climate Programme WCP-55 (1983); Tanre et al. (1990).
MODELS = {
    "continental": {"dust": 0.70, "water_soluble": 0.29, "soot": 0.01},
    "maritime": {"water_soluble": 0.05, "oceanic": 0.95},
    "urban": {"dust": 0.17, "water_soluble": 0.61, "soot": 0.22},
}

_EXAMPLE = "dust:0.5+water_soluble:0.5"


def mixture(aerosol):
    """
    Volume fractions of the components of an aerosol.

    Parameters
    ----------
    aerosol : str or mapping
        One of `MODELS`; or a text like ``"dust:0.5+water_soluble:0.5"``, or a mapping of components to fractions.

    Returns
    -------
    fractions : dict
        In the order of `COMPONENTS`, without those that are 0. [1]

    Raises
    ------
    ValueError
        If a model or a component is unknown, a fraction is negative, or their sum is not 1 within 1e-6.
    TypeError
        If the aerosol is neither text nor mapping, or a fraction is not a number; or it is a file or a Dataset, which
        `fifesim.atmosphere.read_aerosol` takes.
    """
    is_file = isinstance(aerosol, PurePath) or (isinstance(aerosol, str) and aerosol.endswith((".nc", ".csv")))
    # A Dataset is a mapping, too.
    if is_file or hasattr(aerosol, "data_vars"):
        raise TypeError(
            "aerosol must be a text, a mapping or the result of fifesim.atmosphere.read_aerosol, got a Dataset or a "
            "file: use aerosol=fifesim.atmosphere.read_aerosol(...)"
        )
    if isinstance(aerosol, Mapping):
        return _checked_fractions(aerosol, aerosol)
    if not isinstance(aerosol, str):
        raise TypeError(f"aerosol must be a text or a mapping, got {aerosol!r}: type aerosol={_EXAMPLE!r}")
    if aerosol in MODELS:
        return dict(MODELS[aerosol])
    if ":" not in aerosol:
        name = closest(aerosol, [*MODELS, *COMPONENTS])
        hint = f": type aerosol={f'{name}:1' if name in COMPONENTS else name!r}" if name else ""
        raise ValueError(
            f"aerosol must be one of {', '.join(MODELS)}, or a mixture of {', '.join(COMPONENTS)}, such as dust:1 or "
            f"{_EXAMPLE}, got {aerosol!r}{hint}"
        )
    return _checked_fractions(_parsed(aerosol), aerosol)


def canonical(aerosol):
    """Canonical text of an aerosol: the name of a model, or the mixture with its components in order."""
    fractions = mixture(aerosol)
    for name, model in MODELS.items():
        if fractions == model:
            return name
    return "+".join(f"{name}:{np.format_float_positional(value, trim='-')}" for name, value in fractions.items())


def _parsed(text):
    """Fractions of a mixture text, not yet checked."""
    fractions = {}
    for part in text.split("+"):
        name, _, number = part.partition(":")
        try:
            value = float(number)
        except ValueError:
            raise ValueError(
                f"aerosol must give each component a number after a colon, got {part.strip()!r} in {text!r}: "
                f"type aerosol={_EXAMPLE!r}"
            ) from None
        if name.strip() in fractions:
            raise ValueError(f"aerosol must name each component once, got {name.strip()!r} twice in {text!r}: add up")
        fractions[name.strip()] = value
    return fractions


def _checked_fractions(fractions, given):
    for name, value in fractions.items():
        if name not in COMPONENTS:
            hint = f": type {near!r}" if (near := closest(name, COMPONENTS)) else ""
            raise ValueError(
                f"aerosol component must be one of {', '.join(COMPONENTS)}, got {name!r} in {given!r}{hint}"
            )
        if not isinstance(value, Real) or isinstance(value, bool):
            raise TypeError(f"aerosol fraction of {name} must be a number from 0 to 1, got {value!r}: type 0.5")
        if not value >= 0:
            raise ValueError(f"aerosol fraction of {name} must be from 0 to 1, got {value:g}: type 0 to leave it out")
    total = sum(fractions.values())
    if not abs(total - 1) <= 1e-6:
        scaled = "+".join(f"{name}:{value / total:.4g}" for name, value in fractions.items()) if total > 0 else _EXAMPLE
        raise ValueError(f"aerosol fractions must add up to 1, got {total:g} in {given!r}: type aerosol={scaled!r}")
    return {name: float(fractions[name]) for name in COMPONENTS if fractions.get(name, 0) > 0}
