"""The canopy on labelled rasters: its reflectance on level ground, and the light that it absorbs."""

from functools import partial

import numpy as np

from fifesim.ground.canopy import absorption
from fifesim.ground.canopy.crowns import SHAPE, check_crowns, crown_shares, lai_in_crowns
from fifesim.ground.canopy.description import Canopy, is_raster
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.leaf_area import check_map, warn_of_large
from fifesim.ground.canopy.rasters.evaluation import SHARES, canopy_kernel, even_canopy, in_words, shares_of
from fifesim.ground.landscape.rasters.evaluation import by_class
from fifesim.rasters import cf, directions
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.origins import made_of
from fifesim.rasters.packed import unpacked

ABSORBING = ("leaf_angles", *SHARES)
"""Properties of the canopy that the light absorbed by its leaves depends on."""


def level_reflectance(lai, bands, stand, light, *, exact=False, **provenance):
    """
    Reflectance factor of a canopy over its background, for flat ground.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        With a name and a wavelength [um].
    stand : fifesim.ground.canopy.rasters.evaluation.BandCanopy
        SAIL is evaluated at every cell where its leaf optics or dissociation are rasters.
    light : fifesim.ground.canopy.rasters.evaluation.Light
        Carried on as coordinates. SAIL is evaluated at every cell where an angle is a raster.
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
        If the optics or a share are not possible, or LAI is negative.

    See Also
    --------
    fifesim.ground.canopy.sail_model.sail, fifesim.ground.canopy.layers.two_layers,
    fifesim.ground.canopy.crowns.clumped
    """
    lai = checked_scene(lai)
    kernel, rasters = canopy_kernel(lai, [band.name for band in bands], stand, light, exact)
    varies = directions.varying(light.geometry)
    out = chunking.pointwise(kernel, lai.drop_vars(varies, errors="ignore"), *rasters, bands=len(bands))
    below = "raster" if is_raster(stand.background) else ",".join(f"{value:g}" for value in stand.background)
    provenance = {"background": below} | provenance
    told, angles = in_words(stand.canopy), str(leaf_angle_classes(stand.canopy.leaf_angles))
    out = _labelled(out, lai, bands, light.geometry, angles, told, provenance)
    return made_of(out, even_canopy(lai, stand, light, exact))


def reflectance_of_classes(lai, cover, bands, stands, light, *, exact=False, **provenance):
    """
    Reflectance factor of canopies of several classes over their backgrounds, for flat ground.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    cover : xarray.DataArray, dims (y, x)
        Codes; -1 and NaN give NaN.
    stands : dict of int to fifesim.ground.canopy.rasters.evaluation.BandCanopy
        By code.
    bands, light, exact, **provenance
        As in `level_reflectance`.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        The same bits as of each class alone. [1]

    Raises
    ------
    ValueError
        As in `level_reflectance`; when computed, if a cell has another code.
    """
    lai = checked_scene(lai)
    kernels, distinct = {}, []
    for code, stand in stands.items():
        alike = [kernel for other, kernel in distinct if _same(stand, other)]
        kernels[code] = alike[0] if alike else canopy_kernel(lai, [band.name for band in bands], stand, light, exact)
        distinct.append((stand, kernels[code]))
    out = by_class(kernels, cover, lai, bands=len(bands))
    angles = dict.fromkeys(str(leaf_angle_classes(each.canopy.leaf_angles)) for each in stands.values())
    return _labelled(out, lai, bands, light.geometry, " and ".join(angles), "", {"background": "by class"} | provenance)


def same_properties(one, other, names):
    """Whether some properties of two canopies are known to be the same."""
    return all(_same(getattr(one, name), getattr(other, name)) for name in names)


def _same(one, other):
    """Whether two values are known to be the same; of rasters, those that are one object."""
    if one is other:
        return True
    if isinstance(one, Canopy) and isinstance(other, Canopy):
        return same_properties(one, other, ("hotspot", "crown_shape", *ABSORBING))
    if isinstance(one, tuple | list):
        return isinstance(other, tuple | list) and len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and np.array_equal(one, other)
    return isinstance(one, str | float | int) and isinstance(other, str | float | int) and one == other


