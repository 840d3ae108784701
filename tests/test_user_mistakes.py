"""
User mistakes and their expected outcome: an error, a warning, or the correct result.

``data/user_mistakes.toml`` lists the mistakes by topic and title:

- ``code`` is user code whose last line is an expression. The fixture ``names`` defines its names: a landscape of
  60 x 60 cells on the FIFE site, its image, and its NDVI.
- ``refused`` are words of the expected error, a ValueError unless ``error`` names another type. ``unsaid`` is text that
  the message must not contain.
- ``warned`` are words of the expected warning.
- ``expected`` is an expression for the correct value from an independent calculation.

Code with both ``refused`` and ``expected`` may do either. A silent wrong result is a failure.
"""

import ast
import builtins
import shlex
import tomllib
import traceback
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pvlib
import pytest
import rasterio
import rioxarray  # noqa: F401  registers .rio
import xarray as xr
from typer.testing import CliRunner

import fifesim
from fifesim.cli import app

PACKAGE = str(Path(fifesim.__file__).parent)
MISTAKES = tomllib.loads((Path(__file__).parent / "data" / "user_mistakes.toml").read_text(encoding="utf-8"))
# Command lines that exit with code 2 and write nothing.
COMMANDS = MISTAKES.pop("commands")


def plain(values, crs=26914, x0=7e5, y0=4.33e6, cell=10.0, **coords):
    """Raster from another program, with a CRS but no attributes."""
    rows, columns = values.shape[-2:]
    place = {"y": y0 - cell * (np.arange(rows) + 0.5), "x": x0 + cell * (np.arange(columns) + 0.5)}
    raster = xr.DataArray(values, dims=("band", "y", "x")[-values.ndim :], coords=place | coords)
    return raster if crs is None else raster.rio.write_crs(crs)


def own(values, **coords):
    """Red and near-infrared raster from another program."""
    return plain(np.asarray(values), **(coords or {"band": ["TM3", "TM4"]}))


def west(raster, value):
    """Raster with its four western columns set to a value."""
    return raster.where(raster.x > raster.x[3], value)


def normalized(bands):
    """NDVI of a red and a near-infrared band by definition."""
    with np.errstate(invalid="ignore"):
        return (bands[1] - bands[0]) / (bands[1] + bands[0])


def planetary(image):
    """Planetary reflectance of digital numbers by hand. [1]"""
    gain, offset, irradiance = (image[name].values[:, None, None] for name in ("gain", "offset", "solar_irradiance"))
    radiance = image.values * gain + offset
    return np.pi * radiance * float(image.earth_sun_distance) ** 2 / (irradiance * np.cos(np.radians(float(image.sza))))


def blocks(values):
    """Means over blocks of 3 x 3 cells; NaN if any cell is NaN."""
    return values.reshape(20, 3, 20, 3).mean((1, 3))


def sun_of_pvlib(time, latitude, longitude):
    """Solar zenith angle [degree]."""
    return float(pvlib.solarposition.get_solarposition(pd.to_datetime([time]), latitude, longitude)["zenith"].iloc[0])


def polar(longitude, latitude):
    """Easting and northing in EPSG:3413 [m]."""
    (x,), (y,) = rasterio.warp.transform("EPSG:4326", "EPSG:3413", [longitude], [latitude])
    return round(x), round(y)


def polar_slope(x0, y0):
    """Elevation of 60 x 60 cells of 10 m around a point in EPSG:3413 that decreases toward true south. [m]"""
    step = 10 * (np.arange(60) + 0.5) - 300
    x, y = np.meshgrid(x0 + step, y0 - step)
    # The pole is the origin, so true north is toward the origin.
    return 500 - 0.1 * (np.hypot(x, y) - np.hypot(x0, y0))


def translate(source, target, bands, unscale=False):
    """Copy a file as ``gdal_translate -b`` does, optionally with ``-unscale -ot Float32``."""
    with rasterio.open(source) as old:
        profile = {"driver": "GTiff", "width": old.width, "height": old.height, "count": len(bands), "crs": old.crs}
        profile |= {"transform": old.transform, "nodata": old.nodata, "dtype": "float32" if unscale else old.dtypes[0]}
        with rasterio.open(target, "w", **profile) as new:
            new.update_tags(**old.tags())
            for number, band in enumerate(bands, 1):
                scale, offset = old.scales[band - 1], old.offsets[band - 1]
                new.write(old.read(band) * scale + offset if unscale else old.read(band), number)
                new.set_band_description(number, old.descriptions[band - 1])
            if not unscale:
                new.scales, new.offsets = [[each[band - 1] for band in bands] for each in (old.scales, old.offsets)]


