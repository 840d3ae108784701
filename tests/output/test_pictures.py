"""Contents, coordinates and titles of pictures, whose words and colours come from one table of quantities."""

import dataclasses
from xml.etree import ElementTree

import dask.array as da
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import to_hex

import fifesim
from fifesim.experiments.explorer import layer_words
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.output.colours import axis_label, long_name, percentile_limits, short_name, subject, unit
from fifesim.output.maps import value_map


@pytest.fixture(autouse=True)
def close_figures():
    matplotlib.use("agg")
    yield
    plt.close("all")


def drawn_artist(axes):
    return (axes.images or axes.collections)[0]


def test_image_is_drawn_in_colour_at_its_coordinates(whole):
    axes, colours = whole["image"].fifesim.plot(), whole["image"].fifesim.rgb()
    box, found = grids.geobox(whole["image"]).boundingbox, np.isfinite(colours.values)
    np.testing.assert_allclose(drawn_artist(axes).get_extent(), [box.left, box.right, box.bottom, box.top])
    assert axes.get_xlabel() == "Easting [m]" and axes.get_aspect() == 1
    np.testing.assert_array_equal(np.asarray(drawn_artist(axes).get_array()[..., :3])[found], colours.values[found])
    assert axes.get_title().startswith("TM4, TM3, TM3 as red, green, blue\nLandsat-5 Thematic Mapper")


def test_no_data_is_transparent(whole):
    image = whole["image"].copy(deep=True)
    image[0, 1, 2] = 0
    alpha = np.asarray(drawn_artist(image.fifesim.plot()).get_array())[..., 3]
    valid = (image != 0).all("band").values
    assert alpha[1, 2] == 0 and not valid[1, 2]
    np.testing.assert_array_equal(alpha, valid)
    one = np.ma.getmaskarray(drawn_artist(image.fifesim.plot(band="TM3")).get_array())
    assert one[1, 2]
    np.testing.assert_array_equal(one, (image.sel(band="TM3") == 0).values)


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
    assert layer_words(["clumping"])["clumping"]["axis"] == "clumping [m² m⁻²]"
    assert dataclasses.replace(CLUMPING, label="").label == "clumping index"
    assert unit(xr.DataArray(0.0, attrs={"units": "W m-2 sr-1 um-1"})) == "[W m⁻² sr⁻¹ µm⁻¹]"
    assert unit(whole["ndvi"]) == unit(xr.DataArray(0.0)) == ""
    assert short_name(whole["image"]) == "digital number" and short_name(whole["ndvi"]) == "NDVI"
    assert long_name(whole["image"].sel(band="TM3")) == "TM3: digital number"
    assert long_name(xr.DataArray(0.0, name="my_field")) == "My field" and long_name(xr.DataArray(0.0)) == "Values"


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


def test_percentile_limits_ignore_missing_values():
    assert percentile_limits([np.nan, 1.0, 3.0, np.inf], (0, 100)) == (1.0, 3.0)
    assert percentile_limits(np.full(3, np.nan)) == (0.0, 1.0)
    assert percentile_limits(xr.DataArray(np.arange(101.0))) == (1.0, 99.0)


def test_subject_names_instrument_date_and_location(whole):
    said = subject(whole["image"].assign_coords(time=np.datetime64("1987-06-06T16:35", "ns")))
    assert said == "Landsat-5 Thematic Mapper, 6 June 1987, 39.13° N, 96.62° W"
    south = fifesim.grid_at("EPSG:32734", 300000.0, 6200000.0, 300.0, 300.0, 30.0)
    assert subject(fifesim.lai_scene(south, "burned-grazed", seed=1)).endswith("34.32° S, 18.83° E")
    assert subject(xr.DataArray(np.zeros(3))) == ""


def test_colours_of_a_factor_are_centred_on_one_unless_given(whole):
    factor = (whole["lai"] * 0 + 1.0).rename("kt")
    factor[0, 0], factor[0, 1] = 0.9, 1.3
    picture = drawn_artist(factor.fifesim.plot(stretch=(0, 100)))
    assert picture.get_cmap().name == "RdBu_r" and picture.get_clim() == pytest.approx((0.7, 1.3))
    picture = drawn_artist(factor.fifesim.plot(cmap="magma", limits=(0, 2)))
    assert picture.get_cmap().name == "magma" and picture.get_clim() == (0, 2)
    # The colour bar has an arrow where values lie beyond its ends.
    for limits, arrows in (((0, 2), "neither"), ((0.95, 2), "min"), ((0.9, 1.3), "neither"), ((0, 1), "max")):
        assert drawn_artist(factor.fifesim.plot(limits=limits)).colorbar.extend == arrows


def test_given_axes_and_kilometres(whole):
    figure, axes = plt.subplots()
    large = whole["lai"].isel(y=slice(2), x=slice(2)).drop_attrs()
    large = grids.place(large, fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, 8000.0, 8000.0, 4000.0))
    assert large.fifesim.plot(axes=axes) is axes and len(figure.axes) == 2
    assert axes.get_ylabel() == "Northing [km]"
    np.testing.assert_allclose(drawn_artist(axes).get_extent(), [705, 713, 4326, 4334])


