"""
Hashes of the results of many runs, to compare two versions of fifesim bit by bit.

Only values count: of a GeoTIFF its pixels, of a table its numbers. Names of variables are part of the keys.

    python benchmarks/bits.py before.json
    python benchmarks/bits.py --compare before.json after.json
"""

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
import time
from functools import cache, partial
from pathlib import Path

import dask
import numpy as np
import pandas as pd
import rasterio
import xarray as xr
from rasterio.transform import from_origin

import fifesim

SMALL = ("--realisations", "2", "--cells", "120")
COMMANDS = {
    "simulate": ("simulate", "--threads", "1"),
    "simulate --paper": ("simulate", "--paper", "--threads", "1"),
    "simulate, DEM": ("simulate", "dem.toml", "--threads", "1"),
    "simulate, landscape": ("simulate", "landscape.toml", "--threads", "1"),
    "reproduce": ("reproduce", *SMALL),
    "budget": ("budget", *SMALL),
}
COMMAND = "from fifesim.cli import app; app()"
BANDS = ["TM3", "TM4"]
# Leaves and background have spectra between these wavelengths. [um]
SPECTRA = (0.43, 2.42)
MOST_BANDS = 14

LANDSCAPE = """
[grid]
width = 900.0
height = 900.0
[ground]
distribution = "unburned-ungrazed"
arp = 0.24
brown = 0.2
dissociation = 0.5
crown_cover = 0.8
moisture = 0.25
[landscape]
cover = "voronoi"
size = 200.0
[landscape.deviations]
brown = 0.06
crown_cover = 0.1
soil = 0.03
moisture = 0.08
[classes.burned-grazed]
distribution = "burned-grazed"
share = 0.6
hotspot = 0.05
[classes.unburned-ungrazed]
leaf_angles = "erectophile"
share = 0.4
[classes.unburned-ungrazed.background_spectra]
soil_dry = 0.4
dead_grass = 0.2
shade = 0.4
[geometry]
sza = 50.0
saa = 120.0
vza = 10.0
vaa = 280.0
[atmosphere]
visibility = 15.0
aerosol = "urban"
adjacency = true
[sensor]
instrument = "L4TM"
bands = ["TM3", "TM4"]
noise = ["all"]
offset = [0.2, -0.1]
"""
STUDY = """
[grid]
width = 360
height = 360
[ground]
background_spectra = { soil_dry = 0.6, shade = 0.4 }
brown_leaf = { chlorophyll = 5.0, brown = 1.5 }
[dataset]
seed = 1
landscapes = 4
[draw]
visibility = { log-uniform = [5, 60] }
"ground.arp" = { uniform = [0.05, 0.2] }
distribution = { choice = ["burned-grazed", "unburned-ungrazed"] }
brown = { normal = [0.2, 0.1], within = [0, 0.6] }
"ground.leaf.chlorophyll" = { uniform = [20, 60] }
sza = { uniform = [20, 60] }
saa = { uniform = [90, 180] }
"""
DEM = """
[grid]
width = 900.0
height = 900.0
[terrain]
dem = "dem.tif"
"""


def of_array(values):
    """SHA-256 of the type, shape and bytes of an array."""
    values = np.asarray(values)
    if values.dtype.kind not in "biufmM":
        raise TypeError(f"an array of {values.dtype} has no bytes of its own")
    found = hashlib.sha256(f"{values.dtype.str} {values.shape} ".encode())
    found.update(np.ascontiguousarray(values).tobytes())
    return found.hexdigest()


def of_result(name, result):
    """Hash of each variable of an array, Dataset or DataTree."""
    if isinstance(result, xr.DataTree):
        return {
            key: value
            for node in result.subtree
            for key, value in of_result(f"{name}{node.path.rstrip('/')}", node.to_dataset()).items()
        }
    if isinstance(result, xr.Dataset):
        return {f"{name}/{key}": of_array(values) for key, values in result.data_vars.items()}
    return {name: of_array(result)}


