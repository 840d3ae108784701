"""The canopy on labelled rasters: its reflectance on level ground, and the light that it absorbs."""

from functools import partial

import numpy as np
import xarray as xr

from fifesim.base.geometry import ANGLES, relative_azimuth
from fifesim.ground.canopy import absorption
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.optics import check_map
from fifesim.ground.canopy.reflectance_table import canopy_reflectance, directional_reflectance
from fifesim.rasters import cf, directions
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.dates import by_date
from fifesim.rasters.packed import unpacked


def level_reflectance(
    lai,
    *,
    bands,
    wavelengths,
    leaf_reflectance,
    leaf_transmittance,
    background,
    diffuse_fraction,
    geometry,
    leaf_angles="spherical",
    hotspot=0.0,
    exact=False,
    **provenance,
):
    """
    Reflectance factor of a canopy over its background, for flat ground.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    bands : sequence of str, shape (band,)
        Names.
    wavelengths : sequence of float, shape (band,)
        [um]
    leaf_reflectance, leaf_transmittance : sequence of float, shape (band,), or xarray.DataArray, dims (band, y, x)
        Where they are rasters, SAIL is evaluated at every cell. [1]
    background : sequence of float, shape (band,), or xarray.DataArray, dims ([band], y, x)
        Reflectance below the canopy. [1]
    diffuse_fraction : sequence of float, shape (band,), or xarray.DataArray, dims (band, y, x)
        Share of skylight in the irradiance. [1]
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        Carried on as coordinates. Where an angle is a raster, SAIL is evaluated at every cell.
    leaf_angles : optional
        As `ground.canopy.leaf_angles.leaf_angle_classes` takes them.
    hotspot : float, optional
        Leaf size over canopy height; 0 is none. [1]
    exact : bool, optional
        Evaluate SAIL at every cell instead of interpolating a table that is within 1e-6 of it.
    **provenance : str or number
        Further attributes.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If the optics or the hotspot are not possible, or LAI is negative.

    See Also
    --------
    fifesim.ground.canopy.sail_model.sail
    """
    lai = checked_scene(lai)
    said = {"leaf_angles": leaf_angles, "hotspot": hotspot, "exact": exact}
    optics = {"leaf_reflectance": leaf_reflectance, "leaf_transmittance": leaf_transmittance, "background": background}
    light = {"diffuse_fraction": diffuse_fraction, "geometry": geometry}
    kernel, rasters = canopy_kernel(bands, **optics, **light, **said)
    out = chunking.pointwise(kernel, lai.drop_vars(ANGLES, errors="ignore"), *rasters, bands=len(bands))
    described = "raster" if isinstance(background, xr.DataArray) else ",".join(f"{value:g}" for value in background)
    said = {"leaf_angles": str(leaf_angle_classes(leaf_angles)), "background": described}
    return labelled(out, lai, bands, wavelengths, geometry, **said, **provenance)


def canopy_kernel(
    bands,
    *,
    leaf_reflectance,
    leaf_transmittance,
    background,
    diffuse_fraction,
    geometry,
    leaf_angles="spherical",
    hotspot=0.0,
    exact=False,
):
    """
    What gives the reflectance of cells of one canopy, and the rasters that it takes.

    Parameters
    ----------
    bands : sequence of str
    leaf_reflectance, leaf_transmittance, background, diffuse_fraction, geometry, leaf_angles, hotspot, exact
        As in `level_reflectance`.

    Returns
    -------
    kernel : callable
        ``kernel(lai, *blocks)`` gives reflectance, shape (band, ...), from leaf area of shape (...) and blocks of the
        rasters, of shape (..., [band]).
    rasters : list of xarray.DataArray

    Raises
    ------
    ValueError
        As in `level_reflectance`.
    """
    if not 0 <= hotspot < np.inf:
        raise ValueError(f"hotspot must be at least 0, got {hotspot:g}: it is leaf size over canopy height")
    parameters = {"leaf_angles": leaf_angle_classes(leaf_angles), "hotspot": float(hotspot)}
    if isinstance(background, xr.DataArray):
        cf.check_units(background, "surface_reflectance")
        background = _background_bands(background, bands)
    background = _per_band(background)
    leaves = leaf_reflectance, leaf_transmittance
    if directions.varying(geometry) or any(isinstance(each, xr.DataArray) for each in leaves):
        by_band = [_per_band(each) for each in (background, diffuse_fraction, *leaves)]
        return partial(_by_cell, parameters), [*by_band, *directions.angles(geometry)]
    names = "leaf_reflectance", "leaf_transmittance"
    parameters |= {name: tuple(map(float, values)) for name, values in zip(names, leaves, strict=True)}
    parameters |= {name: getattr(geometry, name) for name in ("sza", "vza", "raa")}
    parameters |= {"diffuse_fraction": tuple(map(float, diffuse_fraction)), "exact": exact}
    return partial(_reflectance, parameters), [background]


