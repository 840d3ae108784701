"""Simulation of a scenario: scene, image and truth, as in Figure 1."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.atmosphere.clouds.labels import DEEPEST_GROUND, cast_clouds, cloud_field
from fifesim.base.arguments import Chunks
from fifesim.chain.comparison import shows_ndvi
from fifesim.chain.landscapes import block_averages
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.chain.steps import kt, kt_and_reflectance, ndvi
from fifesim.grids import grid as grids
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.scenario.ground import canopy_of, cut, elevation, ground_scene, in_memory, truth_of
from fifesim.scenario.scenario import Scenario
from fifesim.sensor.pixel_labels import pixel_grid, shifts_of, warn_of_pixels


def simulate(scenario: Scenario, chunks: Chunks = "auto", *, complete: bool = False) -> xr.DataTree:
    """
    Simulate scene, image and truth of a scenario.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    chunks : mapping or int, optional
        Chunks of the scene; by default whole tiles of the random field.
    complete : bool, optional
        If True, also simulate the ground around the scene within reach of the pixel footprints, so that the image has
        no missing pixels at its edge. The positions of scene, truth and pixels do not change. Chips of
        `fifesim.dataset` are complete.

    Returns
    -------
    run : xarray.DataTree
        Lazy. ``scene`` has ``lai`` and ``surface_reflectance`` by cell, and ``dem`` unless the ground is flat.
        ``image`` has digital numbers ``dn`` and ``ndvi``. ``truth`` has means of ``lai`` and ``fpar`` over the pixels
        of the gridded product, for any sampling interval. With terrain, ``terrain`` has ``dem``, ``slope`` and ``kt``
        averaged in the same way, with the known extent of the elevation in its attributes; ``level`` has the digital
        numbers for level ground. With clouds, ``truth`` has the fractions ``cloud`` and ``shadow``, and the mean
        ``optical_thickness``.

    Raises
    ------
    ValueError
        If values of the scenario contradict each other, or `complete` is used with ``method = "periodic"``, whose field
        ends at the edge of the scene.

    Examples
    --------
    >>> import fifesim
    >>> scenario = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    >>> run = fifesim.simulate(scenario)
    >>> list(run.children), run["image"]["dn"].shape
    (['scene', 'truth', 'image'], (2, 10, 10))
    """
    nodes, reach = run_nodes(scenario, chunks, complete)
    tree = xr.DataTree.from_dict({name: xr.Dataset(arrays) for name, arrays in nodes.items()})
    if reach:
        tree["terrain"].attrs = {f"reach_{side}": distance for side, distance in reach.items()}
    return tree


def run_nodes(scenario, chunks, complete, whole=True):
    """Rasters of a run by node and name, of its image and truth alone unless it is whole, and the reach of the land."""
    grid, setup = scenario.geobox(), setup_of(scenario)
    ground, setup, inside = with_margin(scenario, setup) if complete else (grid, setup, {})
    means = partial(block_averages, pixel=scenario.sensor.size, min_valid=setup.min_valid)
    setup = replace(setup, clouds=clouds_of(scenario, ground, chunks))
    dem, horizon, reach = elevation(scenario, ground, chunks)
    dem, horizon = (dem, horizon) if whole else in_memory(dem, horizon)
    lit = replace(setup, dem=dem, horizon=horizon)
    land = ground_scene(scenario, ground, chunks)
    scene, nodes = land.isel(inside), {}
    level = reflectance = reflectance_of(setup if whole else lit, land)
    if whole:
        nodes["scene"] = dict(scene.data_vars)
    nodes["truth"] = means(truth_of(scenario, setup, scene))
    if whole and dem is not None:
        reflectance, kt = _on_slopes(lit, level, land)
        own, slope = cut(dem, grid), cut(terrain_labels.slope(dem), grid)
        nodes["scene"]["dem"] = own
        nodes["terrain"] = means({"dem": own, "slope": slope, "kt": kt.isel(inside)})
        nodes["level"] = {"dn": image_of(setup, level, land)}
    if whole:
        nodes["scene"]["surface_reflectance"] = reflectance.isel(inside)
    if setup.clouds is not None:
        hidden = cast_clouds(reflectance, setup.clouds, dem=dem)[["cloud", "shadow", "optical_thickness"]]
        nodes["truth"] |= means(hidden.isel(inside).data_vars)
    image = image_of(lit, reflectance, land)
    nodes["image"] = {"dn": image} | ({"ndvi": ndvi(image)} if shows_ndvi(image) else {})
    return nodes, reach


def warn_of_scenario_pixels(*scenarios):
    """Warn once if the pixels of scenarios have other sizes than those of their instruments."""
    sizes = {}
    for one in scenarios:
        own, size = one.sensor, one.sensor.interval
        if size != "native":
            place = own.instrument, own.response, tuple(own.bands)
            sizes.setdefault(place, (own.description, set()))[1].add(own.size if size == "product" else size)
    for (_, _, bands), (description, found) in sizes.items():
        warn_of_pixels(description, description.select(bands), found)


def _on_slopes(setup, level, land):
    """Reflectance on slopes and Kt of a setup with elevation, from the reflectance of level ground."""
    if setup.slopes == "kt":
        return kt_and_reflectance(level, setup.dem, setup.horizon, setup.upwelling)[::-1]
    return reflectance_of(setup, land), kt(level, setup.dem, horizon=setup.horizon)


def clouds_of(scenario, grid, chunks="auto"):
    """Cloud field of a scenario on a grid and within reach of it; None if the sky is clear."""
    own, geometry = scenario.clouds, scenario.sun_and_view()
    if own.cloud_cover == 0:
        return None
    deepest = 0.0 if scenario.terrain.dem == "flat" else DEEPEST_GROUND
    reach = (own.top + deepest) * (np.tan(np.radians(geometry.sza)) + np.tan(np.radians(geometry.vza)))
    return cloud_field(
        grid,
        own.cloud_cover,
        thickness=(own.thickness, own.thickness if own.deviation is None else own.deviation),
        length=own.length,
        height=(own.base, own.top),
        seed=own.seed,
        time=scenario.overpass_time(),
        margin=float(reach),
        chunks=chunks,
    )


def setup_of(scenario):
    """Setup of a scenario: ground, atmosphere and instrument, without elevation."""
    own = scenario.sensor
    aligned = own.interval == "product"
    # Keys that are fields of a setup have their names. The seed of a setup is the seed of the sensor.
    keys = dict([*scenario.terrain, *scenario.atmosphere, *own])
    given = {name: tuple(value) if isinstance(value, list) else value for name, value in keys.items()}
    return Setup(
        **{name: value for name, value in given.items() if name in Setup.__dataclass_fields__}
        | {
            "instrument": own.description,
            "atmosphere": scenario.model_atmosphere(),
            "geometry": scenario.sun_and_view(),
            "canopy": canopy_of(scenario),
            "clouds": clouds_of(scenario, scenario.geobox()),
            "dem": None,
            "onto": grids.aligned_grid(scenario.geobox(), own.size) if aligned else None,
            "interval": None if aligned else own.interval,
            "noise_models": own.given_noise(),
        }
    )


def with_margin(scenario, setup):
    """Grid covered by the footprints of all pixels, its setup, and the slices of the scenario in it."""
    if scenario.ground.method == "periodic":
        raise ValueError('ground.method = "periodic" has no ground beyond the scene: use method = "streaming"')
    grid, bands = scenario.geobox(), setup.instrument.select(setup.bands)
    pixels = pixel_grid(grid, setup.instrument, bands, setup.onto, setup.interval)
    spreads = zip(*map(setup.instrument.line_spreads, bands), strict=True)
    sizes = zip(spreads, grids.cell_size(pixels), shifts_of(setup.offset, pixels), grids.cell_size(grid), strict=True)
    down, across = (
        max(int(np.ceil((max(one.half_width for one in along) - pixel / 2 + np.abs(shift).max()) / cell - 1e-9)), 0)
        for along, pixel, shift, cell in sizes
    )
    inside = {"y": slice(down, down + grid.shape.y), "x": slice(across, across + grid.shape.x)}
    a, shape = grid.affine, (grid.shape.y + 2 * down, grid.shape.x + 2 * across)
    ground = GeoBox(shape, Affine(a.a, 0.0, a.c - across * a.a, 0.0, a.e, a.f - down * a.e), grid.crs)
    return ground, replace(setup, onto=pixels, interval=None), inside