def of_folder(name, folder):
    """Hash of the pixels of each GeoTIFF and of the numbers of each table in a folder."""
    found = {}
    for path in sorted(folder.glob("*.tif")):
        with rasterio.open(path) as raster:
            found[f"{name}/{path.name}"] = of_array(raster.read())
    for path in sorted(folder.glob("*.csv")):
        found[f"{name}/{path.name}"] = of_array(pd.read_csv(path).select_dtypes("number").to_numpy())
    return found


def command(name):
    """Hashes of the files that a command writes, in a folder that also holds its inputs."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        heights = 400 + 30 * np.sin(np.arange(100) / 9)[:, None] * np.cos(np.arange(120) / 7)
        # Cells of 30 m, at least 1 km beyond the scene on each side.
        place = {"crs": "EPSG:26914", "transform": from_origin(704970 - 1005, 4334220 + 1005, 30, 30)}
        shape = {"height": 100, "width": 120, "count": 1, "dtype": "float32"}
        with rasterio.open(folder / "dem.tif", "w", driver="GTiff", **shape, **place) as raster:
            raster.write(heights.astype("float32"), 1)
        for file, text in {"dem.toml": DEM, "landscape.toml": LANDSCAPE}.items():
            (folder / file).write_text(text, encoding="utf-8")
        call = [sys.executable, "-c", COMMAND, *COMMANDS[name], "-q", "-o", "out"]
        subprocess.run(call, cwd=folder, check=True)
        return of_folder(name, folder / "out")


@cache
def ground():
    """Leaf area of 270 x 270 cells, hills, and a raster of values from 0 to 1."""
    grid = fifesim.fife_site(30 / 9, window=((0, 270), (0, 270)))
    lai = fifesim.lai_scene(grid, arp=0.15, seed=7)
    share = lai.copy(data=np.random.default_rng(1).beta(2, 4, lai.shape)).drop_attrs(deep=False)
    return lai, fifesim.flint_hills(grid, seed=7), share


def steps():
    """Each step of the chain, from field to analysis."""
    lai, dem, _ = ground()
    rho = lai.fifesim.surface_reflectance("TM", bands=BANDS, dem=dem)
    toa = rho.fifesim.to_toa()
    model = fifesim.NoiseModel(thermal=0.4, shot=0.005, detectors=16, gain_spread=0.005)
    image = toa.fifesim.sense("TM", noise="all", seed=3, noise_models=model)
    ndvi, truth = image.fifesim.ndvi(), lai.fifesim.aggregate(30)
    fit = fifesim.regress(truth, ndvi)
    thick = fifesim.Atmosphere(aerosol="urban", visibility=8, engine="successive-orders")
    away = {"nadir_offset": -60e3, "heading": 193.6}
    view = fifesim.sensor.scan_geometry("TM", lai.odc.geobox, **away).assign(sza=28.5, saa=117.0)
    swath = lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=view).fifesim.to_toa()
    dates = np.array(["1987-05-01T16:35", "1987-07-10T16:35"], "M8[ns]")
    growing = lai * xr.DataArray([0.3, 1.2], coords={"time": dates}, dims="time")
    found = {
        "lai": lai,
        "lai, periodic": fifesim.lai_scene(lai.odc.geobox, arp=0.15, seed=7, method="periodic"),
        "lai, downscaled": fifesim.ground.downscale(truth, lai.odc.geobox, seed=7),
        "hills": dem,
        "slope": dem.fifesim.slope(),
        "aspect": dem.fifesim.aspect(),
        "wetness": dem.fifesim.wetness(),
        "horizon": dem.fifesim.horizon(),
        "sky_view": dem.fifesim.sky_view(),
        "kt": lai.fifesim.surface_reflectance("TM", bands=BANDS).fifesim.kt(dem),
        "surface_reflectance": rho,
        "to_toa": toa,
        "to_toa, adjacency": rho.fifesim.to_toa(adjacency=True, surroundings=[0.05, 0.3]),
        "to_toa, elevation": rho.fifesim.to_toa(elevation=dem),
        "to_toa, successive orders": lai.fifesim.surface_reflectance(
            "TM", bands=BANDS, atmosphere=thick
        ).fifesim.to_toa(),
        "to_surface": image.fifesim.to_surface(),
        "sense": image,
        "sense, native": toa.fifesim.sense("TM", interval="native", offset=(0.3, -0.2), quantise=False),
        "to_radiance": image.fifesim.to_radiance(),
        "to_reflectance": image.fifesim.to_reflectance(),
        "ndvi": ndvi,
        "aggregate": truth,
        "regress": [fit.slope, fit.intercept, fit.r2],
        "variogram": lai.fifesim.variogram(60),
        "as_seen_by": rho.fifesim.as_seen_by("OLI", bands=["OLI4", "OLI5"]),
        "sense_swath": swath.fifesim.sense_swath("TM", **away),
        "season": growing.fifesim.surface_reflectance("TM", bands=BANDS).fifesim.to_toa().fifesim.sense(),
        "compare": fifesim.compare(lai, ["TM", "OLI"]),
    }
    return {key: value for name, result in found.items() for key, value in of_result(name, result).items()}


def canopies():
    """Reflectance and absorbed light of canopies."""
    lai, _, share = ground()
    cases = {
        "default": {},
        "erectophile": {"leaf_angles": "erectophile", "hotspot": 0.1},
        "leaf": {"leaf_optics": fifesim.Leaf(chlorophyll=45), "background": {"dead_grass": 0.7, "shade": 0.3}},
        "two layers": {"brown": 0.3, "dissociation": 0.7},
        "two layers by cell": {"brown": share, "dissociation": 0.5},
        "crowns": {"crown_cover": 0.7, "crown_shape": 1.5, "brown": 0.2},
        "crowns by cell": {"crown_cover": 0.5 + 0.5 * share},
        "soil by cell": {"soil": 0.1 * share, "moisture": share},
        "background by cell": {"background": 0.3 * share},
        "all by cell": {"brown": share, "crown_cover": 0.5 + 0.5 * share, "background": 0.3 * share},
        "leaf content by cell": {"leaf_optics": fifesim.Leaf(chlorophyll=20 + 40 * share)},
    }
    found = {}
    for name, fields in cases.items():
        canopy = fifesim.Canopy(**fields)
        found[f"surface_reflectance, {name}"] = lai.fifesim.surface_reflectance("TM", bands=BANDS, canopy=canopy)
        found[f"fpar, {name}"] = lai.fifesim.fpar(canopy=canopy, leaves="green")
    for name in ("two layers", "crowns", "background by cell", "leaf content by cell"):
        canopy = fifesim.Canopy(**cases[name])
        exact = lai.fifesim.surface_reflectance("TM", bands=BANDS, canopy=canopy, exact=True)
        found[f"surface_reflectance, {name}, exact"] = exact
    return {name: of_array(values) for name, values in found.items()}


def landscapes():
    """A landscape of classes and drawn fields, through the chain."""
    _, dem, _ = ground()
    fields = {
        "soil": fifesim.ground.Field(sd=0.03, arp=0.05),
        "brown": fifesim.ground.Field(mean=0.15, sd=0.06, arp=0.05),
        "moisture": fifesim.ground.Field(mean=0.25, sd=0.08, arp=0.242),
    }
    patches = fifesim.ground.Patches("voronoi", size=200)
    land = fifesim.landscape(dem.odc.geobox, cover=patches, **fields, seed=7)
    rho = land.fifesim.surface_reflectance("MSI", bands=["MSI4", "MSI8"], dem=dem)
    found = of_result("landscape", land) | of_result("landscape, truth", land.fifesim.aggregate(30))
    found |= of_result("landscape, fpar", land.fifesim.fpar())
    return found | of_result("landscape, image", rho.fifesim.to_toa().fifesim.sense())


def instrument(name):
    """All kinds of pixels of an instrument, in some of its bands."""
    described = fifesim.instrument(name)
    bands = [band for band in described.bands if SPECTRA[0] < band.wavelength < SPECTRA[1]]
    bands = [band.name for band in bands[:: -(-len(bands) // MOST_BANDS)]]
    cell = float(np.max(described.ground_interval)) / 5
    side = 80 * cell
    grid = fifesim.grid_at("EPSG:26914", 704970.0, 4334220.0, side, side, cell)
    lai = fifesim.lai_scene(grid, arp=0.15, seed=7)
    light = lai.fifesim.surface_reflectance(
        name, bands=bands, geometry=fifesim.fife_geometry(), atmosphere=fifesim.Atmosphere()
    )
    return of_result(name, light.fifesim.to_toa().fifesim.sense(name))


def experiments():
    """Reproduction, budget and sweep, with all digits."""
    repeated = fifesim.reproduce(dem="flint-hills", realisations=1, cells=120)
    found = of_result("reproduce, hills", repeated[["intercept", "slope", "r2", "ren", "pixel_ndvi", "cell_ndvi"]])
    scenario = fifesim.Scenario(
        grid={"width": 900, "height": 900}, sensor={"instrument": "L4TM", "offset": [0.2, 0.0], "noise": ["all"]}
    )
    found |= of_result("budget, L4TM", fifesim.budget(scenario, realisations=2, cells=120))
    found |= of_result("sweep", fifesim.scenario.sweep(scenario, {"arp": [0.05, 0.24], "visibility": [10, 45]}))
    return found


def chips():
    """A training set of twenty chips, and one of them by itself."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(STUDY, encoding="utf-8")
        study = fifesim.scenario.read_study(path)
        found = of_result("dataset", fifesim.dataset(study, Path(folder) / "chips.zarr", n=20).load())
    whole = fifesim.simulate(fifesim.scenario.chips_of(study, 20).scenario(4), complete=True)
    for part in ("scene", "image", "truth"):
        found |= of_result(f"dataset, chip 4, {part}", whole[part].to_dataset())
    return found


