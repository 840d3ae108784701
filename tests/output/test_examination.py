"""Exam of processors, and the ENVI product that they read."""

import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import rasterio
import xarray as xr
from scipy.spatial import cKDTree

import fifesim
from fifesim.output.examination import edge_distance

GRID = fifesim.grid_at("EPSG:32614", 705000, 4330000, width=600, height=600, cell=30)
HOWTO = Path(__file__).parents[2] / "docs" / "howto" / "processor.md"


LAI = fifesim.lai_scene(GRID, seed=7).drop_attrs(deep=False)


def raster(values, name, **attrs):
    """Raster on the grid."""
    return LAI.copy(data=np.broadcast_to(values, GRID.shape).astype(float)).rename(name).assign_attrs(attrs)


@pytest.fixture(scope="module")
def truth():
    """Reflectance of 0.3 with cos i from west to east, and a class boundary from south to north."""
    cosine = np.linspace(0.1, 0.9, 20)[None, :]
    cover = (np.arange(20) >= 5)[None, :] + 1.0
    return xr.Dataset(
        {
            "TM4": raster(0.3, "TM4", units="1"),
            "illumination": raster(cosine, "illumination"),
            "cover": raster(cover, "cover"),
        }
    )


def known_error(truth):
    """Result that is wrong by 0.1 (cos i - 0.5)."""
    return (truth["TM4"] + 0.1 * (truth["illumination"] - 0.5)).rename("TM4").assign_attrs(units="1")


def test_known_error_is_scored_by_tenth_of_cos_i(truth):
    """Two columns are in each group: their mean error and mean square error are known by hand."""
    scores = fifesim.exam(known_error(truth), truth)
    cosine = np.linspace(0.1, 0.9, 20).reshape(10, 2)
    found = scores["illumination"].to_dataset().squeeze(["product", "quantity"])
    np.testing.assert_allclose(found["illumination"], cosine.mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(found["bias"], 0.1 * (cosine.mean(axis=1) - 0.5), atol=1e-14)
    np.testing.assert_allclose(found["rmse"], np.sqrt(np.mean((0.1 * (cosine - 0.5)) ** 2, axis=1)), atol=1e-14)
    assert found["n"].values.tolist() == [40] * 10 and float(scores["n"].item()) == 400
    assert float(scores["bias"].item()) == pytest.approx(0, abs=1e-14)


def test_error_by_class_and_distance_to_its_edge(truth):
    distance = np.abs(np.arange(20) - 4.5) * 30
    wrong = (truth["TM4"] + 1e-4 * distance[None, :]).rename("TM4")
    scores = fifesim.exam(wrong, truth)
    by_edge = scores["edge_distance"].to_dataset().squeeze(["product", "quantity"])
    assert by_edge["edge_distance"].values[0] == pytest.approx(15)
    np.testing.assert_allclose(by_edge["bias"], 1e-4 * by_edge["edge_distance"], rtol=1e-12)
    by_class = scores["cover"]["bias"].squeeze().values
    np.testing.assert_allclose(by_class, [1e-4 * distance[:5].mean(), 1e-4 * distance[5:].mean()], rtol=1e-12)


def test_edge_distance_is_from_a_search_of_neighbours():
    rng = np.random.default_rng(3)
    classes = np.kron(rng.integers(0, 3, (4, 5)), np.ones((6, 6)))
    classes[3, 4] = np.nan
    rows, columns = np.indices(classes.shape)
    near = np.zeros(classes.shape, bool)
    for down, across in ((0, 1), (1, 0), (0, -1), (-1, 0)):
        r, c = np.clip(rows + down, 0, len(classes) - 1), np.clip(columns + across, 0, classes.shape[1] - 1)
        near |= np.isfinite(classes) & np.isfinite(classes[r, c]) & (classes[r, c] != classes)
    far, _ = cKDTree(np.argwhere(near) * 20.0).query(np.stack([rows, columns], axis=-1) * 20.0)
    found = edge_distance(classes, 20.0, 20.0)
    assert np.isnan(found[3, 4]) and np.isnan(found).sum() == 1
    np.testing.assert_allclose(found[np.isfinite(classes)], far[np.isfinite(classes)] + 10)
    assert np.isnan(edge_distance(np.ones((3, 3)), 1.0, 1.0)).all()


def test_results_are_compared_on_the_pixels_that_all_have(truth):
    wrong = known_error(truth)
    gaps = truth["TM4"].where(truth["illumination"] > 0.5)
    scores = fifesim.exam({"one": wrong, "two": gaps}, truth)
    assert scores["n"].values.ravel().tolist() == [200, 200]
    assert scores["missing"].values.ravel().tolist() == [0, 0.5]
    assert float(scores["bias"].sel(product="one").item()) == pytest.approx(
        0.1 * (np.linspace(0.1, 0.9, 20)[10:].mean() - 0.5)
    )


def test_files_and_rasters_in_memory_have_the_same_scores(truth, tmp_path):
    (tmp_path / "truth").mkdir()
    for name, each in truth.data_vars.items():
        each.fifesim.to_geotiff(tmp_path / "truth" / f"{name}.tif")
    wrong = known_error(truth)
    wrong.fifesim.to_geotiff(tmp_path / "out.tif")
    xr.testing.assert_allclose(
        fifesim.exam(tmp_path / "out.tif", tmp_path / "truth").to_dataset(), fifesim.exam(wrong, truth).to_dataset()
    )


def test_page_has_the_scores(truth, tmp_path):
    page = tmp_path / "exam.html"
    scores = fifesim.exam({"own": known_error(truth)}, truth, page=page, title="An exam")
    text = page.read_text(encoding="utf-8")
    assert "<h1>An exam</h1>" in text and f"{float(scores['rmse'].item()):.4f} own" in text
    headings = re.findall(r"<h2>(.*?)</h2>", text)
    assert headings == ["All pixels", "Error by cos i", "Error by distance to edges [m]", "Error by class"]
    assert text.count("<img") == 4
    with pytest.raises(FileExistsError, match="overwrite=True"):
        fifesim.exam(known_error(truth), truth, page=page)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda each: each.rename("red"), r"no quantity of the truth .*TM4.* rename variables"),
        (lambda each: each.assign_attrs(units="%"), r"TM4 of result: result and the truth must have the same units"),
        (lambda each: each.assign_coords(x=each.x + 10), "TM4 of result: .*pair"),
        (lambda each: (each * 10000).assign_attrs(standard_name="surface_bidirectional_reflectance"), "multiply it by"),
    ],
)
def test_contradicting_results_are_refused(truth, change, words):
    with pytest.raises(ValueError, match=words):
        fifesim.exam(change(truth["TM4"]), truth)


