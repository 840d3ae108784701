"""Spectral bands: response-weighted means, solar irradiance, and the digital numbers that bands record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pvlib

from fifesim.base.arguments import Numbers, described
from fifesim.base.caches import cached
from fifesim.base.messages import warn

# Wavelengths of sunlight in micrometres are between these, in nanometres or metres outside. [um]
SHORTEST, LONGEST = 0.1, 100.0

PER_MICROMETRE = dict.fromkeys(
    ("um", "µm", "μm", "micrometer", "micrometers", "micrometre", "micrometres", "micron", "microns"), 1.0
) | dict.fromkeys(("nm", "nanometer", "nanometers", "nanometre", "nanometres"), 1000.0)
"""Spellings of units of wavelengths, in lower case, and how many of them are a micrometre."""

# Noise of measured spectra and responses, relative to their peak: larger negative values are errors. [1]
NOISE = 0.01


class Window(NamedTuple):
    """Spectral window in which a band must lie for a purpose: its limits and the best wavelength. [um]"""

    name: str
    low: float
    high: float
    best: float


# The absorption of all pigments, the green peak and the red absorption of chlorophyll, the plateau of leaves in the
# near infrared, and the window between two absorption bands of water vapour, where leaf water also absorbs.
BLUE = Window("blue", 0.45, 0.52, 0.48)
GREEN = Window("green", 0.50, 0.60, 0.56)
RED = Window("red", 0.60, 0.70, 0.66)
NEAR_INFRARED = Window("near infrared", 0.75, 1.00, 0.84)
SHORTWAVE_INFRARED = Window("shortwave infrared", 1.53, 1.75, 1.62)

COMPOSITES = {"false colour": (NEAR_INFRARED, RED, GREEN), "natural colour": (RED, GREEN, BLUE)}
"""Windows of the bands that become red, green and blue in a colour composite."""

# Common names of bands in catalogues of images, with the wavelengths between which they lie by the table of STAC's
# extension for electro-optical data (its README, github.com/stac-extensions/eo), and where Landsat or Sentinel-2 has
# them; rededge1 to 3, swir1 and swir2 are usual names of the same. [um]
COMMON_NAMES = {
    name: Window(name, *limits)
    for name, limits in {
        "coastal": (0.40, 0.45, 0.443),
        "blue": (0.45, 0.53, 0.48),
        "green": (0.50, 0.60, 0.56),
        "yellow": (0.58, 0.62, 0.60),
        "red": (0.60, 0.70, 0.66),
        "rededge071": (0.69, 0.73, 0.705),
        "rededge075": (0.73, 0.76, 0.74),
        "rededge078": (0.76, 0.80, 0.783),
        "rededge1": (0.69, 0.73, 0.705),
        "rededge2": (0.73, 0.76, 0.74),
        "rededge3": (0.76, 0.80, 0.783),
        "nir": (0.75, 1.00, 0.84),
        "nir08": (0.75, 0.90, 0.865),
        "nir09": (0.85, 1.05, 0.945),
        "cirrus": (1.35, 1.40, 1.375),
        "swir16": (1.55, 1.75, 1.61),
        "swir22": (2.10, 2.30, 2.20),
        "swir1": (1.55, 1.75, 1.61),
        "swir2": (2.10, 2.30, 2.20),
    }.items()
}


def check_micrometres(what, wavelengths):
    """Raise ValueError if the largest of some wavelengths is in another unit."""
    largest = np.max(wavelengths)
    if not SHORTEST <= largest <= LONGEST:
        nm = "divide nanometres by 1000, or state their unit, .attrs['units'] = 'nm'"
        cure = nm if largest > LONGEST else "convert them to um, or correct their unit"
        raise ValueError(f"{what} are in um, got {largest:g}: {cure}")


def without_noise(what, values, wavelength, highest=np.inf):
    """Values with noise outside of 0 to `highest` removed, with a warning; values beyond `NOISE` of the peak stay."""
    values = np.asarray(values, float)
    clipped = np.clip(values, 0, highest)
    outside = np.abs(values - clipped)
    if not 0 < outside.max() <= NOISE * values.max():
        return values
    at = outside.argmax()
    warn(
        f"{what} is {values[at]:g} at {wavelength[at]:g} um, {outside[at] / values.max():.2g} of its peak outside of "
        f"its range: up to {NOISE:g} is taken as noise and set to {clipped[at]:g}"
    )
    return clipped


def nearest_band(wavelengths, window):
    """Index of the band inside a window that is nearest to its best wavelength, None if there is none."""
    wavelengths = np.asarray(wavelengths, float)
    inside = np.flatnonzero((wavelengths >= window.low) & (wavelengths <= window.high))
    return int(inside[np.argmin(np.abs(wavelengths[inside] - window.best))]) if inside.size else None


def colour_composite(wavelengths, name="false colour"):
    """Indices of the red, green and blue band of a colour composite, None where a window holds no band."""
    # Without a green band the false-colour composite repeats the red one.
    numbers = [nearest_band(wavelengths, window) for window in COMPOSITES[name]]
    if name == "false colour" and numbers[2] is None:
        numbers[2] = numbers[1]
    return numbers


class Quadrature(NamedTuple):
    """Means over a band of spectra at the same wavelengths: places of the nodes among these, and weights."""

    nodes: np.ndarray
    index: np.ndarray
    share: np.ndarray
    weight: np.ndarray
    total: float

    def mean(self, values):
        """Mean of a spectrum over the response, shape (...)."""
        values = np.asarray(values, float)
        spectrum = values[..., self.index] * (1 - self.share) + values[..., self.index + 1] * self.share
        return np.trapezoid(spectrum * self.weight, self.nodes) / self.total


@dataclass(frozen=True)
class Band:
    """
    A spectral band.

    Parameters
    ----------
    name : str
        Name, such as ``"TM3"``.
    wavelength : sequence of float, shape (n,)
        Wavelengths of the response, increasing. [um]
    response : sequence of float, shape (n,)
        Relative spectral response, zero outside the wavelengths given. [1]

    Raises
    ------
    ValueError
        If the wavelengths do not increase or are not in um, or the response is zero throughout, missing or
        negative by more than noise of 1 % of its peak.

    Examples
    --------
    >>> from fifesim.sensor import Band
    >>> round(Band("red", (0.62, 0.63, 0.68, 0.69), (0.0, 1.0, 1.0, 0.0)).center, 3)
    0.655
    """

    name: str
    # Bands are keys of caches: hashing thousands of numbers takes longer than most look-ups.
    wavelength: Sequence[float] = field(repr=False, hash=False)
    response: Sequence[float] = field(repr=False, hash=False)

    def __post_init__(self):
        if not isinstance(self.name, str):
            raise TypeError(f"name of a Band must be text, got {described(self.name)}")
        wavelength, response = (_numbers(self, name) for name in ("wavelength", "response"))
        if len(wavelength) < 2 or len(wavelength) != len(response) or not np.all(np.diff(wavelength) > 0):
            raise ValueError(f"band {self.name}: wavelengths must increase, one for each response")
        check_micrometres(f"band {self.name}: wavelengths", wavelength)
        response = without_noise(f"band {self.name}: the response", response, wavelength)
        if not np.all(response >= 0) or response.max() == 0:
            raise ValueError(
                f"band {self.name}: the response must not be negative, nor missing, nor zero everywhere, got "
                f"{response.min():g} to {response.max():g}: noise up to {NOISE:.0%} of the peak is set to 0; for more, "
                "type numpy.clip(response, 0, None), and leave missing points out"
            )
        object.__setattr__(self, "wavelength", wavelength)
        object.__setattr__(self, "response", tuple(response.tolist()))

    @cached_property
    def center(self) -> float:
        """Response-weighted mean wavelength [um]."""
        return float(self.mean(self.wavelength, self.wavelength))

    @property
    def limits(self) -> tuple[float, float]:
        """Wavelengths between which the response is not zero [um]."""
        used = np.flatnonzero(self.response)
        return self.wavelength[max(used[0] - 1, 0)], self.wavelength[min(used[-1] + 1, len(self.wavelength) - 1)]

    def mean(self, values: Numbers, wavelength: Numbers, weight: Numbers = 1.0) -> np.ndarray:
        """
        Mean of a spectrum over the response, by the trapezoidal rule on the union of both wavelength sets.

        Parameters
        ----------
        values : array, shape (..., n)
            Spectrum.
        wavelength : array, shape (n,)
            Its wavelengths, increasing and covering the band. [um]
        weight : array, shape (n,), optional
            Additional weight, such as the solar irradiance.

        Returns
        -------
        mean : array, shape (...)

        Raises
        ------
        ValueError
            If the spectrum does not cover the band.
        """
        return self.quadrature(wavelength, weight).mean(values)

    def quadrature(self, wavelength: Numbers, weight: Numbers = 1.0) -> Quadrature:
        """
        What `mean` takes of any spectrum at the same wavelengths.

        Parameters
        ----------
        wavelength, weight
            As in `mean`.

        Returns
        -------
        quadrature : Quadrature

        Raises
        ------
        ValueError
            As in `mean`.
        """
        wavelength = np.asarray(wavelength, float)
        nodes, response = self._nodes(wavelength)
        weight = response * np.interp(nodes, wavelength, np.broadcast_to(weight, wavelength.shape))
        index = np.clip(np.searchsorted(wavelength, nodes) - 1, 0, wavelength.size - 2)
        share = (nodes - wavelength[index]) / (wavelength[index + 1] - wavelength[index])
        return Quadrature(nodes, index, share, weight, np.trapezoid(weight, nodes))

    def _nodes(self, wavelength):
        """Wavelengths of the response and of a spectrum inside the band, with the response there."""
        low, high = self.limits
        if wavelength[0] > low or wavelength[-1] < high:
            raise ValueError(
                f"band {self.name} spans {low:g} to {high:g} um, "
                f"the spectrum only {wavelength[0]:g} to {wavelength[-1]:g} um"
            )
        inside = wavelength[(wavelength > low) & (wavelength < high)]
        own = [w for w in self.wavelength if low <= w <= high]
        nodes = np.union1d(inside, own)
        return nodes, np.interp(nodes, self.wavelength, self.response)


def _numbers(band, name):
    value = getattr(band, name)
    try:
        numbers = np.asarray(value, float)
    except (TypeError, ValueError):
        numbers = None
    if numbers is None or numbers.ndim != 1:
        raise TypeError(f"band {band.name}: {name} must be a list of numbers, got {described(value)}")
    return tuple(numbers.tolist())


@cached(128, "solar spectrum")
def solar_spectrum():
    """Wavelength [um] and extraterrestrial solar irradiance [W m-2 um-1] at 1 AU from ASTM G173-03, shape (2002,)."""
    table = pvlib.spectrum.get_reference_spectra(standard="ASTM G173-03")
    return table.index.to_numpy() / 1000, table["extraterrestrial"].to_numpy() * 1000


def solar_irradiance_steps(wavelength):
    """Solar irradiance at 1 AU, averaged over the steps of a coarser spectrum. [W m-2 um-1]"""
    # Fraunhofer lines are narrower than a step, so the irradiance at its centre is not representative.
    fine, irradiance = solar_spectrum()
    wavelength = np.asarray(wavelength, float)
    middle = (wavelength[1:] + wavelength[:-1]) / 2
    edges = np.concatenate([wavelength[:1], middle, wavelength[-1:]])
    total = np.concatenate([[0], np.cumsum(np.diff(fine) * (irradiance[1:] + irradiance[:-1]) / 2)])
    return np.diff(np.interp(edges, fine, total)) / np.diff(edges)


def solar_irradiance(band):
    """Response-weighted solar irradiance of a band at 1 AU. [W m-2 um-1]"""
    wavelength, irradiance = solar_spectrum()
    return float(band.mean(irradiance, wavelength))


def check_counts(dn, largest, cure):
    """Raise ValueError if a value cannot be a digital number; NaN is no data."""
    dn = np.asarray(dn)
    wrong = (dn < 0) | (dn > largest)
    if dn.dtype.kind == "f":
        wrong |= (dn != np.rint(dn)) & ~np.isnan(dn)
    if np.any(wrong):
        raise ValueError(f"a digital number of {dn[wrong].flat[0]:g} is not a whole number from 0 to {largest}: {cure}")


def counts(dn, nodata, largest, cure, saturated=None):
    """Digital numbers as stored in images: uint8 or uint16, with 0 for no data."""
    dn = np.asarray(dn)
    missing = (dn == nodata) | (np.isnan(dn) if dn.dtype.kind == "f" else False)
    kept = np.where(missing, 0, dn)
    check_counts(kept, largest, cure)
    if saturated is not None:
        kept = np.where(kept == saturated, 0, kept)
    return kept.astype(np.uint8 if largest < 256 else np.uint16)
