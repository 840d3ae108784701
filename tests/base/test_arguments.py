"""Invalid arguments of every public function give one line that names the argument, and no raw library error."""

from __future__ import annotations

import inspect
import pickle
import shutil
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, Literal, get_type_hints

import numpy as np
import pytest
import xarray as xr
from odc.geo.geobox import GeoBox

import fifesim
from fifesim.accessor import PUBLIC, find
from fifesim.base import arguments as kinds
from fifesim.base.arguments import (
    NUMBER,
    FilePath,
    Kind,
    Metres,
    Names,
    Range,
    check_fields,
    checked,
    kind_of,
)
from fifesim.grids import grid as grids
from fifesim.ground.canopy.description import LEAF
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.sensor.description.instrument_file import InstrumentLike

PACKAGE = str(Path(fifesim.__file__).parent)

# Public functions with arguments, except classes of results, whose fields users do not type.
CHECKED = [
    name
    for name in sorted(set(PUBLIC) - {"Instrument", "Landscape", "Regression", "Retrieval"})
    if inspect.signature(find(name)).parameters
]

# Accepted values that look wrong, by function and argument. In addition, the first argument of a function may be a
# raster elsewhere ("crs").
ARRAYS = {"numpy", "list", "empty", "1-d", "crs"}
# Pairs such as (down, across), (bottom, top) and limits, names of three bands, and numbers by band.
LISTS = {
    "grid_at": ["cell"], "read_aerosol": ["layer"], "sense": ["interval", "offset", "gain_drift"], "rgb": ["stretch"],
    "plot": ["composite", "limits", "stretch"], "plot_comparison": ["limits"], "topographic_correction": ["c"],
    "cloud_field": ["thickness", "height", "drift"], "overpasses": ["place"], "train": ["levels"], "score": ["by"],
    "retrieve": ["intervals"],
}  # fmt: skip
ACCEPTED = {
    **{(function, name): {"list"} for function, names in LISTS.items() for name in names},
    # Any text is a valid label; None and other types are rejected.
    ("read_responses", "name"): {"str"},
    ("Band", "name"): {"str"}, ("CoverClass", "name"): {"str"}, ("to_geotiff", "path"): {"str"},
    ("dataset", "folder"): {"str"}, ("write_style", "path"): {"str"}, ("train", "path"): {"str"},
    ("learn_landscape", "source"): {"str"},
    # Descriptions without a grid check rasters and spectra when they are used; see the test of canopy fields.
    **{("Canopy", name): {"list", "str", "dataset", "numpy", "1-d", "crs"} for name in PROPERTIES},
    # Setup is a description without a raster; names of bands, instruments and noise are checked by the steps.
    ("Setup", "instrument"): {"str"}, ("Setup", "dem"): {"crs"},
    ("Setup", "clouds"): {"dataset"}, ("Setup", "surroundings"): ARRAYS - {"empty"},
    **{("Setup", name): {"list", "str"} for name in ("bands", "noise", "interval", "offset")},
    **{("Weather", each.name): {"crs"} for each in fields(fifesim.models.Weather)},
    **{("RPV", each.name): ARRAYS for each in fields(fifesim.ground.RPV)},
    **{("RossLi", each.name): ARRAYS for each in fields(fifesim.ground.RossLi)},
    **{("Leaf", each.name): ARRAYS - {"list"} for each in fields(fifesim.Leaf)},
    # A Dataset is processed raster by raster, and a Dataset with sun coordinates is a geometry.
    ("aggregate", "array"): {"dataset", "crs"}, ("to_geotiff", "raster"): {"dataset", "crs"},
    ("brdf_normalise", "to"): {"dataset"},
    **{(name, "geometry"): {"dataset"} for name in CHECKED if name != "Scenario"},
    # Numbers of any shape.
    ("mtf", "frequency"): {"list", "1-d"}, ("cloud_field", "time"): {"list", "1-d"},
    ("snr", "radiance"): ARRAYS, ("noise_equivalent_radiance", "radiance"): ARRAYS,
    **{("sun_position", name): {"list", "1-d"} for name in ("latitude", "longitude", "altitude")},
    # Statistics need no coordinates; chunks of a raster elsewhere are valid chunks; None where it has a meaning.
    ("density", "array"): {"1-d", "crs"}, ("share_kept", "pixels"): {"1-d", "crs"}, ("share_kept", "cells"): {"crs"},
    ("horizon", "beside"): {"crs"}, ("scale_bias", "array"): {"crs"}, ("landscape", "dem"): {"crs"},
    ("score", "truth"): {"crs"}, ("calibrate", "saturated"): {"none"}, ("simulate", "chunks"): {"none"},
}  # fmt: skip


