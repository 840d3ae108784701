"""Bias and variance of the error of a quantity that is computed from retrieved leaf area, by stage."""

from collections.abc import Callable
from functools import partial
from inspect import Parameter, signature
from itertools import product
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import xarray as xr

from fifesim.analysis.scaling import shapley
from fifesim.base.arguments import Kind
from fifesim.chain.absorbed_light import fpar as absorbed_fraction
from fifesim.chain.driver import cell_block_means
from fifesim.experiments.scatter.stages import (
    IDEAL_PROPERTIES,
    STAGES,
    images_of_all,
    means_of,
    scene_of,
    setup_over,
    switches_of,
    working_stages,
)
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.grids.sites import on_fife_site
from fifesim.ground.canopy.description import is_raster
from fifesim.models import labels as models
from fifesim.models.weather import weather_over
from fifesim.retrieval.description import Retrieval
from fifesim.scenario.ground import drawn_properties, spectral_canopy
from fifesim.scenario.scenario import is_on_site

QuantityOrFunction: TypeAlias = Annotated[
    str | Callable[..., Any],
    Kind("a name such as 'gpp', or a function of LAI", lambda value: isinstance(value, str) or callable(value)),
]

ERROR_STAGES = STAGES | {
    "non-linearity": "reflectance is linear in LAI, along the tangent at the mean LAI of the pixel",
    "retrieval": "leaf area of the pixel's footprint is known",
    "scaling": "the model at the mean leaf area of the pixel is the truth, instead of its mean over the cells",
}
"""Stages of the error of a quantity, with their ideal states."""


class Target(NamedTuple):
    """Quantity whose error is attributed: a model of `models.labels`, a function, or LAI or FPAR itself."""

    name: str
    quantity: str
    """Key of `cf.QUANTITIES`, empty for a function."""
    model: Any
    weather: Any
    takes_fpar: bool

    @property
    def units(self):
        """Unit of the quantity, empty for a function."""
        return cf.QUANTITIES[self.quantity].units if self.quantity else ""


def target_of(quantity, scenario, weather=None):
    """Target of a name or function, with the weather over a scenario."""
    if callable(quantity):
        name = getattr(quantity, "__name__", type(quantity).__name__)
        return Target(name, "", quantity, weather, _arguments(quantity, name) == 2)
    if quantity in ("lai", "fpar"):
        return Target(quantity, quantity, None, weather, quantity == "fpar")
    known = {kind: next(iter(each)) for kind, each in models.LAND_MODELS.items()}
    for kind, each in models.LAND_MODELS.items():
        name = known.get(quantity, quantity)
        if name in each and quantity in (kind, name):
            weather = weather_over("the scene", weather, is_on_site(scenario))
            varying = [field for field in each[name].weather if is_raster(getattr(weather, field))]
            if varying:
                raise ValueError(f"the quantity needs weather of numbers, got a raster of {', '.join(varying)}")
            return Target(name, kind, each[name], weather, not each[name].of_green_leaves)
    names = ["lai", "fpar", *models.LAND_MODELS, *(name for each in models.LAND_MODELS.values() for name in each)]
    raise ValueError(f"quantity must be a function of LAI, or one of {', '.join(names)}, got {quantity!r}")


def _arguments(function, name):
    """Number of arguments that a function needs: LAI, or LAI and FPAR."""
    kinds = Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD
    try:
        needed = [each for each in signature(function).parameters.values() if each.kind in kinds]
    except ValueError:
        return 1
    count = len([each for each in needed if each.default is Parameter.empty]) or len(needed[:1])
    if count not in (1, 2):
        raise ValueError(f"{name} must take LAI, or LAI and FPAR, it needs {count} arguments")
    return count


def fixed_stages(retrieval):
    """Stages that cannot be ideal, with the reasons."""
    if not isinstance(retrieval, Retrieval):
        return {}
    found = {"NDVI scaling": "the retrieval takes reflectance, not NDVI"}
    if retrieval.level == "toa":
        found["atmosphere"] = "the retrieval was trained at the top of the atmosphere"
    return found


