"""Where the pixels of an instrument lie, and what they see."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.spatial_response import (
    BoxcarResponse,
    CosineResponse,
    GaussianResponse,
    TwoAxesResponse,
)
from fifesim.sensor.pixel_labels import bands_by_grid, pixel_grid

TM = instrument("TM", "paper")
INTERVAL = 43e-6 * 705e3


def scene(shape=(180, 198), values=None):
    grid = fifesim.fife_site(30 / 9, window=((90, 90 + shape[0]), (180, 180 + shape[1])))
    if values is None:
        values = np.random.default_rng(2).uniform(10.0, 90.0, (2, *shape))
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": ["TM3", "TM4"]}, name="toa_radiance")
    array.attrs["units"] = "W m-2 sr-1 um-1"
    return directions.with_geometry(grids.place(array, grid), Geometry(40.0, 120.0))


def sensed(array, tm=TM, **options):
    return fifesim.sense(array, tm, quantise=False, **options)


def ramp(shape=(180, 198)):
    """Radiance that rises by one a metre eastward and by a hundredth southward."""
    y, x = np.meshgrid(np.arange(shape[0]) * 10 / 3, np.arange(shape[1]) * 10 / 3, indexing="ij")
    return scene(shape, np.stack([0.01 * y + x] * 2))


@pytest.mark.parametrize("interval", [0.0, -30.0, float("nan"), (30.0, 30.0, 30.0)])
def test_an_interval_that_is_no_distance_is_refused(interval):
    with pytest.raises(ValueError, match="interval must be 'native', or positive metres"):
        sensed(scene(), interval=interval)


@pytest.mark.parametrize("offset", [0.5, (0.5,), (1, 2, 3)])
def test_an_offset_without_rows_and_columns_is_refused(offset):
    with pytest.raises(ValueError, match="offset must be two, of rows and of columns"):
        sensed(scene(), offset=offset)


def test_own_interval_moves_the_coordinates():
    image = check_raster_function(lambda toa: sensed(toa, interval="native"), scene(), quantity="toa_radiance")
    np.testing.assert_allclose(np.diff(image["x"]), INTERVAL, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.diff(image["y"]), -INTERVAL, rtol=0, atol=1e-6)
    corner = grids.geobox(scene()).affine
    np.testing.assert_allclose([image["x"][0], image["y"][0]], [corner.c + INTERVAL / 2, corner.f - INTERVAL / 2])
    onto = fifesim.grid_at("EPSG:26914", corner.c, corner.f, 21 * INTERVAL, 19 * INTERVAL, INTERVAL)
    xr.testing.assert_allclose(image, sensed(scene(), onto=onto), rtol=1e-9)


def test_interval_in_metres_may_differ_down_and_across():
    image = sensed(scene(), interval=(60.0, 22.0))
    assert grids.cell_size(grids.geobox(image)) == (60.0, 22.0)


@pytest.mark.parametrize("offset", [(0.0, 0.25), (0.5, 0.0), (-0.3, 1.2)])
def test_offset_sees_the_ground_beside_and_keeps_the_coordinates(offset):
    """A ramp shifts by slope times offset; a cell's steps are alike in every pixel of nine cells for whole cells."""
    nominal, moved = sensed(ramp()), sensed(ramp(), offset=offset)
    np.testing.assert_array_equal(moved["x"], nominal["x"])
    np.testing.assert_array_equal(moved["y"], nominal["y"])
    inside = np.s_[:, 2:-2, 2:-2]
    shift = 30 * (0.01 * offset[0] + offset[1])
    # Within a cell the ramp is flat, which leaves a hundredth of a cell.
    np.testing.assert_allclose((moved - nominal).values[inside], shift, rtol=0, atol=0.06)
    whole = 3 * 10 / 3
    exact = sensed(ramp(), offset=(0.0, whole / 30)) - nominal
    np.testing.assert_allclose(exact.values[inside], whole, rtol=1e-10)


def test_drift_moves_each_column_by_its_own():
    """Pixels taken at the instrument's interval but taken for those of the product drift by 0.315 m a pixel."""
    steps = (np.arange(20) + 0.5) * (INTERVAL - 30) / 30
    drifting = sensed(scene(), offset=(0.0, np.append(steps, [0.0, 0.0])), interval=30.0)
    onto = grids.geobox(sensed(scene(), interval=(30.0, INTERVAL)))
    np.testing.assert_allclose(drifting[..., :20], sensed(scene(), onto=onto)[..., :20], rtol=1e-10)


