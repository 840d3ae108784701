"""One scene through many instruments."""

import numpy as np
import xarray as xr

from fifesim import chain
from fifesim.ground import optics
from fifesim.sensor import raster as sensor
from fifesim.sensor.instruments import instrument as find_instrument

# Where the red and the near infrared band of an instrument lie, and the best place. [um]
_RED = (0.60, 0.70, 0.66)
_NIR = (0.75, 1.00, 0.84)

# Bands further from those of the table of leaf optics are another part of the spectrum. [um]
_NEAR = 0.06


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
    dem, atmosphere, geometry, leaf_angles, hotspot : optional
        As in `fifesim.chain.surface_reflectance`.
    leaf_optics, background : mapping, optional
        By band name, as in `fifesim.chain.surface_reflectance`. By default each band has those of the TM band that is
        nearest to it, at most 0.06 um away.
    interval, noise, seed, quantise : optional
        As in `fifesim.sensor.raster.sense`.

    Returns
    -------
    images : xarray.DataTree
        A node for each instrument by its name, with ``dn`` (or ``toa_radiance``), dims (band, y, x).

    Raises
    ------
    ValueError
        If an instrument is named twice, ``bands`` names one that is not asked for, no leaf optics are near a band, or a
        step of the chain refuses its input.

    See Also
    --------
    fifesim.chain.surface_reflectance, fifesim.chain.to_toa, fifesim.sensor.raster.sense
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
            leaf_optics=_nearest(selected, "leaf optics") if leaf_optics is None else leaf_optics,
            background=_nearest(selected, "background") if background is None else background,
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
    for what, (low, high, best) in (("red", _RED), ("near infrared", _NIR)):
        inside = [band for band in description.bands if low <= band.wavelength <= high]
        if not inside:
            raise ValueError(
                f"{description.name} has no {what} band, {low:g} to {high:g} um: give "
                f"bands={{{description.name!r}: ...}}"
            )
        found.append(min(inside, key=lambda band: abs(band.wavelength - best)))
    return tuple(found)


def _nearest(bands, what):
    """Optics of the nearest TM band for each band, by name."""
    known = find_instrument("TM").bands
    centres = np.array([band.wavelength for band in known])
    values = {
        "leaf optics": lambda name: tuple(float(each[0]) for each in optics.leaf_optics([name])),
        "background": lambda name: float(optics.background([name])[0]),
    }[what]
    found = {}
    for band in bands:
        nearest = int(np.argmin(np.abs(centres - band.wavelength)))
        distance = abs(centres[nearest] - band.wavelength)
        if distance > _NEAR:
            raise ValueError(
                f"no {what} near {band.name} at {band.wavelength:.3f} um: the nearest are those of "
                f"{known[nearest].name}, {distance:.3f} um away; give {what.replace(' ', '_')}={{{band.name!r}: ...}}"
            )
        found[band.name] = values(known[nearest].name)
    return found
