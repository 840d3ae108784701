"""PROSPECT-D: reflectance and transmittance of a leaf from its chemistry and structure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fifesim.base import files
from fifesim.base.arguments import Array, NumberOrArray, Range, check_number, described
from fifesim.base.arrays import as_rows, compiled, jitable
from fifesim.base.caches import cached

_PIGMENT = {"mg m-2": 0.1, "g m-2": 100.0, "mg cm-2": 1000.0}

# Absorbing constituents of a leaf. The usual ranges contain LOPEX and ANGERS (Feret et al., 2008) and dead leaves.
CONTENTS = {
    "chlorophyll": Range("ug cm-2", 0.0, 200.0, (2.0, 120.0), _PIGMENT),
    "carotenoids": Range("ug cm-2", 0.0, 100.0, (0.5, 30.0), _PIGMENT),
    "anthocyanins": Range("ug cm-2", 0.0, 100.0, (0.05, 40.0), _PIGMENT),
    "brown": Range("1", 0.0, 10.0, (0.0, 3.0), {"percent": 0.01}),
    "water": Range("cm", 0.0, 0.2, (0.0004, 0.06), {"mm or kg m-2": 0.1, "m": 100.0, "g m-2 or um": 1e-4}),
    "dry_matter": Range("g cm-2", 0.0, 0.1, (0.0005, 0.04), {"g m-2": 1e-4, "mg cm-2": 1e-3, "kg m-2": 0.1}),
}

# Layers of a leaf and its contents; measured leaves have 1 to 3.5 layers.
LEAF_RANGES = {"structure": Range("1", 1.0, 10.0, (1.0, 4.0)), **CONTENTS}

# Half opening of the cone of incident light around the normal of the rough surface. [degree]
_INCIDENCE = 40.0

# Fresnel's equations are analytic in the cosine: 32 nodes integrate them to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True)
class Leaf:
    """
    A leaf described by its contents. The defaults are the green tallgrass of ``data/README.md``.

    Parameters
    ----------
    structure : float or raster, optional
        N, layers of cells with air between them, 1 (compact) to about 3. [1]
    chlorophyll, carotenoids, anthocyanins : float or raster, optional
        Pigments, per one-sided leaf area. [ug cm-2]
    brown : float or raster, optional
        Brown pigments of a senescent leaf, 0 (green) to about 1. [1]
    water : float or raster, optional
        Equivalent thickness. [cm]
    dry_matter : float or raster, optional
        Leaf mass per area. [g cm-2]

    Raises
    ------
    ValueError
        If a number is outside the range of leaves. A raster is checked when it is used.
    TypeError
        If a value is not a number.

    Warns
    -----
    UserWarning
        If a number is possible, but usual in another unit.

    References
    ----------
    [Feret2017]_

    Examples
    --------
    >>> from fifesim import Leaf
    >>> Leaf(water=12)
    Traceback (most recent call last):
    ...
    ValueError: Leaf: water must be in [0, 0.2] cm, got 12: if it is in g m-2 or um, type water=0.0012
    """

    structure: NumberOrArray = 1.7
    chlorophyll: NumberOrArray = 29.0
    carotenoids: NumberOrArray = 7.25
    anthocyanins: NumberOrArray = 0.0
    brown: NumberOrArray = 0.0
    water: NumberOrArray = 0.012
    dry_matter: NumberOrArray = 0.0148

    def __post_init__(self):
        for name, known in LEAF_RANGES.items():
            value = getattr(self, name)
            if not hasattr(value, "ndim") or not value.ndim:
                value = _number(name, value)
            # Lazy arrays are checked when they are computed.
            if isinstance(value, float | np.ndarray):
                check_number(f"Leaf: {name}", value, known)
            object.__setattr__(self, name, value)

    def contents(self) -> list[NumberOrArray]:
        """Structure and contents, in the order of the fields."""
        return [getattr(self, name) for name in LEAF_RANGES]

    def varying(self) -> dict[str, Array]:
        """Contents that vary between leaves, a dict of str to array."""
        values = {name: getattr(self, name) for name in LEAF_RANGES}
        return {name: value for name, value in values.items() if not isinstance(value, float)}


def leaf_spectrum(leaf, limits=(0.4, 2.5)):
    """
    Hemispherical reflectance and transmittance of a leaf, PROSPECT-D.

    The leaf is a pile of N layers of which the uppermost is lit within a cone of 40 degrees and the others by
    isotropic light; N need not be whole.

    Parameters
    ----------
    leaf : Leaf
        Leaf of numbers, or of arrays of shape (...) that broadcast; NaN gives NaN.
    limits : (float, float), optional
        Range of wavelengths. [um]

    Returns
    -------
    wavelength : array, shape (n,)
        0.4 to 2.5 in steps of 0.001, as far as the limits and the next step on either side. [um]
    reflectance, transmittance : array, shape (..., n)
        [1]

    References
    ----------
    [Jacquemoud1990]_; [Feret2017]_
    """
    table = files.table("prospect_d.csv")
    first, last = np.searchsorted(table["wavelength"].to_numpy(), limits)
    nodes = slice(max(first - 1, 0), last + 2)
    shape, contents = as_rows(*leaf.contents())
    spectra = np.empty((2, contents.shape[1], len(table.iloc[nodes])), contents.dtype)
    _spectra(contents, _constants()[:, nodes], spectra)
    reflectance, transmittance = spectra.reshape(2, *shape, -1)
    return table["wavelength"].to_numpy()[nodes], reflectance, transmittance


def leaf_band_means(contents, weights):
    """
    Means of leaf reflectance and transmittance over bands, shape (2, band, ...), without keeping spectra. [1]
    `contents` are arrays in the order and units of `Leaf`; `weights` [1] are those of each wavelength of
    ``prospect_d.csv``, shape (2101, band). NaN gives NaN.
    """
    shape, rows = as_rows(*contents)
    used = np.flatnonzero(weights.any(axis=1))
    means = np.zeros((2, weights.shape[1], rows.shape[1]), rows.dtype)
    _means(rows, np.ascontiguousarray(_constants()[:, used]), np.ascontiguousarray(weights[used]), means)
    return means.reshape(2, weights.shape[1], *shape)


@cached(1, "constants of leaves")
def _constants():
    """Specific absorption of the contents, and three transmissivities of leaf surfaces, shape (9, wavelength)."""
    table = files.table("prospect_d.csv")
    n = table["refractive_index"].to_numpy()
    entering = [interface_transmissivity(n, cone) for cone in (_INCIDENCE, 90.0)]
    return np.ascontiguousarray([*(table[name] for name in CONTENTS), *entering, entering[1] / n**2])


@compiled
def _spectra(contents, constants, spectra):
    """Reflectance and transmittance of each leaf at each wavelength."""
    for leaf in range(contents.shape[1]):
        for node in range(constants.shape[1]):
            spectra[0, leaf, node], spectra[1, leaf, node] = _leaf(contents[:, leaf], constants[:, node])


@compiled
def _means(contents, constants, weights, means):
    """Sums of reflectance and transmittance of each leaf over wavelengths, by weights of each band."""
    for leaf in range(contents.shape[1]):
        for node in range(constants.shape[1]):
            reflectance, transmittance = _leaf(contents[:, leaf], constants[:, node])
            for band in range(weights.shape[1]):
                means[0, band, leaf] += weights[node, band] * reflectance
                means[1, band, leaf] += weights[node, band] * transmittance


@jitable
def _leaf(contents, constants):
    """Reflectance and transmittance of a leaf at one wavelength."""
    absorption, structure = 0 * contents[0], contents[0]
    for number in range(1, contents.size):
        absorption += contents[number] * constants[number - 1]
    tau = layer_transmissivity(absorption / structure)
    cone, hemisphere, leaving = constants[-3], constants[-2], constants[-1]
    # One layer that is lit from outside, and one between others.
    top_reflectance, top_transmittance = plate(cone, leaving, tau)
    reflectance, transmittance = plate(hemisphere, leaving, tau)
    below_reflectance, below_transmittance = pile(reflectance, transmittance, structure - 1)
    multiple = top_transmittance / (1 - below_reflectance * reflectance)
    return top_reflectance + multiple * below_reflectance * transmittance, multiple * below_transmittance


def _number(name, value):
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"Leaf: {name} must be a number, or a raster, got {described(value)}") from None


# Coefficients of k^n in E1(k) + ln(k), which is entire; 40 reach rounding up to k = 4.
_SERIES = np.array([-np.euler_gamma, *(-((-1) ** n) / (n * math.factorial(n)) for n in range(1, 41))])


@jitable
def layer_transmissivity(k):
    r"""
    Isotropic transmittance of an absorbing layer without its surfaces, from its absorption k. [1] :math:`\tau = (1 - k)
    \, e^{-k} + k^2 E_1(k)`, which is 2 E3(k): by the series of E1, or a continued fraction [DLMF 8.9.2] of E3.
    [Jacquemoud1990]_
    """
    if k.real <= 0:
        return 1 + 0 * k
    if k.real > 4:
        fraction = k + 63
        for n in range(30, 0, -1):
            fraction = k + 1 + 2 * n - n * (n + 2) / fraction
        return 2 * np.exp(-k) / fraction
    total = 0 * k
    for n in range(18 if k.real < 1 else 40, -1, -1):
        total = total * k + _SERIES[n]
    return (1 - k) * np.exp(-k) + k * k * (total - np.log(k))


def interface_transmissivity(refractive_index, angle):
    """
    Transmittance of a plane surface for unpolarized light from air, averaged over a cone about its normal.

    Parameters
    ----------
    refractive_index : array
        n, above 1. [1]
    angle : float
        Half opening of the cone; 90 is a hemisphere. [degree]

    Returns
    -------
    transmissivity : array
        [1]

    Notes
    -----
    The mean of Fresnel's transmissivity with weight ``sin(2 theta)``, integrated over the cosine. Stern gives it in
    closed form for the hemisphere, Allen for the cone.

    References
    ----------
    [Stern1964]_; [Allen1973]_
    """
    n = np.asarray(refractive_index, float)[..., None]
    # Between cos(angle) and 1, as 1 - d: a narrow cone loses no digits.
    depth = 2 * np.sin(np.radians(angle) / 2) ** 2
    mu = 1 - depth * (1 + _NODES) / 2
    mu_inside = np.sqrt(1 - (1 - mu**2) / n**2)
    perpendicular = ((mu - n * mu_inside) / (mu + n * mu_inside)) ** 2
    parallel = ((n * mu - mu_inside) / (n * mu + mu_inside)) ** 2
    passed = 1 - (perpendicular + parallel) / 2
    return np.sum(passed * mu * _WEIGHTS, axis=-1) / np.sum(mu * _WEIGHTS)


@jitable
def plate(entering, leaving, tau):
    """Reflectance and transmittance of a layer from the transmissivities of its surfaces and inside, [Allen1969]_."""
    inside = (1 - leaving) * tau
    transmittance = entering * tau * leaving / (1 - inside * inside)
    return 1 - entering + inside * transmittance, transmittance


@jitable
def pile(r, t, layers):
    """Reflectance and transmittance of a pile of layers of reflectance r above 0 and transmittance t, [Stokes1862]_."""
    square = (1 + r + t) * (1 + r - t) * (1 - r + t) * (1 - r - t)
    d = np.sqrt(square) if square.real > 0 else 0 * square
    a = (1 + r * r - t * t + d) / (2 * r)
    if (a * a - 1).real < 1e-7:
        # Without absorption, the limit is a random walk.
        passed = t / (t + (1 - t) * layers) if t.real > 0 else t
        return 1 - passed, passed
    # The inverse of Stokes' b: it is 0, not infinite, where a layer is opaque.
    q = (2 * t / (1 - r * r + t * t + d)) ** layers if t.real > 0 else (0 * t if layers.real > 0 else 1 + 0 * t)
    return a * (1 - q * q) / (a * a - q * q), q * (a * a - 1) / (a * a - q * q)
