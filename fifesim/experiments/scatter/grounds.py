"""The ground of a scenario with any of what varies over it at its ideal."""

from fifesim.ground.landscape.classes import OPTICS
from fifesim.scenario.ground import drawn_properties, ground_scene, said_by_stands

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
    drawn = drawn_properties(scenario)
    found = {
        "soil": bool({"soil", "moisture"} & set(drawn)),
        "dead leaves": "brown" in drawn,
        "cover": len(classes) > 1 and any(_has_optics(each) for each in classes.values()),
        "clumping": "crown_cover" in drawn or min(said_by_stands(scenario, "crown_cover")) < 1,
        "covariance": any(own.covary.values()),
    }
    return tuple(name for name in PROPERTIES if found[name])


def _has_optics(kind):
    return any(getattr(kind, name) is not None for name in OPTICS)


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
    if "soil" not in at_work:
        land = land.drop_vars("soil", errors="ignore")
        land = land.assign(moisture=own.moisture) if "moisture" in land else land
    if "dead leaves" not in at_work and "brown" in land:
        land = land.assign(brown=scenario.ground.brown)
    if "clumping" not in at_work and "clumping" in varying(scenario):
        land = land.assign(crown_cover=1.0)
    if "cover" not in at_work and "cover" in land:
        first = land["cover"].attrs["flag_values"][0]
        land["cover"] = land["cover"].where(land["cover"] < 0, first).astype(land["cover"].dtype)
    return land.compute()
