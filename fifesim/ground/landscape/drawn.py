"""Properties of the ground that vary in fields: what values they have, and how coarsely they vary."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from numbers import Real

from scipy import stats

from fifesim.base.annotations import Distribution
from fifesim.base.kinds import described
from fifesim.ground.canopy.properties import DRAWN
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP, check_arp
from fifesim.ground.landscape.coarse_lattice import check_coarser

SHARES = tuple(name for name, known in DRAWN.items() if (known.lowest, known.highest) == (0, 1))
"""Properties between 0 and 1."""


@dataclass(frozen=True)
class Field:
    """
    A property of a landscape that varies in a field.

    Parameters
    ----------
    mean : float, optional
        [1]
    sd : float
        Standard deviation. [1]
    arp : float, optional
        Autoregressive parameter of the field, in [0, 0.2498]. [1]
    coarser : int, optional
        Ground cells along a side of a cell of the field's own lattice, which `arp` counts in: with 4 a field varies
        over 27 m and more on ground cells of 3.3 m, and takes a tenth of the time. By default it has the ground's.

    Raises
    ------
    ValueError
        If a number is out of its range.
    TypeError
        If one is no number.

    Examples
    --------
    >>> from fifesim import Field
    >>> float(Field(mean=0.2, sd=0.1).distribution("brown").mean())
    0.2
    """

    mean: float = 0.0
    sd: float = 0.0
    arp: float = 0.15
    coarser: int = 1

    def __post_init__(self):
        for name in ("mean", "sd", "arp"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, Real):
                raise TypeError(f"Field: {name} must be a number, got {described(value)}: type Field(mean=0.2, sd=0.1)")
        if not 0 <= self.sd < float("inf"):
            raise ValueError(f"Field: sd must be at least 0, got {self.sd:g}: it is a standard deviation")
        if not abs(self.mean) <= 1:
            raise ValueError(f"Field: mean must be in [-1, 1], got {self.mean:g}")
        check_coarser(self.coarser)
        check_arp(self.arp)
        if self.arp > LARGEST_STREAMING_ARP:
            raise ValueError(f"Field: arp must be at most {LARGEST_STREAMING_ARP}, got {self.arp:g}")

    def distribution(self, name: str) -> Distribution:
        """
        Distribution of a share: the beta distribution of its mean and standard deviation.

        Parameters
        ----------
        name : str
            Of the property, ``"moisture"``, ``"brown"`` or ``"crown_cover"``.

        Returns
        -------
        distribution : frozen scipy distribution
            [1]

        Raises
        ------
        ValueError
            If nothing between 0 and 1 has this mean and standard deviation.
        """
        if not 0 < self.mean < 1:
            raise ValueError(
                f"{name} lies between 0 and 1: for it to vary its mean must lie between them, such as 0.2, got "
                f"{self.mean:g}"
            )
        most = (self.mean * (1 - self.mean)) ** 0.5
        if not 0 < self.sd < most:
            raise ValueError(
                f"{name} lies between 0 and 1: with a mean of {self.mean:g} its sd must be above 0 and below "
                f"{most:.3g}, got {self.sd:g}"
            )
        return _beta(float(self.mean), float(self.sd))


# The same object each time: what is tabulated of a distribution is kept with it.
@lru_cache(maxsize=32)
def _beta(mean, sd):
    weight = mean * (1 - mean) / sd**2 - 1
    return stats.beta(mean * weight, (1 - mean) * weight)
