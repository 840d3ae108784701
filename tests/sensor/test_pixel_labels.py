"""Pixel grids of an instrument, offsets and line spread functions."""

from dataclasses import replace

import numpy as np
import products
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.base.footprints import Boxcar
from fifesim.grids import grid as grids
from fifesim.sensor.description import spatial_response as responses
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.pixel_labels import check_scene, pixel_grid

TM = instrument("TM", "paper")
INTERVAL = 43e-6 * 705e3
PIXELS = fifesim.fife_site(30.0, ((0, 4), (0, 5)))


def scene(shape=(180, 198), values=None):
    grid = fifesim.fife_site(30 / 9, window=((90, 90 + shape[0]), (180, 180 + shape[1])))
    values = np.random.default_rng(2).uniform(10.0, 90.0, (2, *shape)) if values is None else values
    return products.radiance(values, grid, ["TM3", "TM4"])


def sensed(array, tm=TM, **options):
    return fifesim.sense(array, tm, quantise=False, **options)


THIRTY = fifesim.grid_at("EPSG:26914", 705600, 4333900, 60, 60, 30)
WIDE = replace(TM, lsf=responses.CosineResponse("cosine", step=4.778e-5, count=90))


@pytest.mark.parametrize(
    ("options", "message"),
    [({"interval": each}, "interval must be 'native', or positive metres") for each in (0.0, np.nan, (30.0,) * 3)]
    + [({"offset": each}, "offset must be two, of rows and of columns") for each in ((0.5,), (1, 2, 3))]
    + [
        ({"interval": "own"}, "'native'"),
        ({"interval": 30.0, "onto": THIRTY}, "give one of them"),
        ({"offset": (np.zeros(3), 0.0)}, "20 of them"),
        ({"offset": (0.0, np.nan)}, "finite"),
        ({"offset": (30.0, 0.0)}, "less than the 20 pixels of the image, got 30: every pixel would be outside"),
        ({"tm": WIDE}, r"point spread of TM TM3, TM4, 3031\.6 x 3031\.6 m, is wider than the scene of"),
    ],
)
def test_invalid_interval_offset_or_point_spread_raises(options, message):
    with pytest.raises(ValueError, match=message):
        sensed(scene(), **options)


def test_native_interval_sets_the_coordinates():
    image = check_raster_function(lambda toa: sensed(toa, interval="native"), scene(), quantity="toa_radiance")
    np.testing.assert_allclose(np.diff(image["x"]), INTERVAL, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.diff(image["y"]), -INTERVAL, rtol=0, atol=1e-6)
    corner = grids.geobox(scene()).affine
    np.testing.assert_allclose([image["x"][0], image["y"][0]], [corner.c + INTERVAL / 2, corner.f - INTERVAL / 2])
    onto = fifesim.grid_at("EPSG:26914", corner.c, corner.f, 21 * INTERVAL, 19 * INTERVAL, INTERVAL)
    xr.testing.assert_allclose(image, sensed(scene(), onto=onto), rtol=1e-9)
    # The interval may differ between rows and columns.
    assert grids.cell_size(grids.geobox(sensed(scene(), interval=(60.0, 22.0)))) == (60.0, 22.0)


@pytest.mark.parametrize("offset", [(0.0, 0.25), (0.5, 0.0), (-0.3, 1.2)])
def test_offset_shifts_the_image_but_not_the_coordinates(offset):
    """A ramp shifts by slope times offset, exactly for an offset of whole cells."""
    y, x = np.meshgrid(np.arange(180) * 10 / 3, np.arange(198) * 10 / 3, indexing="ij")
    ramp = scene(values=np.stack([0.01 * y + x] * 2))
    nominal, moved = sensed(ramp), sensed(ramp, offset=offset)
    np.testing.assert_array_equal(moved["x"], nominal["x"])
    np.testing.assert_array_equal(moved["y"], nominal["y"])
    inside = np.s_[:, 2:-2, 2:-2]
    shift = 30 * (0.01 * offset[0] + offset[1])
    # The ramp is constant within a cell: 0.01 cells.
    np.testing.assert_allclose((moved - nominal).values[inside], shift, rtol=0, atol=0.06)
    exact = sensed(ramp, offset=(0.0, 10 / 30)) - nominal
    np.testing.assert_allclose(exact.values[inside], 10.0, rtol=1e-10)


