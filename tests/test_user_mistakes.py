"""
Mistakes of users and their expected outcome: an error, a warning, or the right numbers.

Each entry of the tables is code as a user types it. Its last line is an expression. The fixture ``names`` defines the
names in it: a landscape of 60 x 60 cells on the FIFE site, its image, and its NDVI. A silent wrong result is a failure:
code that passes without an error must give the value of an independent calculation, or warn.
"""

import ast
import shlex
import traceback
import warnings
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Mistake:
    """
    A mistake and its expected outcome.

    Parameters
    ----------
    title : str
        The mistake in a few words.
    code : str
        Python code.
    error : type, optional
        Exception that it raises.
    warning : bool, optional
        Whether it warns.
    words : tuple of str, optional
        Each is part of the message.
    unsaid : str, optional
        Is not part of the message.
    expected : str, optional
        Expression for the right value, where there is no error.
    rtol : float, optional
        Tolerance of the comparison. [1]
    """

    title: str
    code: str
    error: type | None = None
    warning: bool = False
    words: tuple[str, ...] = ()
    unsaid: str = ""
    expected: str = ""
    rtol: float = 1e-9


def refused(title, code, *words, error=ValueError, unsaid="", expected=""):
    """A mistake that raises an error; one with ``expected`` may give the right value instead."""
    return Mistake(title, code, error, False, words, unsaid, expected)


def warned(title, code, *words):
    """A likely mistake: a warning names it."""
    return Mistake(title, code, None, True, words)


def right(title, code, expected, *, rtol=1e-9):
    """An input that looks like a mistake and is handled correctly."""
    return Mistake(title, code, expected=expected, rtol=rtol)


UNITS = [
    refused("surface reflectance in percent", "(rho * 100).fifesim.to_toa()", "reflectance of", "0.01 for percent"),
    refused("TOA reflectance in percent", '(toa * 100).fifesim.sense("TM")', "reflectance of", "0.01 for percent"),
    refused("NDVI of percent from another program", "own(rho.values * 100).fifesim.ndvi()", "0.01 for percent"),
    refused("SAVI of percent", '(rho * 100).fifesim.index("SAVI")', "reflectance of", "0.01 for percent"),
    refused(
        "integers times 10000 without a scale",
        '(rho * 10000).round().astype("int16").fifesim.ndvi()',
        "whole numbers (int16) without a scale",
        "scale_factor=0.0001",
    ),
    refused(
        "reflectance times 10000 as float", "(rho * 10000).fifesim.index('EVI2')", "0.0001 where 1 is written 10000"
    ),
    warned("reflectance ten times too large", '(toa * 10).fifesim.sense("TM")', "reflectances above 1", "percent"),
    right(
        "integers times 10000 with their scale",
        "scaled = (rho * 10000).round().astype('int16')\n"
        "scaled.assign_attrs(scale_factor=0.0001, _FillValue=-9999).fifesim.ndvi()",
        "normalized(np.round(rho.values * 10000))",
    ),
    refused("LAI in percent", '(lai * 100).fifesim.surface_reflectance("TM")', "leaf area index", "lai * 0.01"),
    refused("LAI in tenths, dense", "fifesim.open_lai(lai * 10, grid)", "up to 21.9", "lai * 0.1"),
    refused("LAI in tenths as integers", "fifesim.open_lai((lai * 10).astype('uint8'), grid)", "up to 21", "lai * 0.1"),
    warned("LAI in tenths, sparse", "fifesim.open_lai(lai * 5 + 6, grid)", "leaf area index"),
    refused(
        "wavelengths in nm",
        'rho.assign_coords(wavelength=("band", [661.0, 838.0])).fifesim.to_toa()',
        "wavelength reaches 838 um",
        "attrs['units'] = 'nm'",
    ),
    right(
        "wavelengths in nm that say so",
        'nm = toa.assign_coords(wavelength=("band", [661.0, 838.0], {"units": "nm"}))\nnm.fifesim.ndvi()',
        "normalized(toa.values)",
    ),
    refused(
        "wavelengths of a cube in nm",
        'own(rho.values, wavelength=("band", [661.0, 838.0])).fifesim.to_bands("TM")',
        "reaches 838",
        "'nm'",
    ),
    refused("a band in nm", 'fifesim.Band("red", (630, 660, 690), (0, 1, 0))', "at most 100 um, got 690", "divide"),
    right(
        "a band's response in percent",
        'fifesim.Band("red", (0.63, 0.66, 0.69), (0, 100, 0)).center',
        'fifesim.Band("red", (0.63, 0.66, 0.69), (0, 1, 0)).center',
    ),
    refused("visibility in m", "fifesim.Atmosphere(visibility=45000)", "5 to 100 km, got 45000", "visibility=45"),
    refused("altitude in m", "fifesim.Atmosphere(altitude=400)", "0 to 4 km, got 400", "altitude=0.4"),
    refused("ozone in Dobson units", "fifesim.Atmosphere(o3=300)", "o3", "0 to 1 cm-atm, got 300"),
    refused("water vapour in mm", "fifesim.Atmosphere(h2o=30)", "h2o", "0 to 10 g cm-2, got 30"),
    warned("sun in radians", "fifesim.Geometry(sza=0.47, saa=2.05)", "sza=0.47", "radians", "sza=26.9"),
    warned(
        "sun of a raster in radians",
        "toa.assign_coords(sza=0.4712, saa=2.05).fifesim.to_surface()",
        "sza=0.4712",
        "radians",
    ),
    warned(
        "rasters of the sun in radians",
        "flat = (lai * 0).drop_attrs(deep=False)\n"
        'sun = xr.Dataset({"sza": flat + 0.47, "saa": flat + 2.05})\n'
        'lai.fifesim.surface_reflectance("TM", bands=["TM3"], geometry=sun)',
        "radians",
    ),
    refused(
        "Earth-Sun distance in km",
        "image.assign_coords(earth_sun_distance=149.6e6).fifesim.to_reflectance()",
        "astronomical units",
    ),
    refused(
        "solar irradiance per nm",
        "image.assign_coords(solar_irradiance=image.solar_irradiance / 1000).fifesim.to_reflectance()",
        "solar_irradiance",
        "W m-2 um-1",
    ),
    refused("pixel in km", "lai.fifesim.aggregate(0.03)", "at least 1/50 of a cell", "got 0.03", "metres, not km"),
    refused("interval in km", 'toa.fifesim.sense("TM", interval=0.03)', "got 0.03", "metres, not km"),
    refused("offset in metres", 'toa.fifesim.sense("TM", offset=(30, 0))', "got 30", "in pixels, not metres"),
    refused(
        "patches in km", 'fifesim.landscape(grid, cover=fifesim.Patches("voronoi", 0.3), seed=7)', "got 0.3 m", "km"
    ),
    refused("cell of a site in km", "fifesim.fife_site(cell=30000)", "cell must be in (0, 15000] m, got 30000"),
    warned("a corner in degrees", 'fifesim.grid_at("EPSG:26914", -96.5, 39.1, 100, 100, 10)', "-96.5", "degrees"),
    refused("a variogram's reach in km", "lai.fifesim.variogram(reach=0.09)", "at least a cell (10 m)", "0.09"),
    refused(
        "a level in percent",
        "ndvi.fifesim.invert(fit, level=95)",
        "level must be between 0 and 1, got 95",
    ),
    refused("a share in percent", 'toa.fifesim.sense("TM", min_valid=98)', "min_valid must be in [0, 1], got 98"),
]

