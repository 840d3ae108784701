"""Invalid arguments of every public function give one line that names the argument, and no raw library error."""

import inspect
import shutil
import tomllib
import traceback
import warnings
from dataclasses import fields
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.accessor import PUBLIC, find
from fifesim.base import arguments as kinds
from fifesim.base.arguments import kind_of
from fifesim.grids import grid as grids
from fifesim.ground.canopy.description import LEAF
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.sensor.description.instrument_file import InstrumentLike

PACKAGE = str(Path(fifesim.__file__).parent)
TABLE = tomllib.loads((Path(__file__).parents[1] / "data" / "public_arguments.toml").read_text(encoding="utf-8"))

# Public functions with arguments, except classes of results, whose fields users do not type.
CHECKED = [
    name
    for name in sorted(set(PUBLIC) - {"Instrument", "Landscape", "Regression", "Retrieval"})
    if inspect.signature(find(name)).parameters
]


def accepted_kinds(name, argument, first):
    """Kinds of values that may be accepted although they look wrong."""
    matching = (each for pattern, each in TABLE["accepted"].items() if fnmatch(f"{name}.{argument}", pattern))
    return next(matching, ["crs"] if first else [])


def default_arguments(name):
    """Optional arguments of a public function and their default values."""
    parameters = inspect.signature(find(name)).parameters
    return {key: each.default for key, each in parameters.items() if each.default is not each.empty}


def required_arguments(name):
    return set(inspect.signature(find(name)).parameters) - set(default_arguments(name))


def reflectance_spectra(grid):
    """Reflectance spectra of the cells of a grid."""
    wavelength = np.linspace(0.4, 2.4, 201)
    values = np.linspace(0.05, 0.4, 201)[:, None, None] * np.ones(grid.shape)
    cells = grids.place(xr.DataArray(values, dims=("wavelength", "y", "x"), name="surface_reflectance"), grid)
    return cells.assign_coords(wavelength=wavelength)


