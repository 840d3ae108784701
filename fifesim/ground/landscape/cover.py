"""
Patches of cover as a function of seed and place.

All patterns are functions of northing and easting, so that a window is a slice of the whole, chunks change nothing, and
cells of another size show the same patches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import norm

from fifesim.base.kinds import described
from fifesim.ground.landscape.patterns import pastures, smooth_field, voronoi

PATTERNS = ("voronoi", "levels", "pastures")

# Shares may miss 1 by rounding.
_WHOLE = 1e-6


@dataclass(frozen=True)
class Patches:
    """
    How the classes of a drawn landscape lie.

    Parameters
    ----------
    pattern : {"voronoi", "levels", "pastures"}
        ``voronoi``: cells about random points, as stands and watersheds are. ``levels``: between contours of a smooth
        field, in the order of the classes, as zones along a slope are. ``pastures``: rectangles with fences between.
    size : float
        Of a patch: the root of the mean area; of ``levels``, the distance at which the correlation of the field falls
        to 1/e. [m]
    shares : sequence or mapping of str to float, optional
        Share of the ground of each class, in their order or by name; equal by default. [1]

    Raises
    ------
    ValueError
        If there is no such pattern, the size is not positive, or the shares are negative or do not sum to 1.
    TypeError
        If one is of another kind.

    Examples
    --------
    >>> from fifesim import Patches
    >>> Patches("voronoi", 300, shares={"grass": 0.7, "wood": 0.3}).size
    300.0
    """

    pattern: Literal["voronoi", "levels", "pastures"]
    size: float
    shares: Sequence[float] | Mapping[str, float] | None = None

    def __post_init__(self):
        if self.pattern not in PATTERNS:
            raise ValueError(f"the pattern of patches is one of {', '.join(PATTERNS)}, got {described(self.pattern)}")
        size = self.size
        if isinstance(size, bool | str) or np.ndim(size) or not 0 < float(size) < np.inf:
            raise ValueError(f"the size of patches is a number above 0, in metres, got {described(size)}")
        object.__setattr__(self, "size", float(size))
        if self.shares is not None:
            named = hasattr(self.shares, "items")
            values = list(self.shares.values() if named else self.shares)
            _check_shares(values)
            shares = dict(zip(self.shares, values, strict=True)) if named else tuple(map(float, values))
            object.__setattr__(self, "shares", shares)

    def shares_of(self, names: Sequence[str]) -> tuple[float, ...]:
        """
        Share of each class.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        shares : tuple of float

        Raises
        ------
        ValueError
            If they are the shares of other classes.
        """
        if self.shares is None:
            return (1.0 / len(names),) * len(names)
        if isinstance(self.shares, dict):
            if set(self.shares) != set(names):
                raise ValueError(f"shares are of {', '.join(self.shares)}, the classes are {', '.join(names)}")
            return tuple(float(self.shares[name]) for name in names)
        if len(self.shares) != len(names):
            raise ValueError(f"{len(self.shares)} shares for {len(names)} classes: give one for each")
        return self.shares


def patch_classes(patches, shares, seed, northing, easting, codes=None):
    """
    Number of the class of each cell.

    Parameters
    ----------
    patches : Patches
    shares : sequence of float, shape (n,)
        They sum to 1. [1]
    seed : int
        In [0, 2**63).
    northing, easting : array, shape (y,), (x,)
        Of cell centres. [m]
    codes : array of int16, shape (n,), optional
        Of the classes, in the place of their numbers.

    Returns
    -------
    classes : array of int16, shape (y, x)
        From 0 to n - 1, or codes.

    Examples
    --------
    A window is a slice of the whole:

    >>> north, east = np.arange(40) * -10.0, np.arange(50) * 10.0
    >>> whole = patch_classes(Patches("voronoi", 90), (0.5, 0.5), 7, north, east)
    >>> part = patch_classes(Patches("voronoi", 90), (0.5, 0.5), 7, north[5:20], east[9:])
    >>> bool((whole[5:20, 9:] == part).all())
    True
    """
    if not np.size(northing) or not np.size(easting):
        return np.zeros((np.size(northing), np.size(easting)), np.int16)
    codes = np.arange(len(shares), dtype=np.int16) if codes is None else codes
    place = np.asarray(northing, float) / patches.size, np.asarray(easting, float) / patches.size
    if patches.pattern == "levels":
        limits = norm.ppf(np.minimum(np.cumsum(shares)[:-1], 1.0))
        return codes[np.searchsorted(limits, smooth_field(seed, *place), side="right")]
    draw = voronoi if patches.pattern == "voronoi" else pastures
    return draw(seed, *place, lambda numbers: codes[np.searchsorted(np.cumsum(shares)[:-1], numbers, side="right")])


def _check_shares(values):
    wrong = [value for value in values if isinstance(value, str) or np.ndim(value) or not 0 <= float(value) <= 1]
    if wrong:
        raise ValueError(f"the share of a class is in [0, 1], got {described(wrong[0])}")
    if not abs(sum(values) - 1) <= _WHOLE:
        given = ", ".join(f"{value:g}" for value in values[:8]) + (", ..." if values[8:] else "")
        raise ValueError(f"the shares of the classes must sum to 1, got {sum(values):g} of {given}")