def labelled(reflectance, lai, bands, wavelengths, geometry, *, leaf_angles, **provenance):
    """
    Reflectance of a scene with its bands, place, directions and attributes.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
    lai : xarray.DataArray, dims (y, x)
    bands, wavelengths, geometry
        As in `level_reflectance`.
    leaf_angles : str
        In words.
    **provenance : str or number
        Further attributes.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
    """
    out = reflectance.assign_coords(cf.band_coordinates(band=bands, wavelength=wavelengths))
    out = directions.with_geometry(grids.place(out, grids.geobox(lai)), geometry)
    said = f"surface_reflectance: SAIL, {leaf_angles} leaves, {_directions(geometry)}"
    return cf.label(out, "surface_reflectance", source=lai, history=said, leaf_angles=leaf_angles, **provenance)


@by_date
def fpar(lai, *, geometry=None, time=None, leaf_angles="spherical", fpar_inf=absorption.FPAR_INF):
    """
    Fraction of photosynthetically active radiation that a canopy absorbs.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    geometry : fifesim.base.geometry.Geometry, optional
        The sun's; by default that which the array carries, else at its time and place.
    time : str or datetime, optional
        In the place of ``geometry``.
    leaf_angles : optional
        As `ground.canopy.leaf_angles.leaf_angle_classes` takes them.
    fpar_inf : float, optional
        Of an infinitely thick canopy. [1]

    Returns
    -------
    fpar : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If LAI is negative.

    References
    ----------
    [Friedl1995]_, Eq. 6

    See Also
    --------
    fifesim.ground.canopy.absorption.fpar
    """
    if not 0 < fpar_inf <= 1:
        raise ValueError(f"fpar_inf must be in (0, 1], got {fpar_inf:g}: it is a fraction, 0.94 in the paper")
    geometry = directions.given_geometry(geometry, lai, time)
    if "sza" in directions.varying(geometry):
        directions.uniform_geometry(geometry, "fpar")
    extinction = float(absorption.extinction_coefficient(float(geometry.sza), leaf_angles))
    lai = checked_scene(lai)
    out = chunking.pointwise(_fpar, lai, extinction=extinction, fpar_inf=fpar_inf)
    out = grids.place(out, grids.geobox(lai))
    return cf.label(out, "fpar", source=lai, history=f"fpar: Beer's law, K {extinction:.4f}, limit {fpar_inf:g}")


def checked_scene(lai):
    """
    Leaf area of a scene in its unit.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]

    Returns
    -------
    lai : xarray.DataArray, dims (y, x)

    Raises
    ------
    ValueError
        If it is another quantity, has other dimensions or no grid; of what is in memory, if it has no data.
    """
    cf.check_quantity(lai, "lai")
    if set(lai.dims) != {"y", "x"}:
        raise ValueError(f"leaf area index has dimensions (y, x), got {lai.dims}: select one layer with .isel or .sel")
    grids.geobox(lai)
    lai = unpacked(lai)
    if lai.chunks is None and lai.size and not np.isfinite(lai.values).any():
        raise ValueError("all cells of the leaf area index are NaN: look at the nodata value and the place of its map")
    return lai


def _per_band(values):
    """A raster, or values of each band, without the names of the bands."""
    if isinstance(values, xr.DataArray):
        return values.drop_vars("band", errors="ignore")
    return xr.DataArray(np.asarray(values, float), dims="band")


def _reflectance(parameters, lai, background):
    # apply_ufunc hands the bands over as the last axis.
    return canopy_reflectance(check_map(lai), background=np.moveaxis(background, -1, 0), **parameters)


def _by_cell(parameters, cells, ground, sky, reflectance, transmittance, sza, saa, vza, vaa):
    """Reflectance where the directions of sun or sensor, or the leaves, vary over the scene."""
    towards = {"sza": sza, "vza": vza, "raa": relative_azimuth(saa, vaa)}
    light = {"background": ground, "diffuse_fraction": sky, **towards}
    return directional_reflectance(check_map(cells), reflectance, transmittance, **light, **parameters)


def _directions(geometry):
    """The zenith angles in words."""
    return ", ".join(
        f"{name} varying" if name in directions.varying(geometry) else f"{name} {getattr(geometry, name):.2f}"
        for name in ("sza", "vza")
    )


def _fpar(lai, **parameters):
    return absorption.fpar(check_map(lai), **parameters)


def _background_bands(background, bands):
    """A background raster with one band for each of the canopy's."""
    if "band" not in background.dims:
        return background.expand_dims(band=list(bands))
    missing = [name for name in bands if name not in background["band"].to_numpy().tolist()]
    if missing:
        raise ValueError(
            f"the background lacks band {', '.join(missing)}, it has {', '.join(map(str, background['band'].values))}"
        )
    return background.sel(band=list(bands))