ELEVATION = [
    refused("a DEM in feet that says so", '(dem / 0.3048).assign_attrs(units="ft").fifesim.slope()', "'ft'", "'m'"),
    refused(
        "a model in feet that says so",
        'fifesim.fine_dem((dem / 0.3048).assign_attrs(units="ft"), grid)',
        "'ft'",
        "vertical_units",
    ),
    right(
        "a model in feet, converted",
        'fifesim.fine_dem(dem / 0.3048, grid, vertical_units="ft")',
        "dem.values",
        rtol=1e-6,
    ),
    warned(
        "a DEM in feet that does not say so",
        'lai.fifesim.surface_reflectance("TM", dem=dem / 0.3048)',
        "dem * 0.3048",
        "beside an altitude of the atmosphere of 0.4 km",
    ),
    warned(
        "a DEM in decimetres",
        "fifesim.fine_dem(plain(dem.values * 10), plain(dem.values).odc.geobox)",
        "slope",
    ),
    refused("an unknown unit", 'fifesim.fine_dem(dem, grid, vertical_units="furlong")', "'furlong'", "us-ft"),
    refused("fill values in a DEM", "dem.where(dem.x > dem.x[3], -9999).fifesim.slope()", "-9999", "land has"),
    refused("a declared fill value", "dem.rio.write_nodata(-9999).fifesim.slope()", "-9999", "masked=True"),
    refused(
        "fill values beside the grid",
        "holes = plain(dem.values).where(dem.x.values > dem.x.values[29], -9999)\n"
        "fifesim.fine_dem(holes, holes.odc.geobox[:, 30:])",
        "-9999",
    ),
    refused("LAI for elevation", "lai.fifesim.slope()", "units '1'", "'m'"),
    refused("elevation for LAI", 'dem.fifesim.surface_reflectance("TM")', "units 'm'"),
    refused(
        "a DEM that is too small", "fifesim.fine_dem(dem.isel(x=slice(30)), grid)", "lacks up to 300 m in the east"
    ),
    refused(
        "a DEM half a cell off",
        'lai.fifesim.surface_reflectance("TM", dem=dem.assign_coords(x=dem.x + 5))',
        "dem has other cells",
    ),
    refused("one elevation as a number", "rho.fifesim.to_toa(elevation=400)", "elevation", "got 400", error=TypeError),
    refused("elevation ten times too high", "rho.fifesim.to_toa(elevation=dem * 10)", "0 to 4 km", "got 4.15"),
    refused("a horizon in three directions", "dem.fifesim.horizon(directions=3)", "16 up, got 3"),
    refused(
        "a DEM for the horizon", "dem.fifesim.sky_view(horizon=dem)", "horizon", "fifesim.horizon", error=TypeError
    ),
    right(
        "aspect in a polar grid",
        "x0, y0 = polar(-120, 80)\n"
        "south = plain(polar_slope(x0, y0), crs=3413, x0=x0 - 300, y0=y0 + 300)\n"
        "float(south.fifesim.aspect()[30, 30])",
        "180.0",
        rtol=1e-3,
    ),
]

DIRECTIONS = [
    refused("sun below the horizon", "fifesim.Geometry(sza=95, saa=100)", "sza", "got 95", "below the horizon"),
    refused("view at 90 degrees", "fifesim.Geometry(30, 100, vza=90)", "vza must be in [0, 90) degrees, got 90"),
    refused("negative zenith angle", "fifesim.Geometry(-30, 100)", "sza", "got -30"),
    refused("sun too low for the model", "rho.fifesim.to_toa(geometry=fifesim.Geometry(80, 120))", "0 to 75", "got 80"),
    right(
        "azimuth counted westward",
        "dem.fifesim.illumination(geometry=fifesim.Geometry(50, -120)).values",
        "dem.fifesim.illumination(geometry=fifesim.Geometry(50, 240)).values",
    ),
    refused(
        "angles as a tuple", 'lai.fifesim.surface_reflectance("TM", geometry=(30, 120))', "Geometry", error=TypeError
    ),
    refused("an angle as text", 'fifesim.Geometry("30", 120)', "sza must be a number, got '30'", error=TypeError),
    refused(
        "another sun than the image's",
        "toa.fifesim.to_surface(geometry=fifesim.Geometry(60, 120))",
        "sza=28.5",
        "sza=60",
        "drop_vars('sza')",
    ),
    refused(
        "another sun than that of the light",
        'toa.fifesim.sense("TM", geometry=fifesim.Geometry(60, 120))',
        "sza=28.5",
        "sza=60",
    ),
    refused(
        "two suns at once",
        'lai.fifesim.surface_reflectance("TM", time="1987-06-06T16:35Z", geometry=fifesim.Geometry(30, 120))',
        "give one of them",
    ),
    refused(
        "a date alone", 'fifesim.sun_position("1987-06-06", 39, -96)', "'1987-06-06' is a date alone", "time of day"
    ),
    refused("day before month", 'fifesim.sun_position("06/06/1987", 39, -96)', "'06/06/1987'", "the year first"),
    refused("a date of another age", 'fifesim.sun_position("9999-06-06T16:35Z", 39, -96)', "1700 to 2200", "9999"),
    refused(
        "a time of the night", 'fifesim.sun_position("1987-06-06T05:35Z", 39, -96)', "below the horizon", "check time"
    ),
    refused("exchanged coordinates", 'fifesim.sun_position("1987-06-06T16:35Z", -96, 39)', "below the horizon"),
    right(
        "longitude counted eastward to 360",
        'fifesim.sun_position("1987-06-06T16:35Z", 39, 264).sza',
        'sun_of_pvlib("1987-06-06T16:35Z", 39, -96)',
    ),
    right(
        "local time with its offset",
        'fifesim.sun_position("1987-06-06T11:35-05:00", 39, -96).sza',
        'sun_of_pvlib("1987-06-06T16:35Z", 39, -96)',
    ),
    refused("a track off the Earth", "fifesim.Track(latitude=-96, longitude=39, heading=190)", "(-90, 90)", "got -96"),
    warned(
        "a time dimension of dates",
        'days = lai.expand_dims(time=pd.to_datetime(["1987-06-06"]))\n'
        'days.fifesim.surface_reflectance("TM", bands=["TM3"])',
        "midnight",
        "time of day",
    ),
]

