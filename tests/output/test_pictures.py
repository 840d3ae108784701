"""Contents, colours, coordinates and titles of pictures."""

import dask.array as da
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.grids import grid as grids


@pytest.fixture(autouse=True)
def close_figures():
    matplotlib.use("agg")
    yield
    plt.close("all")


def drawn_artist(axes):
    return (axes.images or axes.collections)[0]


def test_image_is_drawn_in_colour_at_its_coordinates(whole):
    axes = whole["image"].fifesim.plot(composite=("TM4", "TM3", "TM3"))
    box = grids.geobox(whole["image"]).boundingbox
    np.testing.assert_allclose(drawn_artist(axes).get_extent(), [box.left, box.right, box.bottom, box.top])
    assert axes.get_xlabel() == "Easting [m]" and axes.get_aspect() == 1
    colours = whole["image"].fifesim.rgb(("TM4", "TM3", "TM3"))
    found = np.isfinite(colours.values)
    np.testing.assert_array_equal(np.asarray(drawn_artist(axes).get_array()[..., :3])[found], colours.values[found])
    assert axes.get_title().startswith("TM4, TM3, TM3 as red, green, blue\nLandsat-5 Thematic Mapper")
    assert "earth_sun_distance" not in axes.get_title()


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


def test_quantity_has_a_colour_map_and_a_bar_with_its_unit(whole):
    axes = whole["lai"].fifesim.plot(stretch=(0, 100))
    picture = drawn_artist(axes)
    assert picture.get_cmap().name == "YlGn"
    assert picture.get_clim() == (float(whole["lai"].min()), float(whole["lai"].max()))
    assert axes.figure.axes[1].get_ylabel() == "LAI [m² m⁻²]"
    factor = (whole["lai"] * 0 + 1.0).rename("kt")
    factor[0, 0], factor[0, 1] = 0.9, 1.3
    picture = drawn_artist(factor.fifesim.plot(stretch=(0, 100)))
    assert picture.get_cmap().name == "RdBu_r" and picture.get_clim() == pytest.approx((0.7, 1.3))
    picture = drawn_artist(factor.fifesim.plot(cmap="magma", limits=(0, 2)))
    assert picture.get_cmap().name == "magma" and picture.get_clim() == (0, 2)


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


def test_rasters_that_are_no_maps_are_rejected(whole):
    with pytest.raises(ValueError, match=r"there is no band 'TM1': the raster has TM3, TM4"):
        whole["image"].fifesim.plot(band="TM1")
    with pytest.raises(ValueError, match=r"a map has dimensions \(\[band\], y, x\)"):
        whole["image"].expand_dims("scene").fifesim.plot()


def test_fit_is_drawn_with_its_pixels(whole):
    fit = fifesim.regress(whole["truth"], whole["ndvi"])
    axes = fit.plot(whole["truth"], whole["ndvi"])
    assert axes.get_xlabel() == "Normalized difference vegetation index"
    assert axes.get_ylabel() == "Leaf area index [m² m⁻²]"
    x, y = axes.lines[0].get_data()
    np.testing.assert_allclose(y, fit.predict(x))
    values = whole["ndvi"].values
    assert (x[0], x[-1]) == (np.nanmin(values), np.nanmax(values))
    assert f"n = {fit.n}" in axes.get_title() and "R² = " in axes.get_title()
    pixels = axes.collections[0].get_array()
    assert pixels.sum() == fit.n


def test_fit_without_rasters_is_a_line_centred_on_the_mean(whole):
    fit = fifesim.regress(whole["truth"], whole["ndvi"])
    axes = fit.plot(level=0.9)
    x, _ = axes.lines[0].get_data()
    assert x.mean() == pytest.approx(fit.x_mean)
    assert axes.get_legend().get_texts()[0].get_text() == "90 % prediction interval"
    with pytest.raises(ValueError, match="give both rasters or none"):
        fit.plot(whole["truth"])


def test_instruments_are_compared_with_common_colours(lai):
    images = fifesim.compare(lai, ["MSI", "TM"])
    figure = images.fifesim.plot_comparison()
    panels = [axes for axes in figure.axes if axes.images]
    assert [axes.get_title().split(",")[0] for axes in panels] == ["MSI", "TM"]
    assert panels[0].images[0].get_clim() == panels[1].images[0].get_clim()
    mean = float(images["TM"]["dn"].fifesim.ndvi().mean())
    assert f"mean {mean:.3f}" in panels[1].get_title() and "30 m" in panels[1].get_title()
    with pytest.raises(ValueError, match="no image has a red and a near infrared band"):
        xr.DataTree.from_dict({"/TM": images["TM/dn"].isel(band=[0]).to_dataset()}).fifesim.plot_comparison()


def make_scores(spread, seed=3):
    """Scores by class of estimates whose intervals are too narrow by the factor `spread`."""
    rng = np.random.default_rng(seed)
    truth = xr.DataArray(rng.normal(size=(8, 400)), dims=("landscape", "pixel"), name="lai")
    guess = truth + rng.normal(0, 0.5, truth.shape)
    level = xr.DataArray([0.5, 0.9], dims="level")
    half = spread * 0.5 * xr.DataArray([0.674, 1.645], dims="level")
    estimate = {"lai": guess, "lai_low": guess - half, "lai_high": guess + half, "lai_sd": 0 * guess + spread * 0.5}
    classes = xr.DataArray(np.arange(400) % 2, dims="pixel", name="cover")
    return fifesim.score(xr.Dataset(estimate, {"level": level}), truth, by=classes)


def test_scores_are_drawn_by_group_with_error_bars():
    scores = make_scores(0.5)
    figure = fifesim.output.plot_score(scores)
    coverage, pit = figure.axes
    drawn_artist = [container[0] for container in coverage.containers]
    assert len(drawn_artist) == 2
    for at, line in enumerate(drawn_artist):
        assert np.array_equal(line.get_xdata(), [0.5, 0.9])
        assert np.array_equal(line.get_ydata(), scores.coverage.isel(cover=at))
    bars = coverage.containers[0][2][0].get_segments()
    lengths = [bar[1, 1] - bar[0, 1] for bar in bars]
    assert lengths == pytest.approx(4 * scores.coverage_se.isel(cover=0).values)
    assert [patch.get_data().values.tolist() for patch in pit.patches] == scores.pit.values.tolist()
    assert list(pit.lines[0].get_ydata()) == [1, 1]
    assert [text.get_text() for text in coverage.get_legend().get_texts()] == ["cover 0", "cover 1"]
    # The coverage of intervals that are too narrow lies below the nominal level.
    assert (scores.coverage < scores.level).all()


def test_scores_that_cannot_be_drawn_are_rejected():
    with pytest.raises(ValueError, match="neither coverage nor pit"):
        fifesim.output.plot_score(make_scores(1.0)[["rmse"]])
    with pytest.raises(ValueError, match="select one"):
        fifesim.output.plot_score(xr.concat([make_scores(1.0)] * 2, "product"))