TIME, SUN = "2023-06-03T17:10Z", (39.0928, -96.6261)


@pytest.fixture(scope="module")
def scene():
    """Radiance of four bands of EMIT on a slope to the north-east."""
    cells = fifesim.grid_at("EPSG:32614", 705000, 4330000, width=600, height=480, cell=20)
    lai = fifesim.lai_scene(cells, seed=7)
    east, south = np.meshgrid(20.0 * np.arange(30), 20.0 * np.arange(24))
    dem = lai.drop_attrs(deep=False).copy(data=400 + 0.1 * (south - east) / np.sqrt(2)).rename("dem")
    options = {"bands": ["EMIT29", "EMIT69", "EMIT169"], "atmosphere": fifesim.Atmosphere(visibility=30), "time": TIME}
    toa = lai.fifesim.surface_reflectance("EMIT", **options).fifesim.to_toa()
    return toa.fifesim.sense("EMIT", quantise=False), dem


@pytest.fixture(scope="module")
def product(scene, tmp_path_factory):
    image, dem = scene
    truth = xr.Dataset({"lai": image.isel(band=0, drop=True) * 0 + 1.0})
    return image.fifesim.to_envi(tmp_path_factory.mktemp("envi"), dem=dem, truth=truth)


def read(product, end):
    with rasterio.open(next(product.glob(f"*_{end}.img"))) as source:
        return source.read(masked=True).astype(float).filled(np.nan), source.descriptions, source


def test_gdal_reads_the_radiance_within_single_precision(scene, product):
    image, _ = scene
    values, names, source = read(product, "rdn")
    assert np.isfinite(values).any()
    # 1 W m-2 sr-1 um-1 is 100 uW cm-2 over 1000 nm.
    np.testing.assert_allclose(values, image.values * 100 / 1000, rtol=6e-8)
    assert source.crs.to_epsg() == 32614 and source.transform.a == 60 and source.driver == "ENVI"
    assert [name.split()[0] for name in names] == ["EMIT29", "EMIT69", "EMIT169"]
    header = next(product.glob("*_rdn.hdr")).read_text(encoding="utf-8")
    listed = {key: re.search(rf"^{key} = \{{(.*?)\}}", header, re.MULTILINE)[1] for key in ("wavelength", "fwhm")}
    assert [round(float(each)) for each in listed["wavelength"].split(",")] == [589, 887, 1633]
    assert np.allclose([float(each) for each in listed["fwhm"].split(",")], 8.5, atol=0.2)
    assert "interleave = bil" in header and "data units = uW/cm^2/sr/nm" in header and "Simulated scene" in header
    assert str(product.parent) not in header


