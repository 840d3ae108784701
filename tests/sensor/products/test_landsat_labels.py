"""Landsat products as images: numbers by hand, labels, and what is missing."""

import shutil

import numpy as np
import products
import pytest
import rasterio
from lazy import check_place, no_compute

import fifesim
from fifesim.atmosphere import engines
from fifesim.grids import cf

KINDS = {"TM": products.TM, "OLI": products.OLI}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """By instrument and level: a folder, and what lies in its files."""
    found = {}
    for name, level in (("TM", 1), ("OLI", 1), ("OLI", 2)):
        folder = tmp_path_factory.mktemp(f"{name}{level}")
        found[name, level] = folder, products.landsat(folder, KINDS[name], level)
    return found


@pytest.fixture
def copy(folders, tmp_path):
    shutil.copytree(folders["TM", 1][0], tmp_path, dirs_exist_ok=True)
    return tmp_path


def by_hand(name, files, sza=None):
    """Reflectance of red and near infrared by the formula of the handbook, in double precision."""
    numbers = {"TM": ("3", "4"), "OLI": ("4", "5")}[name]
    kind = KINDS[name]
    sza = 90 - float(kind["image"]["SUN_ELEVATION"]) if sza is None else sza
    out = []
    for number in numbers:
        *_, gain, offset = kind["bands"][number]
        rho = (gain * files[number].astype(float) + offset) / np.cos(np.radians(sza))
        saturated = files["saturated"] & (1 << (int(number) - 1)) != 0
        rho[(files[number] == 0) | (files[number] == np.iinfo(kind["dtype"]).max) | saturated] = np.nan
        out.append(rho)
    return np.array(out), [f"{name}{number}" for number in numbers]


@pytest.mark.parametrize("name", ["TM", "OLI"])
def test_a_scene_goes_through_to_a_file(folders, name, tmp_path):
    """
    Level 1, the surface, NDVI and a GeoTIFF, each by hand.

    Reflectance has 32 bits twice, at the top of the atmosphere and at the ground: 6e-8 of itself each, the first over
    what the air lets through, half of it or more. Below 1 that is 2e-7; of NDVI, which divides both bands by their sum,
    1e-6 even where that is a tenth.
    """
    folder, files = folders[name, 1]
    toa, bands = by_hand(name, files)
    air = fifesim.Atmosphere(visibility=30.0)
    scene = fifesim.open_landsat(folder / f"{KINDS[name]['product']}_MTL.txt", bands=bands)
    surface = scene.fifesim.to_surface(air)
    responses = tuple(band.response for band in fifesim.instrument(name).select(bands))
    sun = 90 - float(KINDS[name]["image"]["SUN_ELEVATION"]), 0.0, float(KINDS[name]["image"]["SUN_AZIMUTH"])
    expected = products.surface_by_hand(toa, engines.band_terms(air, responses, *sun))
    np.testing.assert_allclose(surface, expected, rtol=0, atol=2e-7)
    red, nir = expected
    ndvi = surface.fifesim.ndvi()
    np.testing.assert_allclose(ndvi, (nir - red) / (nir + red), rtol=0, atol=1e-6)
    with rasterio.open(ndvi.fifesim.to_geotiff(tmp_path / "ndvi.tif")) as source:
        np.testing.assert_array_equal(source.read(1), ndvi)
        assert source.crs.to_string() == KINDS[name]["crs"]
        assert (source.transform.c, source.transform.f) == KINDS[name]["corner"]
    again = fifesim.open_image(surface.fifesim.to_geotiff(tmp_path / "surface.tif"))
    np.testing.assert_array_equal(again, surface)
    times = {"TM": "2011-03-12T19:54:32.695056", "OLI": "2020-12-04T19:02:11.194486"}
    assert again["time"].values == np.datetime64(times[name])


def test_labels_are_those_of_the_packages_own_images(folders):
    folder, files = folders["TM", 1]
    with no_compute():
        scene = fifesim.open_landsat(folder)
    check_place(scene, "EPSG:32609")
    assert (scene.name, scene.dtype, scene.attrs["instrument"]) == ("toa_reflectance", np.float32, "TM")
    assert cf.attributes("toa_reflectance").items() <= scene.attrs.items()
    tm = fifesim.instrument("TM")
    assert scene["band"].values.tolist() == [band.name for band in tm.bands]
    np.testing.assert_array_equal(scene["wavelength"], [band.wavelength for band in tm.bands])
    # Of Landsat 5's band 3 by hand: pi 0.9936974^2 (264 + 1.17) / (0.549637 + 0.002436).
    assert float(scene["solar_irradiance"][2]) == pytest.approx(1490.0, abs=0.1)
    assert [float(scene[name]) for name in ("vza", "vaa")] == [0.0, 0.0]
    assert float(scene["sza"]) == pytest.approx(69.50031513)
    assert float(scene["earth_sun_distance"]) == 0.9936974
    np.testing.assert_array_equal(scene["quality"], files["quality"])
    assert "LT05_L1TP_058014_20110312_20200823_02_T1" in scene.attrs["history"]


