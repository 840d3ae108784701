"""The canopy on labelled rasters: its reflectance on level ground, and the light that it absorbs."""

from functools import partial

import numpy as np
import xarray as xr

from fifesim.ground.canopy import absorption
from fifesim.ground.canopy.crowns import SHAPE, check_crowns, crown_shares, lai_in_crowns
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.leaf_area import check_map, warn_of_large
from fifesim.ground.canopy.rasters import canopy_shares
from fifesim.ground.canopy.rasters.evaluation import canopy_kernel, even_canopy
from fifesim.rasters import cf, directions
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.origins import made_of
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
    brown=0.0,
    dissociation=0.0,
    brown_optics=None,
    crown_cover=1.0,
    crown_shape=SHAPE,
    soil_changes=None,
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
    brown, dissociation, crown_cover : float or xarray.DataArray, dims (y, x), optional
        Dead share of the leaf area, how far it lies below the rest, and the share of the ground below crowns. Where the
        dissociation is a raster, SAIL is evaluated at every cell. [1]
    brown_optics : (reflectance, transmittance), optional
        Of dead leaves, each as those of the leaves are given; where some are dead they are needed. [1]
    crown_shape : float, optional
        Crown diameter over height. [1]
    soil_changes : (callable, sequence of xarray.DataArray), optional
        What makes the background of each cell of a dry one, from `ground.canopy.rasters.soils.soil_kernel`.
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
        If the optics, the hotspot or a share are not possible, or LAI is negative.

    See Also
    --------
    fifesim.ground.canopy.sail_model.sail, fifesim.ground.canopy.layers.two_layers,
    fifesim.ground.canopy.crowns.clumped
    """
    lai = checked_scene(lai)
    optics = {"leaf_reflectance": leaf_reflectance, "leaf_transmittance": leaf_transmittance, "background": background}
    shares = {"brown": brown, "dissociation": dissociation, "crown_cover": crown_cover}
    how = {"leaf_angles": leaf_angles, "hotspot": hotspot, "brown_optics": brown_optics, "crown_shape": crown_shape}
    how["soil_changes"] = soil_changes
    light = {"diffuse_fraction": diffuse_fraction, "geometry": geometry, "exact": exact}
    kernel, rasters = canopy_kernel(lai, bands, **optics, **shares, **how, **light)
    varies = directions.varying(geometry)
    out = chunking.pointwise(kernel, lai.drop_vars(varies, errors="ignore"), *rasters, bands=len(bands))
    described = "raster" if isinstance(background, xr.DataArray) else ",".join(f"{value:g}" for value in background)
    said = {"leaf_angles": str(leaf_angle_classes(leaf_angles)), "background": described}
    out = labelled(out, lai, bands, wavelengths, geometry, told=canopy_shares.in_words(shares), **said, **provenance)
    return made_of(out, even_canopy(lai, **optics, **shares, **how, **light))


def labelled(reflectance, lai, bands, wavelengths, geometry, *, leaf_angles, told="", **provenance):
    """
    Reflectance of a scene with its bands, place, directions and attributes.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
    lai : xarray.DataArray, dims (y, x)
    bands, wavelengths, geometry
        As in `level_reflectance`.
    leaf_angles, told : str
        Leaf angles, and what else there is to tell, for a line of the history.
    **provenance : str or number
        Further attributes.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
    """
    out = reflectance.assign_coords(cf.band_coordinates(band=bands, wavelength=wavelengths))
    out = directions.with_geometry(grids.place(out, grids.geobox(lai)), geometry)
    said = f"surface_reflectance: SAIL, {leaf_angles} leaves, {told}{_directions(geometry)}"
    return cf.label(out, "surface_reflectance", source=lai, history=said, leaf_angles=leaf_angles, **provenance)


def fpar(
    lai,
    *,
    geometry=None,
    time=None,
    leaf_angles="spherical",
    fpar_inf=absorption.FPAR_INF,
    leaves="all",
    brown=0.0,
    dissociation=0.0,
    crown_cover=1.0,
):
    """
    Fraction of photosynthetically active radiation that a canopy absorbs, or its green leaves.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    geometry, time, leaf_angles, fpar_inf, leaves, brown, dissociation, crown_cover : optional
        As in `fifesim.fpar`.

    Returns
    -------
    fpar : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If LAI is negative, or a share outside 0 to 1.

    References
    ----------
    [Friedl1995]_, Eq. 6

    See Also
    --------
    fifesim.ground.canopy.absorption.fpar, fifesim.ground.canopy.absorption.green_fpar
    """
    geometry = directions.given_geometry(geometry, lai, time)
    if "sza" in directions.varying(geometry):
        directions.uniform_geometry(geometry, "fpar")
    lai = checked_scene(lai)
    said = {"leaf_angles": leaf_angles, "fpar_inf": fpar_inf, "leaves": leaves}
    shares = {"brown": brown, "dissociation": dissociation, "crown_cover": crown_cover}
    kernel, rasters, shares = fpar_kernel(lai, geometry, **said, **shares)
    out = chunking.pointwise(kernel, lai, *rasters)
    out = grids.place(out, grids.geobox(lai))
    of = "" if leaves == "all" else "green leaves, "
    extinction = absorption.extinction_coefficient(float(geometry.sza), leaf_angles)
    said = f"fpar: Beer's law, {of}{canopy_shares.in_words(shares)}K {float(extinction):.4f}, limit {fpar_inf:g}"
    return cf.label(out, "green_fpar" if leaves == "green" else "fpar", source=lai, history=said)


def fpar_kernel(
    lai,
    geometry,
    *,
    leaf_angles="spherical",
    fpar_inf=absorption.FPAR_INF,
    leaves="all",
    brown=0.0,
    dissociation=0.0,
    crown_cover=1.0,
):
    """
    Kernel of the light that a canopy absorbs, and the rasters that it takes.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or None
        Whose CRS the rasters have where they lost theirs.
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        Of one sun.
    leaf_angles, fpar_inf, leaves, brown, dissociation, crown_cover : optional
        As in `fpar`.

    Returns
    -------
    kernel : callable
        ``kernel(lai, *blocks)`` gives the fraction from leaf area, and blocks of the rasters. [1]
    rasters : list of xarray.DataArray
    shares : dict of str to float or xarray.DataArray
        Those that it uses.

    Raises
    ------
    ValueError
        As in `fpar`.
    """
    if not 0 < fpar_inf <= 1:
        raise ValueError(f"fpar_inf must be in (0, 1], got {fpar_inf:g}: it is a fraction, 0.94 in the paper")
    if leaves not in ("all", "green"):
        raise ValueError(f"leaves must be 'all' or 'green', got {leaves!r}: which of them absorb the light")
    shares = {"crown_cover": canopy_shares.share("crown_cover", crown_cover, lai)}
    if leaves == "green":
        shares |= {"brown": canopy_shares.share("brown", brown, lai)}
        shares |= {"dissociation": canopy_shares.share("dissociation", dissociation, lai)}
    sza = float(geometry.sza)
    extinction = float(absorption.extinction_coefficient(sza, leaf_angles))
    light = {"extinction": extinction, "fpar_inf": fpar_inf, "sza": sza}
    kernel, rasters = canopy_shares.with_shares(partial(_fpar, **light), shares)
    return kernel, rasters, shares


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
        If it is another quantity, also by its name or long_name, has other dimensions or no grid; in memory, if it has
        no data.

    Warns
    -----
    UserWarning
        If the mean of a raster in memory that fifesim did not make exceeds 8.
    """
    cf.check_quantity(lai, "lai")
    if set(lai.dims) != {"y", "x"}:
        raise ValueError(f"leaf area index has dimensions (y, x), got {lai.dims}: select one layer with .isel or .sel")
    grids.geobox(lai)
    said = [each for each in (lai.name, lai.attrs.get("long_name")) if isinstance(each, str)]
    cf.check_words(str(lai.name or "the raster"), said, "lai")
    lai = unpacked(lai)
    if lai.chunks is None and lai.size:
        if not np.isfinite(lai.values).any():
            raise ValueError(
                "all cells of the leaf area index are NaN: look at the nodata value and the place of its map"
            )
        # Scenes and maps of fifesim carry their distribution, and were looked at when they were made.
        if "lai_distribution" not in lai.attrs:
            warn_of_large(lai.values)
    return lai


def _directions(geometry):
    """The zenith angles in words."""
    return ", ".join(
        f"{name} varying" if name in directions.varying(geometry) else f"{name} {getattr(geometry, name):.2f}"
        for name in ("sza", "vza")
    )


def _fpar(lai, *, extinction, fpar_inf, sza, crown_cover, **kinds):
    lai, light = check_map(lai), {"extinction": extinction, "fpar_inf": fpar_inf}
    if not isinstance(crown_cover, np.ndarray) and crown_cover == 1:
        return absorption.green_fpar(lai, **light, **kinds) if kinds else absorption.fpar(lai, **light)
    check_crowns(lai, crown_cover)
    inside, lit = lai_in_crowns(lai, crown_cover), crown_shares(crown_cover, SHAPE, sza, 0.0, 0.0).sun
    return lit * (absorption.green_fpar(inside, **light, **kinds) if kinds else absorption.fpar(inside, **light))