def test_large_lazy_scene_is_not_loaded_whole():
    """The picture reads a 60 km scene in 3 m cells chunk by chunk."""
    grid = fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, 60000.0, 60000.0, 3.0)
    held = []

    def make(block_info=None):
        held.append(block_info[None]["chunk-shape"])
        return np.full(held[-1], 0.5, np.float32)

    cells = da.map_blocks(make, chunks=((4000,) * 5, (4000,) * 5), dtype=np.float32, meta=np.empty((0, 0), np.float32))
    scene = grids.place(xr.DataArray(cells, dims=("y", "x"), name="ndvi"), grid)
    picture = drawn_artist(scene.fifesim.plot(size=100))
    assert picture.get_array().shape == (100, 100)
    # Each block of 200 cells is shown by one cell next to its middle, half a cell off.
    np.testing.assert_allclose(picture.get_extent(), [705, 765, 4274, 4334], rtol=0, atol=1.6e-3)
    assert len(held) == 25


def test_scan_is_drawn_at_its_pixel_locations(site):
    lai = fifesim.lai_scene(site, "burned-grazed", seed=7)
    image = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"]).fifesim.to_toa()
    image = image.fifesim.sense_swath("TM", heading=193.6)
    for axes in (image.fifesim.plot(), image.fifesim.ndvi().fifesim.plot()):
        corners = drawn_artist(axes).get_coordinates()
        sweeps = len(np.unique(image["sweep"]))
        assert sweeps > 1
        assert corners.shape == (image.sizes["line"] + sweeps, image.sizes["sample"] + 1, 2)
        # Mesh rows lie on the scan lines, with an empty row between two sweeps.
        middles = corners[:-1, :-1] + corners[:-1, 1:] + corners[1:, :-1] + corners[1:, 1:]
        values = np.ma.getdata(drawn_artist(axes).get_array())
        empty = values[..., -1] == 0 if values.ndim > 2 else np.isnan(values)
        between = np.flatnonzero(np.diff(image["sweep"])) + np.arange(1, sweeps)
        assert empty[between].all() and not empty.all(axis=1)[between - 1].any()
        for k, name in enumerate("xy"):
            lines = np.delete(middles[..., k] / 4, between, axis=0)
            np.testing.assert_allclose(lines, image[name], rtol=0, atol=0.02)


def test_scan_with_only_latitude_and_longitude_is_drawn_in_degrees():
    line, sample = np.mgrid[0:4, 0:5]
    places = {"latitude": (("line", "sample"), 60 - line * 0.01), "longitude": (("line", "sample"), 9 + sample * 0.02)}
    axes = xr.DataArray(line + 0.0, dims=("line", "sample"), coords=places, name="ndvi").fifesim.plot()
    assert axes.get_ylabel() == "Latitude [°]" and axes.get_aspect() == pytest.approx(2, rel=1e-2)
    np.testing.assert_allclose(drawn_artist(axes).get_coordinates()[0, 0], [8.99, 60.005])


def test_fit_is_drawn_with_its_pixels_or_as_a_line_centred_on_the_mean(whole):
    fit, values = fifesim.regress(whole["truth"], whole["ndvi"]), whole["ndvi"].values
    axes = fit.plot(whole["truth"], whole["ndvi"])
    x, y = axes.lines[0].get_data()
    np.testing.assert_allclose(y, fit.predict(x))
    assert (x[0], x[-1]) == (np.nanmin(values), np.nanmax(values))
    assert axes.collections[0].get_array().sum() == fit.n and f"n = {fit.n}" in axes.get_title()
    assert (axes.get_ylabel(), axes.get_xlabel()) == (
        "Leaf area index [m² m⁻²]", "Normalized difference vegetation index"
    )  # fmt: skip
    axes = fit.plot(level=0.9)
    assert axes.lines[0].get_data()[0].mean() == pytest.approx(fit.x_mean)
    assert axes.get_legend().get_texts()[0].get_text() == "90 % prediction interval"


def test_instruments_are_compared_with_common_colours(lai):
    images = fifesim.compare(lai, ["MSI", "TM"])
    panels = [axes for axes in images.fifesim.plot_comparison().axes if axes.images]
    assert [axes.get_title().split(",")[0] for axes in panels] == ["MSI", "TM"]
    assert panels[0].images[0].get_clim() == panels[1].images[0].get_clim()
    mean = float(images["TM"]["dn"].fifesim.ndvi().mean())
    assert f"mean {mean:.3f}" in panels[1].get_title() and "30 m" in panels[1].get_title()


def test_scores_are_drawn_by_group_with_error_bars():
    """Error bars extend two standard errors to each side."""
    truth = xr.DataArray(np.random.default_rng(3).normal(size=(8, 400)), dims=("landscape", "pixel"), name="lai")
    half, guess = xr.DataArray([0.3, 0.8], {"level": [0.5, 0.9]}, dims="level"), truth.roll(pixel=1)
    estimate = {"lai": guess, "lai_low": guess - half, "lai_high": guess + half, "lai_sd": 0 * guess + 0.5}
    classes = xr.DataArray(np.arange(400) % 2, dims="pixel", name="cover")
    scores = fifesim.score(xr.Dataset(estimate), truth, by=classes)
    coverage, pit = fifesim.output.plot_score(scores).axes
    for at, (line, _, (bars,)) in enumerate(coverage.containers):
        group = scores.isel(cover=at)
        np.testing.assert_array_equal(line.get_xydata(), np.transpose([group.level, group.coverage]))
        lengths = [bar[1, 1] - bar[0, 1] for bar in bars.get_segments()]
        assert lengths == pytest.approx(4 * group.coverage_se.values)
    assert [patch.get_data().values.tolist() for patch in pit.patches] == scores.pit.values.tolist()
    assert list(pit.lines[0].get_ydata()) == [1, 1]
    assert [text.get_text() for text in coverage.get_legend().get_texts()] == ["cover 0", "cover 1"]