AXES = [
    right("x before y", "lai.T.fifesim.aggregate(30)", "blocks(lai.values)"),
    right("bands last", "toa.transpose('y', 'x', 'band').fifesim.ndvi()", "normalized(toa.values)"),
    right("rows from south to north", "lai.isel(y=slice(None, None, -1)).pipe(fifesim.open_lai, grid)", "lai.values"),
    refused("rows from south to north in a mean", "lai.isel(y=slice(None, None, -1)).fifesim.aggregate(30)", "sortby"),
    refused("columns from east to west", "lai.isel(x=slice(None, None, -1)).fifesim.aggregate(30)", "north up"),
    refused("a column left out", 'lai.isel(x=[0, 1, 2, 4, 5]).fifesim.surface_reflectance("TM")', "not evenly spaced"),
    refused(
        "tiles with a gap",
        'fifesim.open_lai(xr.concat([lai[:, :20], lai[:, 40:]], "x"), grid[:, :40])',
        "evenly spaced",
    ),
    refused(
        "a DEM with shuffled columns",
        "fifesim.fine_dem(dem.isel(x=[0, *range(58, 0, -1), 59]), grid)",
        "evenly spaced",
    ),
    refused("no CRS", "plain(lai.values, crs=None).fifesim.aggregate(30)", "no CRS", ".rio.write_crs"),
    refused(
        "a CRS in degrees",
        "plain(lai.values, crs=4326, x0=-96.5, y0=39.1, cell=1e-4).fifesim.aggregate(30)",
        "degrees",
        ".rio.reproject",
    ),
    refused("a grid in degrees", 'fifesim.grid_at("EPSG:4326", -96.5, 39.1, 1, 1, 0.1)', "degrees", "projected CRS"),
    refused("a grid in feet", 'fifesim.grid_at("EPSG:2276", 7e5, 4e6, 100, 100, 10)', "metres", "foot"),
    refused("northing before easting", 'fifesim.grid_at("EPSG:26914", 4330000, 700000, 100, 100, 10)', "scale of"),
    refused("a CRS that does not exist", 'fifesim.grid_at("EPSG:99999", 7e5, 4e6, 100, 100, 10)', "EPSG:99999"),
    refused("a size smaller than a cell", 'fifesim.grid_at("EPSG:26914", 7e5, 4e6, 15, 15, 30)', "no cell of 30"),
    refused("degrees for y and x", "lai.rename(y='lat', x='lon').fifesim.aggregate(30)", "('lat', 'lon')", ".rename"),
    refused("another zone", "fifesim.regress(truth, ndvi.rio.write_crs(26915))", "EPSG:26914", "EPSG:26915"),
    refused("a grid shifted by half a pixel", "fifesim.regress(truth, ndvi.assign_coords(x=ndvi.x + 15))", "706785"),
    refused("cells and pixels", "fifesim.regress(lai, ndvi)", "10 x 10 m", "30 x 30 m"),
    refused("cells and pixels by index", "fifesim.regress(lai, ndvi, pair='index')", "got 10 and 30 m", "aggregate"),
    refused("a map elsewhere", "fifesim.open_lai(plain(lai.values, x0=2e5), grid)", "does not overlap"),
    refused(
        "pixels in another CRS",
        'toa.fifesim.sense("TM", onto=fifesim.grid_at("EPSG:32615", 2e5, 4.33e6, 300, 300, 30))',
        "EPSG:26914",
        "EPSG:32615",
    ),
    refused(
        "pixels beside the scene",
        'toa.fifesim.sense("TM", onto=fifesim.grid_at("EPSG:26914", 2e5, 4.33e6, 300, 300, 30))',
        "onto must overlap the scene",
    ),
    refused("a number for a grid", 'toa.fifesim.sense("TM", onto=30)', "onto", "GeoBox", error=TypeError),
    refused("a shape for a grid", 'fifesim.lai_scene((60, 60), "burned-grazed")', "GeoBox", error=TypeError),
    refused("a window upside down", "fifesim.fife_site(cell=10, window=((10, 0), (0, 10)))", "((10, 0), (0, 10))"),
    refused("a time dimension without times", 'lai.expand_dims(time=2).fifesim.surface_reflectance("TM")', "time"),
    refused("a pixel larger than the scene", "lai.fifesim.aggregate(3000)", "3000 x 3000 m fits", "600 x 600 m"),
    refused("a map finer than the grid", "fifesim.downscale(lai, grid, arp=0.2, seed=7)", "whole number of cells"),
]

TYPES = [
    refused(f"{what} as LAI", f"lai.astype({kind!r}).fifesim.surface_reflectance('TM')", "lai", error=TypeError,
            )
    for what, kind in (
        ("a mask", "bool"),
        ("complex numbers", "complex64"),
        ("dates", "datetime64[s]"),
        ("text", "str"),
        ("objects", "object"),
    )
] + [
    refused("a complex map", "fifesim.open_lai(lai.astype('complex64'), grid)", error=TypeError),
    refused("a mask as elevation", "(dem > 400).fifesim.slope()", "dem", error=TypeError),
    refused("complex NDVI", "fifesim.regress(truth, ndvi.astype('complex64'))", error=TypeError),
    refused("a mask as LAI in a regression", "fifesim.regress(truth > 1, ndvi)", error=TypeError),
    refused("an array without labels", "fifesim.slope(np.ones((60, 60)))", "xarray.DataArray", error=TypeError),
    refused("a masked array", "fifesim.slope(np.ma.masked_less(dem.values, 400))", "filled", error=TypeError),
    refused("a Dataset for a raster", "fifesim.slope(dem.to_dataset())", "dataset['dem']", error=TypeError),
    refused("a path for a raster", 'fifesim.slope("dem.tif")', "open_rasterio", error=TypeError),
    refused("a number as text", 'fifesim.Atmosphere(visibility="23")', "visibility", "'23'", error=TypeError),
    refused("a switch as text", 'toa.fifesim.sense("TM", quantise="no")', "True or False, got 'no'", error=TypeError),
]  # fmt: skip

MISSING = [
    refused("LAI of -9999", 'west(lai, -9999).fifesim.surface_reflectance("TM")', "-9999", "NaN"),
    refused("LAI of 255", 'west(lai, 255).fifesim.surface_reflectance("TM")', "255", "NaN"),
    refused("infinite LAI", 'west(lai, np.inf).fifesim.surface_reflectance("TM")', "inf", "NaN"),
    refused("LAI of -9999 in a mean", "west(lai, -9999).fifesim.aggregate(30)", "-9999", "NaN"),
    refused("LAI of -9999 in a lazy mean", "west(lai.chunk(), -9999).fifesim.aggregate(30).compute()", "-9999", "NaN"),
    refused("infinite LAI in a mean", "west(lai, np.inf).fifesim.aggregate(30)", "inf", "NaN"),
    refused("the truth's -9999 in a regression", "fifesim.regress(west(truth, -9999), ndvi)", "-9999", "NaN"),
    refused("netCDF's fill value", "fifesim.regress(truth, west(ndvi, 9.96921e36))", "9.96921e+36", "NaN"),
    refused("reflectance of -9999", "west(rho, -9999).fifesim.to_toa()", "-9999", ".where(raster != nodata)"),
    refused("reflectance of 255", "west(rho, 255.0).fifesim.ndvi()", "255", ".where(raster != nodata)"),
    right("cells without data", "west(lai, np.nan).fifesim.aggregate(30)", "blocks(west(lai, np.nan).values)"),
    right("dark cells of 0", "west(rho, 0.0).fifesim.ndvi()", "normalized(west(rho, 0.0).values)"),
    right(
        "a map with a declared fill value",
        'west(lai, 255.0).rio.write_nodata(255).rio.to_raster("lai.tif")\nfifesim.open_lai("lai.tif", grid)',
        "west(lai, np.nan).values",
    ),
    refused(
        "a map with an undeclared fill value",
        'west(lai, -9999.0).rio.to_raster("lai.tif")\nfifesim.open_lai("lai.tif", grid)',
        "-9999",
        "NaN",
    ),
    refused("too few pixels", "fifesim.regress(truth[:1, :2], ndvi[:1, :2])", "at least 3 pairs", "got 2"),
    refused("NDVI without data", "fifesim.regress(truth, ndvi * np.nan)", "at least 3 pairs", "got 0"),
    refused("an empty window", "lai[:0].fifesim.fpar()", "no cells", "y: 0"),
]