def default_arguments(name):
    """Optional arguments of a public function and their default values."""
    parameters = inspect.signature(find(name)).parameters
    return {key: each.default for key, each in parameters.items() if each.default is not each.empty}


def message_faults(error, argument, kind):
    """Faults of an error message: too long, does not name the argument, or raised by a library."""
    text, last = str(error), traceback.extract_tb(error.__traceback__)[-1].filename
    short = len(text) <= 500 and text.count("\n") <= 2
    good = short and names_argument(text, argument, kind) and last.startswith(PACKAGE)
    return [] if good else [f"{argument} = {kind}: {text[:150]} ({last})"]


def required_arguments(name):
    return set(inspect.signature(find(name)).parameters) - set(default_arguments(name))


def reflectance_spectra(grid):
    """Reflectance spectra of the cells of a grid."""
    wavelength = np.linspace(0.4, 2.4, 201)
    values = np.broadcast_to(np.linspace(0.05, 0.4, 201)[:, None, None], (201, *grid.shape)).copy()
    cells = grids.place(xr.DataArray(values, dims=("wavelength", "y", "x"), name="surface_reflectance"), grid)
    return cells.assign_coords(wavelength=wavelength)


def make_raster(values, grid, name):
    raster = grids.place(xr.DataArray(values, dims=("band", "y", "x")[-values.ndim :], name=name), grid)
    return raster.assign_coords(sza=30.0, saa=120.0, vza=0.0, vaa=0.0, earth_sun_distance=1.0)


