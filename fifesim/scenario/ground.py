"""The ground of a scenario: leaf area or a landscape, its canopies, and what of it an image is compared with."""

from pathlib import Path

import xarray as xr

from fifesim.chain.landscapes import fpar
from fifesim.chain.stands import warn_of_tallgrass
from fifesim.ground.landscape.classes import CoverClass, class_table
from fifesim.ground.landscape.cover import PATTERNS, Patches
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.landscape.drawn import Field
from fifesim.ground.landscape.raster import lai_scene, lai_window
from fifesim.ground.landscape.rasters.scenes import landscape
from fifesim.rasters.sites import on_fife_site
from fifesim.scenario.ground_keys import COVARIATES
from fifesim.scenario.land import cut


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
        name, classes = Path(own).name if own else "the scene", _classes(scenario)
        # A mean stands for what is drawn.
        cells = {name: each.mean for name, each in drawn_properties(scenario).items()}
        warn_of_tallgrass(name, class_table(classes) if classes else (), canopy_of(scenario), cells)


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
    return {
        name: Field(mean=getattr(land, name), sd=deviation, arp=own.arps.get(name, land.arp), coarser=own.coarser)
        for name, deviation in own.deviations.items()
        if deviation
    }


def check_leaf_area(scenario):
    """
    Check that the canopy of each stand can hold the largest leaf area index of its distribution.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Raises
    ------
    ValueError
        If the leaf area index within the crowns could exceed the largest that SAIL is evaluated for. The check is left
        to the run where leaf area or a property varies in a map or field.
    """
    land, classes = scenario.ground, _classes(scenario)
    if land.lai_file:
        return
    drawn = dict.fromkeys(drawn_properties(scenario))
    stands = [(f"classes.{each.name}", each.lai, each.canopy.over(land.canopy())) for each in classes]
    for place, distribution, canopy in stands or [("ground", land.distribution, land.canopy())]:
        try:
            canopy.replace(**drawn).check_lai(lai_distribution(distribution).support()[1])
        except ValueError as error:
            raise ValueError(f"{place}.{error}") from None


def canopy_of(scenario):
    """
    Canopy of the keys of [ground], without what is drawn, and without what every class has itself.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    canopy : fifesim.ground.canopy.description.Canopy
    """
    found = scenario.ground.canopy()
    left_out = {name for name in found.given if _all_have(scenario, name)} | set(drawn_properties(scenario))
    return found.replace(**dict.fromkeys(left_out))


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
    fpar_inf = scenario.ground.fpar_inf
    return fpar(land, canopy=setup.canopy, geometry=setup.geometry, leaves=leaves, fpar_inf=fpar_inf)


def _has_dead_leaves(scenario):
    return any(numbers_of_stands(scenario, "brown")) or "brown" in drawn_properties(scenario)


def numbers_of_stands(scenario, name):
    """Values of a property in the stands of a scenario, where it is not drawn, a list of float."""
    ground = [] if _all_have(scenario, name) else [getattr(scenario.ground, name)]
    return [*ground, *(getattr(each.canopy, name) for each in _classes(scenario) if name in each.canopy.given)]


def _all_have(scenario, name):
    """Whether every class of cover has a value of its own."""
    classes = _classes(scenario)
    return bool(classes) and all(name in each.canopy.given for each in classes)


def _classes(scenario):
    return list(scenario.class_table().values()) if scenario.landscape.cover != "none" else []


def _shares(scenario):
    """Shares of the classes that are drawn, None where they are equal."""
    shares = {name: stand.share for name, stand in scenario.classes.items()}
    return shares if any(shares.values()) else None
