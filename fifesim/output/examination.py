"""Exam of a processor: errors of its result by terrain, edges, haze and class, as a table and one HTML page."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.ndimage import distance_transform_edt

from fifesim.analysis.regression_labels import check_same_quantity, matched
from fifesim.analysis.score_labels import score
from fifesim.base.arguments import FilePath, Kind, is_a, is_path
from fifesim.base.files import check_suffix, check_target, in_a_line, whole_file
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.grids.files import open_image
from fifesim.ground.terrain import labels as terrain
from fifesim.output import report
from fifesim.output.colours import percentile_limits

_RASTERS = ".tif", ".tiff", ".img", ".jp2"

_TEMPLATE = Path(__file__).with_name("exam.html.j2")
_DPI = 160

# Conditions by which errors are grouped: names in the truth, title, and explanation.
_CONDITIONS = {
    "illumination": (
        ("illumination",), "cos i", "cos i: cosine of the incidence angle of the sun on the slope, 0 in shadow."
    ),
    "slope": (("slope",), "slope [degree]", ""),
    "edge_distance": (
        ("field", "cover"), "distance to edges [m]", "Pixels next to an edge of a class or field have half a pixel."
    ),
    "aot": (("aot",), "aerosol optical thickness", ""),
    "visibility": (("visibility",), "visibility [km]", ""),
    "cover": (("cover",), "class", ""),
}  # fmt: skip
_SHARES = "class_share"
_GROUPS = 10

# Quantities that are drawn, spread evenly over all.
_DRAWN = 3

# Colours of Okabe and Ito, suitable for colour-blind readers.
_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9")


def _is_product(value):
    return is_path(value) or is_a(value, "DataArray", "Dataset")


ProcessorResults: TypeAlias = Annotated[
    FilePath | xr.DataArray | xr.Dataset | Mapping[str, FilePath | xr.DataArray | xr.Dataset],
    Kind(
        "a file, a folder, an xarray.DataArray or an xarray.Dataset, or a dict of these by name",
        lambda value: _is_product(value) or (isinstance(value, Mapping) and all(map(_is_product, value.values()))),
        dimensions=2,
    ),
]
Truths: TypeAlias = Annotated[
    FilePath | xr.Dataset,
    Kind(
        "the folder truth of a simulated product, or an xarray.Dataset",
        lambda value: is_path(value) or is_a(value, "Dataset"),
        dimensions=2,
        numbers="iufb",
    ),
]


def exam(
    result: ProcessorResults, truth: Truths, *, page: FilePath | None = None, title: str = "", overwrite: bool = False
) -> xr.DataTree:
    """
    Score what a processor returned for a simulated scene, by terrain, distance to edges, haze and class.

    Parameters
    ----------
    result : path, xarray.DataArray, xarray.Dataset, or mapping of str to these
        Rasters of the processor: a file, a folder of GeoTIFFs or ENVI files, or rasters in memory. Variables and bands
        are matched with the truth by name. With a mapping, several results are compared on the pixels that all have.
    truth : path or xarray.Dataset
        Folder ``truth`` of a simulated product, or its rasters. Those that the result has too are scored. Others set
        the groups: ``illumination`` (cos i) and ``slope``, which also follow from ``dem`` and the sun; ``cover`` or
        ``field``, with the distance to their edges; ``aot`` or ``visibility``. The largest ``class_share`` of
        `aggregate` is the class.
    page : str or path, optional
        HTML page to write.
    title : str, optional
        Title of the page.
    overwrite : bool, optional
        Replace an existing page.

    Returns
    -------
    scores : xarray.DataTree
        ``n``, number of pixels, ``bias`` and ``rmse`` in the unit of the truth, and ``missing``, the share of true
        pixels without a result, by ``product`` and ``quantity``. One node for each condition of which the truth has
        several values has ``n``, ``bias`` and ``rmse`` by its groups: classes, or up to ten groups of about as many
        pixels, labelled by their mean.

    Raises
    ------
    ValueError
        If the result has none of the true quantities, another grid or other units than the truth.
    FileExistsError
        If the page exists and ``overwrite`` is False.

    Notes
    -----
    Distance to an edge is the distance to the centre of the nearest pixel that adjoins another class, and half a pixel.
    Pixels without a result or a truth do not count.

    See Also
    --------
    fifesim.score

    Examples
    --------
    A result that is too bright by 0.02 on slopes away from the sun:

    >>> import fifesim
    >>> import numpy as np
    >>> import xarray as xr
    >>> from odc.geo.xr import wrap_xr
    >>> grid = fifesim.grid_at("EPSG:32614", 705000, 4330000, width=600, height=600, cell=30)
    >>> cosine = wrap_xr(np.tile(np.linspace(0.1, 1, 20), (20, 1)), grid)
    >>> truth = xr.Dataset({"red": xr.full_like(cosine, 0.1), "illumination": cosine})
    >>> found = fifesim.exam((truth["red"] + 0.02 * (cosine < 0.5)).rename("red"), truth)
    >>> found["illumination"]["bias"].squeeze().values.round(3)
    array([0.02, 0.02, 0.02, 0.02, 0.01, 0.  , 0.  , 0.  , 0.  , 0.  ])
    """
    if page is not None:
        page = Path(page)
        check_suffix(page, "page", ".html", ".htm")
        check_target(page)
        if page.exists() and not overwrite:
            raise FileExistsError(f"there is a page {in_a_line(page, 150)}: type overwrite=True, or another name")
    true = _rasters(truth, "the truth")
    products = result if isinstance(result, Mapping) and not isinstance(result, xr.Dataset) else {"result": result}
    given = {name: _rasters(each, name) for name, each in products.items()}
    names = [key for key in true if all(key in each for each in given.values())]
    if not names:
        had = "; ".join(f"{name}: {in_a_line(', '.join(each), 150)}" for name, each in given.items())
        raise ValueError(
            f"no quantity of the truth ({in_a_line(', '.join(true), 150)}) is in each result ({had}): rename variables "
            "or bands, for instance with xarray.Dataset({'TM4': red})"
        )
    pairs = {
        key: (_paired({name: each[key] for name, each in given.items()}, true[key].rename(key)), true[key].rename(key))
        for key in names
    }
    lacks = [
        [float(own[name].isnull().where(truth.notnull()).mean()) for own, truth in pairs.values()] for name in given
    ]
    attrs = {"long_name": "share of true pixels without a result", "units": "1"}
    total = _scored(pairs).assign(missing=(("product", "quantity"), lacks, attrs))
    tree = xr.DataTree.from_dict(
        {"/": total} | {name: _scored(pairs, name, by) for name, by in _conditions(true).items()}
    )
    if page is not None:
        left = sorted(set().union(*given.values()) - set(names))
        with whole_file(page) as new:
            new.write_text(_page(tree, pairs, title, left), encoding="utf-8")
    return tree


def _rasters(given, what):
    """Rasters over (y, x) of a file, folder, array or dataset, by name of variable or band."""
    if is_path(given):
        path = Path(given)
        files = sorted(each for each in path.iterdir() if each.suffix in _RASTERS) if path.is_dir() else [path]
        arrays = [_named(open_image(each), each.stem) for each in files]
        if not arrays:
            raise ValueError(f"{in_a_line(path, 150)} has no {' or '.join(_RASTERS)} file: give the folder of rasters")
    else:
        arrays = list(given.data_vars.values()) if isinstance(given, xr.Dataset) else [given]
    found = {}
    for array in arrays:
        if cf.is_counts(array):
            raise ValueError(f"{what} has digital numbers: convert them, for instance with .fifesim.to_reflectance()")
        layers = {str(array.name): array}
        array = array.rename({"class": "band"}) if "class" in array.dims else array
        if array.name == _SHARES:
            layers = {"cover": _largest(array)}
        elif "band" in array.dims:
            # GDAL adds the wavelength to the names of ENVI bands.
            bands = [str(band).partition(" (")[0] for band in array["band"].values]
            layers = {band: array.isel(band=k, drop=True) for k, band in enumerate(bands)}
        if twice := found.keys() & layers:
            raise ValueError(f"{what} has {', '.join(sorted(twice))} twice: select one raster, with dataset[[name]]")
        found |= {name: layer for name, layer in layers.items() if {"y", "x"} <= set(layer.dims)}
    return found


def _largest(shares):
    """Number of the class with the largest share of each pixel, from 1; NaN where unknown."""
    number = shares.fillna(-1).argmax("band") + 1.0
    meanings = " ".join(str(each).replace(" ", "_") for each in shares["band"].values)
    flags = {"flag_values": np.arange(1, shares.sizes["band"] + 1), "flag_meanings": meanings}
    return number.where(shares.notnull().any("band")).rename("cover").assign_attrs(flags)


def _named(array, stem):
    """Raster of a file: a single band without a name is called like the file."""
    if "band" in array.dims and array.sizes["band"] == 1 and str(array["band"].values[0]) == "band1":
        array = array.isel(band=0, drop=True).rename(None)
    return array if array.name or "band" in array.dims else array.rename(stem)


def _conditions(true):
    """Number of the group of each pixel, labelled by the mean of a condition, for those with several values."""
    true, found = dict(true), {}
    if "dem" in true:
        true.setdefault("slope", terrain.slope(true["dem"]))
        sun = next((sun for each in true.values() if (sun := directions.geometry_of(each)) is not None), None)
        if sun is not None:
            true.setdefault("illumination", terrain.illumination(true["dem"], sun))
    for condition, (names, _, _) in _CONDITIONS.items():
        values = next((true[name] for name in names if name in true), None)
        if values is None:
            continue
        if condition == "edge_distance":
            values = values.copy(data=edge_distance(values.values, *grids.cell_size(grids.geobox(values))))
        groups = values if condition == "cover" else values.copy(data=_tenths(values.values))
        if np.unique(groups.values[np.isfinite(groups.values)]).size > 1:
            found[condition] = groups.rename(None)
    return found


def _tenths(values):
    """Mean of the group of each value; groups have about as many pixels, and equal values are in one."""
    known = np.isfinite(values)
    out, given = np.full(values.shape, np.nan), values[known].astype(float)
    edges = np.unique(np.quantile(given, np.arange(1, _GROUPS) / _GROUPS)) if given.size else []
    number = np.searchsorted(edges, given, side="right")
    sums, count = (np.bincount(number, weights, _GROUPS) for weights in (given, None))
    out[known] = (sums / np.maximum(count, 1))[number]
    return out


def edge_distance(classes, cell_y, cell_x):
    """Distance to the centre of the nearest cell next to another class, and half a cell, shape (y, x). [m]"""
    at_edge, known = np.zeros(classes.shape, bool), classes == classes
    for turned, valid, edge in ((classes, known, at_edge), (classes.T, known.T, at_edge.T)):
        differ = (turned[1:] != turned[:-1]) & valid[1:] & valid[:-1]
        edge[1:] |= differ
        edge[:-1] |= differ
    if not at_edge.any():
        return np.full(classes.shape, np.nan)
    distance = distance_transform_edt(~at_edge, sampling=(cell_y, cell_x)) + np.sqrt(cell_y * cell_x) / 2
    return np.where(known, distance, np.nan)


def _paired(estimates, truth):
    """Estimates of a quantity on the grid of the truth, NaN where one of them has none."""
    found, stated = {}, {key: truth.attrs[key] for key in ("standard_name", "units") if key in truth.attrs}
    for name, each in estimates.items():
        # A result without metadata is in the unit and range of the truth.
        each = each.assign_attrs(stated | each.attrs)
        try:
            check_same_quantity(each, truth, (name, "the truth"))
            own, cut = matched(each.astype(float), truth.astype(float))
        except ValueError as error:
            raise ValueError(f"{truth.name} of {name}: {error}") from None
        found[name] = own.assign_coords(y=cut["y"], x=cut["x"]).reindex_like(truth).compute()
    return found


def _common(estimates):
    """Estimates on the pixels that all have."""
    known = np.logical_and.reduce([each.notnull() for each in estimates.values()])
    return {name: each.where(known).assign_attrs(each.attrs) for name, each in estimates.items()}


def _scored(pairs, condition=None, by=None):
    """Scores by product and quantity, and by the groups of a condition."""
    rows = []
    for estimates, truth in pairs.values():
        each = [score(own, truth, by)[["n", "bias", "rmse"]] for own in _common(estimates).values()]
        if by is not None:
            codes, meanings = np.ravel(by.attrs.get("flag_values", ())), by.attrs.get("flag_meanings", "").split()
            names = dict(zip(codes.tolist(), meanings, strict=True))
            labels = [names.get(code, code) for code in each[0]["group"].values.tolist()]
            each = [found.assign_coords(group=labels).rename(group=condition) for found in each]
        rows.append(xr.concat(each, xr.Variable("product", list(estimates))))
    found = xr.concat(rows, xr.Variable("quantity", list(pairs)), combine_attrs="drop_conflicts")
    return found.transpose("product", "quantity", ...)


def _page(tree, pairs, title, left):
    """One self-contained HTML page."""
    products, quantities = (list(map(str, tree[name].values)) for name in ("product", "quantity"))
    drawn = [quantities[k] for k in np.unique(np.linspace(0, len(quantities) - 1, _DRAWN).round().astype(int))]
    shown = drawn[len(drawn) // 2]
    parts = [
        {
            "name": name,
            "title": _CONDITIONS[name][1],
            "words": _CONDITIONS[name][2],
            "picture": report.png(_condition_figure(node.to_dataset(), products, drawn), _DPI),
            "table": node.to_dataset(),
            "extremes": _extremes(node.to_dataset(), products, shown),
        }
        for name, node in tree.children.items()
    ]
    return report.page_html(
        _TEMPLATE, title=title or f"Exam of {', '.join(products)}", scores=tree.to_dataset(), parts=parts, left=left,
        products=products, quantities=quantities, drawn=drawn, shown=shown, units=_unit(tree["rmse"]),
        maps=report.png(_error_figure(*pairs[shown], shown), _DPI),
    )  # fmt: skip


def _unit(values):
    unit = values.attrs.get("units", "1")
    return "" if unit == "1" else f" [{unit}]"


def _extremes(table, products, quantity):
    """Label and bias of the first and the last group with pixels, by product."""
    rows, condition = [], table["bias"].dims[-1]
    for product in products:
        bias = table["bias"].sel(product=product, quantity=quantity).dropna(condition)
        rows.append((product, [(bias[condition].values[k], float(bias[k])) for k in (0, -1) if bias.size]))
    return rows


def _condition_figure(table, products, drawn):
    """Bias and root mean square error of the quantities by a condition, one line for each product."""
    condition = table["bias"].dims[-1]
    figure = Figure(figsize=(1.2 + 2.9 * len(drawn), 4.9), layout="constrained")
    axes = figure.subplots(2, len(drawn), sharex=True, squeeze=False)
    at = table[condition].values
    is_class = condition == "cover"
    places = np.arange(at.size) if is_class else at
    for column, quantity in zip(axes.T, drawn, strict=True):
        for axis, name in zip(column, ("bias", "rmse"), strict=True):
            for k, product in enumerate(products):
                values = table[name].sel(product=product, quantity=quantity).values
                style = {"marker": "osD^v"[k % 5], "color": _COLOURS[k % len(_COLOURS)], "markersize": 4}
                axis.plot(places, values, linestyle="none" if is_class else "-", label=product, linewidth=1.4, **style)
            axis.axhline(0, color="#222222", linewidth=0.8)
            axis.tick_params(labelsize=8)
            axis.spines[["top", "right"]].set_visible(False)
        column[0].set_title(quantity, fontsize=9.5)
        column[1].set_xlabel(_CONDITIONS[condition][1], fontsize=8)
        if is_class:
            column[1].set_xticks(places, [str(each).replace("-", "-\n") for each in at])
            column[1].margins(x=0.2)
    for axis, name in zip(axes[:, 0], ("bias", "rmse"), strict=True):
        axis.set_ylabel(f"{name}{_unit(table[name])}", fontsize=8.5)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), frameon=False, fontsize=8.5, loc="outside upper center", ncols=4
    )
    return figure


def _error_figure(estimates, truth, quantity):
    """Maps of the truth and of the error of each product."""
    errors = {name: each - truth for name, each in estimates.items()}
    limit = max(percentile_limits(each, (2, 98), middle=0.0)[1] for each in errors.values())
    panels = [(f"true {quantity}", truth, "viridis", percentile_limits(truth))]
    panels += [(f"{name} minus truth", each, "RdBu_r", (-limit, limit)) for name, each in errors.items()]
    rows, columns = -(-len(panels) // 3), min(len(panels), 3)
    figure = Figure(figsize=(3.4 * columns, 3.7 * rows), layout="constrained")
    for axis, panel in itertools.zip_longest(figure.subplots(rows, columns, squeeze=False).ravel(), panels):
        axis.axis("off")
        if panel is None:
            continue
        words, values, colours, (low, high) = panel
        axis.set_title(words, fontsize=9)
        shown = axis.imshow(values.values, cmap=colours, vmin=low, vmax=high, interpolation="nearest")
        figure.colorbar(shown, ax=axis, orientation="horizontal", shrink=0.85, pad=0.02).ax.tick_params(labelsize=7.5)
    return figure