@pytest.fixture(scope="module")
def valid_calls(tmp_path_factory):
    """Arguments with which each public function works, as far as possible on a raster of twelve by twelve cells."""
    folder = tmp_path_factory.mktemp("arguments")
    rng, grid = np.random.default_rng(1), fifesim.fife_site(10.0, window=((90, 102), (180, 192)))
    lai = make_raster(rng.uniform(0.5, 4, grid.shape), grid, "lai")
    dem = make_raster(300 + rng.uniform(0, 4, grid.shape), grid, "dem")
    rho = make_raster(rng.uniform(0.05, 0.4, (2, *grid.shape)), grid, "rho").assign_coords(
        band=["TM3", "TM4"], wavelength=("band", [0.66, 0.83])
    )
    rho.attrs["instrument"] = "TM"
    image = fifesim.sense(rho, "TM", min_valid=0.1, interval=20.0)
    ndvi = fifesim.ndvi(rho)
    horizon = fifesim.horizon(dem, directions=16, reach=50.0)
    file = fifesim.to_geotiff(lai, folder / "lai.tif")
    fit = fifesim.regress(lai, ndvi)
    estimate = xr.Dataset({"lai": lai, "low": lai - 0.5, "high": lai + 0.5}, {"level": 0.9})
    tiny = fifesim.Scenario(grid={"width": 60, "height": 60}, terrain={"dem": "flat"}, sensor={"response": "paper"})
    study = fifesim.Study(tiny, {"visibility": {"uniform": [10, 60]}}, landscapes=1, split={"train": 1.0})
    counts = image.drop_vars(["gain", "offset"])
    of_classes = make_raster(np.ones(grid.shape, np.uint8), grid, "cover")
    style = shutil.copy(file, folder / "style.tif")
    images = fifesim.compare(lai, ["TM"], fifesim.Setup(interval=20.0, min_valid=0.1))
    wide = fifesim.fife_site(250.0, window=((20, 26), (20, 26)))
    radiance = make_raster(np.full((1, *wide.shape), 80.0), wide, "toa_radiance").assign_coords(band=["MODIS1"])
    radiance.attrs |= {"instrument": "MODIS", "units": "W m-2 sr-1 um-1"}
    swath = fifesim.sense_swath(radiance, "MODIS", min_valid=0.1)
    coarse = fifesim.fife_site(1100.0, window=((0, 12), (0, 12)))
    avhrr = make_raster(np.full((1, *coarse.shape), 0.2), coarse, "toa_reflectance").assign_coords(band=["AVHRR1"])
    samples = fifesim.sense_swath(avhrr, "AVHRR", min_valid=0.1, quantise=False)
    many = fifesim.Study(tiny, {"visibility": {"uniform": [10, 60]}}, landscapes=3)
    chips = fifesim.dataset(many, folder / "training.zarr", 3)
    with pytest.warns(UserWarning, match=r"few landscapes \(train 1, validation 1, test 1\)"):
        retrieval = fifesim.train(chips, "line", path=folder / "line.nc")
    designs = {"pixel": [30.0], "registration": [0.0]}
    responses = folder / "responses.csv"
    responses.write_text("wavelength,red\n0.6,0\n0.65,1\n0.7,0\n", encoding="utf-8")
    # Arguments shared by name; below, the others by function.
    shared = {
        "grid": grid, "lai": lai, "dem": dem, "reflectance": rho, "toa": rho, "image": image, "ndvi": ndvi,
        "array": lai, "raster": lai, "path_or_raster": file, "scenario": tiny, "study": study, "fit": fit,
        "estimate": lai, "truth": lai, "pixels": lai, "cells": lai, "images": images, "instrument": "TM",
        "band": "MSI4", "latitude": 39.0, "longitude": -96.0, "source": "burned-grazed", "radiance": 10.0,
        "arps": {"lai": 0.1}, "arp": 0.1, "length": 3.0, "pattern": "pastures", "size": 50.0, "heading": 190.0,
        "spectra": reflectance_spectra(grid), "canopies": {"lai": [1.0, 2.0]}, "fractions": {"soil_dry": 1.0},
        "crs": "EPSG:26914", "west": 7e5, "north": 4.3e6, "width": 100.0, "height": 100.0, "cell": 10.0,
        "sza": 30.0, "saa": 120.0, "time": "1987-06-06T16:35Z", "green_up": 120.0, "senescence": 260.0,
        "start": "1987-06-01T00:00Z", "end": "1987-06-20T00:00Z", "place": (39.1, -96.5), "target": "OLI",
        "clouds": fifesim.cloud_field(grid, 0.3, length=100.0, margin=1500.0), "scene": lai, "dn": counts,
        "rho0": 0.1, "k": 0.9, "theta": -0.1, "rhoc": 0.1, "iso": 0.3, "vol": 0.15, "geo": 0.03,
        "surface": fifesim.ground.RossLi(0.3, 0.15, 0.03), "axes": {"visibility": [20.0, 40.0]}, "draws": study.draws,
        "aerosol": "continental", "instruments": ["TM"], "swath": samples, "name": "TM", "thermal": 1.0, "shot": 0.1,
        "y": lai, "x": ndvi, "variable": lai, "reach": 30.0, "algorithm": np.sqrt, "extinction": 0.5, "n": 1,
        "scores": fifesim.score(estimate, lai), "retrieval": retrieval, "margin": 0.0,
        "wavelength": (0.6, 0.65, 0.7), "response": (0.0, 1.0, 0.0),
    }  # fmt: skip
    on_hills = {"dem": dem, "horizon": horizon}
    leafy = fifesim.lai_scene(fifesim.fife_site(10.0, window=((90, 150), (180, 240))), seed=1)
    given = {
        "Field": {"mean": 1.0, "sd": 0.1, "arp": 0.1},
        "CoverClass": {"name": "grass", "lai": 2.0, "arp": 0.1, "canopy": fifesim.Canopy(), "code": 3},
        "landscape": {"dem": dem, "cover": of_classes, "classes": [fifesim.CoverClass("grass", 1.2, code=1)]},
        "downscale": {"lai": fifesim.aggregate(lai, 60.0, min_valid=0.1)},
        "canopy_spectra": {"geometry": fifesim.fife_geometry()},
        "adjust_bands": {"instrument": "OLI", "bands": ["OLI4"], "source": "TM"},
        "as_seen_by": {"instrument": "OLI", "bands": ["OLI4"], "source": "TM", "atmosphere": fifesim.Atmosphere(),
                       "onto": grid},
        "spectral_adjustment": {"source": "TM", "bands": ["OLI4"]},
        "composite": {"images": xr.concat([ndvi, ndvi], "time")},
        "grid_swath": {"image": swath, "grid": wide},
        "index": {"image": rho, "name": "ndvi"},
        "rgb": {"image": rho, "composite": ("TM4", "TM3", "TM3")},
        "plot_fit": {"y": lai, "x": ndvi},
        "budget": {"realisations": 1, "cells": 90},
        "trade": {"designs": designs, "scenario": None},
        "read_responses": {"path": responses, "altitude": 5e5, "gsd": 10.0},
        "plot_trade": {"results": fifesim.trade("TM", designs), "cost": xr.DataArray([1.0], dims="pixel")},
        "cloud_field": {"cover": 0.3, "length": 100.0},
        "phenology": {"time": ["1987-06-06"]},
        "sensitivity": {"quantity": "lai", "n": 2},
        "scenario_like": {"image": leafy, "file": folder / "like.json"},
        "dataset": {"folder": folder / "chips.zarr", "n": 1, "overwrite": True},
        "explore": {"path": folder / "page.html", "overwrite": True},
        "reproduce": {"realisations": 1, "cells": 135},
        "read_study": {"path": "study.toml"},
        "read_scenario": {"path": "scenario.toml"},
        "read_instrument": {"path": "tm.toml"},
        "read_retrieval": {"path": folder / "line.nc"},
        "write_style": {"path": style, "overwrite": True},
        "to_geotiff": {"path": folder / "out.tif", "overwrite": True},
        "open_image": {"path": file},
        "open_landsat": {"path": folder / "scene_MTL.txt"},
        "open_sentinel2": {"path": folder / "scene.SAFE"},
        "fife_site": {"cell": 30.0, "window": ((0, 2), (0, 2))},
        "lai_scene": {"arp": 0.1, "seed": 1},
        "Leaf": {"structure": 1.5, "chlorophyll": 30.0, "water": 0.01, "dry_matter": 0.01},
        "surface_reflectance": {"instrument": "TM", "bands": ["TM3", "TM4"]},
        "Weather": {
            each.name: getattr(fifesim.models.fife_weather(), each.name) for each in fields(fifesim.models.Weather)
        },
        "topographic_correction": {"method": "c"},
        **{name: {"path_or_raster": dem, "grid": grid[4:6, 4:6]} for name in ("fine_dem", "source_dem")},
        **{name: {"instrument": "MSI"} for name in ("noise_equivalent_radiance", "snr")},
        "horizon": {"directions": 16, "reach": 50.0},
        **dict.fromkeys(("sky_view", "terrain_view", "illumination", "shadow"), on_hills),
        "kt": {**on_hills, "instrument": "TM"},
        "Atmosphere": {"visibility": 45.0},
        "read_aerosol": {"source": fifesim.atmosphere.aerosol_tables("continental")},
        **{name: {"instrument": "TM", "elevation": dem} for name in ("to_toa", "to_surface")},
        "compare_engines": {"setup": fifesim.Setup(bands=("TM3",)), "reflectance": 0.2, "engines": ("5S",)},
        "sense": {"instrument": "TM", "min_valid": 0.1, "interval": 20.0},
        "sense_swath": {"instrument": "TM", "min_valid": 0.1},
        "compare": {"setup": fifesim.Setup(interval=20.0, min_valid=0.1)},
        "psf": {"band": "TM3"},
        "mtf": {"bands": "TM3"},
        "NoiseModel": {"detectors": 16},
        "train": {"source": chips, "method": "line", "bands": ["TM3", "TM4"], "quantities": ["lai"], "levels": [0.5]},
        "retrieve": {"image": rho.drop_attrs(), "intervals": [0.5]},
        "score": {"estimate": estimate, "truth": lai.isel(y=slice(6), x=slice(6)), "pair": "index"},
        "noise_std": {"instrument": "TM", "noise_models": fifesim.NoiseModel(1.0, 0.1)},
        "density": {"points": 32},
        "learn_landscape": {"image": leafy}, "compare_landscapes": {"one": leafy, "other": leafy},
    }  # fmt: skip
    assert set(given) <= set(CHECKED)
    return {
        name: {key: shared[key] for key in required_arguments(name) & set(shared)}
        | default_arguments(name)
        | given.get(name, {})
        for name in CHECKED
    }


