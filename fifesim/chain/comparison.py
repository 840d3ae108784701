"""One scene through many instruments."""

from dataclasses import replace

import xarray as xr

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
        A node for each instrument by its name, with ``dn`` (or ``toa_radiance``), dims (band, y, x).

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
        given = bands.get(description.name)
        selected = description.red_and_near_infrared() if given is None else description.select(given)
        own = replace(setup, instrument=description, bands=tuple(band.name for band in selected))
        nodes[f"/{description.name}"] = image_of(own, reflectance_of(own, lai)).to_dataset()
    return xr.DataTree.from_dict(nodes)