BANDS = [
    refused("an unknown band", 'lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM9"])', "'TM9'", "TM1, TM2"),
    refused("a band twice", 'lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM3"])', "each once"),
    refused("a band by its number", 'lai.fifesim.surface_reflectance("TM", bands=[3])', "got 3", error=TypeError),
    refused("the thermal band", 'lai.fifesim.surface_reflectance("TM", bands=["TM6"])', "'TM6'"),
    refused("no red band", 'toa.sel(band=["TM4"]).fifesim.ndvi()', "no red band between 0.6 and 0.7 um"),
    refused("no near infrared band", "toa.sel(band=['TM3']).fifesim.ndvi()", "no near infrared band"),
    refused("one band", "toa.isel(band=1).fifesim.ndvi()", "near infrared"),
    refused("no blue band for EVI", 'rho.fifesim.index("EVI")', "no blue band"),
    refused("a misspelt index", 'rho.fifesim.index("NVDI")', "'NVDI'", "NDVI"),
    right("bands in another order", 'toa.sel(band=["TM4", "TM3"]).fifesim.ndvi()', "normalized(toa.values)"),
    right("bands by colour", 'toa.assign_coords(band=["red", "nir"]).fifesim.ndvi()', "normalized(toa.values)"),
    refused("nameless bands", 'toa.drop_vars(["band", "wavelength"]).fifesim.ndvi()', "wavelength", "'red', 'nir'"),
    refused(
        "exchanged wavelengths",
        'paper = fifesim.instrument("TM", "paper")\n'
        'toa.assign_coords(wavelength=("band", [0.838, 0.661])).fifesim.sense(paper).fifesim.ndvi()',
        "TM3",
    ),
    refused("wavelengths of other bands", 'rho.assign_coords(wavelength=("band", [0.83, 0.66])).fifesim.to_toa()',
            "TM3", "0.83", "contradict"),
    refused("an unknown instrument", 'fifesim.instrument("OIL")', "'OIL'", "OLI"),
    refused("a mission for an instrument", 'fifesim.instrument("Landsat")', "'Landsat'", "TM"),
    right("a mission with its number", 'fifesim.instrument("landsat 8").bands[3].wavelength', "0.655", rtol=1e-3),
    refused("bands of another instrument", 'toa.fifesim.sense("OLI")', "no band of OLI responds at 0.838"),
    warned("bands nearly another's", 'toa.fifesim.sense("MSI")', "TM3, TM4 of TM are taken for MSI4, MSI8",
           "adjust_bands"),
    refused("a name that bands lack", 'own(rho.values, band=["B4", "B8"]).fifesim.to_toa(geometry=sun, '
            'instrument="TM", atmosphere=air)', "'B8'", "TM1, TM2"),
    refused("spectra that end before the band", 'own(rho.values, wavelength=("band", [0.66, 0.67])).fifesim.'
            'to_bands("TM")', "0.66 to 0.67", "TM4"),
    refused("leaf optics of one band", 'lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], '
            'canopy=fifesim.Canopy(leaf_optics={"TM3": (0.1, 0.1)}))', "'TM4'"),
    refused("three backgrounds for two bands", 'lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], '
            "canopy=fifesim.Canopy(background=[0.1, 0.2, 0.3]))", "(3,) for 2 bands"),
]  # fmt: skip

DIGITAL_NUMBERS = [
    refused("digital numbers without calibration", "plain(image.values).fifesim.ndvi()", "uint8", "calibrate"),
    refused("digital numbers as float", "own(image.values.astype(float)).fifesim.ndvi()", "calibrate digital numbers"),
    right("whole digital numbers as float", "image.astype(float).fifesim.ndvi()", "normalized(planetary(image))"),
    refused(
        "radiance calibrated by hand",
        "radiance = image * image.gain + image.offset\nradiance.fifesim.ndvi()",
        "digital number",
        expected="normalized(planetary(image))",
    ),
    refused(
        "radiance calibrated by hand, lazy",
        "dn = image.chunk()\nradiance = dn * dn.gain + dn.offset\nradiance.fifesim.ndvi().compute()",
        "digital number",
        expected="normalized(planetary(image))",
    ),
    refused("digital numbers above 255", '(image.astype("uint16") * 4).fifesim.ndvi()', "digital number"),
    refused("a gain of zero", "image.assign_coords(gain=image.gain * 0).fifesim.ndvi()", "gain must be above 0"),
    refused("a negative gain", "image.assign_coords(gain=-image.gain).fifesim.ndvi()", "gain must be above 0"),
    refused("a gain in mW", "image.assign_coords(gain=image.gain * 1000).fifesim.ndvi()", "gain", "W m-2 sr-1 um-1"),
    refused("a lost gain", 'image.drop_vars(["gain", "offset"]).fifesim.ndvi()', "without a scale", "calibrate"),
    refused("a lost sun", 'image.drop_vars("sza").fifesim.ndvi()', "no sza", "open_image"),
    refused("calibrated twice", "image.fifesim.to_reflectance().fifesim.to_reflectance()", "'1'", "W m-2 sr-1 um-1"),
    refused("calibrated again", 'image.fifesim.calibrate("TM")', "calibration already", "drop_vars"),
    refused("half digital numbers", 'own(image.values + 0.5).fifesim.calibrate("TM", geometry=sun)', "49.5",
            "0 to 255"),
    refused("too large digital numbers", 'own(image.values * np.uint16(4)).fifesim.calibrate("TM", geometry=sun)',
            "0 to 255"),
    refused("reflectance for digital numbers", 'own(rho.values).fifesim.calibrate("TM", geometry=sun)', "0 to 255"),
    refused("a scale of reflectance as that of radiance", 'own(image.values.astype("uint16")).fifesim.calibrate("TM", '
            'geometry=sun, gain=2.75e-5, offset=-0.2)', "reflectance of", "TM3"),
    refused("a gain per nm", 'own(image.values).fifesim.calibrate("TM", geometry=sun, gain=8e-4, offset=-1e-3)',
            "radiance in this unit"),
    refused("a gain alone", 'own(image.values).fifesim.calibrate("TM", geometry=sun, gain=0.8)', "gain and offset"),
    refused("calibration without a sun", 'own(image.values).fifesim.calibrate("TM")', "sun", "time="),
    right(
        "saturated digital numbers",
        'full = own(np.where(image.values > 60, 255, image.values).astype("uint8"))\n'
        'full.fifesim.calibrate("TM", geometry=sun).fifesim.to_reflectance().isnull().values',
        "image.values > 60",
    ),
    refused("a regression on digital numbers", 'fifesim.regress(truth, image.sel(band="TM4"))', "digital numbers",
            "to_reflectance"),
    refused("a mean of digital numbers", "image.fifesim.aggregate(60)", "0 is no data", "to_reflectance"),
]  # fmt: skip

STEPS = [
    refused("sense before to_toa", 'rho.fifesim.sense("TM")', "surface reflectance", ".fifesim.to_toa"),
    refused("to_toa twice", "toa.fifesim.to_toa()", "top of the atmosphere", ".fifesim.to_surface"),
    refused("to_toa of leaf area", "lai.fifesim.to_toa()", "instrument"),
    refused("to_toa of an image", "image.fifesim.to_toa()", "digital numbers"),
    refused("sense twice", 'image.fifesim.sense("TM")', "digital numbers"),
    refused("correction of surface reflectance", "rho.fifesim.to_surface()", "surface reflectance"),
    refused("correction twice", "toa.fifesim.to_surface().fifesim.to_surface()", "surface reflectance"),
    right(
        "correction of digital numbers", "image.fifesim.to_surface().fifesim.to_toa()", "planetary(image)", rtol=1e-6
    ),
    refused("NDVI of leaf area", "lai.fifesim.ndvi()", "leaf area index"),
    refused("NDVI of NDVI", "ndvi.fifesim.ndvi()", "normalized difference"),
    refused("reflectance for leaf area", 'rho.fifesim.surface_reflectance("TM")', "leaf area index is needed"),
    refused("NDVI for leaf area", "ndvi.fifesim.fpar()", "leaf area index is needed"),
    refused("another view of TOA reflectance", 'toa.fifesim.as_seen_by("TM")', "to_surface"),
    refused(
        "another air below", "rho.fifesim.to_toa(fifesim.Atmosphere(visibility=10))", "visibility=45", "visibility=10"
    ),
    refused(
        "the wrong air above",
        "toa.fifesim.to_surface(fifesim.Atmosphere(visibility=10))",
        "visibility=10 km",
        "assume=True",
    ),
    refused("a composite of one date", "toa.fifesim.composite()", "time", "xarray.concat"),
    right(
        "a composite in a file",
        'days = pd.to_datetime(["1987-06-06", "1987-07-06"])\n'
        'season = xr.concat([toa, toa * 0.5], xr.DataArray(days, dims="time", name="time"))\n'
        'season.fifesim.composite().to_netcdf("season.nc")\n'
        'xr.open_dataset("season.nc")["toa_reflectance"]',
        "toa.values",
        rtol=1e-5,
    ),
    refused("a misspelt method", "lai.fifesim.nvdi()", "'nvdi'", "'ndvi'", error=AttributeError),
    refused("a misspelt function", "fifesim.surface_reflectence(lai)", "'surface_reflectance'", error=AttributeError),
    refused("a misspelt argument", 'lai.fifesim.surface_reflectance("TM", band="TM3")', "'bands'", error=TypeError),
]