@pytest.fixture(scope="module")
def wrong_values(valid_calls):
    lai = valid_calls["fpar"]["lai"]
    elsewhere = fifesim.grid_at("EPSG:32633", 5e5, 5e6, 120, 120, 10)
    return {
        "numpy": np.ones((12, 12)),
        "list": [1.0, 2.0],
        "none": None,
        "str": "nonsense",
        "dataset": xr.Dataset({"a": lai, "b": lai}),
        "empty": lai.isel(y=slice(0, 0)),
        "1-d": lai.isel(y=0, drop=True),
        "crs": make_raster(lai.values, elsewhere, "elsewhere"),
    }


def names_argument(text, argument, kind):
    """Whether a message names the argument, the unknown name, or the grids that differ."""
    stem = argument.replace("_", " ").rstrip("s")
    others = {"str": ("nonsense",), "crs": ("raster", "grid", "lattice")}.get(kind, ())
    also = {
        "leaf_optics": ("leaf reflectance", "leaf transmittance"),
        "source": ("aerosol",),
        # Classes and quantities are named item by item.
        "classes": ("class 1 must be", "class a must be"),
        "derivatives": ("1.0 is no quantity of canopies and their derivatives",),
        "composite": ("colours",),
        "image": ("colours are of several bands",),
        "scenario": ("study",),
        "spectra": ("lai is leaf area index by its name",),
        "brown_leaf": ("leaf_optics", "leaf transmittance"),
    }.get(argument, ())
    words = argument.lower(), stem.lower(), "there is no file or folder", *others, *also
    return any(word in text.lower() for word in words)


