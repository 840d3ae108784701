"""Training of a retrieval from a study or a dataset of chips: pixels of the chain, of uniform ground, or corrected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Literal

import numpy as np
import xarray as xr

from fifesim.analysis.score_labels import score
from fifesim.atmosphere.aerosols import aerosol_optical_thickness
from fifesim.base.arguments import FilePath, Kind, Names, described
from fifesim.base.bands import NEAR_INFRARED, RED, nearest_band
from fifesim.base.files import check_target
from fifesim.base.messages import warn
from fifesim.chain.driver import Driver
from fifesim.output.chips.store import chip_arrays, layout_of
from fifesim.retrieval import methods
from fifesim.retrieval.description import FORMAT, RETRIEVED, Retrieval
from fifesim.retrieval.inversion import DRAWN_STATES
from fifesim.scenario.chips import chips_of
from fifesim.scenario.ensemble import uniform_reflectance
from fifesim.scenario.keys import STAND, VARYING
from fifesim.scenario.scenario import parse_scenario, put, values_of
from fifesim.scenario.simulation import setup_of
from fifesim.scenario.studies import Study, parse_study, read_study

StudyOrDataset = Annotated[
    FilePath | Study | xr.Dataset,
    Kind("the path of a study, a fifesim.Study, or a dataset of chips as fifesim.dataset gives it", dimensions=0),
]

LandscapeFile = Annotated[
    FilePath, Kind("konza, or the path of a learned landscape that Landscape.save wrote, such as 'mine.json'")
]

_LEVELS = (0.5, 0.8, 0.95)
# Number of landscapes in a part below which `train` warns.
_FEW_LANDSCAPES = 10


def train(
    source: StudyOrDataset,
    method: Literal["line", "lookup", "quantiles", "optimal-estimation"] = "quantiles",
    *,
    landscape: LandscapeFile | None = None,
    bands: Names | None = None,
    quantities: Names = ("lai", "fpar"),
    level: Literal["toa", "surface"] = "toa",
    pixels: Literal["chain", "uniform"] = "chain",
    levels: Sequence[float] = _LEVELS,
    chips: int | None = None,
    seed: int = 0,
    path: FilePath | None = None,
) -> Retrieval:
    """
    Train a retrieval of leaf area and related quantities; computes.

    The method is fitted to the part ``train`` of the chips, its intervals are stretched to hold on ``validation``, and
    it is scored on ``test``.

    Parameters
    ----------
    source : path, fifesim.Study or xarray.Dataset
        Study, whose chips are made in memory, or chips from `fifesim.dataset`.
    method : {"quantiles", "lookup", "line", "optimal-estimation"}, optional
        "quantiles" is a network trained for quantiles; "lookup" weights at most 20,000 simulated pixels by their
        likelihood, with the covariance of noise, blur and registration found in the chips; "line" is a regression on
        NDVI, whose intervals are not stretched. "optimal-estimation" finds the most probable LAI together with the
        other quantities that the study draws, for one stand; it needs the study, or a dataset from `fifesim.dataset`.
    landscape : str or path, optional
        Learned landscape of which the chips of the study are made, instead of the leaf area of its scenario: "konza",
        or a file of `fifesim.ground.Landscape.save`. Its leaf area is the prior.
    bands : str or sequence of str, optional
        Bands, by default all of the chips.
    quantities : str or sequence of str, optional
        Any of "lai", "fpar" and "green_fpar".
    level : {"toa", "surface"}, optional
        Level of the images: reflectance at the top of the atmosphere or of the surface. Chips have
        ``toa_reflectance``. It is corrected with an aerosol optical depth whose error has a standard deviation of 0.05
        + 0.15 times the depth [Levy2010]_, unless the dataset has a variable ``surface_reflectance`` of your processor.
    pixels : {"chain", "uniform"}, optional
        Pixels to which the method is fitted: images of the whole chain, or uniform ground with errors of the same
        covariance. Intervals and scores are from the chain. "uniform" needs the study, or a dataset from
        `fifesim.dataset`.
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

    Warns
    -----
    UserWarning
        If a part has fewer than 10 landscapes, or `fifesim.score` warns of the part ``test``.

    Raises
    ------
    ValueError
        If the dataset lacks bands, quantities, its study or one of the parts train, validation and test, or has no
        valid pixel; or if optimal estimation or uniform pixels are requested for a landscape of several classes.
    OSError
        If the file cannot be written into the folder of ``path``; found before the training.

    See Also
    --------
    fifesim.retrieve, fifesim.retrieval.read_retrieval, fifesim.dataset, fifesim.score

    Examples
    --------
    Ten landscapes keep this example short; `fifesim.train` warns of them.

    >>> import fifesim
    >>> chip = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    >>> study = fifesim.Study(chip, {"visibility": {"uniform": [10, 60]}}, landscapes=10)
    >>> retrieval = fifesim.train(study, "lookup", chips=20)
    >>> retrieval.method, retrieval.bands, retrieval.quantities
    ('lookup', ('TM3', 'TM4'), ('lai', 'fpar'))
    """
    names = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    _check(names, levels)
    if path is not None:
        # Before the training, which would be lost.
        check_target(path)
    dataset = source if isinstance(source, xr.Dataset) else made(_study(source, landscape), chips)
    if landscape is not None and dataset is source:
        raise ValueError("landscape is given for chips that are already made: give their study instead of the dataset")
    levels = tuple(sorted(float(each) for each in levels))
    variable = f"{level}_reflectance"
    _check_dataset(dataset, names)
    chosen = _chosen_bands(dataset, bands)
    dataset, fitted = _levelled(dataset, level, pixels, seed)
    take = partial(pixels_of, variable=variable, bands=chosen, seed=seed)
    learned = take(fitted, names=names, part="train")
    wavelengths = tuple(float(each) for each in dataset["wavelength"].sel(band=list(chosen)).values)
    tables = methods.domain_of(learned.reflectance)
    if method == "optimal-estimation":
        described, states = with_states(fitted)
        known = take(described, names=[*(f"state_{name}" for name in states), *names], part="train")
        tables |= methods.fit_optimal_estimation(known, _study_of_one_stand(dataset), states, level, chosen, names)
    elif method == "line":
        tables |= methods.fit_line(learned, _red_and_near_infrared(wavelengths, chosen))
    else:
        tables |= methods.FITS[method](learned, levels, seed)
    tables["prior_range"] = np.quantile(learned.truth, (0.005, 0.995), axis=0)
    tables["angle_range"] = np.stack([learned.angles.min(0), learned.angles.max(0)])
    tables["stretch"] = np.ones((len(names), len(levels)))
    if method != "line":
        unseen = take(dataset, names=names, part="validation")
        found = methods.ESTIMATORS[method](tables, unseen.reflectance, unseen.angles, levels=levels)
        tables["stretch"] = methods.stretch_factors(found, unseen.truth, unseen.landscape, levels)
    retrieval = Retrieval(
        method=method,
        level=level,
        instrument=str(dataset.attrs.get("instrument", "")),
        bands=chosen,
        wavelengths=wavelengths,
        quantities=names,
        levels=levels,
        prior=_prior(learned, names) + (f", learned from {landscape}" if landscape is not None else ""),
        seed=seed,
        tables=tables,
        version=FORMAT,
    )
    retrieval = replace(retrieval, score=_score(retrieval, take(dataset, names=names, part="test")))
    if path is not None:
        retrieval.to_netcdf(path)
    return retrieval


def _study(source, landscape):
    """Study of a retrieval, of a learned landscape if one is given."""
    study = source if isinstance(source, Study) else read_study(source)
    if landscape is None:
        return study
    values = values_of(study.scenario)
    values["ground"] = {key: value for key, value in values.get("ground", {}).items() if key not in STAND}
    put(values, ("landscape", "learned"), str(landscape))
    return replace(study, scenario=parse_scenario(values))


def _check(names, levels):
    wrong = [name for name in names if name not in RETRIEVED]
    if wrong or not names or len(set(names)) < len(names):
        raise ValueError(f"quantities must be different names among {', '.join(RETRIEVED)}, got {described(names)}")
    if not len(levels) or not all(0 < each < 1 for each in levels) or len(set(levels)) < len(levels):
        raise ValueError(f"levels must be different numbers between 0 and 1, got {described(levels)}")


def _levelled(dataset, level, pixels, seed):
    """Chips with reflectance at the level, and those to which the method is fitted."""
    is_own = level == "surface" and "surface_reflectance" in dataset
    if is_own and pixels == "uniform":
        raise ValueError("the surface_reflectance of the dataset is not of uniform ground: use pixels='chain'")
    fitted = dataset
    if pixels == "uniform":
        fitted = with_uniform_ground(dataset.isel(chip=np.flatnonzero(dataset["split"] == "train")), seed)
    if level == "toa" or is_own:
        return dataset, fitted
    return tuple(with_surface_reflectance(each, seed) for each in (dataset, fitted))


def _red_and_near_infrared(wavelengths, names):
    places = tuple(nearest_band(wavelengths, window) for window in (RED, NEAR_INFRARED))
    if None in places:
        raise ValueError(f"line needs a red and a near infrared band, got {', '.join(names)}: add them")
    return places


def _study_of_one_stand(dataset):
    study = study_of(dataset, "optimal-estimation")
    if study.scenario.landscape.cover != "none":
        raise ValueError(
            f"optimal-estimation needs a single stand, got landscape.cover = {study.scenario.landscape.cover!r}: use "
            "quantiles"
        )
    return study


def _check_dataset(dataset, names):
    wanted = ("toa_reflectance", *names, "lai", "landscape", "split", "sza", "saa", "vza", "vaa")
    lacking = [name for name in dict.fromkeys(wanted) if name not in dataset.variables]
    if lacking:
        cure = (
            "choose other quantities" if set(lacking) <= set(RETRIEVED) else "give chips as fifesim.dataset makes them"
        )
        raise ValueError(f"source has no {', '.join(lacking)}: {cure}")
    parts = set(np.unique(dataset["split"].values).tolist())
    if missing := {"train", "validation", "test"} - parts:
        raise ValueError(
            f"source has no chips of {', '.join(sorted(missing))}: a retrieval is fitted on train, its intervals "
            "are set on validation and it is scored on test; make more chips or landscapes"
        )
    split, landscape = dataset["split"].values, dataset["landscape"].values
    counts = {part: np.unique(landscape[split == part]).size for part in ("train", "validation", "test")}
    if min(counts.values()) < _FEW_LANDSCAPES:
        found = ", ".join(f"{part} {count}" for part, count in counts.items())
        warn(
            f"the chips are of few landscapes ({found}): pixels of one landscape depend on each other, so that errors "
            f"and intervals are uncertain; use at least {_FEW_LANDSCAPES} landscapes in each part, such as "
            "Study(..., landscapes=40, split={'train': 0.5, 'validation': 0.25, 'test': 0.25})"
        )


def _chosen_bands(dataset, bands):
    known = [str(name) for name in dataset["band"].values]
    wanted = known if bands is None else [bands] if isinstance(bands, str) else [str(name) for name in bands]
    if missing := [name for name in wanted if name not in known]:
        raise ValueError(f"the chips have no band {', '.join(missing)}, they have {', '.join(known)}")
    return tuple(wanted)


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


# Number of training pixels (more do not improve a network of this size), and of pixels of the other parts.
_PIXELS, _UNSEEN = 100_000, 20_000


def made(study, count):
    """Chips of a study in memory, as a dataset."""
    chips = chips_of(study, 10 * study.landscapes if count is None else count)
    layout = layout_of(chips)
    arrays = chip_arrays(chips, np.arange(len(chips)), layout)
    variables = {name: (("chip", *layout.variables[name][0]), values) for name, values in arrays.items()}
    found = xr.Dataset(variables, layout.bands.coords).assign(chips.table())
    return found.assign_attrs(instrument=study.scenario.sensor.description.name, study=study.to_toml())


def study_of(dataset, purpose):
    """Study from which the chips of a dataset were made."""
    if "study" not in dataset.attrs or "chip" not in dataset.coords:
        raise ValueError(
            f"{purpose} needs the study of the chips: give the study, or chips as fifesim.dataset makes them"
        )
    return parse_study(dataset.attrs["study"])


def _scenarios(dataset, purpose):
    """Iterate over the scenarios of the chips of a dataset."""
    numbers = dataset["chip"].values
    chips = chips_of(study_of(dataset, purpose), int(numbers.max()) + 1)
    return (chips.scenario(int(number)) for number in numbers)


def with_uniform_ground(dataset, seed):
    """Dataset of uniform ground with the true properties, and errors as large as the effects of the chain."""
    found, rest = dataset.copy(deep=True), np.empty(dataset["toa_reflectance"].shape)
    for at, scenario in enumerate(_scenarios(dataset, "pixels='uniform'")):
        if scenario.landscape.cover != "none":
            raise ValueError("pixels='uniform' needs a study of one stand: leave out landscape.cover, or use 'chain'")
        ground = {name: dataset[name].values[at].astype(float) for name in ("lai", *VARYING) if name in dataset}
        found["toa_reflectance"][at] = uniform_reflectance(scenario, ground)
        rest[at] = dataset["toa_reflectance"].values[at] - found["toa_reflectance"].values[at]
    # Blur, registration, variation within pixels and noise.
    rest = np.moveaxis(rest, 1, -1).reshape(-1, rest.shape[1])
    covariance = np.atleast_2d(np.cov(rest[np.isfinite(rest).all(1)].T))
    zero, shape = np.zeros(len(covariance)), dataset["lai"].shape
    error = np.random.default_rng(seed).multivariate_normal(zero, covariance, shape)
    found["toa_reflectance"] += np.moveaxis(error, -1, 1)
    return found


# Standard deviation of the aerosol optical depth by which an image is corrected: constant, and share of the depth, the
# expected error over land in Levy et al. (2010). [1]
_AOT_ERROR = 0.05, 0.15


def with_surface_reflectance(dataset, seed):
    """Dataset with reflectance corrected by an aerosol optical depth that has an error."""
    random, light = np.random.default_rng(seed), dataset["toa_reflectance"].copy(deep=True)
    for at, scenario in enumerate(_scenarios(dataset, "level='surface'")):
        setup = setup_of(scenario)
        true = setup.atmosphere.aot
        error = random.normal(0, _AOT_ERROR[0] + _AOT_ERROR[1] * true) if true else 0.0
        air = replace(setup.atmosphere, visibility=None, aot=min(max(true + error, 0.0), 2.0))
        light[at] = Driver(replace(setup, atmosphere=air, coupling="lambert")).corrected(light.values[at].astype(float))
    return dataset.assign(surface_reflectance=light)


def with_states(dataset):
    """Dataset with the unknowns of optimal estimation that vary between chips or pixels, and their names."""
    like, found = dataset["lai"], {}
    for name, path in DRAWN_STATES.items():
        column = ".".join(path)
        if name in VARYING and name in dataset:
            found[name] = dataset[name]
        elif name == "log_aot" and "atmosphere.visibility" in dataset:
            depths = [aerosol_optical_thickness(float(each)) for each in dataset["atmosphere.visibility"].values]
            found[name] = np.log(depths)
        elif column in dataset:
            values = dataset[column].values
            # The logarithm needs some aerosol.
            found[name] = np.log(np.maximum(values, 0.005)) if name == "log_aot" else values
    varying = {name: values for name, values in found.items() if np.ptp(np.asarray(values)) > 0}
    states = {
        f"state_{name}": values
        if isinstance(values, xr.DataArray)
        else xr.DataArray(values, dims="chip").broadcast_like(like)
        for name, values in varying.items()
    }
    return dataset.assign(states | {"state_lai": like}), ("lai", *varying)


def pixels_of(dataset, variable, bands, names, part, seed):
    """Valid pixels of one part of a dataset, a random choice of them if there are many."""
    own = dataset.isel(chip=np.flatnonzero(dataset["split"].values == part)).sel(band=list(bands))
    light = np.asarray(own[variable].transpose("chip", "y", "x", "band").values, float)
    chips, rows, columns, width = light.shape
    truth = np.stack([np.asarray(own[name].transpose("chip", "y", "x").values, float) for name in names], axis=-1)
    angles = methods.angles_of(*(own[name].values for name in ("sza", "saa", "vza", "vaa")))
    chip = np.repeat(np.arange(chips), rows * columns)
    spectra, true = light.reshape(-1, width), truth.reshape(-1, len(names))
    valid = np.flatnonzero(np.isfinite(spectra).all(1) & np.isfinite(true).all(1))
    if not valid.size:
        raise ValueError(f"no pixel of the part {part} has both reflectance and truth")
    chosen = np.sort(np.random.default_rng(seed).permutation(valid)[: _PIXELS if part == "train" else _UNSEEN])
    whole = chip[chosen]
    return methods.TrainingPixels(spectra[chosen], angles[whole], true[chosen], whole, own["landscape"].values[whole])
