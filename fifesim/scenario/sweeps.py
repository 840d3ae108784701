"""Parameter sweeps: regressions over ranges of scenario keys, in one lazy Dataset."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Annotated, Any

import dask
import dask.array as da
import numpy as np
import xarray as xr

from fifesim.analysis.regression_labels import check_pair, regress
from fifesim.base.arguments import PLAIN, Array, Pairing, described
from fifesim.scenario.ensemble import realise
from fifesim.scenario.scenario import Scenario, find_key, in_text
from fifesim.scenario.simulation import simulate, warn_of_scenario_pixels
from fifesim.sensor.pixel_labels import warned_of_pixels

# Statistics of the regression of the truth on NDVI.
STATISTICS = ("slope", "intercept", "r2", "residual_deviation", "n")
VARIABLES = ("lai", "fpar")


def sweep(
    scenario: Scenario,
    axes: Annotated[Mapping[str, Sequence[Any] | Array], PLAIN],
    measures: Mapping[str, Callable[[xr.DataTree], float]] | None = None,
    *,
    pair: Pairing = "coordinates",
) -> xr.Dataset:
    """
    Simulate a scenario for all combinations of parameter values.

    All combinations use the seeds of the scenario, and therefore the same random numbers.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    axes : mapping
        Values by key, such as ``{"arp": [0.05, 0.15], "visibility": [10, 45]}``. Add the section if the key occurs in
        several, as in ``"ground.seed"`` or ``"classes.grass.brown"``. Alternatively, an arbitrary name with a tuple of
        values and a function of (Scenario, value) that returns a Scenario. In the coordinate, list values such as
        ``offset`` are text: "0.2, 0.0".
    measures : mapping of str to callable, optional
        Functions that compute a number from a run, an `xarray.DataTree` with ``image`` and ``truth`` in memory. By
        default the regressions of true LAI and FPAR on NDVI.
    pair : {"coordinates", "index"}, optional
        As in `regress`, for the default measures.

    Returns
    -------
    results : xarray.Dataset
        Lazy, one task per combination. The dimensions are the axes. The default measures are slope, intercept, r2,
        residual_deviation and n, with an additional dimension ``variable`` (lai, fpar).

    Raises
    ------
    ValueError
        If an axis has no values or is not a key.
    TypeError
        If `axes` is not a mapping.

    Warns
    -----
    UserWarning
        If pixels are smaller than 0.8 or larger than 1.25 of the instrument's own, because its blur stays: the effect
        of their size on R2 is mixed with an artefact.

    Examples
    --------
    >>> from fifesim import Scenario
    >>> from fifesim.scenario import sweep
    >>> fit = sweep(Scenario(), {"arp": [0.05, 0.15, 0.24], "visibility": [10.0, 45.0]})
    >>> dict(fit.r2.sizes)
    {'arp': 3, 'visibility': 2, 'variable': 2}
    """
    if not isinstance(axes, Mapping):
        raise TypeError(f"axes must map keys to values, such as {{'visibility': [5, 45]}}, got {described(axes)}")
    if not axes:
        raise ValueError("a sweep needs at least one axis, such as {'arp': [0.05, 0.15, 0.24]}")
    check_pair(pair)
    steps = {name: _axis(name, given) for name, given in axes.items()}
    names = STATISTICS if measures is None else tuple(measures)
    shape = (len(names),) + ((len(VARIABLES),) if measures is None else ())
    points, scenarios = [], []
    for values in product(*(values for values, _, _ in steps.values())):
        one = scenario
        for value, (_, change, _) in zip(values, steps.values(), strict=True):
            one = change(one, value)
        one.complete()
        scenarios.append(one)
        points.append(da.from_delayed(dask.delayed(_point)(one, measures, pair), shape=shape, dtype=float))
    warn_of_scenario_pixels(*scenarios)
    sizes = tuple(len(values) for values, _, _ in steps.values())
    # Statistics first, then the axes.
    found = da.stack(points, axis=1).reshape(shape[0], *sizes, *shape[1:])
    dims = (*steps, *(("variable",) if measures is None else ()))
    coordinates = {name: (name, _labels(values), attributes) for name, (values, _, attributes) in steps.items()}
    if measures is None:
        coordinates["variable"] = list(VARIABLES)
    return xr.Dataset({name: (dims, found[k]) for k, name in enumerate(names)}, coords=coordinates)


def _point(scenario, measures, pair):
    """Results of one scenario, computed in the calling thread, because scenarios run in parallel."""
    if measures is not None:
        with warned_of_pixels():
            run = simulate(scenario)
        kept = xr.DataTree.from_dict({name: run[name].to_dataset() for name in ("image", "truth")})
        # A user-defined measure may need any part of the run.
        kept = kept.map_over_datasets(lambda node: node.compute(scheduler="synchronous"))
        return np.array([float(measure(kept)) for measure in measures.values()])
    kept = realise(scenario)
    fits = [regress(kept["truth"][name], kept["image"]["ndvi"], pair=pair) for name in VARIABLES]
    return np.array([[getattr(fit, name) for fit in fits] for name in STATISTICS], float)


def _axis(name, given):
    """Values of an axis, the function that sets a value in a scenario, and attributes for plots."""
    has_function = isinstance(given, tuple) and len(given) == 2 and callable(given[1])
    values = given[0] if has_function else given
    if isinstance(values, str) or not np.iterable(values) or not len(list(values)):
        raise ValueError(f"the axis {name!r} needs a list of values, got {values!r}: write [value] for a single value")
    if has_function:
        return list(values), given[1], {}
    key = find_key(name)
    return list(values), lambda scenario, value: scenario.replace(**{key.name: value}), key.attributes


def _labels(values):
    """Values as a coordinate: text for lists."""
    if all(np.ndim(value) == 0 for value in values):
        return values
    return [in_text(np.atleast_1d(value)) for value in values]
