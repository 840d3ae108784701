"""Metadata of real products: each opens with its stated values, or raises an error with reason and remedy."""

import shutil
import tarfile
from pathlib import Path

import numpy as np
import pandas as pd
import products
import pytest
from mistakes import mistakes

import fifesim
from fifesim.sensor.products.landsat_labels import read_scene
from fifesim.sensor.products.sentinel2_labels import sentinel2_product

DATA = Path(__file__).parents[2] / "data" / "real_products"
# Arbitrary location: neither scale nor sun depends on it.
PLACE = {"crs": "EPSG:32633", "corner": (600000.0, 5000000.0)}
NO_TILE = "S2A_MSIL1C_20240101T102431_N0510_R065_T30NWM_20240101T122107.SAFE"
OTHER_TILE = "S2A_MSIL1C_20210908T042701_N0301_R133_T46RER_20210908T070248.SAFE"
NAN_SUN = "S2A_MSIL2A_20230625T234621_N0509_R073_T01WCP_20230626T022158.SAFE"
OFF_NADIR = "LC08_L2SP_017036_20130419_20200913_02_T2"

# Rows of expected.csv, grouped by product.
TABLE = pd.read_csv(DATA / "expected.csv", dtype=str, keep_default_na=False)
EXPECTED = {product: rows.to_dict("records") for product, rows in TABLE.groupby("product", sort=False)}
OPENED = [product for product, rows in EXPECTED.items() if rows[0]["expect"] != "refused"]
LANDSAT = [product for product in OPENED if product.startswith("L")]
SENTINEL2 = [product for product in OPENED if product.startswith("S2")]


