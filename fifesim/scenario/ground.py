"""The ground of a scenario: leaf area or a landscape, its canopies, and what of it an image is compared with."""

from pathlib import Path

import xarray as xr

from fifesim.chain.landscapes import fpar
from fifesim.chain.stands import warn_of_tallgrass
from fifesim.ground.canopy.crowns import check_crowns
from fifesim.ground.landscape.classes import CoverClass, class_table
from fifesim.ground.landscape.cover import PATTERNS, Patches
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.landscape.drawn import Field
from fifesim.ground.landscape.raster import lai_scene, lai_window
from fifesim.ground.landscape.rasters.scenes import landscape
from fifesim.rasters.sites import on_fife_site
from fifesim.scenario.ground_keys import COVARIATES
from fifesim.scenario.land import cut

# What `Setup` has of a stand by the same names, and what a class of cover calls otherwise.
_NUMBERS = ("leaf_angles", "hotspot", "brown", "dissociation", "crown_cover", "crown_shape")
_OF_A_CLASS = {"leaf_optics": "leaf"}


def ground_scene(scenario, grid, chunks=None, dem=None):
    """
    The ground of a scenario.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    chunks : mapping or int, optional
        Makes it lazy.
    dem : xarray.DataArray, dims (y, x), optional
        Elevation on the grid or more, which leaf area may go with. [m]

    Returns
    -------
    land : xarray.Dataset
        ``lai`` [m2 m-2], and ``cover`` and properties that vary where the scenario has them.
    """
    land, own = scenario.ground, scenario.landscape
    if not own.is_one():
        return _landscape(scenario, grid, chunks, dem)
    if land.lai_file:
        lai = lai_window(land.lai_file, grid, chunks=chunks)
    else:
        lai = lai_scene(grid, land.distribution, arp=land.arp, seed=land.seed, method=land.method, chunks=chunks)
    return lai.to_dataset(name="lai")


def _landscape(scenario, grid, chunks, dem):
    land, own = scenario.ground, scenario.landscape
    properties = drawn_properties(scenario)
    if own.moisture and "moisture" not in properties:
        properties["moisture"] = own.moisture
    if own.cover == "none":
        cover, classes = None, CoverClass("ground", lai=land.distribution)
    else:
        cover, classes = own.cover, scenario.class_table()
    if own.cover in PATTERNS:
        cover = Patches(own.cover, own.size, _shares(scenario))
    covary = {name: correlation for name, correlation in own.covary.items() if correlation}
    of_dem = bool(set(covary) & set(COVARIATES))
    return landscape(
        grid,
        cover=cover,
        classes=classes,
        lai=land.lai_file,
        arp=land.arp,
        covary=covary or None,
        dem=cut(dem, grid) if of_dem else None,
        geometry=scenario.sun_and_view() if "illumination" in covary else None,
        seed=land.seed,
        chunks=chunks,
        **properties,
    )


def warn_of_canopy(scenario):
    """
    Warn if optics of FIFE's tallgrass are taken for a map of leaf area, or for another site.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        As it was written, without completed keys.

    Warns
    -----
    UserWarning
        As `fifesim.chain.stands.warn_of_tallgrass`.
    """
    own = scenario.ground.lai_file
    if own or not on_fife_site(scenario.geobox()):
        canopy = {"leaf_optics": None, "background": None, "brown_leaf": None, "brown": 0.0} | canopy_of(scenario)
        classes = class_table(_classes(scenario)) if _classes(scenario) else ()
        warn_of_tallgrass(Path(own).name if own else "the scene", classes, canopy, drawn_properties(scenario))


def drawn_properties(scenario):
    """
    Properties of the ground of a scenario that vary in fields.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    properties : dict of str to fifesim.ground.landscape.drawn.Field
    """
    land, own = scenario.ground, scenario.landscape
    means = {"soil": 0.0, "moisture": own.moisture, "brown": land.brown, "crown_cover": land.crown_cover}
    return {
        name: Field(mean=means[name], sd=deviation, arp=own.arps.get(name, land.arp), coarser=own.coarser)
        for name, deviation in own.deviations.items()
        if deviation
    }