def test_every_public_function_has_a_valid_call(valid_calls):
    assert [
        f"{name}: {missing}" for name in valid_calls if (missing := required_arguments(name) - set(valid_calls[name]))
    ] == []


def accepted_kinds(name, argument, first):
    """Kinds of values that may be accepted although they look wrong."""
    return ACCEPTED.get((name, argument), {"crs"} if first else set())


@pytest.mark.parametrize("name", CHECKED)
def test_wrong_argument_is_named_in_one_line(valid_calls, wrong_values, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function, given, found = find(name), valid_calls[name], []
    for argument in given:
        first = argument == next(iter(inspect.signature(function).parameters))
        for kind, value in wrong_values.items():
            if value is default_arguments(name).get(argument, wrong_values):
                continue
            # Some functions accept a Dataset of bands as a raster.
            if kind == "dataset" and first and "Dataset" in PUBLIC[name].methods_of:
                continue
            # A valid path, whose page takes many simulations.
            if (name, argument, kind) == ("explore", "path", "str"):
                continue
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    function(**(given | {argument: value}))
            except (ValueError, TypeError, FileNotFoundError) as error:
                found += message_faults(error, argument, kind)
            else:
                if kind not in accepted_kinds(name, argument, first):
                    found.append(f"{argument} = {kind} is accepted")
    assert found == []


@pytest.mark.parametrize("field", list(PROPERTIES))
def test_wrong_canopy_field_is_named_in_one_line(valid_calls, wrong_values, field):
    given, found, refused = valid_calls["surface_reflectance"], [], 0
    for kind, value in wrong_values.items():
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                # Dead leaves make the function use their optics.
                dead = {} if field in ("brown", "lai") else {"brown": 0.3}
                fifesim.surface_reflectance(**given | {"canopy": fifesim.Canopy(**dead | {field: value})})
        except (ValueError, TypeError, FileNotFoundError) as error:
            found += message_faults(error, field, kind)
            refused += 1
    assert found == [] and refused >= 5


NOT_REAL = ["bool", "complex64", "datetime64[s]", "timedelta64[s]", "str", "object"]


@pytest.mark.parametrize("name", CHECKED)
def test_rasters_must_hold_real_numbers(valid_calls, name):
    """Masks, dates, text and complex numbers could be converted to floating point and pass for a quantity."""
    function, given = find(name), valid_calls[name]
    for argument, raster in given.items():
        for dtype in NOT_REAL if isinstance(raster, xr.DataArray) else ():
            if (name, dtype) in (("aggregate", "bool"), ("score", "bool")):
                continue
            with pytest.raises(TypeError, match=f"^{argument} must hold real numbers, got .*: it holds "):
                function(**(given | {argument: raster.astype(dtype)}))


def test_rasters_within_an_argument_must_hold_real_numbers(valid_calls):
    given = valid_calls["surface_reflectance"]
    lai, rho = given["lai"], valid_calls["to_toa"]["reflectance"]
    mask = lai > 1
    within = {
        "canopy": fifesim.Canopy(background={"TM3": mask, "TM4": 0.2}),
        "lai": xr.Dataset({"lai": lai, "brown": mask}),
    }
    for argument, value in within.items():
        with pytest.raises(
            TypeError, match=rf"^{argument} must hold real numbers, got bool: it holds a mask, type \.ast"
        ):
            fifesim.surface_reflectance(**(given | {argument: value}))
    fields = {"background": mask, "leaf_optics": {"TM3": (mask, 0.1), "TM4": (0.4, 0.4)}}
    for name, value in (fields | {"brown_leaf": fifesim.Leaf(chlorophyll=mask)}).items():
        with pytest.raises(TypeError, match=r"^canopy must hold real numbers, got bool"):
            fifesim.surface_reflectance(**(given | {"canopy": fifesim.Canopy(**{name: value})}))
    with pytest.raises(TypeError, match=r"^setup must hold real numbers"):
        fifesim.compare(lai, ["TM"], fifesim.Setup(dem=mask))
    for wavelength in (["red", "nir"], np.array(["2001-01-01", "2001-01-02"], "datetime64[s]")):
        for function, of in ((fifesim.sensor.to_bands, {"instrument": "TM"}), (fifesim.ndvi, {})):
            with pytest.raises(TypeError, match=r"^wavelength of \w+ must hold real numbers"):
                function(rho.assign_coords(wavelength=("band", wavelength)), **of)


@pytest.mark.parametrize("name", ["ndvi", "sense", "grid_at"])
def test_checked_function_keeps_its_signature_and_can_be_pickled(name):
    """The name, documentation and signature are kept, and worker processes can load the function."""
    function = find(name)
    bare = inspect.unwrap(function)
    assert bare is not function and function.__doc__ == bare.__doc__
    assert inspect.signature(function) == inspect.signature(bare)
    assert pickle.loads(pickle.dumps(function)) is function


def test_messages_name_the_argument_and_the_remedy(valid_calls):
    lai, rho = valid_calls["fpar"]["lai"], valid_calls["to_toa"]["reflectance"]
    nameless = rho.drop_vars(["band", "wavelength"]).drop_attrs(deep=False)
    typed = {
        "sza of a Geometry is one number, got an array: .*xarray.Dataset": lambda: fifesim.Geometry([30, 40], 100.0),
        "surroundings must be a reflectance.*'lake'": lambda: fifesim.to_toa(rho, surroundings="lake", adjacency=True),
        "band must be a name, got a list of 1": lambda: fifesim.sensor.psf("TM", ["TM3"]),
        "grid must be .*GeoBox.*type raster.odc.geobox": lambda: fifesim.lai_scene(lai),
        "hotspot must be a number, got an xarray.DataArray": lambda: fifesim.fpar(
            lai, canopy=fifesim.Canopy(hotspot=lai)
        ),
        "no instrument and no wavelength": lambda: fifesim.to_toa(nameless),
    }
    for message, call in typed.items():
        with pytest.raises((TypeError, ValueError), match=message) as caught:
            call()
        assert len(str(caught.value)) <= 500


class Sieve:
    """A description that is in no table of the package."""


def sieved(
    raster: xr.DataArray,
    mesh: float,
    sieve: Sieve | None = None,
    *,
    wet: bool = False,
    pixel: Metres = 30.0,
    times: Annotated[int, Kind("a number of shakes")] = 1,
    names: Names = (),
    grid: GeoBox | None = None,
    by: Literal["size", "mass"] = "size",
    weights: Mapping[str, float] | None = None,
    source: FilePath | xr.Dataset = "none",
    sizes: Sequence[float] = (),
    each: Callable[[float], float] | None = None,
) -> str:
    """A public function that is in no table of the package."""
    return "done"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"raster": 5}, "raster must be an xarray.DataArray over (y, x), got 5"),
        ({"raster": "a.tif"}, "raster must be an xarray.DataArray over (y, x), got 'a.tif': open it with"),
        ({"mesh": "2"}, "mesh must be a number, got '2'"),
        ({"mesh": True}, "mesh must be a number, got True"),
        ({"mesh": None}, "mesh must be a number, got None"),
        ({"sieve": 3}, "sieve must be a tests.Sieve, got 3"),
        ({"wet": 1}, "wet must be True or False, got 1"),
        ({"pixel": "30"}, "pixel must be a size in metres, such as 30.0, got '30'"),
        ({"times": "3"}, "times must be a number of shakes, got '3'"),
        ({"names": 5}, "names must be a list of names, got 5"),
        ({"grid": 5}, "grid must be an odc.geo.geobox.GeoBox, such as"),
        ({"by": 5}, "by must be a name, got 5"),
        ({"weights": [1.0]}, "weights must be a mapping of names, got a list of 1"),
        ({"source": 5}, "source must be the path of a file, or an xarray.Dataset, got 5"),
        ({"sizes": 5}, "sizes must be a list, got 5"),
        ({"each": 5}, "each must be a function, got 5"),
        ({"meshes": 5}, "sieved has no argument 'meshes': did you mean 'mesh'?"),
    ],
)
def test_new_function_is_checked_by_its_annotations(lai, given, message):
    message = message.replace("tests.Sieve", f"{__name__.partition('.')[0]}.Sieve")
    with pytest.raises(TypeError) as caught:
        checked(sieved)(**{"raster": lai, "mesh": 2.0, **given})
    assert str(caught.value).startswith(message)