def test_offset_may_differ_by_column():
    """Pixels at the native interval on the product grid drift by 0.315 m per pixel."""
    steps = (np.arange(20) + 0.5) * (INTERVAL - 30) / 30
    drifting = sensed(scene(), offset=(0.0, np.append(steps, [0.0, 0.0])), interval=30.0)
    onto = grids.geobox(sensed(scene(), interval=(30.0, INTERVAL)))
    np.testing.assert_allclose(drifting[..., :20], sensed(scene(), onto=onto)[..., :20], rtol=1e-10)
    jitter = np.random.default_rng(1).normal(0, 1.5, 20), -0.2
    check_raster_function(lambda toa: sensed(toa, offset=jitter), scene(), quantity="toa_radiance")


def test_rows_use_the_along_track_response():
    """A point is smeared by a wide boxcar southward and by a narrow one eastward."""
    along, across = (responses.BoxcarResponse("boxcar", width=width / 705e3) for width in (90, 30))
    values = np.zeros((2, 180, 198))
    values[:, 94, 94] = 1000.0
    image = sensed(scene(values=values), replace(TM, lsf=responses.TwoAxesResponse(along, across))).values
    assert (image[0] > 1e-9).sum(axis=0).max() == 3 and (image[0] > 1e-9).sum(axis=1).max() == 1


def test_bands_may_have_different_spatial_responses():
    other = replace(TM.bands[3], lsf=responses.GaussianResponse("gaussian", fwhm=60 / 705e3))
    mixed = replace(TM, bands=(*TM.bands[:3], other, *TM.bands[4:]), sources=TM.sources)
    small = scene((90, 99))
    image = check_raster_function(lambda toa: sensed(toa, mixed), small, quantity="toa_radiance")
    np.testing.assert_array_equal(image.sel(band="TM3"), sensed(small).sel(band="TM3"))
    np.testing.assert_array_equal(image.sel(band="TM4"), sensed(small, replace(TM, lsf=other.lsf)).sel(band="TM4"))
    turned = sensed(small.isel(band=[1, 0]), mixed)
    np.testing.assert_array_equal(turned.isel(band=[1, 0]), image)
    assert turned["band"].values.tolist() == ["TM4", "TM3"]


def test_bands_of_different_pixel_sizes_are_grouped_or_share_one_grid():
    coarse = replace(TM.bands[3], gsd=60.0)
    mixed = replace(TM, bands=(*TM.bands[:3], coarse, *TM.bands[4:]))
    with pytest.raises(ValueError, match=r"30 x 30 m: TM3; 60 x 60 m: TM4.*sense each group separately.*onto="):
        pixel_grid(grids.geobox(scene()), mixed, mixed.select(["TM3", "TM4"]))
    widths = {node.path: node["toa_radiance"].sizes["x"] for node in sensed(scene(), mixed).leaves}
    assert widths == {"/30m": 22, "/60m": 11}
    assert sensed(scene().sel(band=["TM4"]), mixed).sizes["x"] == 11
    assert sensed(scene(), mixed, interval=30.0).sizes["x"] == 22
    assert sensed(scene(), mixed, interval="native").sizes["band"] == 2


def test_point_spread_must_mostly_lie_in_the_scene():
    assert np.isfinite(sensed(scene(), WIDE, min_valid=0.01)).all()
    boxes = Boxcar(200.0), Boxcar(100.0)
    check_scene(boxes, PIXELS, 0.6, "TM")
    with pytest.raises(ValueError, match="wider than the scene of 120 x 150 m, which holds 60% of it"):
        check_scene(boxes, PIXELS, 0.61, "TM")
