"""Sensitivity of a quantity to the parameters of a study."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fifesim.analysis.scaling import sobol_indices, sobol_points
from fifesim.experiments.scatter.errors import QuantityOrFunction, of_cells, target_of
from fifesim.experiments.scatter.stages import IDEAL_PROPERTIES, scene_of
from fifesim.models.weather import Weather
from fifesim.output.progress import steps
from fifesim.scenario.distributions import points
from fifesim.scenario.studies import Study

# Stream of random numbers of the points; chips and landscapes use lower numbers.
_STREAM = 40


def sensitivity(
    study: Study,
    quantity: QuantityOrFunction = "gpp",
    *,
    n: int = 256,
    weather: Weather | None = None,
    each: Callable[[Sequence[Any]], Iterable[Any]] | None = None,
) -> xr.Dataset:
    """
    Sobol indices of a quantity: shares of its variance by drawn parameter of a study.

    Parameters
    ----------
    study : Study
        Scenario and distributions of its parameters. All points have the seeds of the scenario.
    quantity : str or callable, optional
        Mean over the cells of the scenario of "gpp", "evapotranspiration", one of their models, "lai" or "fpar"; or a
        function of a scenario that returns a number.
    n : int, optional
        Number of points; k parameters take n (k + 2) evaluations. A power of 2 is best.
    weather : Weather, optional
        Numbers for the models; by default `fife_weather`, which is assumed, with a warning outside the FIFE site.
    each : callable, optional
        Wrapper of the sequence of points to show progress; by default a bar on a terminal or in a notebook.

    Returns
    -------
    indices : xarray.Dataset, dims (parameter)
        ``first``, the share of the variance by a parameter alone, ``total``, including its interactions, and their
        standard errors ``first_error`` and ``total_error``. [1] The attributes ``mean`` and ``variance`` are of the
        quantity.

    Raises
    ------
    ValueError
        If nothing is drawn, n is below 2, or the quantity is constant or not a number.

    References
    ----------
    [Saltelli2010]_

    See Also
    --------
    fifesim.budget, fifesim.Study

    Examples
    --------
    >>> import fifesim
    >>> chip = fifesim.Scenario(base="paper", grid={"width": 90, "height": 90}, terrain={"dem": "flat"})
    >>> study = fifesim.Study(chip, {"brown": {"uniform": [0, 0.5]}, "soil": {"uniform": [-0.05, 0.05]}})
    >>> indices = fifesim.experiments.sensitivity(study, lambda each: each.ground.brown + each.ground.soil, n=32)
    >>> indices.total.round(1).values.tolist()
    [1.0, 0.0]
    """
    if n < 2:
        raise ValueError(f"n must be at least 2, got {n}: take a power of 2 such as 256")
    distributions = study.drawn  # type: ignore[attr-defined]
    keys = list(distributions)
    if not keys:
        raise ValueError("the study draws no parameter: give draws={'brown': {'uniform': [0, 0.5]}} or others")
    sets = sobol_points(points(study.sequence, study.seed, _STREAM, n, 2 * len(keys)))
    shares = sets.reshape(-1, len(keys))
    drawn = [one.quantile(column) for one, column in zip(distributions.values(), shares.T, strict=True)]
    measure = quantity if callable(quantity) else _mean_of(target_of(quantity, study.scenario, weather))
    numbers = range(len(shares))
    shown = steps(numbers, "point by point") if each is None else each(numbers)
    found = []
    for number in shown:
        path = {key.path: column[number] for key, column in zip(keys, drawn, strict=True)}
        found.append(_number(measure(study.scenario_with(path)), quantity))
    values = np.reshape(found, sets.shape[:2])
    indices = sobol_indices(values)._asdict()
    made = xr.Dataset(
        {name: ("parameter", index, {"units": "1"}) for name, index in indices.items()},
        {"parameter": [key.name for key in keys]},
    )
    return made.assign_attrs(mean=float(values[:2].mean()), variance=float(values[:2].var()), n=n)


def _mean_of(target):
    """Function of a scenario: the mean of a quantity over its cells."""

    def mean(scenario):
        scene = scene_of(scenario.complete())
        return np.nanmean(of_cells(scene, target, scene.ground(IDEAL_PROPERTIES)))

    return mean


def _number(value, quantity):
    """Result of a quantity as a number."""
    try:
        return float(value)
    except (TypeError, ValueError):
        name = getattr(quantity, "__name__", str(quantity))
        raise ValueError(f"{name} must return a number for a scenario, it returns {type(value).__name__}") from None
