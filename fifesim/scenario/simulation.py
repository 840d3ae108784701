"""Figure 1 end to end: a scenario as scene, image and truth."""

from __future__ import annotations

import xarray as xr

from fifesim.base.annotations import Chunks
from fifesim.chain.comparison import shows_ndvi
from fifesim.chain.images import ndvi
from fifesim.chain.landscapes import aggregate
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.chain.slopes import kt_and_reflectance
from fifesim.ground.terrain.rasters import slopes
from fifesim.rasters import grid as grids
from fifesim.scenario.ground import canopy_of, ground_scene, truth_of
from fifesim.scenario.land import cut, elevation
from fifesim.scenario.scenario import Scenario


def simulate(scenario: Scenario, chunks: Chunks = "auto") -> xr.DataTree:
    """
    Scene, image and truth of a scenario.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    chunks : mapping or int, optional
        Of the scene; by default whole tiles of the random field.

    Returns
    -------
    run : xarray.DataTree
        Lazy. ``scene`` holds ``lai`` and ``surface_reflectance`` by cells, and ``dem`` where the ground is not flat;
        ``image`` the digital numbers ``dn`` and their ``ndvi``; ``truth`` the means of ``lai`` and ``fpar`` over the
        ground of the pixels of the gridded product, whatever the interval. With terrain, ``terrain`` holds ``dem``,
        ``slope`` and ``kt`` over the same ground; its attributes say how far the elevation is known beyond the scene.
        ``level`` holds the digital numbers on level ground.

    Raises
    ------
    ValueError
        If the scenario asks for what cannot be.

    Examples
    --------
    >>> import fifesim
    >>> scenario = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    >>> run = fifesim.simulate(scenario)
    >>> list(run.children), run["image"]["dn"].shape
    (['scene', 'truth', 'image'], (2, 10, 10))
    """
    if not isinstance(scenario, Scenario):
        raise TypeError(f"simulate takes a Scenario, got {type(scenario).__name__}: see fifesim.read_scenario")
    grid, setup = scenario.geobox(), setup_of(scenario)

    def means(rasters):
        return aggregate(rasters, scenario.sensor.size, min_valid=setup.min_valid)

    dem, horizon, reach = elevation(scenario, grid, chunks)
    land = ground_scene(scenario, grid, chunks, dem)
    level = reflectance_of(setup, land)
    nodes = {"scene": dict(land.data_vars), "truth": dict(means(truth_of(scenario, setup, land)).data_vars)}
    if dem is None:
        reflectance = level
    else:
        kt, reflectance = kt_and_reflectance(level, dem, horizon, setup.upwelling)
        dem, slope = cut(dem, grid), cut(slopes.slope(dem), grid)
        nodes["scene"]["dem"] = dem
        nodes["terrain"] = {"dem": means(dem), "slope": means(slope), "kt": means(kt)}
        nodes["level"] = {"dn": image_of(setup, level)}
    nodes["scene"]["surface_reflectance"] = reflectance
    image = image_of(setup, reflectance)
    nodes["image"] = {"dn": image} | ({"ndvi": ndvi(image)} if shows_ndvi(image) else {})
    tree = xr.DataTree.from_dict({name: xr.Dataset(arrays) for name, arrays in nodes.items()})
    if reach:
        tree["terrain"].attrs = {f"reach_{side}": distance for side, distance in reach.items()}
    return tree


def setup_of(scenario):
    """
    Ground, air and instrument of a scenario, without its elevation.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    setup : fifesim.chain.setup.Setup
        Its pixels are those of ``onto`` or at ``interval``.

    Raises
    ------
    ValueError
        If the instrument or its bands are unknown.
    """
    own = scenario.sensor
    aligned = own.interval == "product"
    return Setup(
        instrument=own.description,
        bands=tuple(own.bands),
        atmosphere=scenario.model_atmosphere(),
        geometry=scenario.sun_and_view(),
        **canopy_of(scenario),
        upwelling=scenario.terrain.upwelling,
        adjacency=scenario.atmosphere.adjacency,
        onto=grids.aligned(scenario.geobox(), own.size) if aligned else None,
        interval=None if aligned else own.interval,
        offset=tuple(own.offset),
        min_valid=own.min_valid,
        noise=tuple(own.noise),
        noise_models=own.given_noise(),
        seed=own.seed,
    )