@pytest.mark.parametrize("chunks", [None, {"y": 5, "x": 7}])
@pytest.mark.parametrize("angles", ["centre", "pixel"])
def test_any_chunks_give_the_same(folders, chunks, angles):
    folder, _ = folders["OLI", 1]
    expected = fifesim.open_landsat(folder, angles=angles).compute()
    found = fifesim.open_landsat(folder, angles=angles, chunks=chunks)
    assert (found.chunks is None) == (chunks is None)
    assert found.compute().identical(expected)


def test_angles_by_pixel_divide_by_the_sun_of_each(folders):
    folder, files = folders["OLI", 1]
    scene = fifesim.open_landsat(folder, angles="pixel")
    expected, bands = by_hand("OLI", files, np.where(files["SZA"] == 0, np.nan, files["SZA"] / 100.0))
    np.testing.assert_allclose(scene.sel(band=bands), expected, rtol=0, atol=1e-6)
    fill = files["quality"] == 1
    for name in ("sza", "saa", "vza"):
        np.testing.assert_array_equal(scene[name], np.where(fill, np.nan, files[name.upper()] / 100.0))
    # West of the track the azimuth is stored below 0.
    assert float(scene["vaa"][0, -1]) == 285.0
    assert scene["sza"].attrs["units"] == "degree"


def test_a_scene_by_pixel_goes_through(folders, tmp_path):
    folder, _ = folders["OLI", 1]
    scene = fifesim.open_landsat(folder, angles="pixel", bands=["OLI4", "OLI5"])
    ndvi = scene.fifesim.to_surface().fifesim.ndvi()
    centre = fifesim.open_landsat(folder, bands=["OLI4", "OLI5"]).fifesim.to_surface().fifesim.ndvi()
    assert float(abs(ndvi - centre).max()) < 0.05
    with pytest.warns(UserWarning, match="lacks sza"):
        ndvi.fifesim.to_geotiff(tmp_path / "ndvi.tif")


def test_the_panchromatic_band_is_opened_by_name(folders):
    folder, _ = folders["OLI", 1]
    assert "OLI8" not in fifesim.open_landsat(folder)["band"].values
    pan = fifesim.open_landsat(folder, bands="OLI8")
    assert pan.shape == (1, 23, 35) and "quality" not in pan.coords
    assert float(pan["x"][1] - pan["x"][0]) == 15.0
    with pytest.raises(ValueError, match=r"^LC08_\w+_B4\.TIF and LC08_\w+_B8\.TIF have different grids"):
        fifesim.open_landsat(folder, bands=["OLI8", "OLI4"])
    assert "OLI9" in fifesim.open_landsat(folder, bands=["OLI9"])["band"].values


def test_a_scene_is_seen_by_another_instrument(folders):
    """Coordinates over the pixels are not in the way of an image on others."""
    folder, _ = folders["OLI", 1]
    scene = fifesim.open_landsat(folder, bands=["OLI4", "OLI5"])
    modis = fifesim.instrument("MODIS", response="detector")
    image = scene.fifesim.sense(modis, onto=fifesim.grid_at("EPSG:32610", 353700.0, 5374200.0, 540.0, 360.0, 90.0))
    assert image.shape == (2, 4, 6) and "quality" not in image.coords
    assert scene.fifesim.aggregate(90.0).shape == (2, 4, 6)


def test_without_quality_two_files_less_are_needed(copy, folders):
    for path in copy.glob("*_QA_*"):
        path.unlink()
    with pytest.raises(ValueError, match=r"QA_PIXEL\.TIF is missing in .*quality=False"):
        fifesim.open_landsat(copy)
    scene = fifesim.open_landsat(copy, quality=False)
    assert "quality" not in scene.coords
    # The flagged pixel stays.
    assert int(np.isnan(scene.sel(band="TM3")).sum()) == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"bands": "TM6"}, "TM6 is thermal, and reflectance is read"),
        ({"bands": "TM8"}, "unknown band of TM 'TM8'"),
        ({"angles": "mean"}, "angles must be 'centre' or 'pixel', got 'mean'"),
        ({"instrument": "TM5"}, "unknown instrument 'TM5'"),
    ],
)
def test_what_is_not_there_is_refused(copy, options, said):
    with pytest.raises(ValueError, match=said):
        fifesim.open_landsat(copy, **options)


