"""Every check of the package, area by area."""

from __future__ import annotations

from fifesim.experiments.verification import (
    analysis,
    atmosphere,
    benchmarks,
    canopy,
    landscape,
    scan,
    scattering,
    sensor,
    terrain,
)
from fifesim.experiments.verification.deviations import Deviation
from fifesim.output.progress import steps

AREAS = {
    "random field": landscape.CHECKS,
    "canopy": (*canopy.CHECKS, *canopy.FOLIAGE_CHECKS, *benchmarks.CANOPY),
    "terrain": terrain.CHECKS,
    "atmosphere": (*scattering.CHECKS, *benchmarks.CHECKS, *scattering.ADJACENCY_CHECKS, *atmosphere.CHECKS),
    "sensor": (*sensor.CHECKS, *sensor.LINE_SPREAD_CHECKS, *scan.CHECKS),
    "analysis": analysis.CHECKS,
}


def verify() -> list[Deviation]:
    """
    Check this installation against independent results.

    Returns
    -------
    deviations : list of Deviation
        For each check, the ``area``, ``what`` was compared, the largest ``deviation`` with its ``bound`` and ``unit``,
        the ``source`` of the independent result, and whether the deviation is ``within`` the bound.

    Notes
    -----
    References are theoretical limits, quadratures, and tables from other codes in ``data/verification``. The checks
    take up to half a minute. ``fifesim verify`` prints them by stage.

    References
    ----------
    [Friedl1995]_, line spread and radiances of TM; [Vermote1997]_, the atmosphere

    Examples
    --------
    >>> import fifesim
    >>> [each.what for each in fifesim.verify() if not each.within]  # doctest: +SKIP
    []
    """
    return [deviation for checks in steps(list(AREAS.values()), "areas") for check in checks for deviation in check()]


def deviations():
    """Iterate over the deviations of all checks."""
    return (deviation for checks in AREAS.values() for check in checks for deviation in check())