AIR = [
    refused("too thick a haze", "fifesim.Atmosphere(visibility=2)", "5 to 100 km, got 2"),
    refused("too thick a haze, suggested", "fifesim.Atmosphere(visibility=2)", "got 2", unsaid="type visibility=5"),
    refused("negative visibility", "fifesim.Atmosphere(visibility=-1)", "5 to 100 km, got -1"),
    refused("aerosol of the desert", 'fifesim.Atmosphere(aerosol="desert")', "'desert'", "dust"),
    refused("aerosol of the desert, suggested", 'fifesim.Atmosphere(aerosol="desert")', "'desert'",
            unsaid="='maritime'"),
    refused("dust, suggested", 'fifesim.Atmosphere(aerosol="dust")', "'dust'", unsaid="='urban'"),
    refused("a standard profile", 'fifesim.Atmosphere(profile="standard")', "'standard'", "us-1962"),
    refused("a standard profile, suggested", 'fifesim.Atmosphere(profile="standard")', "'standard'",
            unsaid="='tropical'"),
    refused("haze said twice", "fifesim.Atmosphere(visibility=23, aot=0.3)", "visibility or aot, not both", "0.2347"),
    refused("optical thickness of 3", "fifesim.Atmosphere(aot=3)", "0 to 2", "got 3"),
    refused("a mixture in percent", 'fifesim.Atmosphere(aerosol="dust:50+soot:50")', "add up to 1, got 100"),
    refused("an unknown engine", 'fifesim.Atmosphere(engine="6SV")', "'6SV'", "6S"),
    refused("a number for the air", "rho.fifesim.to_toa(23)", "fifesim.Atmosphere, got 23", error=TypeError),
    refused("a word for the air", 'rho.fifesim.to_toa("clear")', "fifesim.Atmosphere, got 'clear'", error=TypeError),
    warned("no air over an own map", "own(rho.values).fifesim.to_toa(geometry=sun, instrument='TM')",
           "the atmosphere over"),
    refused("no sun over an own map", "own(rho.values).fifesim.to_toa(air, instrument='TM')", "position of the sun"),
    refused("surroundings in percent", "rho.fifesim.to_toa(adjacency=True, surroundings=30)", "0 to 1", "30"),
    refused("surroundings without adjacency", "rho.fifesim.to_toa(surroundings=0.3)", "adjacency=True"),
]  # fmt: skip

CANOPY = [
    refused("chlorophyll ten times too high", "fifesim.Leaf(chlorophyll=400)", "[0, 200] ug cm-2, got 400"),
    refused("leaf water in mg", "fifesim.Leaf(water=12)", "[0, 0.2] cm, got 12"),
    refused("dry matter in g m-2", "fifesim.Leaf(dry_matter=90)", "[0, 0.1] g cm-2, got 90"),
    refused("negative leaf water", "fifesim.Leaf(water=-0.01)", "got -0.01"),
    refused("a misspelt content", "fifesim.Leaf(clorophyll=40)", "'clorophyll'", "'chlorophyll'", error=TypeError),
    refused("leaves that shine", 'canopy(leaf_optics={"TM3": (0.7, 0.6)})', "more than 1, got 1.3"),
    refused("leaf reflectance in percent", 'canopy(leaf_optics={"TM3": (7, 4)})', "[0, 1], got 7", "percent"),
    refused("background in percent", "canopy(background=15)", "[0, 1], got 15", "percent"),
    refused("soils that sum to 1.4", 'canopy(background={"soil_dry": 0.7, "soil_wet": 0.7})', "add up to 1, got 1.4"),
    refused("a misspelt soil", 'canopy(background={"soil_dri": 1})', "soil_dri"),
    refused("dead leaves in percent", "canopy(brown=30)", "brown must be in [0, 1], got 30"),
    refused("too many dead leaves", "canopy(brown=1.5)", "brown must be in [0, 1], got 1.5"),
    refused("crowns in percent", "canopy(crown_cover=40)", "crown_cover must be in [0, 1], got 40"),
    refused("hardly any crowns", "canopy(crown_cover=0.01)", "lai / crown_cover", "219"),
    refused("leaf size in mm", "canopy(hotspot=50)", "hotspot must be in [0, 10], got 50"),
    refused("a negative hot spot", "canopy(hotspot=-1)", "got -1"),
    refused("misspelt leaf angles", 'canopy(leaf_angles="spheric")', "'spheric'", "'spherical'"),
    refused("one leaf angle", "canopy(leaf_angles=57)", "got 57", "campbell(57)", error=TypeError),
    refused("soil brightness in percent", "canopy(soil=30)", "[-1, 1], got 30"),
    refused("moisture in percent", "canopy(moisture=30)", "[0, 1], got 30"),
    refused("an absorbed share in percent", "lai.fifesim.fpar(fpar_inf=94)", "(0, 1], got 94"),
    right("bare soil", "(lai * 0).fifesim.surface_reflectance('TM', bands=['TM3'], "
          "canopy=fifesim.Canopy(background=0.15))", "np.full((1, 60, 60), 0.15)"),
    refused("dead leaves of no canopy", 'lai.fifesim.surface_reflectance("TM", brown=0.3)',
            "type canopy=fifesim.Canopy(brown=...)", error=TypeError),
    refused("dead leaves of a setup", "fifesim.Setup(brown=0.3)", "type canopy=fifesim.Canopy(brown=...)",
            error=TypeError),
    refused("a mapping for a canopy", 'lai.fifesim.surface_reflectance("TM", canopy={"brown": 0.3})',
            "fifesim.Canopy(brown=0.2)", "got a dict", error=TypeError),
    refused("a misspelt property of a canopy", "fifesim.Canopy(bron=0.3)", "'bron'", "'brown'", error=TypeError),
    warned("tallgrass elsewhere", 'own_lai().fifesim.surface_reflectance("TM", atmosphere=air, geometry=sun)', "leaf"),
    refused("NDVI as a map of LAI", "fifesim.open_lai(ndvi, grid)", "ndvi"),
    refused("FPAR as a map of LAI", "fifesim.open_lai(lai.fifesim.fpar(), grid)", "fpar"),
    right(
        "leaf spectra in a file",
        'pd.DataFrame({"wavelength": [0.4, 2.5], "reflectance": 0.1, "transmittance": 0.05}).to_csv("leaf.csv")\n'
        'canopy(leaf_optics="leaf.csv")',
        'canopy(leaf_optics={"TM3": (0.1, 0.05)}).values',
    ),
]  # fmt: skip