def check_crown_cover(scenario):
    """
    Check that the crowns of each stand can hold the largest leaf area index of its distribution.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Raises
    ------
    ValueError
        If the leaf area index within the crowns could exceed the largest that SAIL is evaluated for. The check is left
        to the run where leaf area or crown cover varies in a map or field.
    """
    land = scenario.ground
    if land.lai_file or "crown_cover" in drawn_properties(scenario):
        return
    stands = [("ground", land.distribution, land.crown_cover)]
    if scenario.landscape.cover != "none":
        stands = [
            (f"classes.{name}", each.lai, land.crown_cover if each.crown_cover is None else each.crown_cover)
            for name, each in scenario.class_table().items()
        ]
    for place, distribution, cover in stands:
        try:
            check_crowns(lai_distribution(distribution).support()[1], cover)
        except ValueError as error:
            raise ValueError(f"{place}.crown_cover = {cover:g}: {error}") from None


def canopy_of(scenario):
    """
    What the keys of [ground] say of the canopy.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    canopy : dict
        Fields of a `Setup`, without what is drawn, and without what every class says itself.
    """
    land = scenario.ground
    said = {"leaf_optics": land.leaf_optics(), "background": land.below_canopy(), "brown_leaf": land.dead_leaf()}
    said |= {name: getattr(land, name) for name in _NUMBERS}
    left_out = {name for name in said if _all_say(scenario, _OF_A_CLASS.get(name, name))}
    left_out |= set(drawn_properties(scenario))
    return {name: value for name, value in said.items() if name not in left_out}


def truth_of(scenario, setup, land):
    """
    What of the ground of a scenario an image is compared with, by cells.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    setup : fifesim.chain.setup.Setup
        From `setup_of`.
    land : xarray.Dataset
        From `ground_scene`.

    Returns
    -------
    truth : xarray.Dataset
        ``lai``, ``fpar`` and where leaves are dead ``green_fpar``, and all else that varies but ``cover``.
    """
    absorbed = {name: absorbed_light(scenario, setup, land, kind) for name, kind in fpar_kinds(scenario).items()}
    varying = {name: each for name, each in land.data_vars.items() if name not in ("lai", "cover") and each.ndim == 2}
    return xr.Dataset({"lai": land["lai"], **absorbed, **varying})


def fpar_kinds(scenario):
    """
    Which leaves absorb the light that an image of a scenario is compared with.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    kinds : dict of str to str
        By name of the truth, what `fifesim.fpar` takes as ``leaves``.
    """
    return {"fpar": "all"} | ({"green_fpar": "green"} if _has_dead_leaves(scenario) else {})


def absorbed_light(scenario, setup, land, leaves="all"):
    """
    Share of light that the leaves of a scenario absorb, by cells.

    Parameters
    ----------
    scenario, setup, land
        As in `truth_of`.
    leaves : {"all", "green"}, optional

    Returns
    -------
    fpar : xarray.DataArray, dims (y, x)
        [1]
    """
    told = {name: getattr(setup, name) for name in ("geometry", "leaf_angles", "brown", "dissociation", "crown_cover")}
    return fpar(land, leaves=leaves, fpar_inf=scenario.ground.fpar_inf, **told)


def _has_dead_leaves(scenario):
    return any(said_by_stands(scenario, "brown")) or "brown" in drawn_properties(scenario)


def said_by_stands(scenario, name):
    """
    Numbers of a property that hold somewhere on the ground of a scenario, where it is not drawn.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    name : str
        Of the property, such as ``"crown_cover"``.

    Returns
    -------
    numbers : list of float
    """
    own = [getattr(each, name) for each in _classes(scenario)]
    ground = [] if _all_say(scenario, name) else [getattr(scenario.ground, name)]
    return [*ground, *(number for number in own if number is not None)]


def _all_say(scenario, name):
    """Whether every class of cover has a value of its own."""
    classes = _classes(scenario)
    return bool(classes) and all(getattr(each, name) is not None for each in classes)


def _classes(scenario):
    return list(scenario.class_table().values()) if scenario.landscape.cover != "none" else []


def _shares(scenario):
    """Shares of the classes that are drawn, None where they are equal."""
    shares = {name: stand.share for name, stand in scenario.classes.items()}
    return shares if any(shares.values()) else None
