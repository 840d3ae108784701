"""Maps, colour composites and QGIS styles show each value at its location, in the colour given by the colour bar."""

from xml.etree import ElementTree

import dask
import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, in_chunks
from matplotlib import colormaps
from matplotlib.colors import to_rgb

import fifesim
from fifesim.grids import grid as grids
from fifesim.output import maps
from fifesim.output.colours import dark_and_bright


@pytest.fixture(scope="module")
def lai():
    grid = fifesim.fife_site(cell=10.0, window=((0, 30), (0, 60)))
    return fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=1)


@pytest.fixture(scope="module")
def dn(lai):
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM2", "TM3", "TM4"])
    return rho.fifesim.to_toa().fifesim.sense(fifesim.instrument("TM", response="paper")).compute()


def test_map_colours_match_the_colour_bar(lai):
    """The lower limit maps to the first stop, values above the upper limit to the last, and no data to grey."""
    values = lai.copy(data=np.linspace(0.0, 4.0, lai.size).reshape(lai.shape))
    values[5, 5] = np.nan
    found = maps.value_map(values, "leaves", limits=(0.0, 2.0))
    first, last = (np.multiply(to_rgb(found.bar.stops[end]), 255).round().tolist() for end in (0, -1))
    assert found.pixels[0, 0].tolist() == first and found.pixels[-1, -1].tolist() == last
    assert len(set(found.pixels[5, 5])) == 1
    middle = np.array(colormaps["YlGn"](0.5, bytes=True)[:3], int)
    row, column = divmod(int(np.argmin(np.abs(np.nan_to_num(values.values, nan=9) - 1.0))), lai.shape[1])
    assert np.abs(found.pixels[row, column] - middle).max() <= 2
    assert dict((text, place) for place, text in found.bar.ticks)["1.0"] == pytest.approx(50.0)


def test_frame_marks_its_part_of_the_map(lai):
    """The ground is 600 m wide and 300 m high; the frame marks the right half of its lowest 90 m."""
    part = fifesim.grids.grid.geobox(lai[21:, 30:]).boundingbox
    assert maps.value_map(lai, "", frame=part).frame == pytest.approx((50.0, 70.0, 50.0, 30.0))
    assert maps.value_map(lai, "").scale == (pytest.approx(100 / 6), "100 m")
    wide = fifesim.lai_scene(fifesim.fife_site(cell=100.0, window=((0, 5), (0, 40))), "burned-grazed", seed=1)
    assert maps.value_map(wide, "").scale == (pytest.approx(25), "1 km")


def test_leaves_are_red_and_no_data_is_grey(dn):
    """The composite shows near infrared as red, so the pixel with the highest NDVI has the largest share of red."""
    found = maps.image_map(dn, "", maps.stretch_of(dn)).pixels.astype(float)
    ndvi = dn.fifesim.ndvi().values
    red = found[..., 0] - found[..., 1:].mean(axis=-1)
    assert np.corrcoef(red.ravel(), ndvi.ravel())[0, 1] > 0.9
    assert maps.false_colour_names(dn) == ["TM4", "TM3", "TM2"]
    holed = dn.copy()
    holed[1, 2, 3] = 0
    pixels = maps.image_map(holed, "", maps.stretch_of(dn)).pixels
    assert (pixels[2, 3] == 217).all() and (pixels != 217).any(), "no data is grey"


GRID = fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, 1200.0, 900.0, 30.0)

WAVELENGTHS = {"B2": 0.48, "B3": 0.56, "B4": 0.66, "B8": 0.84}


def make_image(bands=tuple(WAVELENGTHS), dtype=float):
    values = np.random.default_rng(4).uniform(1, 200, (len(bands), 30, 40)).astype(dtype)
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": list(bands)})
    array = array.assign_coords(wavelength=("band", [WAVELENGTHS[name] for name in bands]), sza=30.0)
    return grids.place(array, GRID).assign_attrs(instrument="MSI")


def test_colours_are_stretched_between_percentiles():
    array = make_image()
    found = maps.rgb(array, stretch=(10, 80))
    assert found.dims == ("y", "x", "rgb") and found["rgb"].values.tolist() == ["red", "green", "blue"]
    for colour, name in zip(("red", "green", "blue"), ("B8", "B4", "B3"), strict=True):
        band = array.sel(band=name).values
        low, high = np.percentile(band, (10, 80))
        expected = np.clip((band - low) / (high - low), 0, 1)
        np.testing.assert_allclose(found.sel(rgb=colour), expected, rtol=0, atol=1e-7)
    assert found.attrs["long_name"] == "B8, B4, B3 as red, green, blue"
    assert found.rio.crs.to_epsg() == 26914
    # xarray turns scalar coordinates into titles.
    assert not {"sza", "band", "wavelength"} & set(found.coords)


