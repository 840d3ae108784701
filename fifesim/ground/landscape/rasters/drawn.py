"""Fields of a landscape on labelled rasters: leaf area that goes with the ground, and properties that vary."""

from functools import partial

from fifesim.ground.landscape.drawn import SHARES
from fifesim.ground.landscape.quantiles import quantile_map, quantile_table
from fifesim.ground.landscape.rasters.fields import OF_ELEVATION, landscape_fields, of_elevation
from fifesim.rasters import cf


def drawn_fields(grid, drawn, covary, arps, *, dem=None, geometry=None, **options):
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
    dem, geometry
        As in `landscape_fields`.
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
    options["values"] = {name: _values(name, each) for name, each in drawn.items()}
    others = {name: each.arp for name, each in drawn.items()}
    options["coarser"] = {name: each.coarser for name, each in drawn.items()}
    if not covary:
        made = [landscape_fields(grid, others, **options)] if others else [{}]
    else:
        # Of the elevation once for all.
        named = [name for name in OF_ELEVATION if name in covary and dem is not None]
        options |= {"dem": dem, "geometry": geometry, "covariates": of_elevation(dem, named, geometry=geometry)}
        # Leaf area comes last: it takes of the noise of the others what its own arp needs, and they stay as they are.
        made = [
            landscape_fields(grid, {**others, "lai": arp}, covary, wanted=["lai"] if number else None, **options)
            for number, arp in enumerate(dict.fromkeys(arps))
        ]
    leaf_area = {arp: fields["lai"] for arp, fields in zip(dict.fromkeys(arps), made, strict=False) if covary}
    return leaf_area, {name: _labelled(name, each, made[0][name]) for name, each in drawn.items()}


def _values(name, given):
    """What makes a property of standard normal scores, in their place."""
    if name in SHARES:
        return partial(_share, quantile_table(given.distribution(name)))
    return partial(_normal, given.mean, given.sd)


def _share(table, scores):
    return quantile_map(scores, table, out=scores)


def _normal(mean, deviation, scores):
    scores *= deviation
    if mean:
        scores += mean
    return scores


def _labelled(name, given, values):
    how = "by quantiles" if name in SHARES else f"standard deviation {given.sd:g}"
    return cf.label(values, name, source=values, history=f"{name}: {how}")