def test_observation_has_the_directions_of_sun_and_slope(product):
    values, names, _ = read(product, "obs")
    found = dict(zip(names, values[:, 4, 4], strict=True))
    assert list(names)[:3] == ["path length", "to-sensor azimuth", "to-sensor zenith"] and len(names) == 11
    sun = fifesim.sun_position(TIME, *SUN)
    assert found["to-sun zenith"] == pytest.approx(sun.sza, abs=0.05)
    assert found["to-sun azimuth"] == pytest.approx(sun.saa, abs=0.05)
    assert found["phase"] == pytest.approx(found["to-sun zenith"]) and found["to-sensor zenith"] == 0
    assert found["slope"] == pytest.approx(np.degrees(np.arctan(0.1)), abs=1e-3)
    # The meridian convergence of the place turns the aspect by 1.5 degrees from grid north-east.
    assert found["aspect"] == pytest.approx(45, abs=2)
    normal = np.array([np.sin(a := np.radians(found["aspect"])), np.cos(a)]) * np.sin(np.radians(found["slope"]))
    toward = np.array([np.sin(s := np.radians(found["to-sun azimuth"])), np.cos(s)]) * np.sin(np.radians(sun.sza))
    upward = np.cos(np.radians(found["slope"])) * np.cos(np.radians(sun.sza))
    assert found["cosine i"] == pytest.approx(normal @ toward + upward, abs=1e-3)
    assert found["UTC time"] == pytest.approx(17 + 10 / 60)
    # Day 154 of the year, from a circular anomaly since perihelion.
    assert found["earth-sun distance"] == pytest.approx(1 - 0.01672 * np.cos(np.radians(0.9856 * 150)), abs=2e-4)
    height = read(product, "loc")[0][2, 4, 4]
    assert found["path length"] == pytest.approx(410000 - height, abs=0.01)


def test_location_is_longitude_latitude_and_elevation(product):
    (longitude, latitude, height), names, source = read(product, "loc")
    assert names == ("longitude", "latitude", "elevation")
    east, north = rasterio.warp.transform("EPSG:4326", source.crs, [longitude[2, 3]], [latitude[2, 3]])
    assert (east[0], north[0]) == pytest.approx((705000 + 3.5 * 60, 4330000 - 2.5 * 60), abs=1e-3)
    assert 380 < np.mean(height) < 420


def test_view_from_the_side_lengthens_the_path(scene, tmp_path):
    """Law of cosines between the earth's centre, the pixel and the sensor."""
    image = scene[0].assign_coords(vza=30.0, vaa=290.0)
    values, names, _ = read(image.fifesim.to_envi(tmp_path, dem=0.0), "obs")
    found = dict(zip(names, values[:, 4, 4], strict=True))
    radius, path = 6.371e6, found["path length"]
    orbit = np.sqrt(radius**2 + path**2 + 2 * radius * path * np.cos(np.radians(30)))
    assert orbit - radius == pytest.approx(410000, abs=0.01)
    assert (found["to-sensor zenith"], found["to-sensor azimuth"], found["slope"]) == (30, 290, 0)


def test_reflectance_and_lazy_images_are_written_alike(scene, product, tmp_path):
    image, dem = scene
    again = image.chunk({"y": 3, "x": 4}).fifesim.to_envi(tmp_path, dem=dem)
    np.testing.assert_array_equal(read(again, "rdn")[0], read(product, "rdn")[0])
    surface = image.fifesim.to_surface(fifesim.Atmosphere(visibility=30))
    written = surface.fifesim.to_envi(tmp_path / "rfl", dem=dem)
    np.testing.assert_allclose(read(written, "rfl")[0], surface.values, rtol=1e-6)


def test_truth_of_the_product_has_slope_and_cos_i(product):
    found = {path.stem: fifesim.open_image(path) for path in (product / "truth").glob("*.tif")}
    assert set(found) == {"lai", "slope", "illumination"}
    light = read(product, "obs")[0][8]
    np.testing.assert_allclose(found["illumination"].values, light, atol=2e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda image: image.assign_attrs(instrument="TM"), "must be one of EMIT, EnMAP, PRISMA"),
        (lambda image: image.drop_vars("time"), "has no time"),
        (lambda image: image.assign_coords(time=np.datetime64("2010-06-03T17:10")), "EMIT has images from 2022"),
        (lambda image: image.assign_coords(saa=10.0), "use time= and not geometry="),
    ],
)
def test_images_that_contradict_the_product_are_refused(scene, tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        change(scene[0]).fifesim.to_envi(tmp_path, dem=scene[1])
    assert list(tmp_path.iterdir()) == []


def test_product_is_not_overwritten(scene, product):
    with pytest.raises(FileExistsError, match="overwrite=True"):
        scene[0].fifesim.to_envi(product.parent, dem=scene[1])


@pytest.mark.slow
def test_processor_of_the_howto_has_the_printed_scores(tmp_path, monkeypatch):
    """All code of the page with HyTools, which the tests of the documentation do not need."""
    pytest.importorskip("hytools")
    monkeypatch.chdir(tmp_path)
    block = re.compile(
        r"^```(?:python|\{code-block\} python\n:class: no-run)\n(.*?)^```$(?:\n+```text\n(.*?)^```$)?", re.S | re.M
    )
    names, compared = {}, 0
    for code, printed in block.findall(HOWTO.read_text(encoding="utf-8")):
        told = StringIO()
        with redirect_stdout(told):
            exec(compile(code, "processor.md", "exec"), names)
        assert not printed or told.getvalue().split() == printed.split()
        compared += bool(printed)
    assert compared == 3