def _labelled(reflectance, lai, bands, geometry, angles, told, provenance):
    """Reflectance of a scene with its bands, place, directions and attributes."""
    names, wavelengths = ([getattr(band, name) for band in bands] for name in ("name", "wavelength"))
    coordinates = cf.band_coordinates(band=names, wavelength=wavelengths) | directions.coordinates_of(geometry)
    out = grids.place(reflectance, grids.geobox(lai), coordinates)
    history = f"surface_reflectance: SAIL, {angles} leaves, {told}{_directions(geometry)}"
    return cf.label(out, "surface_reflectance", source=lai, history=history, leaf_angles=angles, **provenance)


def fpar(lai, canopy, *, geometry=None, time=None, fpar_inf=absorption.FPAR_INF, leaves="all"):
    """
    Fraction of photosynthetically active radiation that a canopy absorbs, or its green leaves.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    canopy : Canopy
    geometry, time, fpar_inf, leaves : optional
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
    kernel, rasters = fpar_kernel(lai, canopy, geometry, fpar_inf, leaves)
    out = chunking.pointwise(kernel, lai, *rasters)
    out = grids.place(out, grids.geobox(lai))
    of = "" if leaves == "all" else "green leaves, "
    extinction = absorption.extinction_coefficient(float(geometry.sza), canopy.leaf_angles)
    told = in_words(canopy, _absorbing(leaves))
    history = f"fpar: Beer's law, {of}{told}K {float(extinction):.4f}, limit {fpar_inf:g}"
    return cf.label(out, "green_fpar" if leaves == "green" else "fpar", source=lai, history=history)


def fpar_kernel(lai, canopy, geometry, fpar_inf=absorption.FPAR_INF, leaves="all"):
    """
    Kernel of the light that a canopy absorbs, and the rasters that it takes.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or None
        Its CRS is that of rasters that lost theirs.
    canopy : Canopy
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        Of one sun.
    fpar_inf, leaves : optional
        As in `fpar`.

    Returns
    -------
    kernel : callable
        ``kernel(lai, *blocks)`` gives the fraction from leaf area, and blocks of the rasters. [1]
    rasters : list of xarray.DataArray

    Raises
    ------
    ValueError
        As in `fpar`.
    """
    if not 0 < fpar_inf <= 1:
        raise ValueError(f"fpar_inf must be in (0, 1], got {fpar_inf:g}: it is a fraction, 0.94 in the paper")
    if leaves not in ("all", "green"):
        raise ValueError(f"leaves must be 'all' or 'green', got {leaves!r}: which of them absorb the light")
    sza = float(geometry.sza)
    extinction = float(absorption.extinction_coefficient(sza, canopy.leaf_angles))
    varying, numbers = shares_of(canopy, _absorbing(leaves), lai)
    return partial(_fpar, extinction, fpar_inf, sza, tuple(varying), numbers), list(varying.values())


def _absorbing(leaves):
    """Properties that the light absorbed by all or by green leaves depends on."""
    return SHARES if leaves == "green" else ("crown_cover",)


def _fpar(extinction, fpar_inf, sza, varying, numbers, lai, *blocks):
    shares = numbers | dict(zip(varying, blocks, strict=True))
    lai, cover = check_map(lai), shares.pop("crown_cover")
    light = {"extinction": extinction, "fpar_inf": fpar_inf}
    absorbed = partial(absorption.green_fpar, **light, **shares) if shares else partial(absorption.fpar, **light)
    if not isinstance(cover, np.ndarray) and cover == 1:
        return absorbed(lai)
    check_crowns(lai, cover)
    lit = crown_shares(cover, SHAPE, sza, 0.0, 0.0).sun
    return lit * absorbed(lai_in_crowns(lai, cover))


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
