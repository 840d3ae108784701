"""All pictures, styles, reports and pages take words and colours from one table of quantities."""

import dataclasses
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import to_hex

import fifesim
from fifesim.base.bands import colour_composite
from fifesim.experiments.explorer import layer_words
from fifesim.grids import cf
from fifesim.output.colours import (
    axis_label,
    colours_of,
    dark_and_bright,
    long_name,
    percentile_limits,
    short_name,
    stops_of,
    subject,
    unit,
)
from fifesim.output.maps import composite_bands, false_colour_names, value_map
from fifesim.output.report import _statistics, fit_figure
from fifesim.sensor.description.fields import false_colour_bands
from fifesim.sensor.description.instruments import instrument, instrument_names

CLUMPING = cf.Quantity(
    "1", "", "clumping index", "1 for leaves at random", label="clumping", shown_units="m2 m-2", lowest=0.2,
    highest=1.0, colours="magma", middle=0.5, ends=(0.25, None),
)  # fmt: skip


@pytest.fixture
def clumping(monkeypatch, lai):
    """A raster of a quantity that is in the table only during a test."""
    matplotlib.use("agg")
    monkeypatch.setitem(cf.QUANTITIES, "clumping", CLUMPING)
    return cf.label(0.3 + lai / 10, "clumping", history="made")


def test_quantity_words_come_from_the_table(clumping, whole):
    assert clumping.name == "clumping" and clumping.attrs["long_name"] == "clumping index"
    assert (short_name(clumping), unit(clumping), long_name(clumping)) == ("clumping", "[m² m⁻²]", "Clumping index")
    assert axis_label("clumping") == "clumping [m² m⁻²]"
    assert clumping.fifesim.plot().figure.axes[1].get_ylabel() == "clumping [m² m⁻²]"
    image = xr.Dataset({"ndvi": whole["ndvi"]})
    truth = xr.Dataset({"clumping": clumping.fifesim.aggregate(30).rename("clumping")})
    fit = fifesim.regress(truth["clumping"], image["ndvi"])
    axis = fit_figure(image, truth, "clumping", fit).axes[0]
    assert axis.get_ylabel() == "True clumping [m² m⁻²]" and axis.get_ylim()[0] >= CLUMPING.lowest
    assert _statistics(image, truth)[0][0] == "Clumping"
    assert layer_words(["clumping"])["clumping"]["axis"] == "clumping [m² m⁻²]"


def test_quantity_colours_come_from_the_table(clumping, tmp_path):
    magma = [to_hex(colormaps["magma"](share)) for share in np.linspace(0, 1, 9)]
    low, high = percentile_limits(clumping, middle=0.5)
    assert (low + high) / 2 == pytest.approx(0.5) and high > 0.5 > low
    picture = clumping.fifesim.plot().images[0]
    assert picture.get_cmap().name == "magma" and picture.get_clim() == pytest.approx((low, high))
    assert value_map(clumping, "").bar.stops == layer_words(["clumping"])["clumping"]["stops"] == magma
    style = fifesim.output.write_style(clumping.fifesim.to_geotiff(tmp_path / "clumping.tif"))
    shown = list(ElementTree.parse(style).getroot().iter("item"))
    assert [item.get("color") for item in shown] == magma
    ends = [float(shown[end].get("value")) for end in (0, -1)]
    assert ends == pytest.approx([0.25, high], rel=1e-5)


def test_quantities_have_short_name_range_and_colour_map():
    wrong = []
    for name, quantity in cf.QUANTITIES.items():
        raster = cf.label(xr.DataArray(np.zeros((2, 2)), dims=("y", "x")), name, history="")
        lowest = -np.inf if quantity.lowest is None else quantity.lowest
        colours, middle = colours_of(name)
        fits = (
            quantity.label == short_name(raster) and 0 < len(quantity.label) <= 40,
            quantity.highest is None or lowest < quantity.highest,
            len(set(stops_of(colours))) >= 8 and (middle is None or lowest <= middle),
            all(end is None or lowest <= end for end in quantity.ends),
        )
        wrong += [] if all(fits) else [(name, fits)]
    assert wrong == []


def test_rasters_of_a_run_lie_within_the_valid_range(whole, site):
    dem = fifesim.flint_hills(site, seed=1)
    relief = dem.fifesim.slope(), dem.fifesim.aspect(), dem.fifesim.sky_view(), dem.fifesim.horizon()
    checked = set()
    for raster in (*whole.values(), *relief):
        for array in (raster, *raster.coords.values()):
            quantity = cf.QUANTITIES.get(array.name)
            if quantity is not None and (quantity.lowest, quantity.highest) != (None, None):
                checked.add(array.name)
                assert quantity.lowest is None or float(array.min()) >= quantity.lowest, array.name
                assert quantity.highest is None or float(array.max()) <= quantity.highest, array.name
    assert {"lai", "surface_reflectance", "dn", "ndvi", "slope", "aspect", "sky_view", "horizon", "sza"} <= checked