def camera(altitude="705000.0", gsd="30", bits="12", center="0.668", width="0.01", snr="200", more=""):
    """Instrument from a minimal file."""
    bits, more = f"bits = {bits}\n" if bits else "", f", {more}" if more else ""
    band = f'name = "red", center = {center}, width = {width}, snr = {snr}, snr_radiance = 100.0{more}'
    text = f'name = "Camera"\naltitude = {altitude}\ngsd = {gsd}\n{bits}bands = [{{ {band} }}]\n'
    Path("camera.toml").write_text(text)
    return fifesim.sensor.read_instrument("camera.toml")


def simulate(**sections):
    """Simulation of 300 m x 300 m on flat ground."""
    size = {"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}}
    return fifesim.simulate(fifesim.Scenario(**(size | sections)))


def study(draws=None, **how):
    """Study of chips of 300 m x 300 m."""
    scenario = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    return fifesim.Study(scenario, draws or {"visibility": {"uniform": [5, 60]}}, **how)


def canopy(**options):
    """Red reflectance of the LAI of the scene."""
    own = fifesim.Canopy(**options)
    return shared()["lai"].fifesim.surface_reflectance("TM", bands=["TM3"], canopy=own)


def fine(arp=0.2, **options):
    """LAI of the cells, downscaled from the truth."""
    return fifesim.ground.downscale(shared()["truth"], shared()["grid"], arp=arp, seed=7, **options)


def own_lai():
    """LAI raster from another program."""
    return plain(shared()["lai"].values)


_SHARED = {}


def shared():
    """Landscape, image and NDVI of 60 x 60 cells of 10 m, computed once."""
    if not _SHARED:
        grid = fifesim.fife_site(cell=10, window=((90, 150), (180, 240)))
        lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
        rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
        toa = rho.fifesim.to_toa()
        image = toa.fifesim.sense(fifesim.instrument("TM", response="paper"))
        ndvi, truth = image.fifesim.ndvi(), lai.fifesim.aggregate(30)
        _SHARED.update(grid=grid, lai=lai, dem=fifesim.flint_hills(grid, seed=7), rho=rho, toa=toa, image=image)
        _SHARED.update(ndvi=ndvi, truth=truth, fit=fifesim.regress(truth, ndvi))
        _SHARED.update(sun=fifesim.Geometry(28.5, 117.0), air=fifesim.Atmosphere())
    return _SHARED


@pytest.fixture
def names(tmp_path, monkeypatch):
    """Names in the code, as fresh copies, with an empty working folder."""
    monkeypatch.chdir(tmp_path)
    scene = {name: each.copy(deep=True) if isinstance(each, xr.DataArray) else each for name, each in shared().items()}
    return globals() | scene


def run(code, names):
    """Computed value of the last line of code, and warnings."""
    *lines, last = ast.parse(code).body
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        exec(compile(ast.Module(lines, []), "<user>", "exec"), names)
        value = eval(compile(ast.Expression(last.value), "<user>", "eval"), names)
        value = value.compute() if hasattr(value, "compute") else value
    return value, [str(each.message) for each in caught if issubclass(each.category, UserWarning)]


def check_error(error, mistake):
    """Check that the error is raised in fifesim, is short and contains the words."""
    text, last = str(error), traceback.extract_tb(error.__traceback__)[-1].filename
    assert isinstance(error, getattr(builtins, mistake.get("error", "ValueError"))), f"{type(error).__name__}: {text}"
    assert last.startswith(PACKAGE) and len(text) <= 600, f"{last}: {text}"
    assert [word for word in mistake["refused"] if word not in text] == [], text
    assert "unsaid" not in mistake or mistake["unsaid"] not in text, text


CASES = [
    pytest.param(mistake, id=f"{topic}-{title.replace(' ', '-')}")
    for topic, mistakes in MISTAKES.items()
    for title, mistake in mistakes.items()
]


@pytest.mark.parametrize("mistake", CASES)
def test_mistake_gives_no_silent_wrong_result(mistake, names):
    try:
        found, told = run(mistake["code"], names)
    except Exception as error:
        if "refused" not in mistake:
            raise
        check_error(error, mistake)
        return
    if "warned" in mistake:
        assert any(all(word in text for word in mistake["warned"]) for text in told), told
    elif "expected" in mistake:
        expected, rtol = eval(mistake["expected"], names), mistake.get("rtol", 1e-9)
        np.testing.assert_allclose(np.asarray(found), expected, rtol=rtol, equal_nan=True)
    else:
        pytest.fail(f"no error, but {found!r:.200}")


@pytest.mark.parametrize("title", COMMANDS)
def test_mistake_on_the_command_line_exits_with_2_and_writes_nothing(title, names):
    Path("mine.toml").write_text(COMMANDS[title]["scenario"])
    done = CliRunner().invoke(app, shlex.split(COMMANDS[title]["command"]))
    assert done.exit_code == 2, done.output
    assert [word for word in COMMANDS[title]["words"] if word not in done.output] == [], done.output
    assert "Traceback" not in done.output and len(done.stderr) <= 520
    assert [path.name for path in Path().iterdir()] == ["mine.toml"]