def check_retrieval(retrieval, scenario):
    """Raise ValueError for a retrieval that does not fit the scenario."""
    if not isinstance(retrieval, Retrieval):
        if retrieval != "line":
            raise ValueError(f"retrieval must be 'line' or a fifesim.Retrieval, got {retrieval!r}: see fifesim.train")
        return
    if "lai" not in retrieval.quantities:
        raise ValueError(
            f"the retrieval estimates {', '.join(retrieval.quantities)}, a budget needs lai: train it with "
            "quantities that include 'lai'"
        )
    name = scenario.sensor.description.name
    if retrieval.instrument != name:
        raise ValueError(
            f"the retrieval is for {retrieval.instrument}, the scenario has {name}: use the same instrument"
        )


def error_shares(scenario, target, retrieval="line"):
    """Bias and variance of the error in one realisation by stage, their totals, and mean and variance of the truth."""
    fixed = fixed_stages(retrieval)
    stages = tuple(name for name in working_stages(scenario) if name not in fixed)
    scene = scene_of(scenario, retrieval if isinstance(retrieval, Retrieval) else None)
    switches = switches_of(stages) | {name: (True,) for name in fixed}
    (images,) = images_of_all([scene], [switches])
    lai, truth, footprint = _truths(scene, target, switches)
    arrays = images, lai, truth, footprint
    found = np.logical_and.reduce([np.isfinite(each).reshape(-1, *scene.shape).all(axis=0) for each in arrays])
    if found.sum() < 3:
        raise ValueError(f"{found.sum()} pixels have data in every image, a budget needs 3: simulate a larger scene")
    images, lai, truth, footprint = (each[..., found] for each in arrays)
    retrieved = np.maximum(images if fixed else on_line(images, lai), 0.0)
    canopy, full = mean_canopy(scene), images.shape[:-1]
    estimates = [of_pixels(scene, target, canopy, each) for each in (footprint, retrieved)]
    truths = [of_pixels(scene, target, canopy, lai), truth]
    errors = [[_moments(one - other, full) for other in truths] for one in estimates]
    # Axes of the stages that vary, of the retrieval and of scaling; then bias and variance.
    values = np.moveaxis(np.array(errors), (0, 1, 2), (-3, -2, -1)).squeeze()
    names = (*stages, "retrieval", "scaling")
    shares = np.zeros((2, len(ERROR_STAGES)))
    shares[:, [list(ERROR_STAGES).index(name) for name in names]] = shapley(values, len(names)).T
    shares[:, [list(ERROR_STAGES).index(name) for name in fixed]] = np.nan
    total, active = values[(1,) * len(names)], truth[(-1,) * len(STAGES)]
    numbers = {"total_bias": total[0], "total_variance": total[1]}
    numbers |= {"truth": active.mean(), "truth_variance": active.var()}
    by_stage = dict(zip(("bias", "variance"), (("stage", each) for each in shares), strict=True))
    return xr.Dataset(by_stage | numbers, {"stage": list(ERROR_STAGES)})


def _moments(error, shape):
    """Mean and variance of errors along the last axis, shape (2,) + shape."""
    return np.stack([np.broadcast_to(each, shape) for each in (error.mean(axis=-1), error.var(axis=-1))])


def on_line(ndvi, lai):
    """Leaf area of pixels on its regression line on NDVI, for each set of stages, shape (..., n). [m2 m-2]"""
    middle, mean = ndvi.mean(axis=-1, keepdims=True), lai.mean(axis=-1, keepdims=True)
    spread = ((ndvi - middle) ** 2).sum(axis=-1, keepdims=True)
    # Constant NDVI has no slope.
    slope = ((ndvi - middle) * (lai - mean)).sum(axis=-1, keepdims=True) / np.where(spread > 0, spread, np.inf)
    return mean + slope * (ndvi - middle)