def make_raster(values, grid, name, **attrs):
    raster = xr.DataArray(values, dims=("band", "y", "x")[-values.ndim :], name=name, attrs=attrs)
    raster = grids.place(raster, grid)
    return raster.assign_coords(sza=30.0, saa=120.0, vza=0.0, vaa=0.0, earth_sun_distance=1.0)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Objects for the table of arguments, as far as possible of twelve by twelve cells."""
    folder = tmp_path_factory.mktemp("arguments")
    rng, grid = np.random.default_rng(1), fifesim.fife_site(10.0, window=((90, 102), (180, 192)))
    lai = make_raster(rng.uniform(0.5, 4, grid.shape), grid, "lai")
    dem = make_raster(300 + rng.uniform(0, 4, grid.shape), grid, "dem")
    rho = make_raster(rng.uniform(0.05, 0.4, (2, *grid.shape)), grid, "rho", instrument="TM")
    rho = rho.assign_coords(band=["TM3", "TM4"], wavelength=("band", [0.66, 0.83]))
    ndvi = fifesim.ndvi(rho)
    image = fifesim.sense(rho, "TM", min_valid=0.1, interval=20.0)
    file = fifesim.to_geotiff(lai, folder / "lai.tif")
    shutil.copy(file, folder / "style.tif")
    estimate = xr.Dataset({"lai": lai, "low": lai - 0.5, "high": lai + 0.5}, {"level": 0.9})
    tiny = fifesim.Scenario(grid={"width": 60, "height": 60}, terrain={"dem": "flat"}, sensor={"response": "paper"})
    draws, setup = {"visibility": {"uniform": [10, 60]}}, fifesim.Setup(interval=20.0, min_valid=0.1)
    study = fifesim.Study(tiny, draws, landscapes=1, split={"train": 1.0})
    wide = fifesim.fife_site(250.0, window=((20, 26), (20, 26)))
    coarse = fifesim.fife_site(1100.0, window=((0, 12), (0, 12)))
    units = {"instrument": "MODIS", "units": "W m-2 sr-1 um-1"}
    radiance = make_raster(np.full((1, *wide.shape), 80.0), wide, "toa_radiance", **units)
    avhrr = make_raster(np.full((1, *coarse.shape), 0.2), coarse, "toa_reflectance").assign_coords(band=["AVHRR1"])
    utm = fifesim.grid_at("EPSG:32614", 705000, 4330000, width=240, height=180, cell=60)
    emit = make_raster(np.full((1, *utm.shape), 80.0), utm, "toa_radiance", **units | {"instrument": "EMIT"})
    sun = fifesim.sun_position(time := "2023-06-03T17:10Z", latitude=39.09, longitude=-96.62)
    emit = emit.assign_coords(band=["EMIT29"], time=np.datetime64(time[:-1]), sza=sun.sza, saa=sun.saa)
    emit = emit.assign_coords(earth_sun_distance=sun.earth_sun_distance)
    chips = fifesim.dataset(fifesim.Study(tiny, draws, landscapes=3), folder / "training.zarr", 3)
    with pytest.warns(UserWarning, match=r"few landscapes \(train 1, validation 1, test 1\)"):
        retrieval = fifesim.train(chips, "line", path=folder / "line.nc")
    designs, weather = {"pixel": [30.0], "registration": [0.0]}, fifesim.models.fife_weather()
    (folder / "responses.csv").write_text("wavelength,red\n0.6,0\n0.65,1\n0.7,0\n", encoding="utf-8")
    products = {
        "TM": (30, "1987-06-06T16:35Z", None),
        "MSI": (10, "2021-06-06T17:10Z", ["MSI2", "MSI3", "MSI4", "MSI8"]),
    }
    for name, (cell, time, bands) in products.items():
        ground = fifesim.lai_scene(fifesim.grid_at("EPSG:32614", 704940, 4334220, 120, 120, cell), seed=1)
        products[name] = ground.fifesim.surface_reflectance(name, bands=bands, time=time).fifesim.to_toa()
    of_classes = make_raster(np.ones(grid.shape, np.uint8), grid, "cover")
    return {
        "folder": folder, "file": file, "grid": grid, "wide": wide, "part": grid[4:6, 4:6], "lai": lai, "dem": dem,
        "rho": rho, "image": image, "ndvi": ndvi, "counts": image.drop_vars(["gain", "offset"]), "study": study,
        "draws": study.draws, "tiny": tiny, "chips": chips, "retrieval": retrieval, "fit": fifesim.regress(lai, ndvi),
        "setup": setup, "setup_of_a_band": fifesim.Setup(bands=("TM3",)), "images": fifesim.compare(lai, ["TM"], setup),
        "swath": fifesim.sense_swath(radiance.assign_coords(band=["MODIS1"]), "MODIS", min_valid=0.1),
        "samples": fifesim.sense_swath(avhrr, "AVHRR", min_valid=0.1, quantise=False), "plain_rho": rho.drop_attrs(),
        "horizon": fifesim.horizon(dem, directions=16, reach=50.0), "spectra": reflectance_spectra(grid),
        "clouds": fifesim.cloud_field(grid, 0.3, length=100.0, margin=1500.0), "cover": of_classes,
        "classes": [fifesim.CoverClass("grass", 1.2, code=1)], "canopy": fifesim.Canopy(), "interval": estimate,
        "scores": fifesim.score(estimate, lai), "corner": lai.isel(y=slice(6), x=slice(6)), "sqrt": np.sqrt,
        "coarse": fifesim.aggregate(lai, 60.0, min_valid=0.1), "series": xr.concat([ndvi, ndvi], "time"),
        "leafy": fifesim.lai_scene(fifesim.fife_site(10.0, window=((90, 150), (180, 240))), seed=1),
        "weather": {each.name: getattr(weather, each.name) for each in fields(weather)},
        "geometry": fifesim.fife_geometry(), "atmosphere": fifesim.Atmosphere(), "noise": fifesim.NoiseModel(1.0, 0.1),
        "designs": designs, "trade": fifesim.trade("TM", designs), "cost": xr.DataArray([1.0], dims="pixel"),
        "landsat": products["TM"], "sentinel2": products["MSI"],
        "ross_li": fifesim.ground.RossLi(0.3, 0.15, 0.03),
        "emit": emit, "true": lai.to_dataset(name="lai"),
        "aerosol_tables": fifesim.atmosphere.aerosol_tables("continental"),
    }  # fmt: skip


def resolved(value, scene):
    """Value of the table of arguments, in which @ marks objects of the scene and files of its folder."""
    if isinstance(value, dict):
        return {key: resolved(each, scene) for key, each in value.items()}
    if not (isinstance(value, str) and value.startswith("@")):
        return value
    name, _, file = value[1:].partition("/")
    return scene[name] / file if file else scene[name]


@pytest.fixture(scope="module")
def valid_calls(scene):
    """Arguments with which each public function works."""
    shared, given = resolved(TABLE["shared"], scene), resolved(TABLE["functions"], scene)
    assert set(given) <= set(CHECKED)
    needed = {name: {key: shared[key] for key in required_arguments(name) & set(shared)} for name in CHECKED}
    calls = {name: needed[name] | default_arguments(name) | given.get(name, {}) for name in CHECKED}
    assert [f"{name}: {lacks}" for name, call in calls.items() if (lacks := required_arguments(name) - set(call))] == []
    return calls


@pytest.fixture(scope="module")
def wrong_values(scene):
    lai = scene["lai"]
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


def outcome(call, argument, kind):
    """Fault of the message about a wrong value: too long, of a library, or without the argument; None if accepted."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call()
    except (ValueError, TypeError, FileNotFoundError) as error:
        text, last = str(error), traceback.extract_tb(error.__traceback__)[-1].filename
        short = len(text) <= 500 and text.count("\n") <= 2
        good = short and names_argument(text, argument, kind) and last.startswith(PACKAGE)
        return "" if good else f"{argument} = {kind}: {text[:150]} ({last})"
    return None


