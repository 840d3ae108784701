"""Fields of a landscape on labelled rasters: leaf area that goes with the ground, and properties that vary."""

import numpy as np

from fifesim.ground.landscape.drawn import SHARES
from fifesim.ground.landscape.rasters.fields import landscape_fields
from fifesim.ground.landscape.rasters.properties import with_deviation, with_distribution


def drawn_fields(grid, drawn, covary, arps, **options):
    """
    Standard normal fields of a landscape.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    drawn : dict of str to fifesim.ground.landscape.drawn.Field
        Properties by name.
    covary : mapping or None
        Correlations of leaf area, as `ground.landscape.rasters.fields.landscape_fields` takes them. [1]
    arps : sequence of float
        Of leaf area, where classes differ in it. [1]
    **options
        Passed to `landscape_fields`.

    Returns
    -------
    leaf_area : dict of float to xarray.DataArray, dims (y, x)
        Of each arp; empty where leaf area goes with nothing.
    properties : dict of str to xarray.DataArray, dims (y, x)
        With their values. [1]

    Raises
    ------
    ValueError
        As `landscape_fields`, or if a property cannot have its standard deviation.
    """
    for name in set(covary or {}) & {"soil", *SHARES} - set(drawn):
        raise ValueError(
            f"covary names {name}, which is not drawn: type {name}=fifesim.Field(mean=..., sd=...), or leave it out"
        )
    # Before anything is computed.
    for name in set(drawn) & set(SHARES):
        drawn[name].distribution(name)
    others = {name: each.arp for name, each in drawn.items()}
    options["coarser"] = {name: each.coarser for name, each in drawn.items()}
    if not covary:
        made = [landscape_fields(grid, others, **options)] if others else [{}]
    else:
        # Leaf area comes last: it takes of the noise of the others what its own arp needs, and they stay as they are.
        made = [landscape_fields(grid, {**others, "lai": arp}, covary, **options) for arp in dict.fromkeys(arps)]
    leaf_area = {arp: fields["lai"] for arp, fields in zip(dict.fromkeys(arps), made, strict=False) if covary}
    return leaf_area, {name: _values(name, each, made[0][name]) for name, each in drawn.items()}


def _values(name, given, score):
    """A property of its standard normal field."""
    if name in SHARES:
        return with_distribution(score, name, given.distribution(name))
    values = with_deviation(score, name, given.sd)
    return values.copy(data=values.data + np.float64(given.mean)) if given.mean else values
