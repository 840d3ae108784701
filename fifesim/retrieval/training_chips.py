"""Chips for training: from a study, as uniform ground, corrected to the surface, and as pixels."""

from dataclasses import replace

import numpy as np
import xarray as xr

from fifesim.atmosphere.aerosols import aerosol_optical_thickness
from fifesim.chain.driver import Driver
from fifesim.output.chips.store import chip_arrays, layout_of
from fifesim.retrieval import methods
from fifesim.retrieval.forward import DRAWN_STATES
from fifesim.scenario.chips import chips_of
from fifesim.scenario.ensemble import uniform_reflectance
from fifesim.scenario.keys import VARYING
from fifesim.scenario.simulation import setup_of
from fifesim.scenario.studies import parse_study

# Training pixels that are used, more do not improve a network of this size, and pixels of the other parts.
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
        light[at] = Driver(replace(setup, atmosphere=air)).corrected(light.values[at].astype(float))
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
    angles = np.stack(
        [own["sza"].values, own["vza"].values, methods.azimuth_difference(own["saa"].values, own["vaa"].values)], axis=1
    )
    # A view at nadir has no azimuth.
    angles[:, 2] = np.where(angles[:, 1] < 0.5, 0.0, angles[:, 2])
    chip = np.repeat(np.arange(chips), rows * columns)
    spectra, true = light.reshape(-1, width), truth.reshape(-1, len(names))
    valid = np.flatnonzero(np.isfinite(spectra).all(1) & np.isfinite(true).all(1))
    if not valid.size:
        raise ValueError(f"no pixel of the part {part} has both reflectance and truth")
    chosen = np.sort(np.random.default_rng(seed).permutation(valid)[: _PIXELS if part == "train" else _UNSEEN])
    whole = chip[chosen]
    return methods.TrainingPixels(spectra[chosen], angles[whole], true[chosen], whole, own["landscape"].values[whole])