def names_argument(text, argument, kind):
    """Whether a message names the argument, the unknown name, or the grids that differ."""
    stem = argument.replace("_", " ").rstrip("s")
    others = {"str": ("nonsense",), "crs": ("raster", "grid", "lattice")}.get(kind, ())
    also = TABLE["named"].get(argument, ())
    words = argument.lower(), stem.lower(), "there is no file or folder", *others, *also
    return any(word in text.lower() for word in words)


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
            fault = outcome(
                lambda value=value, argument=argument: function(**given | {argument: value}), argument, kind
            )
            if fault or (fault is None and kind not in accepted_kinds(name, argument, first)):
                found.append(fault or f"{argument} = {kind} is accepted")
    assert found == []


@pytest.mark.parametrize("field", list(PROPERTIES))
def test_wrong_canopy_field_is_named_in_one_line(valid_calls, wrong_values, field):
    # Dead leaves make the function use their optics.
    given, dead = valid_calls["surface_reflectance"], {} if field in ("brown", "lai") else {"brown": 0.3}

    def call(value):
        return fifesim.surface_reflectance(**given | {"canopy": fifesim.Canopy(**dead | {field: value})})

    found = [outcome(lambda value=value: call(value), field, kind) for kind, value in wrong_values.items()]
    assert not any(found) and found.count("") >= 5


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


@pytest.mark.parametrize(
    ("kind", "fits", "others"),
    [
        (kinds.NUMBER, [1, 2.5, np.float32(1), np.array(3.0)], [True, "1", None, [1.0], np.ones(2), np.array("a")]),
        (kinds.NUMBERS, [1, [1.0, 2.0], np.ones((2, 2)), xr.DataArray([1.0])], [None, "1", ["1"], np.array(["a"])]),
        (kinds.PAIR, [30, (30, 15)], [(1, 2, 3), "30", np.ones((2, 2)), ("a", "b")]),
        (kinds.FLAG, [True, np.bool_(False)], [1, 0, None, "no"]),
        (kinds.NAMES, ["a", ["a"], ()], [5, None, xr.Dataset()]),
        (kinds.MAPPING, [{"a": 1.0}], [[1.0], None, 5]),
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


def _result(name, arguments):
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
            found, expected = (_result(name, valid_calls[name] | {key: each}) for each in (packed, values))
            tried += 1
            if not _same(found, expected):
                wrong.append(f"{name}({key}): {str(found)[:150]!r} instead of {str(expected)[:150]!r}")
    assert tried >= 60
    assert not wrong, "\n".join(wrong)
