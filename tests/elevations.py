"""Elevation of analytic surfaces and random hills, as arrays, files and labelled rasters."""

import numpy as np
import rasterio
import xarray as xr
from affine import Affine

import fifesim
from fifesim.grids import grid as grids

# North-west corner of the largest square inside the Kings Creek DEM. [m]
WEST, NORTH = 708120.0, 4331070.0
CRS = "EPSG:26914"

# Amplitude of `surface`. [m]
AMPLITUDE = 38.0


def surface(x, y):
    """Band-limited hills: waves of 160 to 900 m, at least six cells of 30 m along each axis. [m]"""
    u, v = x - WEST, y - NORTH
    waves = [(160, 30, 2.0), (240, 110, 4.0), (500, 200, 12.0), (900, 75, 20.0)]
    angles = [(2 * np.pi / length, np.radians(angle), size) for length, angle, size in waves]
    return 400 + sum(size * np.sin(k * (u * np.cos(a) + v * np.sin(a)) + size) for k, a, size in angles)


def tilted(x, y):
    """Elevation of a plane. [m]"""
    return 400 + 0.1 * (x - WEST) - 0.05 * (y - NORTH)


def model(function=surface, cell=30.0, margin=600.0, size=900.0, affine=None, shape=None):
    """Point values of a function on a lattice larger than the grid, and the affine transform of the lattice."""
    affine = affine or Affine(cell, 0, WEST - margin, 0, -cell, NORTH + margin)
    shape = shape or (int((size + 2 * margin) / cell),) * 2
    columns, rows = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    return function(*(affine * (columns, rows))), affine


def write(path, values, affine, crs=CRS, unit=None, nodata=-9999.0, dtype="float64"):
    values = np.where(np.isnan(values), nodata, values)
    profile = {"driver": "GTiff", "width": values.shape[1], "height": values.shape[0], "count": 1, "dtype": dtype}
    with rasterio.open(path, "w", crs=crs, transform=affine, nodata=nodata, **profile) as file:
        file.write(values.astype(dtype), 1)
        if unit:
            file.units = (unit,)
    return path


def grid(cell=30 / 9, size=900.0, crs=CRS, west=WEST, north=NORTH):
    return fifesim.grid_at(crs, west, north, size, size, cell)


def truth(dem, function=surface):
    return function(dem["x"].values[None, :], dem["y"].values[:, None])


def labelled(grid, values=None, **attrs):
    values = hills(tuple(grid.shape), seed=1, relief=40.0) if values is None else values
    return grids.place(xr.DataArray(values, dims=("y", "x"), name="dem", attrs={"units": "m"} | attrs), grid)


def plane(shape, cell_y, cell_x, slope, aspect):
    """Elevation of a plane that falls by a slope toward an aspect [degree]."""
    i, j = np.mgrid[: shape[0], : shape[1]].astype(float)
    north, east = -i * cell_y, j * cell_x
    a = np.radians(aspect)
    return 1000 - np.tan(np.radians(slope)) * (east * np.sin(a) + north * np.cos(a))


def hills(shape, seed=0, relief=30.0, length=9.0):
    """Smooth random ground: waves of several lengths [cells]."""
    rng = np.random.default_rng(seed)
    i, j = np.mgrid[: shape[0], : shape[1]].astype(float)
    z = np.full(shape, 400.0)
    for wave in length * 1.6 ** np.arange(5):
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        z += relief * wave / (10 * length) * np.sin(2 * np.pi / wave * (i * np.cos(angle) + j * np.sin(angle)) + phase)
    return z