def test_new_function_accepts_values_allowed_by_its_annotations(lai):
    every = {"wet": np.bool_(True), "pixel": 5, "times": 2, "names": ["a"], "grid": lai.odc.geobox, "by": "mass"}
    every |= {"weights": {"a": 1.0}, "source": xr.Dataset(), "sizes": np.ones(2), "each": np.sqrt}
    assert checked(sieved)(lai, 2, Sieve(), **every) == "done"
    # The default value of an argument is always valid.
    assert checked(sieved)(lai, np.float32(2), None, weights=None, each=None) == "done"


def test_fields_of_a_new_description_are_checked_by_their_annotations():
    @dataclass
    class Mesh:
        width: Annotated[float, NUMBER]
        wet: bool = False

        def __post_init__(self):
            check_fields(self)

    assert not Mesh(2.0).wet
    for given, message in (({"width": "2"}, "width must be a number, got '2'"), ({"wet": 1}, "wet must be True or")):
        with pytest.raises(TypeError, match=f"^{message}"):
            Mesh(**{"width": 2.0, **given})


Share = Annotated[float, Range("1", 0, 1, others={"percent": 0.01}, ends="[)")]
Depth = Annotated[float | None, Range("m", 0, np.inf, ends="()"), "depth of the water"]


@dataclass
class Pond:
    """A description with a range of each kind."""

    share: Share = 0.5
    depth: Depth = None

    def __post_init__(self):
        check_fields(self)


