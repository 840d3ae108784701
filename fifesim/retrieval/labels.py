"""Retrieval of labelled images."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
import xarray as xr

from fifesim.base.arguments import Kind
from fifesim.base.files import shown
from fifesim.grids import cf, chunks, swaths
from fifesim.retrieval.description import ANGLE_MARGIN, OUTSIDE, Retrieval
from fifesim.retrieval.methods import angles_of
from fifesim.retrieval.networks import SL2P_BANDS, sl2p

_ANGLES = ("sza", "saa", "vza", "vaa")

# Bands that differ by more than this belong to another instrument. [um]
_SAME_BAND = 0.01

_FLAG = {
    "standard_name": "status_flag",
    "long_name": "flag of the retrieval",
    "flag_masks": np.array([1, 2, 4], np.int8),
    "flag_meanings": "outside_training_inputs edge_of_prior not_converged",
}

# Variables of SL2P by their names in its tables, and its bands and their names here.
_SL2P = {"lai": "LAI", "fpar": "FAPAR", "fcover": "FCOVER"}
_SL2P_BANDS = tuple(name.replace("B", "MSI") for name in SL2P_BANDS)

RetrievalLike = Annotated[
    Retrieval | str,
    Kind("a fifesim.Retrieval, as fifesim.train gives it, or 'sl2p'", lambda value: isinstance(value, Retrieval | str)),
]


def retrieve(image: xr.DataArray, retrieval: RetrievalLike, intervals: Sequence[float] | None = None) -> xr.Dataset:
    """
    Estimate leaf area and related quantities of each pixel, with intervals and a flag.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Reflectance, at the level for which the retrieval was trained, with the coordinates ``sza``, ``saa``, ``vza``
        and ``vaa``, as in images of `sense`, `open_landsat` and `open_sentinel2`. [1]
    retrieval : Retrieval or "sl2p"
        From `train` or `read_retrieval`; or the networks of ESA's Level-2 prototype processor for surface reflectance
        of Sentinel-2, which have no intervals.
    intervals : sequence of float, optional
        Levels of the central intervals, a subset of the training levels; by default all. [1]

    Returns
    -------
    estimates : xarray.Dataset of float32, dims (y, x)
        For each quantity, such as ``lai``: its median, the standard deviation ``lai_sd``, and the ends ``lai_low`` and
        ``lai_high`` of intervals, with a first dimension ``level``. ``flag`` has the bits 1, outside of the training
        inputs, 2, at the edge of the prior, and 4, no convergence, as described by its CF attributes; use pixels with
        flag 0.
        SL2P gives ``lai``, ``fpar``, ``fcover`` and ``flag``. Lazy if the image is.

    Raises
    ------
    ValueError
        If the image lacks bands or angles, holds digital numbers or reflectance of the other level, is of another
        instrument, has sun or view outside of the training, or a level was not trained.

    References
    ----------
    SL2P: [WeissBaret2016]_

    See Also
    --------
    fifesim.train, fifesim.score

    Examples
    --------
    Ten landscapes keep this example short; `fifesim.train` warns of them.

    >>> import fifesim
    >>> chip = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    >>> study = fifesim.Study(chip, {"visibility": {"uniform": [10, 60]}}, landscapes=10)
    >>> retrieval = fifesim.train(study, chips=20)
    >>> image = fifesim.simulate(chip)["image"]["dn"].fifesim.to_reflectance()
    >>> estimates = image.fifesim.retrieve(retrieval, intervals=[0.8])
    >>> list(estimates.data_vars)
    ['lai', 'lai_sd', 'lai_low', 'lai_high', 'fpar', 'fpar_sd', 'fpar_low', 'fpar_high', 'flag']
    """
    if isinstance(retrieval, str):
        if retrieval != "sl2p":
            raise ValueError(f"retrieval must be 'sl2p' or from fifesim.train, got {retrieval!r}: see read_retrieval")
        return _by_sl2p(image)
    levels = _levels(retrieval, intervals)
    _check_level(image, retrieval.level)
    light = _selected(image, retrieval.bands, retrieval.wavelengths, retrieval.instrument)
    angles = [_angle(image, name) for name in _ANGLES]
    _check_angles(angles, retrieval)
    places = [retrieval.levels.index(level) for level in levels]
    count, kinds = len(levels), len(retrieval.quantities)
    kernel = partial(_estimates, retrieval=retrieval, places=places)
    layers = kinds * (2 + 2 * count) + len(retrieval.diagnostics) + 1
    found = chunks.pointwise(kernel, light, *angles, bands=layers, dtype=np.float32)
    numbers = iter(range(layers))
    history = f"retrieve: {retrieval.method} of {', '.join(retrieval.bands)}; prior: {retrieval.prior}"
    out = {}
    for name in retrieval.quantities:
        out[name] = _layer(found, next(numbers), image, name, history)
        out[f"{name}_sd"] = _layer(found, next(numbers), image, name, history, "standard deviation")
        for end in ("low", "high"):
            parts = [_layer(found, next(numbers), image, name, history, f"{end} end of the interval") for _ in levels]
            whole = xr.concat(parts, xr.DataArray(list(levels), dims="level", name="level"), combine_attrs="override")
            out[f"{name}_{end}"] = whole
        out[name].attrs["ancillary_variables"] = f"{name}_sd flag"
    for name in retrieval.diagnostics:
        out[name] = swaths.placed_as(found.isel(band=next(numbers)), image).rename(name)
        out[name].attrs = {"long_name": name.replace("_", " "), "units": "1", "history": history}
    out["flag"] = _flag(found.isel(band=-1), image, history)
    return xr.Dataset(out)


def _levels(retrieval, intervals):
    """Levels of the intervals, increasing."""
    wanted = retrieval.levels if intervals is None else tuple(sorted(float(level) for level in intervals))
    if not wanted or not set(wanted) <= set(retrieval.levels):
        known = ", ".join(f"{level:g}" for level in retrieval.levels)
        raise ValueError(
            f"intervals must be among the levels of the training, {known}, got {shown(list(wanted))}: train with "
            "levels=[...] for others"
        )
    return wanted


def _check_level(image, level):
    """Raise ValueError for digital numbers, radiance or reflectance of the other level."""
    if cf.is_counts(image) or image.dtype.kind in "iu":
        raise ValueError(
            "the image holds digital numbers: convert it with .fifesim.to_reflectance(), or apply its scale and offset"
        )
    cf.check_quantity(image, f"{level}_reflectance")


def _selected(image, names, wavelengths, instrument):
    """Bands of an image in the order of the training."""
    if "band" not in image.dims:
        raise ValueError(f"the image has no dimension band: the retrieval needs {', '.join(names)}")
    known = [str(name) for name in np.atleast_1d(image["band"].values)]
    if missing := [name for name in names if name not in known]:
        raise ValueError(
            f"the image lacks {', '.join(missing)}: the retrieval needs {', '.join(names)}, the image has "
            f"{', '.join(known)}"
        )
    light = image.isel(band=[known.index(name) for name in names])
    if wavelengths is not None and "wavelength" in light.coords:
        off = np.abs(np.asarray(light["wavelength"].values) - np.asarray(wavelengths))
        if off.max() > _SAME_BAND:
            at = int(off.argmax())
            raise ValueError(
                f"band {names[at]} of the image is at {float(light['wavelength'][at]):.3f} um, the training with "
                f"{instrument} had {wavelengths[at]:.3f} um: train with the instrument of the image"
            )
    # The layers of the result have other labels.
    return light.drop_vars([name for name, each in light.coords.items() if "band" in each.dims])


def _angle(image, name):
    if name not in image.coords:
        raise ValueError(
            f"the image has no coordinate {name}: assign the angles of sun and view, such as "
            f"image.assign_coords({name}=30.0)"
        )
    return image.coords[name].reset_coords(drop=True)


def _check_angles(angles, retrieval):
    """Raise ValueError if sun or view of the whole image is outside of the training."""
    if any(each.ndim for each in angles):
        return
    first, last = retrieval.tables["angle_range"]
    own = angles_of(*(float(each) for each in angles))
    for name, value, low, high in zip(("sza", "vza", "relative azimuth"), own, first, last, strict=True):
        if not low - ANGLE_MARGIN <= value <= high + ANGLE_MARGIN:
            raise ValueError(
                f"{name} of the image is {value:.1f} degrees, the training had {low:.1f} to {high:.1f}: train with a "
                f"study whose geometry includes it, such as draw.geometry.sza"
            )


# Pixels that are estimated at once, so that hidden layers and likelihoods stay small.
_BATCH = 2**16


def _in_batches(function, layers, light, *angles):
    """Layers of a block from a function of reflectance, shape (n, bands), and angles, shape (n, 3), in degrees."""
    shape, spectra = light.shape[:-1], light.reshape(-1, light.shape[-1])
    flat = [each if np.ndim(each) == 0 else np.broadcast_to(each, shape).reshape(-1) for each in angles]
    out = np.empty((layers, len(spectra)), np.float32)
    for start in range(0, len(spectra), _BATCH):
        part = slice(start, start + _BATCH)
        own = spectra[part].astype(float)
        seen = (np.broadcast_to(each if np.ndim(each) == 0 else each[part], len(own)) for each in flat)
        out[:, part] = function(own, angles_of(*seen))
    return out.reshape(layers, *shape)


def _estimates(light, *angles, retrieval, places):
    """Layers of a block in the order of `retrieve`, and the flag as the last one; NaN for no data."""

    def layers_of(spectra, directions):
        found, layers = retrieval.estimate(spectra, directions), []
        for kind in range(len(retrieval.quantities)):
            layers += [found.median[:, kind], found.sd[:, kind]]
            layers += [end[:, kind, place] for end in (found.low, found.high) for place in places]
        return [*layers, *found.diagnostics, np.where(np.isnan(found.median[:, 0]), np.nan, found.flag)]

    count = len(retrieval.quantities) * (2 + 2 * len(places)) + len(retrieval.diagnostics) + 1
    return _in_batches(layers_of, count, light, *angles)


def _layer(found, at, image, name, history, what=""):
    """One layer of the result."""
    values = cf.label(swaths.placed_as(found.isel(band=at), image), name, source=image, history=history)
    if what:
        # Only values of the quantity itself have a standard name.
        values.attrs.pop("standard_name", None)
        values.attrs["long_name"] = f"{values.attrs['long_name']}, {what}"
    return values


def _flag(values, image, history):
    """Flag as whole numbers, -1 for no data."""
    flag = swaths.placed_as(values.fillna(-1).astype(np.int8), image).rename("flag")
    flag.attrs = _FLAG | {"history": history}
    flag.encoding["_FillValue"] = np.int8(-1)
    return flag


def _by_sl2p(image):
    """LAI, FPAR and cover of Sentinel-2 surface reflectance by ESA's networks."""
    _check_level(image, "surface")
    light = _selected(image, _SL2P_BANDS, None, "MSI")
    angles = [_angle(image, name) for name in _ANGLES]
    found = chunks.pointwise(_sl2p_layers, light, *angles, bands=len(_SL2P) + 1, dtype=np.float32)
    history = "retrieve: SL2P, ATBD 2.1"
    out = {name: _layer(found, at, image, name, history) for at, name in enumerate(_SL2P)}
    return xr.Dataset(out | {"flag": _flag(found.isel(band=-1), image, history)})


def _sl2p_layers(light, *angles):
    """LAI, FPAR, cover and flag of a block."""

    def layers_of(spectra, directions):
        cos_sza, cos_vza, cos_raa = np.cos(np.radians(directions)).T
        values, outside = zip(*(sl2p(spectra, cos_vza, cos_sza, cos_raa, name) for name in _SL2P.values()), strict=True)
        return [*values, np.where(np.isnan(values[0]), np.nan, OUTSIDE * np.any(outside, axis=0))]

    return _in_batches(layers_of, len(_SL2P) + 1, light, *angles)
