"""The ground of a scenario with any of what varies over it at its ideal."""

from fifesim.ground.canopy.properties import DRAWN
from fifesim.scenario.ground import drawn_properties, ground_scene, numbers_of_stands

# In this order along the axes of what `stages.pixels` gives.
PROPERTIES = {
    "soil": "as bright and as moist everywhere",
    "dead leaves": "the same share of dead leaves everywhere",
    "cover": "leaves and what lies below them are those of the first class",
    "clumping": "leaves stand evenly, without gaps between crowns",
    "covariance": "leaf area goes with nothing else",
}


def varying(scenario):
    """
    What varies over the ground of a scenario beside its leaf area.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    properties : tuple of str
        In the order of `PROPERTIES`.
    """
    own, classes = scenario.landscape, scenario.class_table() if scenario.landscape.cover != "none" else {}
    found = {DRAWN[name].effect for name in drawn_properties(scenario)}
    if len(classes) > 1 and any(each.canopy.given for each in classes.values()):
        found.add("cover")
    if any(set(numbers_of_stands(scenario, name)) != {known.default} for name, known in _of("clumping").items()):
        found.add("clumping")
    if any(own.covary.values()):
        found.add("covariance")
    return tuple(name for name in PROPERTIES if name in found)


def _of(effect):
    """Properties of the canopy whose variation is an effect."""
    return {name: known for name, known in DRAWN.items() if known.effect == effect}


def ground_with(scenario, grid, at_work, dem=None):
    """
    Ground of a scenario with some of what varies at its ideal, from the same random numbers.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    at_work : collection of str
        Of `PROPERTIES`; the others are ideal.
    dem : xarray.DataArray, dims (y, x), optional
        Elevation, which leaf area may go with. [m]

    Returns
    -------
    land : xarray.Dataset
        In memory, with ``lai`` [m2 m-2].
    """
    own, ideal = scenario.landscape, {}
    if "covariance" not in at_work:
        ideal["covary"] = {}
    land = ground_scene(scenario.model_copy(update={"landscape": own.model_copy(update=ideal)}), grid, dem=dem)
    for name, known in DRAWN.items():
        # Without clumping there are no gaps between crowns; what else is not at work has its mean.
        if known.effect == "clumping" and known.effect in varying(scenario) and known.effect not in at_work:
            land = land.assign({name: known.default})
        elif known.effect not in at_work and name in land:
            land = land.assign({name: getattr(scenario.ground, name)})
    if "cover" not in at_work and "cover" in land:
        first = land["cover"].attrs["flag_values"][0]
        land["cover"] = land["cover"].where(land["cover"] < 0, first).astype(land["cover"].dtype)
    return land.compute()