LANDSCAPES = [
    refused(
        "shares that sum to 1.1", 'fifesim.Patches("voronoi", 300, {"grass": 0.6, "wood": 0.5})', "sum to 1, got 1.1"
    ),
    refused("shares in percent", 'fifesim.Patches("voronoi", 300, [60, 40])', "[0, 1], got 60"),
    refused("a misspelt pattern", 'fifesim.Patches("voronnoi", 300)', "voronoi", "'voronnoi'"),
    refused(
        "a code without a class",
        'codes = (lai * 0 + 5).astype("int16")\n'
        'fifesim.landscape(grid, cover=codes, classes=[fifesim.CoverClass("grass", lai=1.0, code=1)], seed=7)',
        "codes without a class: 5",
    ),
    refused("a map without classes", "fifesim.landscape(grid, cover=lai, seed=7)", "classes="),
    refused("arp of 0.3", 'fifesim.lai_scene(grid, "burned-grazed", arp=0.3, seed=7)', "[0, 0.25), got 0.3"),
    refused("arp in percent", 'fifesim.lai_scene(grid, "burned-grazed", arp=15, seed=7)', "[0, 0.25), got 15"),
    refused("a seed as text", 'fifesim.lai_scene(grid, seed="7")', "whole number", "got '7'", error=TypeError),
    refused("a fractional seed", "fifesim.lai_scene(grid, seed=7.5)", "whole number", "got 7.5", error=TypeError),
    refused("a negative seed", "fifesim.lai_scene(grid, seed=-7)", "whole number", "got -7"),
    refused("a misspelt treatment", 'fifesim.lai_scene(grid, "burned-graze")', "'burned-graze'", "'burned-grazed'"),
    refused("a number for a distribution", "fifesim.lai_scene(grid, 2.5)", "distribution", "2.5", error=TypeError),
    refused(
        "samples of LAI in tenths",
        'pd.DataFrame({"lai": range(10, 350, 10)}).to_csv("lai.csv", index=False)\n'
        'fifesim.lai_scene(grid, "lai.csv", seed=7)',
        "lai",
    ),
    refused(
        "samples with text",
        'pd.DataFrame({"lai": ["2,5", "x", *np.linspace(0.5, 3.5, 30)]}).to_csv("lai.csv", index=False)\n'
        'fifesim.lai_scene(grid, "lai.csv", seed=7)',
        "lai.csv",
    ),
    refused("LAI of a class of 50", 'fifesim.CoverClass("grass", lai=50)', "class 'grass'", "50"),
    refused(
        "dead leaves of a class in percent",
        'fifesim.CoverClass("grass", canopy=fifesim.Canopy(brown=3))',
        "[0, 1], got 3",
    ),
    refused(
        "dead leaves of no canopy of a class",
        'fifesim.CoverClass("grass", brown=0.3)',
        "type canopy=fifesim.Canopy(brown=...)",
        error=TypeError,
    ),
    refused("a drawn mean in percent", "fifesim.Field(mean=30, sd=1)", "mean must be in [-1, 1], got 30"),
    refused("a correlation of 5", 'fifesim.landscape(grid, dem=dem, covary={"wetness": 5}, seed=7)', "[-1, 1], got 5"),
    refused("a correlation without a DEM", 'fifesim.landscape(grid, covary={"wetness": 0.5}, seed=7)', "give dem="),
    refused("variation in percent", "fine(cv=40)", "cv", "got 40"),
    warned("variation that is not reached", "fine(cv=0.4, arp=0.24)", "0.4"),
]

ANALYSIS = [
    refused("constant NDVI", "fifesim.regress(truth, ndvi * 0 + 0.5)", "all 400 values of x are 0.5"),
    refused("a regression on several bands", "fifesim.regress(truth, toa)", "select one band"),
    refused("a regression on a regression", "fifesim.regress(truth, fit)", "x must be", error=TypeError),
    refused("a misspelt pairing", "fifesim.regress(truth, ndvi, pair='place')", "'place'", "'coordinates'"),
    right(
        "a line of NDVI on LAI",
        "fifesim.regress(ndvi, truth).slope",
        "np.polyfit(truth.values.ravel(), ndvi.values.ravel(), 1)[0]",
    ),
    refused("a line with exchanged arguments", "ndvi.fifesim.invert(fifesim.regress(ndvi, truth))", "exchange"),
    refused("a line applied to LAI", "truth.fifesim.invert(fit)", "leaf_area_index", "normalized_difference"),
    refused("a line of LAI taken for FPAR", 'ndvi.fifesim.invert(fit, "fpar")', "leaf_area_index"),
    refused("truth and NDVI in an error", "fifesim.inversion_error(truth, ndvi)", "same quantity"),
    refused("pixels of another quantity", "truth.fifesim.share_kept(ndvi)", "same quantity", "leaf_area_index"),
    refused("pixels and cells exchanged", "lai.fifesim.share_kept(truth)", "got 10 and 30 m", "exchange"),
    right(
        "LAI below 0 from a line",
        "(ndvi * 0 + 0.05).fifesim.invert(fit).lai.fillna(0).min()",
        "0.0",
    ),
    right(
        "NDVI times 100 in a line",
        "(ndvi * 100).fifesim.invert(fit).lai.fillna(0).max() <= 100",
        "True",
    ),
    refused("an increment below 0", "truth.fifesim.relative_equivalent_noise(ndvi, -0.1)", "positive, got -0.1"),
    refused("a negative extinction", "lai.fifesim.fpar_bias(extinction=-0.5)", "extinction must be positive, got -0.5"),
    refused("a negative bandwidth", "lai.fifesim.density(bandwidth=-1)", "positive, got -1"),
]

SENSORS = [
    refused(
        "noise that the instrument lacks",
        'toa.fifesim.sense("TM", noise=["fixed-pattern"])',
        "no fixed-pattern noise for TM3",
    ),
    refused("an unknown noise", 'toa.fifesim.sense("TM", noise=["gaussian"])', "gaussian", "shot, thermal"),
    refused("noise as a switch", 'toa.fifesim.sense("TM", noise=True)', "noise", "got True", error=TypeError),
    refused(
        "noise that the instrument lacks, compared",
        'fifesim.compare(lai, ["L4TM"], fifesim.Setup(noise=("shot", "thermal")))',
        "shot",
    ),
    refused("a negative interval", 'toa.fifesim.sense("TM", interval=-30)', "positive metres", "got -30"),
    refused("one number for an offset", 'toa.fifesim.sense("TM", offset=0.5)', "offset must be two", "got 0.5"),
    refused("an instrument twice", 'fifesim.compare(lai, ["TM", "TM"])', "different names"),
    refused("a negative radiance", 'fifesim.snr("MSI", "MSI4", -10)', "must not be negative, got -10"),
    refused("altitude in km", 'camera(altitude="705.0")', "interval", "radians"),
    refused("pixel in km, in a file", 'camera(gsd="0.03")', "gsd = 0.03", "multiply by 1000"),
    refused("wavelength in nm, in a file", 'camera(center="668", width="10")', "668", "nm", "divide by 1000"),
    refused("a missing key", 'camera(bits="")', "bits", "missing"),
    refused("an unknown key", 'camera(more="snrr = 200")', "snrr", "'snr'"),
    refused("48 bits", 'camera(bits="48")', "bits = 48", "at most 16"),
    refused("a negative SNR", 'camera(snr="-200")', "snr", "-200"),
    refused("no instrument file", 'fifesim.read_instrument("TM.toml")', "TM.toml", error=FileNotFoundError),
]

