"""PROSPECT-D: reflectance and transmittance of a leaf from its chemistry and structure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import exp1

from fifesim.base import files
from fifesim.base.annotations import Array, NumberOrArray
from fifesim.base.arguments import described
from fifesim.base.caches import cached

CONTENTS = {
    "chlorophyll": ("ug cm-2", 200.0),
    "carotenoids": ("ug cm-2", 100.0),
    "anthocyanins": ("ug cm-2", 100.0),
    "brown": ("1", 10.0),
    "water": ("cm", 0.2),
    "dry_matter": ("g cm-2", 0.1),
}
"""What absorbs in a leaf: its unit and the largest content that is taken for one."""

LARGEST_STRUCTURE = 10.0
"""Most layers of a leaf [1]; measured leaves have 1 to 3.5."""

# Light from outside comes within a cone about the normal of the rough surface. [degree]
_INCIDENCE = 40.0

# Fresnel's equations are analytic in the cosine: 32 nodes integrate them to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True)
class Leaf:
    """
    A leaf, by what it is made of; the defaults are the green tallgrass of ``data/README.md``.

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
        If a number is outside the range of leaves; of a raster when it is used.
    TypeError
        If it is no number.

    References
    ----------
    [Feret2017]_

    Examples
    --------
    >>> from fifesim import Leaf
    >>> Leaf(water=12)
    Traceback (most recent call last):
    ...
    ValueError: Leaf: water must be in [0, 0.2] cm, got 12: check its unit
    """

    structure: NumberOrArray = 1.7
    chlorophyll: NumberOrArray = 29.0
    carotenoids: NumberOrArray = 7.25
    anthocyanins: NumberOrArray = 0.0
    brown: NumberOrArray = 0.0
    water: NumberOrArray = 0.012
    dry_matter: NumberOrArray = 0.0148

    def __post_init__(self):
        ranges = {"structure": ("1", 1.0, LARGEST_STRUCTURE)}
        ranges |= {name: (unit, 0.0, largest) for name, (unit, largest) in CONTENTS.items()}
        for name, (unit, low, high) in ranges.items():
            value = getattr(self, name)
            if not hasattr(value, "ndim") or not value.ndim:
                value = _number(name, value)
            # Lazy arrays are looked at when they compute.
            if isinstance(value, float | np.ndarray):
                outside = np.atleast_1d(value)[np.atleast_1d((value < low) | (value > high))]
                if outside.size or (isinstance(value, float) and np.isnan(value)):
                    got = outside[0] if outside.size else value
                    unit = "" if unit == "1" else f" {unit}"
                    raise ValueError(f"Leaf: {name} must be in [{low:g}, {high:g}]{unit}, got {got:g}: check its unit")
            object.__setattr__(self, name, value)

    def varying(self) -> dict[str, Array]:
        """What differs from leaf to leaf, a dict of str to array."""
        values = {name: getattr(self, name) for name in ("structure", *CONTENTS)}
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

    Examples
    --------
    Light that is neither reflected nor transmitted is absorbed, which is most of it in the red:

    >>> wavelength, reflectance, transmittance = leaf_spectrum(Leaf(chlorophyll=40))
    >>> bool(1 - (reflectance + transmittance)[wavelength == 0.67][0] > 0.8)
    True
    """
    table = files.table("prospect_d.csv")
    first, last = np.searchsorted(table["wavelength"].to_numpy(), limits)
    table = table.iloc[max(first - 1, 0) : last + 2]
    refractive_index = table["refractive_index"].to_numpy()
    content = {name: _column(getattr(leaf, name)) for name in CONTENTS}
    structure = _column(leaf.structure)
    absorption = sum(content[name] * table[name].to_numpy() for name in CONTENTS) / structure
    tau = layer_transmissivity(absorption)
    # Reflectance of one layer that is lit from outside, and of one between others.
    first = plate(refractive_index, tau, _INCIDENCE)
    other = plate(refractive_index, tau, 90.0)
    reflectance_below, transmittance_below = pile(*other, structure - 1)
    multiple = 1 - reflectance_below * other[0]
    reflectance = first[0] + first[1] * reflectance_below * other[1] / multiple
    transmittance = first[1] * transmittance_below / multiple
    return table["wavelength"].to_numpy(), reflectance, transmittance