def pond(share: Share = 0.5, depth: Depth = None):
    """A public function with the same ranges."""
    return SimpleNamespace(share=share, depth=depth)


@pytest.mark.parametrize("checks", [Pond, checked(pond)])
@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"share": 1}, ValueError, r"share must be in \[0, 1\), got 1: if it is in percent, type share=0.01$"),
        ({"share": xr.DataArray(-1.0)}, ValueError, r"share must be in \[0, 1\), got -1$"),
        ({"share": float("nan")}, ValueError, r"share must be in \[0, 1\), got nan$"),
        ({"depth": 0.0}, ValueError, "depth must be above 0 m, got 0: check its unit$"),
        ({"depth": np.inf}, ValueError, "depth must be above 0 m, got inf"),
        (
            {"share": np.ones(3)},
            TypeError,
            r"share must be a number, got a numpy array \(3,\), where one is for all cells$",
        ),
        ({"depth": "2 m"}, TypeError, "depth must be a number in m, got '2 m': leave the unit out$"),
    ],
)
def test_range_in_an_annotation_is_checked(checks, given, error, message):
    with pytest.raises(error, match=f"^{message}"):
        checks(**given)
    assert checks(share=0, depth=None).share == 0 and checks(share=np.float32(0.5), depth=1e-9).depth > 0


def public_arguments():
    """Public functions with their parameters and annotations."""
    for name in PUBLIC:
        function = inspect.unwrap(find(name))
        if inspect.isfunction(function):
            hints = get_type_hints(function, include_extras=True)
            for parameter in inspect.signature(function).parameters:
                yield name, parameter, hints.get(parameter)


def test_every_public_argument_has_an_annotation_with_a_kind():
    breaches = []
    for name, parameter, annotation in public_arguments():
        try:
            assert annotation is not None, "it has no annotation"
            assert kind_of(annotation).words and callable(kind_of(annotation).fits)
        except (AssertionError, TypeError) as error:
            breaches.append(f"{name}({parameter}): {error}")
    assert breaches == []


def test_annotation_without_a_kind_is_an_error():
    for annotation in (tuple[int, int, str], Annotated[tuple[int, int, str], "metres"]):
        with pytest.raises(TypeError, match="nothing states the kind of tuple"):
            kind_of(annotation)
    assert kind_of(Any).fits(None)


