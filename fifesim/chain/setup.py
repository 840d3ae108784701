"""Description of all steps from leaf area to digital numbers."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, fields
from typing import Literal

import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.atmosphere.clouds.labels import Clouds, cast_clouds
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import (
    Coupling,
    Interval,
    Names,
    NoiseKinds,
    Offset,
    Surroundings,
    WholeNumber,
    check_fields,
)
from fifesim.base.files import in_a_line
from fifesim.base.lattice import check_seed
from fifesim.chain import coupled_ground, steps
from fifesim.grids.directions import Directions
from fifesim.grids.inputs import Horizon
from fifesim.ground.canopy.description import TALLGRASS, Canopy
from fifesim.sensor import labels as sensor
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.response.noise import NoiseModels


@dataclass(frozen=True, eq=False)
class Setup:
    """
    Ground, atmosphere and instrument of a simulation.

    Parameters
    ----------
    instrument : str or Instrument, optional
    bands : sequence of str, optional
        Band names; all by default.
    atmosphere : Atmosphere, optional
        By default midlatitude summer, continental aerosol, 45 km visibility.
    geometry : Geometry or xarray.Dataset, optional
        Directions of sun and sensor; by default from the leaf area raster, else as in the paper.
    canopy : Canopy, optional
        As in `fifesim.surface_reflectance`.
    dem, horizon, upwelling, slopes : optional
        As in `fifesim.surface_reflectance`; without a dem the ground is level.
    coupling : {"lambert", "four-stream", "directional"}, optional
        As in `fifesim.to_toa`, for any ground; by default "lambert".
    adjacency, surroundings : optional
        As in `fifesim.to_toa`.
    clouds : xarray.Dataset, optional
        Cloud field, as in `fifesim.atmosphere.cast_clouds`; the same sky for all instruments.
    onto, interval, offset, min_valid : optional
        Position of pixels and minimum valid fraction, as in `fifesim.sense`.
    noise, noise_models, seed, quantise : optional
        As in `fifesim.sense`.

    Examples
    --------
    >>> import fifesim
    >>> haze = fifesim.Atmosphere(visibility=10)
    >>> setup = fifesim.Setup(instrument="OLI", bands=("OLI4", "OLI5"), atmosphere=haze)
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> list(lai.fifesim.compare(["OLI"], setup).children)
    ['OLI']
    """

    instrument: InstrumentLike = "TM"
    bands: Names | None = None
    atmosphere: Atmosphere | None = None
    geometry: Directions | None = None
    canopy: Canopy | None = TALLGRASS
    dem: xr.DataArray | None = None
    horizon: Horizon | None = None
    upwelling: bool = True
    slopes: Literal["kt", "upright"] = "kt"
    coupling: Coupling = "lambert"
    adjacency: bool = False
    surroundings: Surroundings | None = None
    clouds: Clouds | None = None
    onto: GeoBox | None = None
    interval: Interval | None = None
    offset: Offset = (0.0, 0.0)
    min_valid: float = sensor.MIN_VALID
    noise: NoiseKinds = ()
    noise_models: NoiseModels | None = None
    seed: WholeNumber = 0
    quantise: bool = True

    def __post_init__(self):
        check_fields(self)
        check_seed(self.seed)
        if self.canopy is None:
            object.__setattr__(self, "canopy", TALLGRASS)

    def __repr__(self):
        others = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "instrument"}
        changed = [f"{name}={_brief(value)}" for name, value in others.items() if not is_default(self, name)]
        name = getattr(self.instrument, "name", self.instrument)
        return f"Setup({', '.join([f'instrument={name!r}', *changed])})"


def is_default(setup, name):
    """Whether a field has its default value; always False for rasters."""
    value, default = getattr(setup, name), Setup.__dataclass_fields__[name].default
    return value is default or (isinstance(value, (str, int, float, tuple)) and value == default)


def _brief(value):
    """Short text of a value; large values are described by type and size."""
    if isinstance(value, xr.DataArray | xr.Dataset | GeoBox):
        sizes = dict(zip(value.dims, value.shape, strict=True)) if isinstance(value, GeoBox) else dict(value.sizes)
        return f"<{type(value).__name__} of {' x '.join(f'{name} {size}' for name, size in sizes.items())}>"
    return in_a_line(repr(value), 160)


def reflectance_of(setup, lai, coupling="lambert"):
    """Surface reflectance of leaf area in the bands of a setup, or its streams for a coupling, lazy if an input is."""
    given = _arguments(setup, steps.surface_reflectance) | ({"slopes": "kt"} if setup.dem is None else {})
    streams = {"lambert": False, "four-stream": True}.get(coupling, coupling)
    return steps.surface_reflectance(lai, geometry=setup.geometry, streams=streams, **given)


def toa_of(setup, reflectance, lai):
    """Reflectance at the top of the atmosphere, from a surface reflectance and the leaf area or landscape below."""
    clouds = None if setup.clouds is None else cast_clouds(reflectance, setup.clouds, dem=setup.dem)
    own = {name: getattr(setup, name) for name in ("instrument", "adjacency", "surroundings", "coupling")}
    if setup.coupling != "lambert" and (setup.adjacency or not coupled_ground.is_one_pass(reflectance)):
        reflectance = reflectance_of(setup, lai, setup.coupling)
    return steps.to_toa(reflectance, clouds=clouds, **own)


def image_of(setup, reflectance, lai=None):
    """Image of a surface reflectance by the instrument of a setup, with the ground below for a coupling."""
    return sensor.sense(toa_of(setup, reflectance, lai), **_arguments(setup, sensor.sense))


def _arguments(setup, step):
    """Fields of a setup that are arguments of a step, apart from the directions, which rasters carry."""
    names = setup.__dataclass_fields__.keys() - {"geometry"}
    return {name: getattr(setup, name) for name in inspect.signature(step).parameters if name in names}
