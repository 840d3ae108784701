"""The canopy on labelled rasters: its reflectance on level ground, and the light that it absorbs."""

import numpy as np
import xarray as xr

from fifesim.base.geometry import ANGLES, relative_azimuth
from fifesim.ground.canopy import absorption
from fifesim.ground.canopy.crowns import SHAPE, check_crowns, crown_shares, lai_in_crowns
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.optics import check_map
from fifesim.ground.canopy.rasters import canopy_shares
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
    brown=0.0,
    dissociation=0.0,
    brown_optics=None,
    crown_cover=1.0,
    crown_shape=SHAPE,
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
    if not 0 <= hotspot < np.inf:
        raise ValueError(f"hotspot must be at least 0, got {hotspot:g}: it is leaf size over canopy height")
    angles = leaf_angle_classes(leaf_angles)
    parameters = {"leaf_angles": angles, "hotspot": float(hotspot)}
    lai = _checked_scene(lai)
    described = "raster" if isinstance(background, xr.DataArray) else ",".join(f"{value:g}" for value in background)
    if described == "raster":
        cf.check_units(background, "surface_reflectance")
        background = _background_bands(background, bands)
    background = _per_band(background)
    leaves = {"leaf_reflectance": leaf_reflectance, "leaf_transmittance": leaf_transmittance}
    if isinstance(brown, xr.DataArray) or brown != 0:
        leaves |= dict(zip(("brown_reflectance", "brown_transmittance"), brown_optics, strict=True))
    shares = {"brown": brown, "dissociation": dissociation, "crown_cover": crown_cover}
    shares = {name: canopy_shares.share(name, value, lai) for name, value in shares.items()}
    parameters["crown_shape"] = float(crown_shape)
    if directions.varying(geometry) or any(isinstance(each, xr.DataArray) for each in leaves.values()):
        out = _by_cell(lai, background, diffuse_fraction, leaves, geometry, shares, parameters)
    else:
        parameters |= {name: tuple(map(float, values)) for name, values in leaves.items()}
        parameters |= {name: getattr(geometry, name) for name in ("sza", "vza", "raa")}
        parameters |= {"diffuse_fraction": tuple(map(float, diffuse_fraction)), "exact": exact}
        kernel, rasters = canopy_shares.with_shares(_reflectance, shares)
        out = chunking.pointwise(kernel, lai, background, *rasters, bands=len(bands), **parameters)
    out = out.assign_coords(cf.band_coordinates(band=bands, wavelength=wavelengths))
    out = directions.with_geometry(grids.place(out, grids.geobox(lai)), geometry)
    said = f"surface_reflectance: SAIL, {angles} leaves, {canopy_shares.in_words(shares)}{_directions(geometry)}"
    provenance = {"leaf_angles": str(angles), "background": described, **provenance}
    return cf.label(out, "surface_reflectance", source=lai, history=said, **provenance)


@by_date
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
    geometry : fifesim.base.geometry.Geometry, optional
        The sun's; by default that which the array carries, else at its time and place.
    time : str or datetime, optional
        In the place of ``geometry``.
    leaf_angles : optional
        As `ground.canopy.leaf_angles.leaf_angle_classes` takes them.
    fpar_inf : float, optional
        Of an infinitely thick canopy. [1]
    leaves : {"all", "green"}, optional
        Which leaves absorb it: all of them, dead ones too, or those alone that can use it.
    brown, dissociation, crown_cover : float or xarray.DataArray, dims (y, x), optional
        As in `surface_reflectance`. [1]

    Returns
    -------
    fpar : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If LAI is negative, or a share outside 0 to 1.

    Notes
    -----
    Both kinds of leaf absorb alike here, as in Eq. 6. SAIL's own shares, of each wavelength, are in
    `ground.canopy.light_sharing`.

    References
    ----------
    [Friedl1995]_, Eq. 6

    See Also
    --------
    fifesim.ground.canopy.absorption.fpar, fifesim.ground.canopy.absorption.green_fpar
    """
    if not 0 < fpar_inf <= 1:
        raise ValueError(f"fpar_inf must be in (0, 1], got {fpar_inf:g}: it is a fraction, 0.94 in the paper")
    if leaves not in ("all", "green"):
        raise ValueError(f"leaves must be 'all' or 'green', got {leaves!r}: which of them absorb the light")
    geometry = directions.given_geometry(geometry, lai, time)
    if "sza" in directions.varying(geometry):
        directions.uniform_geometry(geometry, "fpar")
    extinction = float(absorption.extinction_coefficient(float(geometry.sza), leaf_angles))
    lai = _checked_scene(lai)
    shares = {"crown_cover": canopy_shares.share("crown_cover", crown_cover, lai)}
    if leaves == "green":
        shares |= {"brown": canopy_shares.share("brown", brown, lai)}
        shares |= {"dissociation": canopy_shares.share("dissociation", dissociation, lai)}
    kernel, rasters = canopy_shares.with_shares(_fpar, shares)
    light = {"extinction": extinction, "fpar_inf": fpar_inf, "sza": float(geometry.sza)}
    out = chunking.pointwise(kernel, lai, *rasters, **light)
    out = grids.place(out, grids.geobox(lai))
    of = "" if leaves == "all" else "green leaves, "
    said = f"fpar: Beer's law, {of}{canopy_shares.in_words(shares)}K {extinction:.4f}, limit {fpar_inf:g}"
    return cf.label(out, "fpar", source=lai, history=said)


def _checked_scene(lai):
    """Leaf area of a scene, in its unit; of what is in memory, with data."""
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


def _reflectance(lai, background, **parameters):
    # apply_ufunc hands the bands over as the last axis.
    return canopy_reflectance(check_map(lai), background=np.moveaxis(background, -1, 0), **parameters)


def _by_cell(lai, background, diffuse_fraction, leaves, geometry, shares, parameters):
    """Reflectance where the directions of sun or sensor, or the leaves, vary over the scene."""

    def kernel(cells, ground, sky, sza, saa, vza, vaa, *rasters, **given):
        optics, given = rasters[: len(leaves)], given | dict(zip(names, rasters[len(leaves) :], strict=True))
        directions = {"sza": sza, "vza": vza, "raa": relative_azimuth(saa, vaa)}
        light = {"background": ground, "diffuse_fraction": sky, **directions}
        return directional_reflectance(check_map(cells), **dict(zip(leaves, optics, strict=True)), **light, **given)

    names = [name for name, value in shares.items() if isinstance(value, xr.DataArray)]
    numbers = {name: value for name, value in shares.items() if name not in names}
    plain = lai.drop_vars(ANGLES, errors="ignore")
    background, sky, *optics = (_per_band(each) for each in (background, diffuse_fraction, *leaves.values()))
    rasters = *directions.angles(geometry), *optics, *(shares[name] for name in names)
    bands = len(optics[0]["band"])
    return chunking.pointwise(kernel, plain, background, sky, *rasters, bands=bands, **numbers, **parameters)


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