@pytest.mark.parametrize("name", instrument_names())
def test_instruments_images_and_styles_use_the_same_composite_bands(name, lai, tmp_path):
    own = instrument(name)
    bands = false_colour_bands(own)
    wavelengths = [band.wavelength for band in bands]
    image = xr.concat([0.1 + 0.1 * lai[:4, :4]] * len(bands), "band")
    image = image.assign_coords(band=[band.name for band in bands], wavelength=("band", wavelengths))
    image = cf.label(image, "toa_reflectance", history="made")
    *green, red, near = (band.name for band in bands)
    assert composite_bands(image) == [near, red, green[0] if green else red]
    assert false_colour_names(image) == ([near, red, *green] if green else [])
    style = fifesim.output.write_style(image.fifesim.to_geotiff(tmp_path / "image.tif"))
    renderer = ElementTree.parse(style).getroot().find("pipe/rasterrenderer")
    numbers = [int(renderer.get(f"{colour}Band")) - 1 for colour in ("red", "green", "blue")]
    assert numbers == colour_composite(wavelengths)


def test_composite_is_stretched_alike_in_qgis_and_in_a_picture(whole, tmp_path):
    toa = whole["toa"]
    style = fifesim.output.write_style(toa.fifesim.to_geotiff(tmp_path / "toa.tif"))
    renderer = ElementTree.parse(style).getroot().find("pipe/rasterrenderer")
    for colour, band in (("red", "TM4"), ("green", "TM3"), ("blue", "TM3")):
        found = [float(renderer.find(f"{colour}ContrastEnhancement/{end}Value").text) for end in ("min", "max")]
        dark, bright = dark_and_bright(toa.sel(band=band))
        np.testing.assert_allclose(found, (dark, bright), rtol=1e-5)
        values = toa.sel(band=band).values
        expected = np.clip((values - dark) / (bright - dark), 0, 1)
        place = {"red": 0, "green": 1, "blue": 2}[colour]
        np.testing.assert_allclose(toa.fifesim.rgb()[..., place], expected, rtol=0, atol=1e-6)


def test_percentile_limits_ignore_missing_values():
    assert percentile_limits([np.nan, 1.0, 3.0, np.inf], (0, 100)) == (1.0, 3.0)
    assert percentile_limits(np.full(3, np.nan)) == (0.0, 1.0)
    values = np.arange(101.0)
    assert percentile_limits(xr.DataArray(values)) == (1.0, 99.0)
    assert dataclasses.replace(CLUMPING, label="").label == "clumping index"


@pytest.mark.parametrize(
    ("name", "units", "said"),
    [
        ("toa_radiance", "W m-2 sr-1 um-1", "[W m⁻² sr⁻¹ µm⁻¹]"),
        ("dem", "m", "[m]"),
        ("lai", "1", "[m² m⁻²]"),
        ("ndvi", "1", ""),
        ("wavelength", "um", "[µm]"),
        (None, None, ""),
    ],
)
def test_units_are_typeset(name, units, said):
    assert unit(xr.DataArray(0.0, name=name, attrs={} if units is None else {"units": units})) == said


def test_quantities_have_a_short_and_a_long_name(whole):
    assert short_name(whole["image"]) == "digital number" and short_name(whole["ndvi"]) == "NDVI"
    assert long_name(whole["ndvi"]) == "Normalized difference vegetation index"
    assert long_name(whole["image"].sel(band="TM3")) == "TM3: digital number"
    assert long_name(xr.DataArray(0.0, name="my_field")) == "My field" and long_name(xr.DataArray(0.0)) == "Values"


def test_subject_names_instrument_date_and_location(whole):
    said = subject(whole["image"].assign_coords(time=np.datetime64("1987-06-06T16:35", "ns")))
    assert said == "Landsat-5 Thematic Mapper, 6 June 1987, 39.13° N, 96.62° W"
    own = whole["lai"].assign_attrs(instrument="mine").drop_vars("time", errors="ignore")
    assert subject(own) == "mine, 39.13° N, 96.62° W"
    south = fifesim.grid_at("EPSG:32734", 300000.0, 6200000.0, 300.0, 300.0, 30.0)
    assert subject(fifesim.lai_scene(south, "burned-grazed", seed=1)).endswith("34.32° S, 18.83° E")
    assert subject(xr.DataArray(np.zeros(3))) == ""