def test_a_missing_band_is_named_with_those_there_are(copy):
    for number in (3, 5, 7):
        (copy / f"LT05_L1TP_058014_20110312_20200823_02_T1_B{number}.TIF").unlink()
    with pytest.raises(ValueError, match=r"B3\.TIF is missing in .*bands=\['TM1', 'TM2', 'TM4'\]"):
        fifesim.open_landsat(copy)
    assert fifesim.open_landsat(copy, bands=["TM1", "TM2", "TM4"]).sizes["band"] == 3
    (copy / "LT05_L1TP_058014_20110312_20200823_02_T1_VZA.TIF").unlink()
    with pytest.raises(ValueError, match=r"VZA\.TIF is missing in .*angles='centre'"):
        fifesim.open_landsat(copy, angles="pixel", bands="TM1")


def test_an_irradiance_that_is_not_said_is_the_instruments(tmp_path):
    groups = products.landsat_groups(products.OLI, level=2)
    del groups["LEVEL1_MIN_MAX_RADIANCE"]
    products.landsat(tmp_path, products.OLI, 2, groups=groups)
    scene = fifesim.open_landsat(tmp_path, bands="OLI4")
    assert float(scene["solar_irradiance"][0]) == 1569.35


def altered(folder, group, **values):
    groups = products.landsat_groups(products.OLI)
    groups[group] |= values
    return products.landsat(folder, products.OLI, groups=groups)


def test_an_off_nadir_view_is_known_by_its_roll_or_by_pixel(tmp_path):
    rolled = {"NADIR_OFFNADIR": "OFFNADIR", "ROLL_ANGLE": "-14.2"}
    altered(tmp_path / "without", "IMAGE_ATTRIBUTES", **rolled)
    with pytest.raises(ValueError, match=r"was acquired off nadir, .*use angles='pixel'"):
        fifesim.open_landsat(tmp_path / "without")
    assert fifesim.open_landsat(tmp_path / "without", angles="pixel")["vza"].ndim == 2
    altered(tmp_path / "with", "IMAGE_ATTRIBUTES", WRS_ROW="036", **rolled)
    scene = fifesim.open_landsat(tmp_path / "with")
    # Descending, to the right: the sensor stands in the east.
    assert float(scene["vza"]) == pytest.approx(15.8, abs=0.1) and 90 < float(scene["vaa"]) < 110


def test_a_product_whose_irradiance_is_impossible_is_refused(tmp_path):
    """A product's own instrument has nearly the same; another one that is given may have any."""
    altered(tmp_path, "LEVEL1_MIN_MAX_RADIANCE", RADIANCE_MAXIMUM_BAND_4="622768.8")
    said = r"LC08_.*: the scale of OLI4 .*RADIANCE_MAXIMUM.* means a solar irradiance of"
    with pytest.raises(ValueError, match=said):
        fifesim.open_landsat(tmp_path)
    assert fifesim.open_landsat(tmp_path, instrument="OLI2").sizes["band"] == 7


def test_an_image_of_one_s_own_opens_as_the_product_that_it_is_written_as(tmp_path):
    """Simulated, digitised as USGS scales Level 1, and read again by its metadata."""
    kind = products.OLI
    grid = fifesim.grid_at(kind["crs"], *kind["corner"], 540.0, 360.0, 30.0)
    rng = np.random.default_rng(3)
    sun = {"sza": 90 - float(kind["image"]["SUN_ELEVATION"]), "saa": 164.9, "vza": 0.0, "vaa": 0.0}
    values = rng.uniform(0.05, 0.5, (2, *grid.shape))
    toa = products.labelled(values, grid, ["OLI4", "OLI5"], sun | {"earth_sun_distance": 0.9854607})
    image = toa.fifesim.sense("OLI", scaling="product", onto=grid)
    products.landsat(tmp_path, kind)
    for name in ("4", "5"):
        path = tmp_path / f"{kind['product']}_B{name}.TIF"
        # GDAL would take the metadata along with what it replaces.
        path.unlink()
        products.write(path, image.sel(band=f"OLI{name}").values, kind["crs"], kind["corner"], 30.0)
    scene = fifesim.open_landsat(tmp_path, bands=["OLI4", "OLI5"], quality=False)
    np.testing.assert_allclose(scene, image.fifesim.to_reflectance(), rtol=0, atol=1e-6)