def hashes():
    """All hashes by name."""
    parts = {name: partial(command, name) for name in COMMANDS}
    parts |= {part.__name__: part for part in (steps, canopies, landscapes, experiments, chips)}
    parts |= {name: partial(instrument, name) for name in fifesim.sensor.instrument_names()}
    found = {}
    for name, part in parts.items():
        start = time.perf_counter()
        new = part()
        if not new or found.keys() & new.keys():
            raise RuntimeError(f"{name} gave no results, or twice the same names")
        found |= new
        print(f"{name}: {len(new)} hashes, {time.perf_counter() - start:.1f} s", flush=True)
    return found


def compare(before, after):
    """Print the keys that differ, and whether one does."""
    before, after = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    differing = 0
    for key in sorted(before.keys() | after.keys()):
        if before.get(key) != after.get(key):
            differing += 1
            print(key if key in before and key in after else f"{key}: only in {'BA'[key in before]}")
    print(f"{differing} of {len(before.keys() | after.keys())} differ")
    return differing > 0


def main():
    """Write the hashes of this version, or compare the hashes of two versions."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("output", type=Path, nargs="?", help="JSON file for the hashes")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("A", "B"), help="exit with 1 if hashes differ")
    given = parser.parse_args()
    if bool(given.output) == bool(given.compare):
        parser.error("give a file for the hashes, or --compare with two files")
    if given.compare:
        sys.exit(compare(*given.compare))
    print(f"fifesim of {Path(fifesim.__file__).parent}")
    with dask.config.set(scheduler="synchronous"):
        found = hashes()
    given.output.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