def _truths(scene, target, switches):
    """LAI and quantity of the blocks, and LAI of the footprints, each (15 axes of stages, y, x)."""
    kinds = list(product(*(switches[name] for name in IDEAL_PROPERTIES)))
    grounds = [scene.ground([name for name, on in zip(IDEAL_PROPERTIES, each, strict=True) if on]) for each in kinds]
    size, (rows, columns), valid = grids.cell_size(scene.blocks)[0], scene.shape, scene.setup.min_valid
    layers = [(ground.land["lai"].values, of_cells(scene, target, ground)) for ground in grounds]
    means = [[cell_block_means(each, scene.grid, size, valid)[:rows, :columns] for each in pair] for pair in layers]
    spread, registration = switches["point spread"], switches["registration"]
    seen = [
        [[means_of(scene, pair[:1], blurred, displaced)[0] for displaced in registration] for blurred in spread]
        for pair in layers
    ]
    varying = [len(switches[name]) if name in IDEAL_PROPERTIES else 1 for name in STAGES]
    sensed = [len(switches[name]) if name in ("point spread", "registration") else 1 for name in STAGES]
    lai, truth = (np.reshape([pair[k] for pair in means], (*varying, *scene.shape)) for k in (0, 1))
    # Properties of the ground are the last axes, and the sensor is before them.
    footprint = np.moveaxis(np.array(seen), 0, 2).reshape(
        *(max(pair) for pair in zip(varying, sensed, strict=True)), *scene.shape
    )
    return lai, truth, footprint


def of_cells(scene, target, ground):
    """Quantity in the cells of a ground, shape (y, x)."""
    setup = setup_over(scene, ground)
    canopy = spectral_canopy(scene.scenario, setup.canopy)
    light = {"canopy": canopy, "atmosphere": scene.driver.air, "geometry": setup.geometry}
    lai = ground.land["lai"].values
    if target.quantity in models.LAND_MODELS:
        if target.name == "farquhar":
            light["pathway"] = _pathway(scene)
        verb = getattr(models, target.quantity)
        return verb(ground.land, target.weather, model=target.name, **light).values
    fpar = None
    if target.takes_fpar:
        fpar = absorbed_fraction(ground.land, method="energy", leaves="green", **light).values
    return _evaluated(target, lai, fpar)


def _pathway(scene):
    """Photosynthesis of the leaves: C4 of the tallgrass on the FIFE site."""
    return "C4" if on_fife_site(scene.grid) else "C3"


def of_pixels(scene, target, canopy, lai):
    """Quantity in pixels with the mean canopy of the scene, shape of the leaf area."""
    fpar, flat = None, np.ascontiguousarray(lai).reshape(-1)
    if target.quantity in models.LAND_MODELS:
        suns = models.suns_over(scene.grid, scene.setup.geometry, scene.driver.air)
        green = flat * (1 - canopy.brown) if target.model.of_green_leaves else flat
        absorbed = partial(scene.driver.absorbed, canopy=canopy, suns=suns.sza) if target.takes_fpar else None
        model = models.of_pathway(target.model, _pathway(scene))
        return models.kernel_of_leaf_area(model, target.weather, suns, absorbed)(green).reshape(lai.shape)
    if target.takes_fpar:
        fpar = scene.driver.absorbed(flat, canopy)[0]
    return _evaluated(target, flat, fpar).reshape(lai.shape)


def _evaluated(target, lai, fpar):
    """LAI, FPAR or the result of a function of them, checked."""
    if target.model is None:
        return lai if target.name == "lai" else fpar
    given = [lai, fpar] if target.takes_fpar else [lai]
    made = np.asarray(target.model(*given), float)
    known = np.isfinite(lai)
    if made.shape != lai.shape:
        raise ValueError(
            f"{target.name} returns shape {made.shape} for leaf area of shape {lai.shape}: return one number per cell"
        )
    if not np.isfinite(made[known]).all():
        raise ValueError(f"{target.name} returns {made[known][~np.isfinite(made[known])][0]} for leaf area of "
                         f"{lai[known][~np.isfinite(made[known])][0]:g}: it must be finite")  # fmt: skip
    if (made[known] < 0).any():
        raise ValueError(f"{target.name} returns {np.nanmin(made):g}: it must not be negative")
    return made


def mean_canopy(scene):
    """Canopy of a pixel whose properties other than leaf area are unknown: means, and the leaves of the first class."""
    scenario, canopy = scene.scenario, spectral_canopy(scene.scenario, scene.setup.canopy)
    if scenario.landscape.cover != "none":
        canopy = next(iter(scenario.class_table().values())).canopy.over(canopy)
    return canopy.replace(**{name: each.mean for name, each in drawn_properties(scenario).items()})