def test_drift_is_the_same_in_any_chunks():
    jitter = np.random.default_rng(1).normal(0, 1.5, 20)
    check_raster_function(
        lambda toa: sensed(toa, offset=(jitter, -0.2)), scene(), quantity="toa_radiance"
    )  # fmt: skip


def test_rows_take_the_response_along_the_track():
    """A point is smeared by a wide boxcar southward and by a narrow one eastward."""
    wide = TwoAxesResponse(
        along=BoxcarResponse("boxcar", width=90 / 705e3), across=BoxcarResponse("boxcar", width=30 / 705e3)
    )
    values = np.zeros((2, 180, 198))
    values[:, 94, 94] = 1000.0
    image = sensed(scene(values=values), replace(TM, lsf=wide)).values
    assert (image[0] > 1e-9).sum(axis=0).max() == 3
    assert (image[0] > 1e-9).sum(axis=1).max() == 1


def test_each_band_has_its_own_response():
    other = replace(TM.bands[3], lsf=GaussianResponse("gaussian", fwhm=60 / 705e3))
    mixed = replace(TM, bands=(*TM.bands[:3], other, *TM.bands[4:]), sources=TM.sources)
    image = check_raster_function(lambda toa: sensed(toa, mixed), scene(), quantity="toa_radiance")
    alone = replace(TM, lsf=other.lsf)
    np.testing.assert_array_equal(image.sel(band="TM3"), sensed(scene()).sel(band="TM3"))
    np.testing.assert_array_equal(image.sel(band="TM4"), sensed(scene(), alone).sel(band="TM4"))
    turned = sensed(scene().isel(band=[1, 0]), mixed)
    np.testing.assert_array_equal(turned.isel(band=[1, 0]), image)
    assert turned["band"].values.tolist() == ["TM4", "TM3"]


def test_bands_of_different_pixels_go_apart_or_onto_one_grid():
    coarse = replace(TM.bands[3], gsd=60.0)
    mixed = replace(TM, bands=(*TM.bands[:3], coarse, *TM.bands[4:]))
    assert bands_by_grid(mixed, mixed.select(["TM4", "TM3"])) == {"30m": [1], "60m": [0]}
    with pytest.raises(ValueError, match=r"30 x 30 m: TM3; 60 x 60 m: TM4.*sense each group separately.*onto="):
        pixel_grid(grids.geobox(scene()), mixed, mixed.select(["TM3", "TM4"]))
    assert {node.path: node["toa_radiance"].sizes["x"] for node in sensed(scene(), mixed).leaves} == {
        "/30m": 22,
        "/60m": 11,
    }
    assert sensed(scene().sel(band=["TM4"]), mixed).sizes["x"] == 11
    assert sensed(scene(), mixed, interval=30.0).sizes["x"] == 22
    assert sensed(scene(), mixed, interval="native").sizes["band"] == 2


def test_radiance_becomes_reflectance():
    radiance = sensed(scene())
    reflectance = fifesim.to_reflectance(radiance)
    assert reflectance.attrs["units"] == "1"
    np.testing.assert_allclose(fifesim.to_reflectance(fifesim.sense(scene(), TM)), reflectance, atol=0.003)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"interval": "own"}, "'native'"),
        ({"interval": 30.0, "onto": fifesim.grid_at("EPSG:26914", 705600, 4333900, 60, 60, 30)}, "give one of them"),
        ({"offset": (np.zeros(3), 0.0)}, "20 of them"),
        ({"offset": (0.0, np.nan)}, "finite"),
    ],
)
def test_a_place_that_is_none_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        sensed(scene(), **options)


def test_point_spread_wider_than_the_scene_is_named():
    wide = replace(TM, lsf=CosineResponse("cosine", step=4.778e-5, count=90))
    with pytest.raises(
        ValueError, match=r"point spread of TM TM3, TM4, 3031\.6 x 3031\.6 m, is wider than the scene of"
    ):
        sensed(scene(), wide)
    assert np.isfinite(sensed(scene(), wide, min_valid=0.01)).all()
