"""Units of elevation, and the vertical resolution that whole numbers of them leave."""

import numpy as np

# Metres in one unit of elevation, and names that files use for it. NIST SP 811, App. B.8: the two feet differ by 2e-6.
_UNITS = {
    "m": (1.0, "metre", "metres", "meter", "meters"),
    "ft": (0.3048, "foot", "feet", "international foot", "foot (international)"),
    "us-ft": (1200.0 / 3937.0, "us survey foot", "us survey feet", "survey foot", "ftus", "foot us", "us foot"),
    "km": (1000.0, "kilometre", "kilometer"),
    "dm": (0.1, "decimetre", "decimeter"),
    "cm": (0.01, "centimetre", "centimeter"),
    "mm": (0.001, "millimetre", "millimeter"),
}

# Above this share of neighbours that are equal, whole numbers are terraces: their risers show in slope and aspect.
TERRACES = 0.25


def metres_per_unit(name):
    """
    Metres in a unit of elevation.

    Parameters
    ----------
    name : str
        As files and coordinate reference systems spell it, such as ``"ft"`` or ``"US survey foot"``.

    Returns
    -------
    metres : float
        [m]

    Raises
    ------
    ValueError
        If the unit is not known.

    Examples
    --------
    >>> metres_per_unit("Foot")
    0.3048
    """
    plain = str(name).strip().lower().replace("_", " ")
    for unit, (metres, *names) in _UNITS.items():
        if plain in (unit, *names):
            return metres
    raise ValueError(f"vertical units must be one of {', '.join(_UNITS)}, got {name!r}")


def terrace_step(values):
    """
    Vertical resolution of elevations that are whole numbers and lie in terraces.

    Parameters
    ----------
    values : array, shape (rows, columns)
        NaN where unknown.

    Returns
    -------
    step : int or None
        Greatest common divisor of the differences, where more than a quarter of the neighbours are equal and some are
        not; None for elevations without terraces. [unit of the values]
    """
    differences = np.concatenate([np.diff(values, axis=axis).ravel() for axis in (0, 1)])
    differences = differences[np.isfinite(differences)]
    known = values[np.isfinite(values)]
    if not known.size or not differences.any() or np.any(known != np.rint(known)):
        return None
    equal = np.mean(differences == 0)
    return int(np.gcd.reduce(np.abs(differences).astype(np.int64))) if equal > TERRACES else None