def test_methods_accept_their_container(lai):
    values = {"DataArray": lai, "Dataset": lai.to_dataset(name="lai"), "DataTree": xr.DataTree()}
    first = {}
    for name, _, annotation in public_arguments():
        first.setdefault(name, annotation)
    for name, public in PUBLIC.items():
        if public.methods_of:
            taken = {each for each, value in values.items() if kind_of(first[name]).fits(value)}
            assert taken == set(public.methods_of), name


def test_class_error_names_the_function_that_returns_its_objects(lai):
    with pytest.raises(
        TypeError, match=r"^scenario must be a fifesim\.Scenario, as fifesim\.scenario\.read_scenario gives it, got 5$"
    ):
        fifesim.simulate(5)
    with pytest.raises(TypeError, match=r"^fit must be a fifesim\.Regression, as fifesim\.regress gives it, got 5$"):
        fifesim.output.plot_fit(5)
    with pytest.raises(TypeError, match=r"^setup must be a fifesim\.Setup, got 5$"):
        fifesim.compare(lai, ["TM"], 5)


@pytest.mark.parametrize(
    ("kind", "fits", "others"),
    [
        (kinds.NUMBER, [1, 2.5, np.float32(1), np.array(3.0)], [True, "1", None, [1.0], np.ones(2), np.array("a")]),
        (kinds.NUMBERS, [1, [1.0, 2.0], np.ones((2, 2)), xr.DataArray([1.0])], [None, "1", ["1"], np.array(["a"])]),
        (kinds.PAIR, [30, (30, 15)], [(1, 2, 3), "30", np.ones((2, 2)), ("a", "b")]),
        (kinds.FLAG, [True, np.bool_(False)], [1, 0, None, "no"]),
        (kinds.CHUNKS, [256, "auto", "64MB", {"y": 2}, (2, 2), None], ["many", xr.Dataset(), np.ones(2)]),
        (LEAF, [fifesim.Leaf(), {"TM3": (0.1, 0.1)}, (0.1, 0.1)], [0.1, (0.1,), 5]),
        (kind_of(InstrumentLike), ["TM", fifesim.instrument("TM")], [None, ["TM"], 5]),
    ],
)
def test_kinds_accept_and_reject_values(kind, fits, others):
    assert all(kind.fits(value) for value in fits)
    assert not any(kind.fits(value) for value in others)


def _packed(raster):
    """Raster as a file stores it: whole numbers with a scale, an offset, and a value for no data in one cell."""
    whole = np.round((raster.drop_attrs(deep=False) - 0.5) * 1000).astype("int32")
    whole[{dim: size // 2 for dim, size in whole.sizes.items()}] = -99
    # Values are metres, reflectances or shares: -99 does not occur.
    return whole.assign_attrs(raster.attrs, scale_factor=0.001, add_offset=0.5, _FillValue=-99)


def _outcome(name, arguments):
    try:
        return find(name)(**arguments)
    except (ValueError, TypeError) as error:
        return str(error)


def _same(one, other):
    if isinstance(one, xr.DataArray | xr.Dataset | xr.DataTree):
        return type(one) is type(other) and one.equals(other)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(_same, one, other))
    return repr(one) == repr(other)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_every_public_function_applies_scale_offset_and_fill_value(valid_calls):
    """A packed raster gives the result of its values in every function, or the same error."""
    tried, wrong = 0, []
    # Figures, files and counts have tests of their own.
    for name in sorted(set(CHECKED) - {"plot", "plot_fit", "plot_trade", "to_geotiff", "calibrate", "Setup", "Canopy"}):
        for key, value in valid_calls[name].items():
            if not isinstance(value, xr.DataArray) or value.dtype.kind != "f" or "gain" in value.coords:
                continue
            packed = _packed(value)
            values = packed.drop_attrs(deep=False).astype(float).where(packed != -99) * 0.001 + 0.5
            values = values.assign_attrs(value.attrs)
            found, expected = (_outcome(name, valid_calls[name] | {key: each}) for each in (packed, values))
            tried += 1
            if not _same(found, expected):
                wrong.append(f"{name}({key}): {str(found)[:150]!r} instead of {str(expected)[:150]!r}")
    assert tried >= 60
    assert not wrong, "\n".join(wrong)
