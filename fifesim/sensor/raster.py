"""The sensor on labelled rasters: from light at the top of the atmosphere to digital numbers, and back."""

from functools import partial

import numpy as np
import xarray as xr

from fifesim import cf, chunks
from fifesim import grid as grids
from fifesim.footprints import axis_operator, regularize
from fifesim.geometry import fife_geometry
from fifesim.sensor import calibration
from fifesim.sensor.instruments import instrument as find_instrument

# Share of its footprint's weight that a pixel needs on valid cells. The paper's footprint of 30.32 m leaves a
# scene of whole 30 m pixels by 0.16 m.
MIN_VALID = 0.98


def sense(toa, instrument="TM", *, onto=None, min_valid=MIN_VALID, geometry=None):
    """
    Image that an instrument records: regularized onto its pixels and digitised.

    Parameters
    ----------
    toa : xarray.DataArray, dims (band, y, x)
        Reflectance or radiance at the top of the atmosphere, by cells. Bands are those of the instrument that have the
        same name, or else whose response is there at their ``wavelength``. [1 or W m-2 sr-1 um-1]
    instrument : str or fifesim.sensor.instruments.Instrument, optional
    onto : odc.geo.geobox.GeoBox, optional
        North-up grid of pixels in the CRS of the scene, of any size and offset. By default the instrument's gridded
        product, with the upper left corner of the scene.
    min_valid : float, optional
        Share of its footprint that a pixel needs on valid cells; below it is no data. [1]
    geometry : fifesim.geometry.Geometry, optional
        By default that which the array carries, else the paper's.

    Returns
    -------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        Digital numbers from 1; 0 is no data. ``gain``, ``offset``, ``wavelength`` and ``solar_irradiance`` are
        coordinates along band.

    Raises
    ------
    ValueError
        If the instrument is unknown or has none of the bands, or ``onto`` is no grid of the scene's CRS.

    See Also
    --------
    fifesim.footprints.regularize, fifesim.sensor.calibration.radiance_to_dn
    """
    cf.check_quantity(toa, "toa_reflectance", "toa_radiance")
    description = find_instrument(instrument)
    toa = toa if "band" in toa.dims else toa.expand_dims("band")
    bands = matching_bands(toa, description)
    geometry = (geometry or cf.geometry_of(toa) or fife_geometry()).uniform("sense")
    radiance = _as_radiance(_regularized(toa, description, onto, min_valid), bands, geometry)
    gain, offset = calibration.gain_offset(
        [band.full_scale_radiance for band in bands], [band.min_radiance for band in bands], description.bits
    )
    dn = chunks.pointwise(
        calibration.radiance_to_dn,
        radiance,
        *(xr.DataArray(values, dims="band") for values in (gain, offset)),
        dtype=np.uint8 if description.bits <= 8 else np.uint16,
        bits=description.bits,
    )
    dn = dn.assign_coords(
        cf.band_coordinates(
            band=[band.name for band in bands],
            wavelength=[band.wavelength for band in bands],
            gain=gain,
            offset=offset,
            solar_irradiance=[band.solar_irradiance for band in bands],
        )
    )
    dn = cf.with_geometry(grids.place(dn, grids.geobox(radiance)), geometry)
    history = f"sense: {description.name}, {description.bits} bits"
    image = cf.label(dn, "dn", source=toa, history=history, instrument=description.name)
    image.attrs["_FillValue"] = image.dtype.type(0)
    return image


def to_radiance(image):
    """
    Radiance of an image of digital numbers.

    Parameters
    ----------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        With coordinates ``gain`` and ``offset``, as `sense` makes it.

    Returns
    -------
    radiance : xarray.DataArray, dims (band, y, x)
        Within half a count of what was recorded, NaN where there are no data. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the image carries no calibration.

    See Also
    --------
    fifesim.sensor.calibration.dn_to_radiance
    """
    missing = {"gain", "offset"} - set(image.coords)
    if missing:
        raise ValueError(f"the image has no {' and '.join(sorted(missing))}: open it with fifesim.open_image")
    out = chunks.pointwise(calibration.dn_to_radiance, image, *_plain(image, "gain", "offset"))
    out = grids.place(out.drop_vars(["gain", "offset"]), grids.geobox(image))
    return cf.label(out, "toa_radiance", source=image, history="to_radiance")


