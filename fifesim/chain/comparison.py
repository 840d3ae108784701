"""One scene through many instruments."""

import xarray as xr

from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.chain import steps as chain
from fifesim.sensor import raster as sensor
from fifesim.sensor.description.instruments import instrument as find_instrument


def compare(
    lai,
    instruments,
    *,
    bands=None,
    dem=None,
    atmosphere=None,
    geometry=None,
    leaf_optics=None,
    background=None,
    leaf_angles="spherical",
    hotspot=0.0,
    interval=None,
    noise=(),
    seed=0,
    quantise=True,
):
    """
    Images of one scene by many instruments, each on its own grid.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        Leaf area index; in chunks, the images are lazy, and one pass over the scene makes them all. [m2 m-2]
    instruments : sequence of str or Instrument
    bands : mapping of str to sequence of str, optional
        Bands by the name of an instrument; by default its red and its near infrared band.
    dem, atmosphere, geometry, leaf_optics, background, leaf_angles, hotspot : optional
        As in `fifesim.chain.steps.surface_reflectance`; spectra, as by default, fit every instrument.
    interval, noise, seed, quantise : optional
        As in `fifesim.sensor.raster.sense`.

    Returns
    -------
    images : xarray.DataTree
        A node for each instrument by its name, with ``dn`` (or ``toa_radiance``), dims (band, y, x).

    Raises
    ------
    ValueError
        If an instrument is named twice, ``bands`` names one that is not asked for, or a step of the chain refuses its
        input.

    See Also
    --------
    fifesim.chain.steps.surface_reflectance, fifesim.chain.steps.to_toa, fifesim.sensor.raster.sense
    """
    descriptions = [find_instrument(each) for each in ([instruments] if isinstance(instruments, str) else instruments)]
    names = [description.name for description in descriptions]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"instruments must be at least one, each once, got {', '.join(names) or 'none'}")
    bands = {find_instrument(name).name if name not in names else name: each for name, each in (bands or {}).items()}
    if set(bands) - set(names):
        raise ValueError(f"bands are given for {', '.join(set(bands) - set(names))}, which is not compared")
    nodes = {}
    for description in descriptions:
        selected = _bands(description, bands.get(description.name))
        reflectance = chain.surface_reflectance(
            lai,
            description,
            bands=[band.name for band in selected],
            dem=dem,
            atmosphere=atmosphere,
            geometry=geometry,
            leaf_optics=leaf_optics,
            background=background,
            leaf_angles=leaf_angles,
            hotspot=hotspot,
        )
        toa = chain.to_toa(reflectance, instrument=description)
        image = sensor.sense(toa, description, interval=interval, noise=noise, seed=seed, quantise=quantise)
        nodes[description.name] = image.to_dataset()
    return xr.DataTree.from_dict({f"/{name}": dataset for name, dataset in nodes.items()})


def _bands(description, names):
    """Bands by name, or the red and the near infrared one."""
    if names is not None:
        return description.select(names)
    found = []
    for window in (RED, NEAR_INFRARED):
        number = nearest([band.wavelength for band in description.bands], window)
        if number is None:
            raise ValueError(
                f"{description.name} has no {window.name} band, {window.low:g} to {window.high:g} um: give "
                f"bands={{{description.name!r}: ...}}"
            )
        found.append(description.bands[number])
    return tuple(found)