def test_composite_bands_may_be_numbers_or_have_no_contrast_or_data():
    assert maps.composite_bands(make_image(), "natural colour") == ["B4", "B3", "B2"]
    numbered = make_image().assign_coords(band=[2, 3, 4, 8])
    found = maps.rgb(numbered, (8, 4, 3))
    np.testing.assert_array_equal(found, maps.rgb(make_image(), ("B8", "B4", "B3")))
    assert found.attrs["long_name"] == "8, 4, 3 as red, green, blue"
    numbered[3] = 7.0
    assert (maps.rgb(numbered).sel(rgb="red") == 0.5).all()
    array = make_image(dtype=np.uint8)
    array[2, 3, 4] = 0
    found = maps.rgb(array)
    assert found[3, 4].isnull().all() and int(found.isnull().sum()) == 3
    other = array.isel(band=0).assign_attrs(_FillValue=array.values[0, 1, 1])
    assert np.isnan(maps.valid(other).values[1, 1])


def test_colours_of_a_lazy_image_are_lazy_and_identical():
    array = make_image()
    read = []
    lazy = in_chunks(array, CHUNKS)
    lazy = lazy.copy(data=lazy.data.map_blocks(lambda block: read.append(1) or block, meta=np.empty((0, 0, 0))))
    found = maps.rgb(lazy)
    assert found.chunks is not None
    # The stretch limits need one pass over the whole image, which keeps no pixel.
    limits = len(read)
    assert limits == lazy.data.npartitions
    with dask.config.set(scheduler="synchronous"):
        xr.testing.assert_identical(found.compute(), maps.rgb(array))


def test_large_raster_is_thinned_to_the_middle_of_each_block():
    array = xr.DataArray(np.arange(12.0)[:, None] * np.ones(7), dims=("y", "x"))
    assert maps.thinned(array, 12) is array
    few = maps.thinned(array, 4)
    assert few.shape == (4, 2) and few[:, 0].values.tolist() == [1, 4, 7, 10]
    assert maps.thinned(array.rename(y="line", x="sample"), 4).sizes == {"line": 4, "sample": 2}


def read_style(raster, path):
    return ElementTree.parse(maps.write_style(fifesim.to_geotiff(raster, path))).getroot().find("pipe/rasterrenderer")


@pytest.mark.parametrize(
    ("bands", "numbers"),
    [
        (["TM3", "TM4"], "2 1 1"),
        (["TM4", "TM2", "TM3"], "1 3 2"),
        (["TM1", "TM2", "TM3"], "3 2 1"),
        (["TM2", "TM3"], None),
    ],
)
def test_style_selects_bands_by_wavelength(lai, tmp_path, bands, numbers):
    """The style shows false colour if possible, else natural colour, else the first band in grey."""
    renderer = read_style(fifesim.surface_reflectance(lai[:6, :6], bands=bands), tmp_path / "image.tif")
    shown = [renderer.get(name) for name in ("redBand", "greenBand", "blueBand", "grayBand")]
    assert shown == ([*numbers.split(), None] if numbers else [None, None, None, "1"])


def test_style_ramps_and_stretches_span_the_data(small_run, tmp_path):
    """NDVI has a fixed range; no data and images without contrast do not break a stretch."""
    truth, image = (fifesim.open_image(small_run / name) for name in ("truth.tif", "image.tif"))
    with pytest.raises(FileExistsError, match="overwrite=True"):
        maps.write_style(small_run / "image.tif")
    (first, *_, last) = items = list(read_style(truth, tmp_path / "truth.tif").iter("item"))
    assert items == sorted(items, key=lambda item: float(item.get("value")))
    assert (first.get("value"), first.get("color")) == ("0", "#ffffe5")
    assert float(last.get("value")) == pytest.approx(float(np.percentile(truth.sel(band="lai"), 99)), rel=1e-5)
    (first, *_, last) = read_style(image.fifesim.ndvi(), tmp_path / "ndvi.tif").iter("item")
    assert [(each.get("value"), each.get("color")) for each in (first, last)] == [("0", "#440154"), ("1", "#fde725")]
    near = image.sel(band=["TM4"]).copy()
    near[:, :, :15] = 0
    expected = np.percentile(fifesim.sensor.to_radiance(image).sel(band="TM4")[:, 15:], (1, 99))
    for name, raster in (("holed", near), ("flat", near.where(False, 7).astype("uint8"))):
        found = read_style(raster, tmp_path / f"{name}.tif").find("contrastEnhancement")
        assert found.find("algorithm").text == "StretchToMinimumMaximum"
        low, high = (float(found.find(end).text) for end in ("minValue", "maxValue"))
        assert low < high and (name == "flat" or [low, high] == pytest.approx(expected, rel=1e-5))


def test_composite_is_stretched_in_qgis_as_in_a_picture(whole, tmp_path):
    renderer = read_style(whole["toa"], tmp_path / "toa.tif")
    for place, (colour, band) in enumerate((("red", "TM4"), ("green", "TM3"), ("blue", "TM3"))):
        found = [float(renderer.find(f"{colour}ContrastEnhancement/{end}Value").text) for end in ("min", "max")]
        dark, bright = dark_and_bright(whole["toa"].sel(band=band))
        np.testing.assert_allclose(found, (dark, bright), rtol=1e-5)
        expected = np.clip((whole["toa"].sel(band=band).values - dark) / (bright - dark), 0, 1)
        np.testing.assert_allclose(whole["toa"].fifesim.rgb()[..., place], expected, rtol=0, atol=1e-6)
