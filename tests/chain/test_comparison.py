"""Simulation of one scene for many instruments."""

import warnings
from dataclasses import replace

import dask
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute

import fifesim
from fifesim.grids import grid as grids
from fifesim.sensor.description.spectral_response import ResponseList

NAMES = ["TM", "OLI", "MSI"]


def test_images_equal_the_chain(lai):
    images = fifesim.compare(lai, ["TM", "OLI"])
    assert isinstance(images, xr.DataTree) and list(images.children) == ["TM", "OLI"]
    rho = fifesim.surface_reflectance(lai, "TM", bands=["TM3", "TM4"])
    xr.testing.assert_identical(images["TM"]["dn"], rho.fifesim.to_toa().fifesim.sense("TM"))
    oli = images["OLI"]["dn"]
    names = ["OLI4", "OLI5"]
    assert oli.dtype == np.uint16 and oli["band"].values.tolist() == names
    rho = fifesim.surface_reflectance(lai, "OLI", bands=names)
    xr.testing.assert_identical(oli, rho.fifesim.to_toa().fifesim.sense("OLI"))


def test_all_images_are_computed_in_one_pass(lai):
    """The result is lazy and identical to separate runs, and each chunk of the scene is read once."""
    reads = []

    def read(block):
        reads.append(block.shape)
        return block

    with no_compute():
        scene = in_chunks(lai, {"y": 23, "x": 27})
        scene = scene.copy(data=scene.data.map_blocks(read, meta=np.empty((0, 0))))
        images = fifesim.compare(scene, NAMES)
    arrays = dask.compute(*(images[name]["dn"] for name in NAMES), scheduler="synchronous")
    assert len(reads) == 4
    for name, array in zip(NAMES, arrays, strict=True):
        xr.testing.assert_identical(array, fifesim.compare(lai, [name])[name]["dn"])


def test_bands_and_options_reach_the_instruments(lai):
    leaf = {"TM2": (0.16, 0.12), "TM5": (0.28, 0.31)} | dict.fromkeys(("OLI4", "OLI5"), (0.3, 0.3))
    canopy = fifesim.Canopy(background=0.2, leaf_optics=leaf)
    setup = fifesim.Setup(interval=(20.0, 25.0), quantise=False, canopy=canopy)
    images = fifesim.compare(lai, ["TM", "OLI"], setup, bands={"TM": ["TM2", "TM5"]})
    assert images["TM"]["toa_radiance"]["band"].values.tolist() == ["TM2", "TM5"]
    for name in ("TM", "OLI"):
        assert grids.cell_size(grids.geobox(images[name]["toa_radiance"])) == (20.0, 25.0)


