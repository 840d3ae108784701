"""One scene through many instruments."""

from dataclasses import replace

import xarray as xr

from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.sensor.description.instruments import instrument as find_instrument


def compare(lai, instruments, setup=None, *, bands=None):
    """
    Images of one scene by many instruments, each on its own grid.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        Leaf area index; in chunks, the images are lazy, and one pass over the scene makes them all. [m2 m-2]
    instruments : sequence of str or Instrument
    setup : Setup, optional
        Ground, air and sampling that they share; its instrument and bands do not count. Spectra of leaf and background,
        as by default, fit every instrument.
    bands : mapping of str to sequence of str, optional
        Bands by the name of an instrument; by default its red and its near infrared band.

    Returns
    -------
    images : xarray.DataTree
        A node for each instrument by its name, with ``dn`` (or ``toa_radiance``), dims (band, y, x); below it, of bands
        of several resolutions, a node for each, such as ``/MSI/10m``.

    Raises
    ------
    ValueError
        If an instrument is named twice, ``bands`` names one that is not asked for, or a step of the chain refuses its
        input.

    See Also
    --------
    fifesim.chain.setup.reflectance_of, fifesim.chain.setup.image_of
    """
    setup = Setup() if setup is None else setup
    if not isinstance(setup, Setup):
        raise TypeError(f"setup must be a fifesim.Setup, got {setup!r}: see fifesim.Setup")
    descriptions = [find_instrument(each) for each in ([instruments] if isinstance(instruments, str) else instruments)]
    names = [description.name for description in descriptions]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"instruments must be at least one, each once, got {', '.join(names) or 'none'}")
    bands = {find_instrument(name).name if name not in names else name: each for name, each in (bands or {}).items()}
    if set(bands) - set(names):
        raise ValueError(f"bands are given for {', '.join(set(bands) - set(names))}, which is not compared")
    nodes = {}
    for description in descriptions:
        selected = tuple(band.name for band in _bands(description, bands.get(description.name)))
        own = replace(setup, instrument=description, bands=selected)
        image = image_of(own, reflectance_of(own, lai))
        nodes[f"/{description.name}"] = image if isinstance(image, xr.DataTree) else image.to_dataset()
    return xr.DataTree.from_dict(nodes)


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
