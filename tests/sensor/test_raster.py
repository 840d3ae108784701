"""The sensor on labelled rasters."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_place, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.base.footprints import axis_operator, regularize
from fifesim.base.geometry import Geometry
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.spatial_response import GaussianResponse
from fifesim.sensor.response import calibration

TM = instrument("TM")
RED_NIR = TM.select(["TM3", "TM4"])
SUN = Geometry(40.0, 120.0, earth_sun_distance=1.0148)


def scene(grid, bands=("TM3", "TM4"), **coords):
    """Reflectance at the top of the atmosphere, different in each cell."""
    values = np.random.default_rng(2).uniform(0.02, 0.5, (len(bands), *grid.shape))
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": list(bands)} | coords, name="toa_reflectance")
    return directions.with_geometry(grids.place(array, grid), SUN)


@pytest.fixture
def toa(site):
    return scene(site)


def radiance_by_kernels(toa, pixels):
    """Footprints, then radiance, called directly."""
    cells = grids.geobox(toa)
    rows, columns = (
        axis_operator(
            TM.line_spread, cell_origin=origin, cell_size=cell, n_cells=n, pixel_origin=start, pixel_size=size,
            n_pixels=count,
        )
        for origin, cell, n, start, size, count in (
            (cells.affine.f, cells.affine.e, cells.shape.y, pixels.affine.f, pixels.affine.e, pixels.shape.y),
            (cells.affine.c, cells.affine.a, cells.shape.x, pixels.affine.c, pixels.affine.a, pixels.shape.x),
        )
    )  # fmt: skip
    means = regularize(toa.values, rows, columns)
    sun = np.array([band.solar_irradiance for band in RED_NIR])[:, None, None]
    return calibration.reflectance_to_radiance(means, sun, SUN.mu_s, SUN.earth_sun_distance)


ONTO = {
    "aligned": None,
    "offset": fifesim.grid_at("EPSG:26914", 705581.3, 4333911.9, 110.0, 95.0, 30.0),
    "own-interval": fifesim.grid_at("EPSG:26914", 705571.0, 4333919.0, 150.0, 130.0, 30.315),
    "beyond-the-scene": fifesim.grid_at("EPSG:26914", 705520.0, 4333960.0, 300.0, 300.0, 30.0),
}


@pytest.mark.parametrize("onto", ONTO.values(), ids=ONTO.keys())
def test_sense_keeps_its_word_and_equals_the_kernels(toa, site, onto):
    image = check_raster_function(lambda toa: fifesim.sense(toa, "TM", onto=onto), toa, quantity="dn")
    pixels = grids.aligned_grid(site, 30.0) if onto is None else onto
    assert grids.same_grid(grids.geobox(image), pixels)
    gain, offset = calibration.gain_offset(
        [band.full_scale_radiance for band in RED_NIR], [band.min_radiance for band in RED_NIR], 8
    )
    radiance = radiance_by_kernels(toa, pixels)
    dn = calibration.radiance_to_dn(radiance, gain[:, None, None], offset[:, None, None], bits=8)
    np.testing.assert_array_equal(image, dn)
    assert image.dtype == np.uint8
    assert (image > 0).any()
    # Half a count, and the rounding of a division.
    half = 0.5 * gain[:, None, None] * (1 + 1e-9)
    inside = (image.values > 1) & (image.values < 255)
    assert (np.abs(fifesim.to_radiance(image).values - radiance) <= half)[inside].all()


def test_image_carries_its_calibration(toa):
    image = fifesim.sense(toa, "TM")
    for name in ("gain", "offset", "wavelength", "solar_irradiance"):
        assert image[name].dims == ("band",)
        assert cf.attributes(name).items() <= image[name].attrs.items()
    assert image["solar_irradiance"].values.tolist() == [band.solar_irradiance for band in RED_NIR]
    assert image.attrs["instrument"] == "TM"
    assert image.attrs["_FillValue"] == 0 and image.attrs["_FillValue"].dtype == image.dtype
    assert directions.geometry_of(image) == SUN


def test_pixels_over_a_hole_are_no_data(toa):
    toa[0, 20:26, 20:26] = np.nan
    paper = instrument("TM", "paper")
    image = fifesim.sense(toa, paper)
    assert (image.sel(band="TM3") == 0).sum() == 1
    assert (image.sel(band="TM4") > 0).all()
    assert (fifesim.sense(toa, paper, min_valid=0.3) > 0).all()


def test_radiance_and_reflectance_keep_their_word(toa):
    image = fifesim.sense(toa.where(toa["x"] > 705640), "TM")
    radiance = check_raster_function(fifesim.to_radiance, image, quantity="toa_radiance")
    reflectance = check_raster_function(fifesim.to_reflectance, image, quantity="toa_reflectance")
    gain, offset, sun = (image[name].values[:, None, None] for name in ("gain", "offset", "solar_irradiance"))
    expected = calibration.dn_to_radiance(image.values, gain, offset)
    np.testing.assert_array_equal(radiance, expected)
    np.testing.assert_array_equal(
        reflectance, calibration.radiance_to_reflectance(expected, sun, SUN.mu_s, SUN.earth_sun_distance)
    )
    assert (image == 0).any()
    np.testing.assert_array_equal(np.isnan(radiance), image == 0)
    np.testing.assert_array_equal(fifesim.to_reflectance(radiance), reflectance)


def test_reflectance_is_within_half_a_count(toa, site):
    image = fifesim.sense(toa, "TM")
    exact = calibration.radiance_to_reflectance(
        radiance_by_kernels(toa, grids.aligned_grid(site, 30.0)),
        image["solar_irradiance"].values[:, None, None],
        SUN.mu_s,
        SUN.earth_sun_distance,
    )
    count = fifesim.to_reflectance(image.copy(data=np.full_like(image, 2))) - fifesim.to_reflectance(
        image.copy(data=np.full_like(image, 1))
    )
    inside = (image.values > 1) & (image.values < 255)
    error = np.abs(fifesim.to_reflectance(image).values - exact)
    assert (error <= 0.5 * count.values * (1 + 1e-9))[inside].all()


def test_radiance_is_sensed_as_it_is(toa, site):
    """A raster in radiance gives the image that its reflectance gives, but for rounding at the halves."""
    sun = np.array([band.solar_irradiance for band in RED_NIR])[:, None, None]
    radiance = toa.copy(data=calibration.reflectance_to_radiance(toa.values, sun, SUN.mu_s, SUN.earth_sun_distance))
    radiance.attrs = {"units": "W m-2 sr-1 um-1"}
    difference = fifesim.sense(radiance, "TM").astype(int) - fifesim.sense(toa, "TM").astype(int)
    assert (difference == 0).mean() > 0.99 and np.abs(difference).max() <= 1


def test_bands_are_found_by_name_or_wavelength(site):
    named = fifesim.sense(scene(site, ("tm4", "TM3")), "TM")
    assert named["band"].values.tolist() == ["TM4", "TM3"]
    by_wavelength = scene(site, (1, 2), wavelength=("band", [0.66, 0.83]))
    image = fifesim.sense(by_wavelength, "TM")
    assert image["band"].values.tolist() == ["TM3", "TM4"]
    np.testing.assert_array_equal(image, fifesim.sense(scene(site), "TM"))


def test_one_band_without_the_dimension_is_an_image_of_one_band(toa):
    one = fifesim.sense(toa.sel(band="TM3"), "TM")
    assert one.dims == ("band", "y", "x")
    np.testing.assert_array_equal(one, fifesim.sense(toa, "TM").sel(band=["TM3"]))


@pytest.mark.parametrize(
    "change, options, message",
    [
        (lambda toa: toa.assign_attrs(units="K"), {}, "units 'K', toa_reflectance needs '1' or 'W m-2 sr-1 um-1'"),
        (lambda toa: toa.assign_coords(band=["TM3", "TM9"]), {}, "TM9.*TM"),
        (lambda toa: toa.drop_vars("band"), {}, "neither names of TM.*nor a wavelength"),
        (lambda toa: toa.assign_coords(band=[1, 2], wavelength=("band", [0.66, 1.2])), {}, r"responds at 1\.2 um"),
        (lambda toa: toa, {"instrument": "MT"}, "MT"),
        (lambda toa: toa, {"instrument": instrument("TM", "paper"), "min_valid": 98}, "min_valid must be in"),
        (lambda toa: toa, {"onto": fifesim.grid_at("EPSG:32614", 0, 0, 60, 60, 30)}, "CRS of the scene"),
    ],
)
def test_what_cannot_be_sensed_is_refused(toa, change, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.sense(change(toa), **({"instrument": "TM"} | options))


def test_onto_must_be_a_grid(toa):
    with pytest.raises(TypeError, match="GeoBox"):
        fifesim.sense(toa, "TM", onto=30)


def test_image_without_calibration_is_refused(toa):
    image = fifesim.sense(toa, "TM")
    with pytest.raises(ValueError, match=r"no gain: open it with fifesim\.open_image"):
        fifesim.to_radiance(image.drop_vars("gain"))
    with pytest.raises(ValueError, match="no sza or no solar_irradiance"):
        fifesim.to_reflectance(image.drop_vars("sza"))
    with pytest.raises(ValueError, match="toa_radiance needs"):
        fifesim.to_reflectance(toa.assign_attrs(units="1"))


def test_geometry_given_wins(toa):
    low = Geometry(60.0, 120.0)
    image = fifesim.sense(toa, "TM", geometry=low)
    assert directions.geometry_of(image) == low
    assert image.astype(int).sum() < fifesim.sense(toa, "TM").astype(int).sum()


def test_two_lazy_scenes_share_nothing_but_their_bits(toa):
    with no_compute():
        image = fifesim.sense(in_chunks(toa, ODD_CHUNKS), "TM")
        check_place(image, grids.geobox(toa).crs)
    xr.testing.assert_identical(image[:, :3].compute(), fifesim.sense(toa, "TM")[:, :3])


@pytest.mark.slow
def test_blur_decides_what_a_line_on_ndvi_explains():
    """Sentinel-2 with the detector alone, with a quarter at the Nyquist frequency, and as it was measured."""
    grid = fifesim.fife_site(10 / 9, window=((0, 1800), (0, 1800)))
    msi = instrument("MSI")
    quarter = GaussianResponse(kind="gaussian", mtf_at_nyquist=0.25)
    soft = replace(msi, lsf=quarter, bands=tuple(replace(band, lsf=None) for band in msi.bands))
    known = {0.05: (0.964, 0.650, 0.66), 0.15: (0.980, 0.722, 0.73), 0.24: (0.980, 0.860, 0.87)}
    for arp, expected in known.items():
        lai = fifesim.lai_scene(grid, arp=arp, seed=1)
        toa = lai.fifesim.surface_reflectance("MSI", bands=["MSI4", "MSI8"]).fifesim.to_toa()
        images = (toa.fifesim.sense(each) for each in (instrument("MSI", "detector"), soft, msi))
        found = [fifesim.regress(lai.fifesim.aggregate(10), image.fifesim.ndvi()).r2 for image in images]
        np.testing.assert_allclose(found, expected, rtol=0, atol=0.02)


class TestSeveralResolutions:
    """All bands of MSI and OLI: a tree with a node for each size of pixels."""

    @pytest.fixture
    def toa(self, site):
        values = np.random.default_rng(4).uniform(0.05, 0.4, (3, *site.shape))
        array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": ["MSI11", "MSI4", "MSI8"]})
        return directions.with_geometry(grids.place(array, site), SUN)

    def test_each_band_lies_on_its_own_grid(self, toa):
        noise = {"noise": "thermal", "seed": 3, "noise_models": fifesim.NoiseModel(thermal=2.0, shot=0.01)}
        tree = fifesim.sense(toa, "MSI", **noise)
        assert [node.path for node in tree.leaves] == ["/10m", "/20m"]
        for path, names in (("10m", ["MSI4", "MSI8"]), ("20m", ["MSI11"])):
            alone = fifesim.sense(toa.sel(band=names), "MSI", **noise)
            xr.testing.assert_identical(tree[path]["dn"], alone)
            assert grids.cell_size(grids.geobox(tree[path]["dn"]))[0] == float(path.removesuffix("m"))

    def test_one_resolution_and_one_grid_for_all_stay_arrays(self, toa, site):
        assert isinstance(fifesim.sense(toa.sel(band=["MSI4", "MSI8"]), "MSI"), xr.DataArray)
        for where in ({"interval": 20.0}, {"onto": grids.aligned_grid(site, 30.0)}):
            assert fifesim.sense(toa, "MSI", **where)["band"].values.tolist() == ["MSI11", "MSI4", "MSI8"]

    def test_native_intervals_and_radiance(self, toa):
        tree = fifesim.sense(toa, "MSI", interval="native", quantise=False)
        assert all(set(node.data_vars) == {"toa_radiance"} for node in tree.leaves) and len(tree.leaves) == 2

    def test_stays_lazy(self, toa):
        with no_compute():
            lazy = fifesim.sense(in_chunks(toa, ODD_CHUNKS), "MSI")
        xr.testing.assert_identical(lazy.compute(), fifesim.sense(toa, "MSI"))

    def test_a_file_is_one_node(self, toa, tmp_path):
        tree = fifesim.sense(toa, "MSI")
        with pytest.raises(TypeError, match=r"got an xarray.DataTree of 10m, 20m: take one of its arrays, such as"):
            fifesim.to_geotiff(tree, tmp_path / "image.tif")
        path = fifesim.to_geotiff(tree["10m/dn"], tmp_path / "image_10m.tif")
        np.testing.assert_array_equal(fifesim.open_image(path), tree["10m/dn"])


@pytest.mark.parametrize("crs", ["EPSG:26915", "+proj=tmerc +lon_0=-96.3 +x_0=500000 +datum=NAD83 +units=m"])
def test_pixels_in_another_crs_are_one_line(toa, crs):
    box = toa.odc.geobox.boundingbox
    other = fifesim.grid_at(crs, box.left, box.top, 90, 90, 30)
    with pytest.raises(
        ValueError,
        match=r"onto must be in the CRS of the scene, EPSG:26914, got .*: make it there",
    ) as e:
        fifesim.sense(toa, "TM", onto=other)
    assert "\n" not in str(e.value) and len(str(e.value)) < 300
