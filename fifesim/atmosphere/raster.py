"""The atmosphere on labelled rasters: surface reflectance to the top of the atmosphere, and back."""

import xarray as xr

from fifesim import cf, chunks
from fifesim import grid as grids
from fifesim.atmosphere import coupling, engines

_REFERENCE = "Tanre et al. (1990), doi:10.1080/01431169008955048"


def to_toa(reflectance, atmosphere, bands, geometry):
    """
    Apparent reflectance at the top of the atmosphere, over a surface that is locally uniform.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Surface reflectance factor. [1]
    atmosphere : fifesim.atmosphere.models.Atmosphere
    bands : sequence of fifesim.bands.Band
        One for each band of the raster.
    geometry : fifesim.geometry.Geometry

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If the units are wrong, or sun or sensor stand lower than the model holds.

    See Also
    --------
    fifesim.atmosphere.coupling.apparent_reflectance
    """
    cf.check_quantity(reflectance, "surface_reflectance")
    step = (coupling.apparent_reflectance, "toa_reflectance", "to_toa")
    return _carry(*step, reflectance, atmosphere, bands, geometry)


def to_surface(reflectance, atmosphere, bands, geometry):
    """
    Surface reflectance from that at the top of the atmosphere; the exact inverse of `to_toa`.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        At the top of the atmosphere. [1]
    atmosphere : fifesim.atmosphere.models.Atmosphere
    bands : sequence of fifesim.bands.Band
    geometry : fifesim.geometry.Geometry

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Negative where noise or a wrong atmosphere makes it so. [1]

    Raises
    ------
    ValueError
        If the units are wrong, or sun or sensor stand lower than the model holds.

    See Also
    --------
    fifesim.atmosphere.coupling.surface_reflectance
    """
    cf.check_quantity(reflectance, "toa_reflectance")
    step = (coupling.surface_reflectance, "surface_reflectance", "to_surface")
    return _carry(*step, reflectance, atmosphere, bands, geometry)


def _carry(kernel, name, verb, reflectance, atmosphere, bands, geometry):
    if "band" not in reflectance.dims:
        reflectance = reflectance.expand_dims("band")
    if set(reflectance.dims) != {"band", "y", "x"}:
        raise ValueError(f"a reflectance has dimensions (band, y, x), got {reflectance.dims}: select one layer first")
    terms = engines.band_terms(atmosphere, tuple(bands), geometry.sza, geometry.vza, geometry.raa)
    per_band = [
        xr.DataArray(getattr(terms, term), dims="band")
        for term in (
            "path_reflectance",
            "transmittance_down",
            "transmittance_up",
            "spherical_albedo",
            "gas_transmittance",
        )
    ]
    plain = reflectance.drop_vars("band", errors="ignore")
    out = chunks.pointwise(kernel, plain, *per_band)
    if "band" in reflectance.coords:
        out = out.assign_coords(band=reflectance["band"])
    out = cf.with_geometry(grids.place(out, grids.geobox(reflectance)), geometry)
    said = {"history": f"{verb}: {atmosphere.engine}, {atmosphere.text}", "atmosphere": atmosphere.text, "references": _REFERENCE}
    return cf.label(out, name, source=reflectance, **said)
