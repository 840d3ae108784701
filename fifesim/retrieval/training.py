"""Training of a retrieval from a study or a dataset of chips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Literal

import numpy as np
import xarray as xr

from fifesim.analysis.score_labels import score
from fifesim.base.annotations import FilePath, Names
from fifesim.base.arguments import Kind, described
from fifesim.base.bands import NEAR_INFRARED, RED, nearest_band
from fifesim.output.chips.store import chip_arrays, layout_of
from fifesim.retrieval import methods
from fifesim.retrieval.description import FORMAT, RETRIEVED, Retrieval
from fifesim.scenario.chips import chips_of
from fifesim.scenario.studies import Study, read_study

StudyOrDataset = Annotated[
    FilePath | Study | xr.Dataset,
    Kind("the path of a study, a fifesim.Study, or a dataset of chips as fifesim.dataset gives it", dimensions=0),
]

# TrainingPixels of the training that are used, more do not improve a network of this size, and of the other parts.
_PIXELS, _UNSEEN = 100_000, 20_000

_LEVELS = (0.5, 0.8, 0.95)


def train(
    source: StudyOrDataset,
    method: Literal["line", "lookup", "quantiles"] = "quantiles",
    *,
    bands: Names | None = None,
    quantities: Names = ("lai", "fpar"),
    level: Literal["toa", "surface"] = "toa",
    levels: Sequence[float] = _LEVELS,
    chips: int | None = None,
    seed: int = 0,
    path: FilePath | None = None,
) -> Retrieval:
    """
    Train a retrieval of leaf area and related quantities; computes.

    The method is fitted to the chips of the part ``train`` of a dataset. Its intervals are then stretched so that they
    contain the stated share of the pixels of the part ``validation``, and it is scored on the part ``test``. No
    landscape is in two parts.

    Parameters
    ----------
    source : path, fifesim.Study or xarray.Dataset
        Study, whose chips are made in memory, or chips from `fifesim.dataset`.
    method : {"quantiles", "lookup", "line"}, optional
        "quantiles" is a network trained for quantiles; "lookup" weights at most 20,000 simulated pixels by their
        likelihood, with the covariance of noise, blur and registration found in the chips; "line" is a regression on
        NDVI, whose intervals are not stretched.
    bands : str or sequence of str, optional
        Bands, by default all of the chips.
    quantities : str or sequence of str, optional
        Any of "lai", "fpar" and "green_fpar".
    level : {"toa", "surface"}, optional
        Level of the images: reflectance at the top of the atmosphere, from ``toa_reflectance`` of the chips, or of the
        surface, from a variable ``surface_reflectance`` that you add to the dataset.
    levels : sequence of float, optional
        Levels of the central intervals. [1]
    chips : int, optional
        Number of chips made from a study, by default 10 for each landscape.
    seed : int, optional
        Seed of the first weights and of the choice of pixels.
    path : str or path, optional
        NetCDF file to which the retrieval is written, see `Retrieval.to_netcdf`.

    Returns
    -------
    retrieval : Retrieval

    Raises
    ------
    ValueError
        If the dataset lacks bands, quantities or one of the parts train, validation and test, or has no valid pixel.

    See Also
    --------
    fifesim.retrieve, fifesim.read_retrieval, fifesim.dataset, fifesim.score

    Examples
    --------
    >>> import fifesim
    >>> chip = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    >>> study = fifesim.Study(chip, {"visibility": {"uniform": [10, 60]}}, landscapes=10)
    >>> retrieval = fifesim.train(study, "lookup", chips=20)
    >>> retrieval.method, retrieval.bands, retrieval.quantities
    ('lookup', ('TM3', 'TM4'), ('lai', 'fpar'))
    """
    names = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    _check(method, names, levels)
    dataset = source if isinstance(source, xr.Dataset) else _made(source, chips)
    variable = "toa_reflectance" if level == "toa" else "surface_reflectance"
    _check_dataset(dataset, variable, names)
    chosen = _chosen_bands(dataset, bands)
    parts = {part: _pixels(dataset, variable, chosen, names, part, seed) for part in ("train", "validation", "test")}
    learned, levels = parts["train"], tuple(sorted(float(each) for each in levels))
    wavelengths = tuple(float(each) for each in dataset["wavelength"].sel(band=list(chosen)).values)
    fit: Callable = methods.FITS[method]
    if method == "line":
        places = tuple(nearest_band(wavelengths, window) for window in (RED, NEAR_INFRARED))
        if None in places:
            raise ValueError(f"line needs a red and a near infrared band, got {', '.join(chosen)}: add them")
        fit = partial(fit, red_and_near_infrared=places)
    tables = fit(learned, levels, seed) | methods.domain_of(learned.reflectance)
    tables["prior_range"] = np.quantile(learned.truth, (0.005, 0.995), axis=0)
    tables["angle_range"] = np.stack([learned.angles.min(0), learned.angles.max(0)])
    tables["stretch"] = np.ones((len(names), len(levels)))
    raw = partial(methods.ESTIMATORS[method], tables, levels=levels)
    if method != "line":
        unseen = parts["validation"]
        found = raw(unseen.reflectance, unseen.angles)
        tables["stretch"] = methods.stretch_factors(found, unseen.truth, unseen.landscape, levels)
    retrieval = Retrieval(
        method=method,
        level=level,
        instrument=str(dataset.attrs.get("instrument", "")),
        bands=chosen,
        wavelengths=wavelengths,
        quantities=names,
        levels=levels,
        prior=_prior(learned, names),
        seed=seed,
        tables=tables,
        version=FORMAT,
    )
    retrieval = replace(retrieval, score=_score(retrieval, parts["test"]))
    if path is not None:
        retrieval.to_netcdf(path)
    return retrieval


def _check(method, names, levels):
    if method not in methods.FITS:
        raise ValueError(f"method must be one of {', '.join(methods.FITS)}, got {method!r}")
    wrong = [name for name in names if name not in RETRIEVED]
    if wrong or not names or len(set(names)) < len(names):
        raise ValueError(f"quantities must be different names among {', '.join(RETRIEVED)}, got {described(names)}")
    if not len(levels) or not all(0 < each < 1 for each in levels) or len(set(levels)) < len(levels):
        raise ValueError(f"levels must be different numbers between 0 and 1, got {described(levels)}")


def _made(source, count):
    """Chips of a study in memory, as a dataset."""
    study = source if isinstance(source, Study) else read_study(source)
    chips = chips_of(study, 10 * study.landscapes if count is None else count)
    layout = layout_of(chips)
    arrays = chip_arrays(chips, np.arange(len(chips)), layout)
    variables = {name: (("chip", *layout.variables[name][0]), values) for name, values in arrays.items()}
    found = xr.Dataset(variables, layout.bands.coords).assign_coords(
        landscape=("chip", chips.landscape), split=("chip", chips.split)
    )
    return found.assign_attrs(instrument=study.scenario.sensor.description.name)


def _check_dataset(dataset, variable, names):
    wanted = (variable, *names, "landscape", "split", "sza", "saa", "vza", "vaa")
    lacking = [name for name in wanted if name not in dataset.variables]
    if lacking:
        cure = "give chips as fifesim.dataset makes them"
        if "surface_reflectance" in lacking:
            cure = "add the corrected reflectance of your processor to the dataset, or use level='toa'"
        if set(lacking) <= set(RETRIEVED):
            cure = "choose other quantities"
        raise ValueError(f"source has no {', '.join(lacking)}: {cure}")
    parts = set(np.unique(dataset["split"].values).tolist())
    if missing := {"train", "validation", "test"} - parts:
        raise ValueError(
            f"source has no chips of {', '.join(sorted(missing))}: a retrieval is fitted on train, its intervals "
            "are set on validation and it is scored on test; make more chips or landscapes"
        )


def _chosen_bands(dataset, bands):
    known = [str(name) for name in dataset["band"].values]
    wanted = known if bands is None else [bands] if isinstance(bands, str) else [str(name) for name in bands]
    if missing := [name for name in wanted if name not in known]:
        raise ValueError(f"the chips have no band {', '.join(missing)}, they have {', '.join(known)}")
    return tuple(wanted)


def _pixels(dataset, variable, bands, names, part, seed):
    """Valid pixels of one part of a dataset, a random choice of them if there are many."""
    own = dataset.isel(chip=np.flatnonzero(dataset["split"].values == part)).sel(band=list(bands))
    light = np.asarray(own[variable].transpose("chip", "y", "x", "band").values, float)
    chips, rows, columns, width = light.shape
    truth = np.stack([np.asarray(own[name].transpose("chip", "y", "x").values, float) for name in names], axis=-1)
    angles = np.stack(
        [own["sza"].values, own["vza"].values, methods.azimuth_difference(own["saa"].values, own["vaa"].values)], axis=1
    )
    # A view at nadir has no azimuth.
    angles[:, 2] = np.where(angles[:, 1] < 0.5, 0.0, angles[:, 2])
    chip = np.repeat(np.arange(chips), rows * columns)
    flat, true = light.reshape(-1, width), truth.reshape(-1, len(names))
    valid = np.flatnonzero(np.isfinite(flat).all(1) & np.isfinite(true).all(1))
    if not valid.size:
        raise ValueError(f"no pixel of the part {part} has both reflectance and truth")
    chosen = np.sort(np.random.default_rng(seed).permutation(valid)[: _PIXELS if part == "train" else _UNSEEN])
    whole = chip[chosen]
    return methods.TrainingPixels(flat[chosen], angles[whole], true[chosen], whole, own["landscape"].values[whole])


def _prior(pixels, names):
    """Prior in words: the distribution of the quantities among the training pixels."""
    texts = []
    for name, values in zip(names, pixels.truth.T, strict=True):
        low, high = np.quantile(values, (0.01, 0.99))
        texts.append(f"{name} mean {values.mean():.3g}, sd {values.std():.3g}, 98 % within {low:.3g} and {high:.3g}")
    landscapes = len(np.unique(pixels.landscape))
    return f"{'; '.join(texts)} ({len(pixels.truth)} pixels of {landscapes} landscapes)"


def _score(retrieval, pixels):
    """Scores of unseen landscapes by quantity."""
    found = retrieval.estimate(pixels.reflectance, pixels.angles)
    scores = []
    for kind, name in enumerate(retrieval.quantities):
        truth = xr.DataArray(
            pixels.truth[:, kind], dims="pixel", name=name, coords={"landscape": ("pixel", pixels.landscape)}
        )
        level = xr.DataArray(list(retrieval.levels), dims="level")
        values = {"": found.median[:, kind], "_sd": found.sd[:, kind]}
        parts = {f"{name}{end}": ("pixel", each) for end, each in values.items()}
        for end, each in zip(("_low", "_high"), (found.low, found.high), strict=True):
            parts[f"{name}{end}"] = (("pixel", "level"), each[:, kind])
        scores.append(score(xr.Dataset(parts, {"level": level}), truth))
    return xr.concat(scores, xr.DataArray(list(retrieval.quantities), dims="quantity", name="quantity"))
