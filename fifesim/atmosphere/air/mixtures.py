"""Names of aerosols: mixtures of components, by their volume."""

from collections.abc import Mapping
from numbers import Real
from pathlib import PurePath

import numpy as np

from fifesim.atmosphere.air.components import COMPONENTS
from fifesim.base.spelling import closest

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
        `fifesim.read_aerosol` takes.

    Examples
    --------
    >>> mixture({"soot": 0.25, "dust": 0.75})
    {'dust': 0.75, 'soot': 0.25}
    >>> mixture("urban") == MODELS["urban"]
    True
    """
    is_file = isinstance(aerosol, PurePath) or (isinstance(aerosol, str) and aerosol.endswith((".nc", ".csv")))
    # A Dataset is a mapping, too.
    if is_file or hasattr(aerosol, "data_vars"):
        raise TypeError(
            "aerosol must be a text, a mapping or what fifesim.read_aerosol gives, got a Dataset or a file: "
            "type aerosol=fifesim.read_aerosol(...)"
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
    """
    The one text that names an aerosol.

    Parameters
    ----------
    aerosol : str or mapping
        As in `mixture`.

    Returns
    -------
    name : str
        One of `MODELS` where the fractions are a model's; else the mixture, its components in order.

    Raises
    ------
    ValueError, TypeError
        As `mixture`.

    Examples
    --------
    >>> canonical({"soot": 0.25, "dust": 0.75})
    'dust:0.75+soot:0.25'
    >>> canonical(mixture("maritime"))
    'maritime'
    """
    fractions = mixture(aerosol)
    for name, model in MODELS.items():
        if fractions == model:
            return name
    return "+".join(f"{name}:{np.format_float_positional(value, trim='-')}" for name, value in fractions.items())


def _parsed(text):
    """Fractions of a mixture text, as yet unchecked."""
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