def to_reflectance(image):
    """
    Planetary reflectance of an image.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Digital numbers or radiance, with the coordinates that `sense` gives.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If the image carries no calibration, solar irradiance or solar zenith angle.

    See Also
    --------
    fifesim.sensor.calibration.radiance_to_reflectance
    """
    radiance = to_radiance(image) if "gain" in image.coords else image
    cf.check_quantity(radiance, "toa_radiance")
    geometry = cf.geometry_of(image)
    if geometry is None or "solar_irradiance" not in image.coords:
        raise ValueError("the image carries no sza or no solar_irradiance: open it with fifesim.open_image")
    geometry.uniform("to_reflectance")
    out = chunks.pointwise(
        calibration.radiance_to_reflectance,
        radiance,
        *_plain(image, "solar_irradiance"),
        mu_s=geometry.mu_s,
        earth_sun_distance=geometry.earth_sun_distance,
    )
    out = grids.place(out, grids.geobox(image))
    return cf.label(out, "toa_reflectance", source=radiance, history="to_reflectance")


def matching_bands(array, instrument):
    """
    Bands of an instrument that those of a raster stand for.

    Parameters
    ----------
    array : xarray.DataArray
        With a coordinate ``band`` of the instrument's names, or ``wavelength`` [um].
    instrument : fifesim.sensor.instruments.Instrument

    Returns
    -------
    bands : tuple of fifesim.sensor.instruments.InstrumentBand

    Raises
    ------
    ValueError
        If a band matches none of the instrument's.
    """
    known = {band.name.lower() for band in instrument.bands}
    names = [str(name) for name in np.atleast_1d(array["band"].values)] if "band" in array.coords else []
    if names and {name.lower() for name in names} <= known:
        return instrument.select(names)
    if "wavelength" in array.coords:
        wavelengths = np.atleast_1d(array["wavelength"].values).astype(float)
        return instrument.select([_band_at(value, instrument).name for value in wavelengths])
    if names:
        return instrument.select(names)
    raise ValueError(
        f"the raster's bands have neither names of {instrument.name} ({', '.join(b.name for b in instrument.bands)}) "
        "nor a wavelength: assign a coordinate 'band' or 'wavelength' [um] along band"
    )


def _band_at(wavelength, instrument):
    """The band with the largest response at a wavelength, at least half of its peak."""
    responses = [
        np.interp(wavelength, band.response.wavelength, band.response.response, left=0.0, right=0.0)
        / max(band.response.response)
        for band in instrument.bands
    ]
    best = int(np.argmax(responses))
    if responses[best] < 0.5:
        centres = ", ".join(f"{band.name} at {band.wavelength:.3f}" for band in instrument.bands)
        raise ValueError(f"no band of {instrument.name} responds at {wavelength:g} um: it has {centres} um")
    return instrument.bands[best]


def _regularized(toa, description, onto, min_valid):
    scene = grids.geobox(toa)
    pixels = grids.aligned(scene, description.gsd) if onto is None else grids.check_grid(onto)
    if pixels.crs != scene.crs:
        raise ValueError(f"onto must be in the CRS of the scene, {scene.crs}, got {pixels.crs}")
    lsf = description.line_spread
    rows = _operator(
        lsf, scene.affine.f, scene.affine.e, scene.shape.y, pixels.affine.f, pixels.affine.e, pixels.shape.y
    )
    columns = _operator(
        lsf, scene.affine.c, scene.affine.a, scene.shape.x, pixels.affine.c, pixels.affine.a, pixels.shape.x
    )
    return chunks.resample(partial(regularize, min_valid=min_valid), rows, columns, toa, pixels)


def _operator(lsf, cell_origin, cell_size, n_cells, pixel_origin, pixel_size, n_pixels):
    return axis_operator(
        lsf,
        cell_origin=cell_origin,
        cell_size=cell_size,
        n_cells=n_cells,
        pixel_origin=pixel_origin,
        pixel_size=pixel_size,
        n_pixels=n_pixels,
    )


def _as_radiance(array, bands, geometry):
    """Radiance of a reflectance; it is scaled once regularized, which is linear and leaves fewer numbers."""
    if str(array.attrs.get("units", "1")) == cf.QUANTITIES["toa_radiance"].units:
        return array
    irradiance = xr.DataArray([band.solar_irradiance for band in bands], dims="band")
    plain = array.drop_vars("band", errors="ignore")
    return chunks.pointwise(
        calibration.reflectance_to_radiance,
        plain,
        irradiance,
        mu_s=geometry.mu_s,
        earth_sun_distance=geometry.earth_sun_distance,
    )


def _plain(image, *names):
    """Coordinates along band as arrays without names that would collide."""
    return [xr.DataArray(image[name].values, dims=image[name].dims) for name in names]