@pytest.fixture(scope="module")
def metadata(tmp_path_factory):
    """Folder with all metadata, landsat/PRODUCT and sentinel2/PRODUCT."""
    folder = tmp_path_factory.mktemp("metadata")
    with tarfile.open(DATA / "metadata.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    return folder


def landsat(metadata, folder, product):
    """Landsat product folder: each band has the number of expected.csv, no data, and saturation."""
    shutil.copytree(metadata / "landsat" / product, folder, dirs_exist_ok=True)
    pixel = 60.0 if product.startswith("LM") else 30.0
    for row in EXPECTED[product]:
        dn, largest = int(row["dn"]), int(row["largest"])
        values = np.array([[dn, 0], [largest, dn]], np.uint8 if largest == 255 else np.uint16)
        products.write(folder / row["file"], values, pixel=pixel, **PLACE)
    for name, value in (("PIXEL", 21824), ("RADSAT", 0)):
        products.write(folder / f"{product}_QA_{name}.TIF", np.full((2, 2), value, "u2"), pixel=pixel, **PLACE)
    return folder


def sentinel2(metadata, folder, product, tile=None):
    """Sentinel-2 .SAFE folder: each band has the number of expected.csv, no data, and saturation."""
    path = folder / product
    path.mkdir()
    (file,) = (metadata / "sentinel2" / product).glob("MTD_MSIL*.xml")
    shutil.copy(file, path)
    values = np.array([[10000, 0], [65535, 10000]], np.uint16)
    for (band, size), name in products.safe_files(file.read_text(encoding="utf-8")).items():
        if band.startswith("B"):
            products.write(path / f"{name}.jp2", values, pixel=float(size), **PLACE, driver="JP2OpenJPEG")
    granule = path / Path(name).parents[-3]
    shutil.copy(metadata / "sentinel2" / (tile or product) / "MTD_TL.xml", granule)
    return path


def check_scene(scene, rows, view):
    """Compare a scene with rows of expected.csv; the README of the data explains the tolerances."""
    assert scene["band"].values.tolist() == [row["band"] for row in rows]
    first = rows[0]
    assert abs(scene["time"].values - np.datetime64(first["time"], "ns")) < np.timedelta64(1, "us")
    stated = [float(first["sun_zenith"]), float(first["sun_azimuth"])]
    tolerance = 0.05 if first["product"] == NAN_SUN else 1e-8
    np.testing.assert_allclose([scene["sza"], scene["saa"]], stated, rtol=0, atol=tolerance)
    np.testing.assert_allclose([scene["vza"], scene["vaa"]], view, rtol=0, atol=1e-6)
    check_scale(scene, rows)


def check_scale(scene, rows):
    """Compare the values that do not depend on the tile: distance, reflectance and solar irradiance."""
    assert float(scene["earth_sun_distance"]) == pytest.approx(float(rows[0]["earth_sun_distance"]), abs=1e-9)
    values = np.full((len(rows), 2, 2), np.nan)
    values[:, [0, 1], [0, 1]] = np.array([float(row["reflectance"]) for row in rows])[:, None]
    np.testing.assert_allclose(scene, values, rtol=0, atol=2e-7)
    for row, irradiance in zip(rows, scene["solar_irradiance"].values, strict=True):
        if row["solar_irradiance"]:
            rtol = 3e-3 if row["product"].startswith("L") else 1e-9
            assert irradiance == pytest.approx(float(row["solar_irradiance"]), rel=rtol)


def check_bands(bands, rows):
    """Compare the scale of bands with the metadata."""
    for row in rows:
        band = bands[row["band"]]
        np.testing.assert_allclose([band.gain, band.offset], [float(row["scale"]), float(row["offset"])], rtol=1e-12)
        # The saturation number of Sentinel-2 is one above the largest valid number.
        assert band.largest == int(row["largest"]) + row["product"].startswith("S2")


@pytest.mark.parametrize("product", LANDSAT)
def test_landsat_products_agree_with_expected_values(metadata, tmp_path, product):
    folder, rows = landsat(metadata, tmp_path, product), EXPECTED[product]
    view = (0.0, 0.0)
    if product == OFF_NADIR:
        # Orbit of 705 km and Earth radius of 6371 km; the azimuth is perpendicular to the track.
        vza = np.degrees(np.arcsin(np.sin(np.radians(11.696)) * (6371 + 705) / 6371))
        view = read_scene(folder)[0].view
        np.testing.assert_allclose(view, (vza, 102.2), rtol=0, atol=0.1)
    check_scene(fifesim.open_landsat(folder), rows, view)
    for file in folder.glob("*_MTL.*"):
        check_bands({band.name: band for band in read_scene(file)[0].bands}, rows)


def mean_view(rows):
    """Mean view direction of the bands that state one."""
    stated = [(float(row["view_zenith"]), float(row["view_azimuth"])) for row in rows]
    zenith, azimuth = np.radians([pair for pair in stated if not np.isnan(pair[0])]).T
    x, y = (np.mean(np.sin(zenith) * turn(azimuth)) for turn in (np.cos, np.sin))
    return np.degrees(np.arctan2(np.hypot(x, y), np.cos(zenith).mean())), np.degrees(np.arctan2(y, x)) % 360


@pytest.mark.parametrize("product", SENTINEL2)
def test_sentinel2_products_agree_with_expected_values(metadata, tmp_path, product):
    path = sentinel2(metadata, tmp_path, product, OTHER_TILE if product == NO_TILE else None)
    rows = {row["band"]: row for row in EXPECTED[product]}
    (file,) = path.glob("MTD_MSIL*.xml")
    bands = sentinel2_product(file).bands
    seen = set()
    for size, at_size in bands.items():
        names = [band.name for band in at_size if band.name != "MSI10"]
        check_bands({band.name: band for band in at_size}, [rows[name] for name in names])
        if size not in (10, 20, 60) or not names:
            continue
        scene = fifesim.open_sentinel2(path, size, quality=False)
        found = [rows[name] for name in scene["band"].values]
        if product == NO_TILE:
            check_scale(scene, found)
        else:
            check_scene(scene, found, mean_view(found))
        seen |= set(names)
    assert seen == set(rows)
    if product == OTHER_TILE:
        assert "quality" not in fifesim.open_sentinel2(path, 10).coords, "cloud masks began with baseline 04.00"


REFUSED = mistakes("refused product", name="sensor_mistakes")


def test_every_product_is_tested():
    assert {product for _, product, _ in REFUSED} == set(EXPECTED) - set(OPENED) and len(EXPECTED) == 26


@pytest.mark.parametrize(("stage", "product", "said"), REFUSED, ids=str)
@pytest.mark.parametrize("angles", ["centre", "pixel"])
def test_unsupported_products_raise_with_reason_and_remedy(metadata, stage, product, said, angles):
    """Also where the file name ends in _MTL.TXT."""
    folder = metadata / "landsat" / product
    for path in (folder, *folder.iterdir()):
        with pytest.raises(ValueError, match=said):
            fifesim.open_landsat(path, angles=angles)
