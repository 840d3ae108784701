"""Every check of the package, area by area."""

from verification import analysis, atmosphere, benchmarks, canopy, landscape, sensor, terrain

AREAS = {
    "random field": landscape.CHECKS,
    "canopy": (*canopy.CHECKS, *benchmarks.CANOPY),
    "terrain": terrain.CHECKS,
    "atmosphere": (*benchmarks.CHECKS, *atmosphere.CHECKS),
    "sensor": sensor.CHECKS,
    "analysis": analysis.CHECKS,
}
# Stage of Figure 1 of each area, in processing order.
AREA_STAGES = dict.fromkeys(("random field", "canopy", "terrain"), "Ground")
AREA_STAGES |= {"atmosphere": "Atmosphere", "sensor": "Sensor", "analysis": "Analysis"}


def deviations():
    """Iterate over the deviations of all checks."""
    return (deviation for checks in AREAS.values() for check in checks for deviation in check())
