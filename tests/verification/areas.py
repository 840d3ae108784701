"""Every check of the package, area by area."""

from verification import (
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

AREAS = {
    "random field": landscape.CHECKS,
    "canopy": (*canopy.CHECKS, *canopy.FOLIAGE_CHECKS, *benchmarks.CANOPY),
    "terrain": terrain.CHECKS,
    "atmosphere": (*scattering.CHECKS, *benchmarks.CHECKS, *scattering.ADJACENCY_CHECKS, *atmosphere.CHECKS),
    "sensor": (*sensor.CHECKS, *sensor.LINE_SPREAD_CHECKS, *scan.CHECKS),
    "analysis": analysis.CHECKS,
}


def deviations():
    """Iterate over the deviations of all checks."""
    return (deviation for checks in AREAS.values() for check in checks for deviation in check())
