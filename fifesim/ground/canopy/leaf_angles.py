"""Leaf angle distributions as fractions of the leaf area in classes of inclination."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from fifesim.base.arguments import Range, check_number, described
from fifesim.base.caches import cached
from fifesim.base.messages import closest

RADIANS_PER_DEGREE = math.pi / 180  # unlike numpy.radians, it serves complex angles, for derivatives


@dataclass(frozen=True)
class LeafAngles:
    """
    Share of the leaf area (`fraction` [1], sum 1) in classes of inclination between leaf normal and vertical [degree].

    ``str`` gives a text from which `leaf_angle_classes` makes the same distribution.
    """

    inclination: tuple
    fraction: tuple = field(repr=False)
    name: str = field(default="", compare=False)

    def __post_init__(self):
        inclination, fraction = (tuple(map(float, values)) for values in (self.inclination, self.fraction))
        if not inclination or len(inclination) != len(fraction):
            raise ValueError(
                f"{len(inclination)} leaf inclinations with {len(fraction)} fractions: give one fraction for each"
            )
        for angle in inclination:
            check_number("a leaf inclination", angle, Range("degree", 0, 90))
        total = math.fsum(fraction)
        if not min(fraction) >= 0 or not abs(total - 1) < 1e-6:
            raise ValueError(
                f"leaf angle fractions must not be negative and sum to 1, got a sum of {total:.9g} "
                f"and a minimum of {min(fraction):g}: divide them by their sum"
            )
        if abs(total - 1) > 1e-15 * len(fraction):
            fraction = tuple(value / total for value in fraction)
        object.__setattr__(self, "inclination", inclination)
        object.__setattr__(self, "fraction", fraction)
        if not self.name:
            pairs = zip(inclination, fraction, strict=True)
            object.__setattr__(self, "name", ", ".join(f"{angle!r}:{share!r}" for angle, share in pairs))

    def __str__(self):
        return self.name


# Cumulative leaf area below an inclination t [radian]: spherical, and de Wit's types.
_CUMULATIVE = {
    "spherical": lambda t: 1 - np.cos(t),
    "planophile": lambda t: (2 * t + np.sin(2 * t)) / np.pi,
    "erectophile": lambda t: (2 * t - np.sin(2 * t)) / np.pi,
    "plagiophile": lambda t: (4 * t - np.sin(4 * t)) / (2 * np.pi),
    "extremophile": lambda t: (4 * t + np.sin(4 * t)) / (2 * np.pi),
    "uniform": lambda t: 2 * t / np.pi,
}


def leaf_angle_classes(distribution="spherical", classes=90):
    r"""
    Fractions of the leaf area in equal classes of inclination, exactly integrated.

    The densities :math:`f(\theta)` are :math:`\sin\theta` (spherical),
    :math:`\frac{2}{\pi}(1 \pm \cos 2\theta)` (planophile, erectophile),
    :math:`\frac{2}{\pi}(1 \mp \cos 4\theta)` (plagiophile, extremophile) and :math:`\frac{2}{\pi}` (uniform).

    Parameters
    ----------
    distribution : str, tuple, sequence of float, or LeafAngles, optional
        ``"spherical"``, ``"planophile"``, ``"erectophile"``, ``"plagiophile"``, ``"extremophile"``,
        ``"uniform"``; ``("verhoef", a, b)`` with \|a\| + \|b\| <= 1; ``("campbell", mean)``, ellipsoidal
        with that mean inclination [degree]; fractions in equal classes from 0 to 90 degrees; or a LeafAngles,
        which passes through. As text: ``"verhoef(-0.35, -0.15)"``, ``"campbell(57)"``, or
        inclinations and fractions, ``"30: 0.5, 60: 0.5"``.
    classes : int, optional
        Number of classes of a named distribution.

    Returns
    -------
    leaf_angles : LeafAngles

    Raises
    ------
    ValueError
        If the name is unknown, or a parameter is outside its range.
    TypeError
        If it is neither text nor a sequence.

    References
    ----------
    [deWit1965]_; [Verhoef1998]_; [Campbell1990]_
    """
    if isinstance(distribution, str):
        distribution = _parsed(distribution)
    if isinstance(distribution, LeafAngles):
        return distribution
    if not isinstance(distribution, Sequence | np.ndarray):
        raise TypeError(
            f"leaf_angles must be a name such as 'spherical' or fractions of classes, got {described(distribution)}: "
            "for a mean inclination of 57 degrees give 'campbell(57)'"
        )
    if len(distribution) and isinstance(distribution[0], str):
        return _named(distribution[0], tuple(float(p) for p in distribution[1:]), int(classes))
    fraction = tuple(distribution)
    return LeafAngles(_centres(len(fraction)), fraction)


def _centres(classes):
    return tuple(90 * (np.arange(classes) + 0.5) / classes)


def _parsed(text):
    """Name and parameters, or a LeafAngles, from text."""
    match = re.fullmatch(r"\s*([a-z]+)\s*(?:\(([^()]*)\))?\s*", text, re.IGNORECASE)
    try:
        if match:
            parameters = match[2].split(",") if match[2] else []
            return (match[1].lower(), *(float(p) for p in parameters))
        pairs = [tuple(map(float, pair.split(":"))) for pair in text.split(",")]
        inclination, fraction = zip(*pairs, strict=True)
    except ValueError:
        raise ValueError(_unknown(text)) from None
    return LeafAngles(inclination, fraction)


def _unknown(text):
    allowed = [*_CUMULATIVE, "verhoef(a, b)", "campbell(mean angle)"]
    near = closest(text.lower(), allowed)
    nearest = f", did you mean {near!r}?" if near else "."
    return (
        f"unknown leaf angle distribution {text!r}{nearest} "
        f"Allowed: {', '.join(allowed)}, or 'inclination: fraction, ...'"
    )


@cached(128, "leaf angle distributions")
def _named(name, parameters, classes):
    """LeafAngles of a named distribution, with this name only for the default number of classes."""
    edges = np.radians(np.linspace(0, 90, classes + 1))
    if name in _CUMULATIVE and not parameters:
        cumulative = _CUMULATIVE[name](edges)
    elif name == "verhoef" and len(parameters) == 2:
        cumulative = _verhoef(edges, *parameters)
    elif name == "campbell" and len(parameters) == 1:
        cumulative = _ellipsoidal(edges, _axis_ratio(*parameters))
    else:
        raise ValueError(_unknown(f"{name}{parameters if parameters else ''}"))
    text = name + (f"({', '.join(map(repr, parameters))})" if parameters else "")
    fraction = np.maximum(np.diff(cumulative), 0.0)
    return LeafAngles(_centres(classes), fraction, text if classes == 90 else "")


def _verhoef(angle, a, b):
    """Two-parameter cumulative distribution (Verhoef 1998); x - a sin x - b/2 sin 2x = 2 angle."""
    if not abs(a) + abs(b) <= 1:
        raise ValueError(f"verhoef(a, b) needs |a| + |b| <= 1, got a = {a:g}, b = {b:g}")
    # y = x - pi / 2, and its sine by the series where it is small: verhoef(0, -1) has a triple root there.
    low, high = np.full_like(angle, -np.pi / 2), np.full_like(angle, np.pi / 2)
    for _ in range(60):
        y = (low + high) / 2
        excess = np.where(np.abs(y) < 1e-4, 2 / 3 * y**3, y - np.sin(2 * y) / 2)
        below = (1 + b) * y - b * excess - a * np.cos(y) < 2 * angle - np.pi / 2
        low, high = np.where(below, y, low), np.where(below, high, y)
    cumulative = 1 + 2 * (high - angle) / np.pi
    cumulative[0], cumulative[-1] = 0, 1
    return cumulative


def _ellipsoidal(angle, axis_ratio):
    """Cumulative ellipsoidal distribution (Campbell 1990): relative area of a cap of a spheroid."""
    # Where the normal of a spheroid of horizontal to vertical axis ratio chi is inclined by t, its relative height is z
    # = (1 + chi^2 tan^2 t)^-1/2; the area grows as sqrt(1 + (chi^2 - 1) z^2) dz.
    q = axis_ratio**2 - 1
    root = math.sqrt(abs(q))

    def area(z):
        if root < 1e-6:
            return 2 * z
        arc = np.arcsinh(root * z) if q > 0 else np.arcsin(np.minimum(root * z, 1))
        return z * np.sqrt(np.maximum(1 + q * z**2, 0)) + arc / root

    height = np.cos(angle) / np.hypot(np.cos(angle), axis_ratio * np.sin(angle))
    return 1 - area(height) / area(1.0)


_MEAN_INCLINATION = Range("degree", 1, 89, (5, 85), {"radians": math.degrees(1)}, "it is the mean inclination")


def _axis_ratio(mean):
    """Axis ratio of the ellipsoidal distribution with a mean inclination [degree]."""
    check_number("campbell: mean", mean, _MEAN_INCLINATION)

    def excess(log_ratio):
        # The mean is the integral of one minus the cumulative distribution.
        above, _ = quad(lambda t: 1 - _ellipsoidal(t, math.exp(log_ratio)), 0, math.pi / 2)
        return math.degrees(above) - mean

    return math.exp(brentq(excess, -8, 8, xtol=1e-13))


def leaf_projection(inclination, zenith):
    r"""
    Mean projection of unit leaf area of one inclination and random azimuth toward a direction.

    .. math::

        \chi = \frac{2}{\pi} \left[ (\beta - \tfrac{\pi}{2}) \cos\theta_l \cos\theta
            + \sin\beta \sin\theta_l \sin\theta \right], \quad
        \cos\beta = -\min(1, \cot\theta_l \cot\theta)

    Parameters
    ----------
    inclination : array
        Leaf inclination :math:`\theta_l`. [degree]
    zenith : array
        Zenith angle :math:`\theta` of the direction. [degree]

    Returns
    -------
    projection : array, shape of the broadcast inputs
        Divided by the cosine of the zenith angle it is the extinction coefficient. [1]

    References
    ----------
    [Verhoef1984]_
    """
    beta, cosines, sines = azimuth_limit(inclination, zenith)
    return 2 / np.pi * ((beta - np.pi / 2) * cosines + np.sin(beta) * sines)


def azimuth_limit(inclination, zenith):
    """
    Azimuth [radian] at which a leaf turns its other side to a direction; pi where every azimuth shows the same side.
    Returned with the products of the cosines and of the sines of inclination and zenith [degree], [Verhoef1984]_.
    """
    tilt, slant = np.multiply(inclination, RADIANS_PER_DEGREE), np.multiply(zenith, RADIANS_PER_DEGREE)
    cosines = np.cos(tilt) * np.cos(slant)
    sines = np.sin(tilt) * np.sin(slant)
    turns = sines > cosines
    ratio = np.where(turns, cosines / np.where(turns, sines, 1), 1)
    return np.arccos(-ratio), cosines, sines