def _number(name, value):
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"Leaf: {name} must be a number, or a raster, got {described(value)}") from None


def _column(value):
    """A number unchanged, or an array of leaves with an axis for wavelengths."""
    return value if isinstance(value, float) else np.asarray(value, float)[..., None]


def layer_transmissivity(absorption):
    r"""
    Isotropic transmittance of an absorbing layer, without its surfaces.

    .. math:: \tau = (1 - k) \, e^{-k} + k^2 E_1(k)

    with :math:`E_1` the exponential integral.

    Parameters
    ----------
    absorption : array
        k, absorption coefficient times thickness, not negative. [1]

    Returns
    -------
    tau : array
        [1]

    References
    ----------
    [Jacquemoud1990]_

    Examples
    --------
    >>> float(layer_transmissivity(0.0))
    1.0
    """
    k = np.asarray(absorption, float)
    # k^2 E1(k) vanishes at 0, where E1 does not exist.
    return (1 - k) * np.exp(-k) + k**2 * exp1(np.where(k > 0, k, 1.0))


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

    Examples
    --------
    >>> interface_transmissivity(1.5, 0.001).round(9).item(), 1 - ((1.5 - 1) / (1.5 + 1)) ** 2
    (0.96, 0.96)
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


def plate(refractive_index, tau, angle):
    """
    Reflectance and transmittance of one layer with two surfaces.

    Parameters
    ----------
    refractive_index : array
        n. [1]
    tau : array
        Transmissivity inside, `layer_transmissivity`. [1]
    angle : float
        Half opening of the cone of the light upon it. [degree]

    Returns
    -------
    reflectance, transmittance : array
        [1]

    References
    ----------
    [Allen1969]_; [Jacquemoud1990]_

    Examples
    --------
    A plate without absorption conserves energy:

    >>> bool(abs(sum(plate(1.4, 1.0, 40.0)) - 1) < 1e-14)
    True
    """
    n = np.asarray(refractive_index, float)
    entering, leaving = (_passing(n.tobytes(), n.shape, cone) for cone in (angle, 90.0))
    leaving = leaving / n**2
    inside = 1 - leaving
    transmittance = entering * tau * leaving / (1 - inside**2 * tau**2)
    return 1 - entering + inside * tau * transmittance, transmittance


@cached(16, "transmissivity of leaf surfaces")
def _passing(refractive_index, shape, angle):
    """`interface_transmissivity` of the bytes of an array, cached because leaves share it."""
    passing = np.asarray(interface_transmissivity(np.frombuffer(refractive_index).reshape(shape), angle))
    passing.flags.writeable = False
    return passing


def pile(reflectance, transmittance, layers):
    """
    Reflectance and transmittance of a pile of equal layers under isotropic light.

    Parameters
    ----------
    reflectance, transmittance : array
        Reflectance r, above 0, and transmittance of one layer. [1]
    layers : float
        Number of layers, not negative; it need not be whole.

    Returns
    -------
    reflectance, transmittance : array
        Reflectance and transmittance of the pile. [1]

    References
    ----------
    [Stokes1862]_

    Examples
    --------
    No layer reflects nothing:

    >>> reflectance, transmittance = pile(0.3, 0.6, 0.0)
    >>> float(reflectance), float(transmittance)
    (0.0, 1.0)
    """
    r, t = np.asarray(reflectance, float), np.asarray(transmittance, float)
    d = np.sqrt(np.maximum((1 + r + t) * (1 + r - t) * (1 - r + t) * (1 - r - t), 0))
    a = (1 + r**2 - t**2 + d) / (2 * r)
    # The inverse of Stokes' b: it is 0, not infinite, where a layer is opaque.
    q = (2 * t / (1 - r**2 + t**2 + d)) ** layers
    # Without absorption a and q are 1, and the limit is that of a random walk.
    conservative = a**2 - 1 < 1e-7
    divisor = np.where(conservative, 1.0, a**2 - q**2)
    passed = t / (t + (1 - t) * layers + (t == 0))
    return (
        np.where(conservative, 1 - passed, a * (1 - q**2) / divisor),
        np.where(conservative, passed, q * (a**2 - 1) / divisor),
    )