FILES = [
    refused(
        "a file that is there",
        'lai.fifesim.to_geotiff("lai.tif")\nlai.fifesim.to_geotiff("lai.tif")',
        "overwrite=True",
        error=FileExistsError,
    ),
    refused("a missing folder", 'lai.fifesim.to_geotiff("out/lai.tif")', "no folder 'out'", error=FileNotFoundError),
    right(
        "a GeoTIFF with another extension",
        'lai.fifesim.to_geotiff("lai.png")\nfifesim.open_lai("lai.png", grid)',
        "lai.values",
        rtol=1e-6,
    ),
    refused("a missing file", 'fifesim.open_image("image.tif")', "image.tif", "no raster file is there"),
    refused("a text file", 'Path("image.tif").write_text("hello")\nfifesim.open_image("image.tif")', "'hello'"),
    refused("no product", 'fifesim.open_landsat("LC08_MTL.txt")', "no file or folder LC08_MTL.txt"),
    refused("no tile", 'fifesim.open_sentinel2("S2A.SAFE")', "no file or folder S2A.SAFE"),
    right(
        "an image opened again",
        'image.fifesim.to_geotiff("a.tif")\nfifesim.open_image("a.tif").fifesim.ndvi()',
        "normalized(planetary(image))",
    ),
    refused(
        "an image opened by rioxarray",
        'image.fifesim.to_geotiff("a.tif")\nrioxarray.open_rasterio("a.tif").fifesim.ndvi()',
        "fifesim.open_image",
    ),
    refused(
        "radiance of rioxarray",
        'image.fifesim.to_geotiff("a.tif")\nrioxarray.open_rasterio("a.tif", mask_and_scale=True).fifesim.ndvi()',
    ),
    refused(
        "bands in another order in the file",
        'image.fifesim.to_geotiff("a.tif")\ntranslate("a.tif", "b.tif", bands=[2, 1])\n'
        'fifesim.open_image("b.tif").fifesim.ndvi()',
        expected="normalized(planetary(image))",
    ),
    right(
        "one band of the file",
        'image.fifesim.to_geotiff("a.tif")\ntranslate("a.tif", "b.tif", bands=[2])\n'
        'fifesim.open_image("b.tif").fifesim.to_reflectance().squeeze().values',
        "planetary(image)[1]",
    ),
    refused(
        "a file of radiance",
        'image.fifesim.to_geotiff("a.tif")\ntranslate("a.tif", "b.tif", bands=[1, 2], unscale=True)\n'
        'fifesim.open_image("b.tif").fifesim.ndvi()',
        expected="normalized(planetary(image))",
    ),
    refused(
        "digital numbers as LAI", 'image.fifesim.to_geotiff("a.tif")\nfifesim.open_lai("a.tif", grid)', "at most 20"
    ),
    refused("elevation as LAI", 'dem.fifesim.to_geotiff("a.tif")\nfifesim.open_lai("a.tif", grid)', "leaf area index"),
    refused("LAI as elevation", 'lai.fifesim.to_geotiff("a.tif")\nfifesim.fine_dem("a.tif", grid)', "'1'", "metres"),
    refused(
        "an empty table of a background",
        'Path("soil.csv").write_text("")\ncanopy(background="soil.csv")',
        "soil.csv",
    ),
]

SCENARIOS = [
    refused("a misspelt key", 'fifesim.Scenario(grid={"widht": 900})', "grid.widht = 900", "'width'"),
    refused("a misspelt section", 'fifesim.Scenario(terain={"dem": "flat"})', "terain", "'terrain'"),
    refused(
        "two mistakes at once",
        'fifesim.Scenario(grid={"widht": 900}, ground={"arp": 0.3})',
        "grid.widht = 900",
        "ground.arp = 0.3",
    ),
    refused("a wrong unit", 'fifesim.Scenario(grid={"width": "3 miles"})', "'3 miles'", "'km' or 'm' or 'cm'"),
    right("metres for km", 'fifesim.Scenario(atmosphere={"visibility": "23000 m"}).atmosphere.visibility', "23.0"),
    refused("a word for a number", 'fifesim.Scenario(ground={"arp": "large"})', "arp = 'large'"),
    refused("text for a list", 'fifesim.Scenario(sensor={"bands": "TM3"})', "sensor.bands = 'TM3'", "list"),
    refused("crowns that are too few", 'simulate(ground={"crown_cover": 0.01})["image"].compute()', "crown_cover"),
    refused("a pixel in km, in a scenario", 'simulate(sensor={"pixel": 0.03})', "0.03", "metres, not km"),
    warned("a sun in radians, in a scenario", 'simulate(geometry={"sza": 0.5, "saa": 2.0})', "sza=0.5", "radians"),
    refused("half a sun", 'fifesim.Scenario(geometry={"sza": 30})', "sza and saa go together"),
    refused("leaves that shine, in a scenario", 'simulate(ground={"leaf_reflectance": {"TM2": 0.1, "TM3": 0.7, '
            '"TM4": 0.4}, "leaf_transmittance": {"TM2": 0.1, "TM3": 0.6, "TM4": 0.4}})', "got 1.3"),
    refused("a DEM that is not there", 'simulate(terrain={"dem": "dem.tif"})', "dem.tif"),
    refused("a name for a scenario", 'fifesim.simulate("mine.toml")', "read_scenario", error=TypeError),
    refused("no scenario file", 'fifesim.read_scenario("mine.toml")', "mine.toml"),
    right(
        "a path relative to the scenario",
        'Path("run").mkdir()\nPath("run/mine.toml").write_text("[ground]\\nlai_file = \'lai.tif\'\\n")\n'
        'fifesim.read_scenario("run/mine.toml").ground.lai_file == str(Path("run/lai.tif").absolute())',
        "True",
    ),
    refused("classes that sum to 1.1", 'fifesim.Scenario(landscape={"cover": "pastures"}, classes={"burned-grazed": '
            '{"share": 0.6}, "burned-ungrazed": {"share": 0.5}})', "sum to 1.1"),
    refused("axes of a sweep by name", 'fifesim.sweep(fifesim.Scenario(), "visibility")', "axes", error=TypeError),
    refused("a misspelt axis", 'fifesim.sweep(fifesim.Scenario(), {"visibilty": [5, 45]})', "'visibility'"),
]  # fmt: skip

STUDIES = [
    refused("a misspelt key to draw", 'study({"visibilty": {"uniform": [5, 60]}})', "'visibilty'", "'visibility'"),
    refused("a misspelt distribution", 'study({"visibility": {"unifrom": [5, 60]}})', "unifrom", "'uniform'"),
    refused("bounds upside down", 'study({"visibility": {"uniform": [60, 5]}})', "got 60 and 5"),
    refused("bounds out of range", 'study({"visibility": {"uniform": [0, 60]}})', "visibility = 0.0", "at least 5"),
    refused("a sun below the horizon", 'study({"sza": {"uniform": [20, 100]}, "saa": {"uniform": [90, 180]}})', "100"),
    refused("a number for a distribution to draw", 'study({"visibility": 23})', "got 23", "uniform"),
    refused("haze drawn twice", 'study({"visibility": {"uniform": [5, 60]}, "aot": {"uniform": [0, 1]}})', "not both"),
    refused("a split in percent", "study(split={'train': 80, 'test': 20})", "sum to 1"),
    refused("a misspelt sequence", "study(sequence='sobool')", "'sobool'", "'sobol'"),
    refused("no chips", "fifesim.dataset(study(), 'chips.zarr', n=0)", "at least 1, got 0"),
    refused(
        "a scenario for a study", "fifesim.dataset(fifesim.Scenario(), 'chips.zarr', n=2)", "Study", error=TypeError
    ),
    refused("a study without a size", "fifesim.Study(fifesim.Scenario(), {})", "grid.width"),
]

MISTAKES = [
    *UNITS, *ELEVATION, *DIRECTIONS, *AXES, *TYPES, *MISSING, *BANDS, *DIGITAL_NUMBERS, *STEPS, *AIR, *CANOPY,
    *LANDSCAPES, *ANALYSIS, *SENSORS, *FILES, *SCENARIOS, *STUDIES,
]  # fmt: skip