@pytest.mark.parametrize(
    ("instruments", "options", "message"),
    [
        ([], {}, "one or more different names, got none"),
        (["TM"], {"bands": {"OLI": ["B4"]}}, "OLI, which is not compared"),
        (["TM", "MT"], {}, "MT"),
    ],
)
def test_invalid_comparison_is_rejected(lai, instruments, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.compare(lai, instruments, **options)


def test_band_beyond_the_spectra_is_named(lai):
    tm = fifesim.instrument("TM")
    far = replace(tm.bands[0], name="far", srf=ResponseList((2.4, 2.5, 2.6), (0.0, 1.0, 0.0)))
    with pytest.raises(
        ValueError, match=r"spectrum for band far, 2\.4 to 2\.6 um: .*give leaf_optics= and background="
    ):
        fifesim.compare(lai, [replace(tm, bands=(*tm.bands, far))], bands={"TM": ["far"]})


def test_resolutions_are_separate_nodes(lai):
    images = fifesim.compare(lai, ["MSI", "TM"], bands={"MSI": ["MSI4", "MSI11"]})
    assert sorted(node.path for node in images.leaves) == ["/MSI/10m", "/MSI/20m", "/TM"]
    assert images["MSI/20m/dn"]["band"].values.tolist() == ["MSI11"]


def test_table_has_one_row_per_instrument(lai):
    images = fifesim.compare(in_chunks(lai, {"y": 23, "x": 27}), ["MSI", "TM"])
    table = images.fifesim.comparison_table(truth=lai)
    assert table.index.tolist() == ["MSI", "TM"] and table.index.name == "instrument"
    assert table.loc["TM", "bands"] == "TM3, TM4" and table["pixel"].tolist() == [10.0, 30.0]
    assert (table.loc["TM", "rows"], table.loc["TM", "columns"]) == (5, 6)
    ndvi = images["TM"]["dn"].fifesim.ndvi().compute()
    assert table.loc["TM", "ndvi_mean"] == pytest.approx(float(ndvi.mean()), rel=1e-14)
    assert table.loc["TM", "ndvi_sd"] == pytest.approx(float(ndvi.std(ddof=1)), rel=1e-14)
    fit = fifesim.regress(lai.fifesim.aggregate(30), ndvi)
    found = table.loc["TM", ["slope", "intercept", "r2", "n"]]
    np.testing.assert_allclose(found.astype(float), [fit.slope, fit.intercept, fit.r2, fit.n], rtol=1e-10)
    assert "r2" not in images.fifesim.comparison_table()


def test_pixel_sizes_of_an_instrument_have_separate_rows(lai):
    """NDVI is missing without a red and a near infrared band."""
    image = fifesim.compare(lai, ["TM"])["TM"]
    tree = xr.DataTree.from_dict({"/TM/30m": image.to_dataset(), "/TM/red": image["dn"].isel(band=[0]).to_dataset()})
    table = tree.fifesim.comparison_table()
    assert table.index.tolist() == ["TM/30m", "TM/red"]
    assert np.isnan(table.loc["TM/red", "ndvi_mean"]) and table.loc["TM/red", "bands"] == "TM3"


def test_table_of_other_trees_is_rejected(lai):
    with pytest.raises(ValueError, match="TM has no dn or toa_radiance, but lai"):
        xr.DataTree.from_dict({"/TM": lai.to_dataset(name="lai")}).fifesim.comparison_table()


def test_comparison_of_a_landscape_equals_the_chain(site):
    land = fifesim.landscape(site, seed=3, soil=fifesim.ground.Field(sd=0.03))
    images = land.fifesim.compare(["TM", "MSI"])
    rho = land.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    xr.testing.assert_equal(images["TM"]["dn"], rho.fifesim.to_toa().fifesim.sense("TM"))
    assert list(images.children) == ["TM", "MSI"]


# Instruments with measured blur, with assumed blur, and with unknown blur (only the detector is known).
MIXED = ["MSI", "OLI", "SuperDove"]


@pytest.fixture(scope="module")
def mixed():
    """Images, and the warning about their blur alone."""
    grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    with pytest.warns(UserWarning, match=r"blur in-flight \(MSI\), assumed \(OLI\), unknown \(SuperDove\)") as caught:
        images = fifesim.compare(fifesim.lai_scene(grid, seed=7), MIXED)
    assert not any("noise" in str(each.message) for each in caught)
    return images


def test_different_origins_of_noise_are_a_warning():
    lai = fifesim.lai_scene(fifesim.fife_site(30), seed=7)
    with pytest.warns(UserWarning, match=r"noise pre-launch \(MSI, OLI\), required \(MODIS\)"):
        fifesim.compare(lai, ["MSI", "OLI", "MODIS"], fifesim.Setup(noise="all"))


def test_equal_origins_are_no_warning(lai):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fifesim.compare(lai, ["MSI", "MSI-C", "TM"])
    assert [str(each.message) for each in caught if issubclass(each.category, UserWarning)] == []


def test_table_and_plot_state_origins_and_dashes_for_unknown_terms(mixed):
    table = fifesim.sensor.comparison_table(mixed)
    assert table["blur"].to_dict() == {"MSI": "in-flight ± 0.03", "OLI": "assumed ± 0.06", "SuperDove": "–"}
    assert table["geolocation"].to_dict() == {"MSI": "in-flight ± 1 m", "OLI": "in-flight ± 4 m", "SuperDove": "–"}
    assert table.loc["OLI", "noise"] == "pre-launch within a factor of 1.05" and table.loc["SuperDove", "noise"] == "–"
    figure = fifesim.output.plot_comparison(mixed)
    titles = [axes.get_title().splitlines()[-1] for axes in figure.axes[:3]]
    assert titles == ["blur in-flight ± 0.03", "blur assumed ± 0.06", "blur –"]
    plt.close(figure)