# Command lines that end with exit code 2 and write nothing: title, scenario, command, words of the message.
COMMANDS = [
    ("a misspelt key", "[grid]\nwidht = 900\n", "simulate mine.toml -o out", "grid.widht", "'width'"),
    (
        "two mistakes",
        "[grid]\nwidht = 9\n[ground]\narp = 0.3\n",
        "simulate mine.toml -o out",
        "widht",
        "ground.arp = 0.3",
    ),
    ("no TOML", "[grid\nwidth = 900\n", "simulate mine.toml -o out", "mine.toml", "TOML"),
    ("a number with a bare unit", "[grid]\nwidth = 900 m\n", "simulate mine.toml -o out", "mine.toml", "line 2"),
    ("a scenario that is not there", "", "simulate nothing.toml -o out", "nothing.toml"),
    ("an unknown instrument", "", "sensors OIL", "OIL", "OLI"),
    ("an unknown option", "", "simulate mine.toml --ouput out", "--ouput"),
    ("an unknown command", "", "simulat mine.toml", "simulat"),
    ("a study without a table", "[grid]\nwidth = 900\nheight = 900\n", "dataset mine.toml -o out -n 2", "draw"),
    ("a negative number of chips", "", "dataset mine.toml -o out -n -2", "--chips"),
]


def plain(values, crs=26914, x0=7e5, y0=4.33e6, cell=10.0, **coords):
    """Raster as another program makes it, with no attributes but a CRS."""
    rows, columns = values.shape[-2:]
    place = {"y": y0 - cell * (np.arange(rows) + 0.5), "x": x0 + cell * (np.arange(columns) + 0.5)}
    raster = xr.DataArray(values, dims=("band", "y", "x")[-values.ndim :], coords=place | coords)
    return raster if crs is None else raster.rio.write_crs(crs)


def own(values, **coords):
    """Raster of a red and a near infrared band as another program makes it."""
    return plain(np.asarray(values), **(coords or {"band": ["TM3", "TM4"]}))


def west(raster, value):
    """Raster with a value in its four western columns."""
    return raster.where(raster.x > raster.x[3], value)


def normalized(bands):
    """NDVI of a red and a near infrared band by its definition."""
    with np.errstate(invalid="ignore"):
        return (bands[1] - bands[0]) / (bands[1] + bands[0])


def planetary(image):
    """Planetary reflectance of digital numbers by hand [1]."""
    gain, offset, irradiance = (image[name].values[:, None, None] for name in ("gain", "offset", "solar_irradiance"))
    radiance = image.values * gain + offset
    return np.pi * radiance * float(image.earth_sun_distance) ** 2 / (irradiance * np.cos(np.radians(float(image.sza))))


def blocks(values):
    """Means over blocks of 3 x 3 cells; NaN where one is NaN."""
    return values.reshape(20, 3, 20, 3).mean((1, 3))


def sun_of_pvlib(time, latitude, longitude):
    """Solar zenith angle [degree]."""
    return float(pvlib.solarposition.get_solarposition(pd.to_datetime([time]), latitude, longitude)["zenith"].iloc[0])


def polar(longitude, latitude):
    """Easting and northing in EPSG:3413 [m]."""
    (x,), (y,) = rasterio.warp.transform("EPSG:4326", "EPSG:3413", [longitude], [latitude])
    return round(x), round(y)


def polar_slope(x0, y0):
    """Elevation of 60 x 60 cells of 10 m around a place in EPSG:3413 that falls toward true south [m]."""
    step = 10 * (np.arange(60) + 0.5) - 300
    x, y = np.meshgrid(x0 + step, y0 - step)
    # The pole is the origin: true north is toward it.
    return 500 - 0.1 * (np.hypot(x, y) - np.hypot(x0, y0))


def translate(source, target, bands, unscale=False):
    """What ``gdal_translate -b`` makes of a file, with ``-unscale -ot Float32`` too."""
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
    """Instrument from a short file."""
    bits, more = f"bits = {bits}\n" if bits else "", f", {more}" if more else ""
    band = f'name = "red", center = {center}, width = {width}, snr = {snr}, snr_radiance = 100.0{more}'
    text = f'name = "Camera"\naltitude = {altitude}\ngsd = {gsd}\n{bits}bands = [{{ {band} }}]\n'
    Path("camera.toml").write_text(text)
    return fifesim.read_instrument("camera.toml")


def simulate(**sections):
    """Simulation of 300 m x 300 m on level ground."""
    size = {"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}}
    return fifesim.simulate(fifesim.Scenario(**(size | sections)))


def study(draws=None, **how):
    """Study of chips of 300 m x 300 m."""
    scenario = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    return fifesim.Study(scenario, draws or {"visibility": {"uniform": [5, 60]}}, **how)


def canopy(**options):
    """Red reflectance of the leaf area of the scene."""
    own = fifesim.Canopy(**options)
    return shared()["lai"].fifesim.surface_reflectance("TM", bands=["TM3"], canopy=own)


def fine(arp=0.2, **options):
    """Leaf area of the cells of the truth."""
    return fifesim.downscale(shared()["truth"], shared()["grid"], arp=arp, seed=7, **options)


def own_lai():
    """Leaf area as another program makes it."""
    return plain(shared()["lai"].values)


_SHARED = {}


def shared():
    """Landscape, image and NDVI of 60 x 60 cells of 10 m, made once."""
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
    """Names in the code: fresh copies, and an empty working folder."""
    monkeypatch.chdir(tmp_path)
    scene = {name: each.copy(deep=True) if isinstance(each, xr.DataArray) else each for name, each in shared().items()}
    return globals() | scene


def run(code, names):
    """Value of the last line of some code, computed, and the warnings."""
    *lines, last = ast.parse(code).body
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        exec(compile(ast.Module(lines, []), "<user>", "exec"), names)
        value = eval(compile(ast.Expression(last.value), "<user>", "eval"), names)
        value = value.compute() if hasattr(value, "compute") else value
    return value, [str(each.message) for each in caught if issubclass(each.category, UserWarning)]


def check_value(found, mistake, names):
    """Compare what the code gave with the value that is right."""
    np.testing.assert_allclose(np.asarray(found), eval(mistake.expected, names), rtol=mistake.rtol, equal_nan=True)


def check_error(error, mistake):
    """The error is one of fifesim, short, and says the words."""
    text, last = str(error), traceback.extract_tb(error.__traceback__)[-1].filename
    assert isinstance(error, mistake.error), f"{type(error).__name__}: {text}"
    assert last.startswith(PACKAGE) and len(text) <= 600, f"{last}: {text}"
    assert [word for word in mistake.words if word not in text] == [], text
    assert not (mistake.unsaid and mistake.unsaid in text), text


@pytest.mark.parametrize(
    "mistake",
    [pytest.param(each, id=each.title.replace(" ", "-")) for each in MISTAKES],
)
def test_a_mistake_is_not_a_silent_wrong_result(mistake, names):
    try:
        found, told = run(mistake.code, names)
    except Exception as error:
        if mistake.error is None:
            raise
        check_error(error, mistake)
        return
    if mistake.warning:
        assert any(all(word in text for word in mistake.words) for text in told), told
    elif mistake.expected:
        check_value(found, mistake, names)
    else:
        pytest.fail(f"no error, but {found!r:.200}")


@pytest.mark.parametrize(("title", "scenario", "command", "words"), [(*each[:3], each[3:]) for each in COMMANDS])
def test_a_mistake_on_the_command_line_ends_with_2_and_writes_nothing(title, scenario, command, words, names):
    Path("mine.toml").write_text(scenario)
    done = CliRunner().invoke(app, shlex.split(command))
    assert done.exit_code == 2, done.output
    assert [word for word in words if word not in done.output] == [], done.output
    assert "Traceback" not in done.output and [path.name for path in Path().iterdir()] == ["mine.toml"]


def test_the_list_is_long_and_each_title_is_its_own():
    titles = [each.title for each in MISTAKES]
    assert len(titles) + len(COMMANDS) >= 100 and len(set(titles)) == len(titles)
