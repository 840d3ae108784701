"""Noise of an instrument on labelled rasters."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import Noise
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.labels import noisy
from fifesim.sensor.response.noise import NoiseModel, add_noise

TM = instrument("TM", "paper")
# Figures of a test, of no real instrument.
SOURCES = TM.sources | {"noise": "Friedl1995", "detectors": "Friedl1995"}
NOISY = replace(
    TM,
    detectors=16,
    sources=SOURCES,
    bands=tuple(
        replace(band, noise=Noise(radiance=50.0, snr=60.0, shot=0.5, gain_spread=0.02, offset_spread=0.3))
        for band in TM.bands
    ),
)
ALL = ("shot", "thermal", "fixed-pattern")
RADIANCE = {"TM3": 40.0, "TM4": 90.0}


def uniform(shape=(900, 990), cell=30 / 9, row=0, column=0):
    """Radiance by cells, each band of one value."""
    grid = fifesim.fife_site(cell, window=((row, row + shape[0]), (column, column + shape[1])))
    values = np.broadcast_to(np.array(list(RADIANCE.values()))[:, None, None], (2, *shape))
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": list(RADIANCE)})
    array.attrs["units"] = "W m-2 sr-1 um-1"
    return directions.with_geometry(grids.place(array, grid), Geometry(40.0, 120.0))


def test_uniform_scene_shows_the_published_ratio():
    """Within three standard errors, also in digital numbers, whose rounding adds a twelfth of a count squared."""
    scene = uniform()
    radiance = fifesim.sense(scene, NOISY, noise=["shot", "thermal"], seed=3, quantise=False)
    dn = fifesim.sense(scene, NOISY, noise=["shot", "thermal"], seed=3)
    for name, signal in RADIANCE.items():
        image = radiance.sel(band=name).values
        expected = float(fifesim.noise_equivalent_radiance(NOISY, name, signal))
        assert abs(image.std() - expected) < 3 * expected / np.sqrt(2 * image.size)
        assert float(fifesim.snr(NOISY, name, signal)) == pytest.approx(signal / expected, rel=1e-12)
        counts = fifesim.to_radiance(dn).sel(band=name)
        quantised = np.hypot(expected, float(dn["gain"].sel(band=name)) / np.sqrt(12))
        assert abs(float(counts.std()) - quantised) < 3 * quantised / np.sqrt(2 * image.size)
    assert float(fifesim.snr(NOISY, "TM3", 50.0)) == pytest.approx(60.0, rel=1e-12)
    with pytest.raises(TypeError, match="band must be a name, got a list of 2"):
        fifesim.snr(NOISY, ["TM3", "TM4"], 50.0)


def test_sixteen_detectors_stripe_the_lines():
    image = fifesim.sense(uniform(), NOISY, noise="fixed-pattern", seed=3, quantise=False)
    lines = image.sel(band="TM3").values
    assert np.ptp(lines, axis=1).max() < 1e-10
    np.testing.assert_allclose(lines[16:], lines[:-16], rtol=1e-14)
    assert lines[:16, 0].std() > 0.3
    assert not np.allclose(lines, image.sel(band="TM4").values * 40 / 90)


def test_noisy_image_is_the_same_in_any_chunks():
    scene = uniform((90, 99))
    check_raster_function(lambda toa: fifesim.sense(toa, NOISY, noise=ALL, seed=3), scene, quantity="dn")
    check_raster_function(
        lambda toa: fifesim.sense(toa, NOISY, noise=ALL, seed=3, quantise=False), scene, quantity="toa_radiance"
    )


def test_a_window_and_a_band_have_the_noise_of_the_whole():
    whole = fifesim.sense(uniform((180, 198)), NOISY, noise=ALL, seed=3)
    window = fifesim.sense(uniform((90, 99), row=90, column=45), NOISY, noise=ALL, seed=3)
    np.testing.assert_array_equal(window, whole.sel(y=window["y"], x=window["x"]))
    one = fifesim.sense(uniform((180, 198)).sel(band=["TM4"]), NOISY, noise=ALL, seed=3)
    np.testing.assert_array_equal(one, whole.sel(band=["TM4"]))


def test_noise_clips_and_never_wraps():
    scene = uniform((270, 270)).copy()
    scene = scene.copy(data=np.stack([np.full((270, 270), -1.2), np.full((270, 270), 206.0)]))
    loud = replace(
        NOISY, bands=tuple(replace(band, noise=Noise(radiance=50.0, snr=4.0, shot=0.0)) for band in TM.bands)
    )
    image = fifesim.sense(scene, loud, noise="thermal", seed=1)
    dark, bright = image.sel(band="TM3").values, image.sel(band="TM4").values
    assert dark.min() == 1 and (dark == 1).mean() == pytest.approx(0.5, abs=0.1) and dark.max() < 100
    assert bright.max() == 255 and (bright == 255).mean() == pytest.approx(0.5, abs=0.1) and bright.min() > 150


def test_history_says_what_noise_there_is():
    scene = uniform((90, 99))
    assert fifesim.sense(scene, NOISY).attrs["history"].endswith("sense: TM, 8 bits")
    noisy = fifesim.sense(scene, NOISY, noise=["shot", "thermal"], seed=9)
    assert noisy.attrs["history"].endswith("sense: TM, 8 bits, noise shot thermal, seed 9")


def test_noise_that_is_not_described_is_refused():
    silent = replace(TM, bands=tuple(replace(band, noise=None) for band in TM.bands))
    with pytest.raises(ValueError, match="TM has no noise for TM3"):
        fifesim.sense(uniform((90, 99)), silent, noise="shot")
    with pytest.raises(ValueError, match="unknown noise thermic"):
        fifesim.sense(uniform((90, 99)), NOISY, noise="thermic")
    bare = NoiseModel(0.5, 0.0)
    with pytest.raises(ValueError, match=r"TM has no shot and no fixed-pattern noise for TM3.*noise_models=\{'TM3'"):
        fifesim.sense(uniform((90, 99)), NOISY, noise=ALL, noise_models=bare)
    with pytest.raises(ValueError, match="TM has no shot noise for TM4"):
        fifesim.sense(uniform((90, 99)), NOISY, noise="shot", noise_models={"TM4": bare})


def test_each_requested_kind_must_exist_in_every_band():
    """The noise of L4TM is the same at any radiance; the other verbs refuse shot noise as `sense` does."""
    lai = fifesim.lai_scene(fifesim.fife_site(cell=10, window=((0, 60), (0, 60))), "burned-grazed", seed=7)
    said = "L4TM has no shot noise for TM3, only thermal; type noise='all'"
    with pytest.raises(ValueError, match=said):
        fifesim.compare(lai, ["MSI", "L4TM"], fifesim.Setup(noise=("shot", "thermal")))
    sensor = {"instrument": "L4TM", "noise": ["shot", "thermal"]}
    with pytest.raises(ValueError, match=said):
        fifesim.Scenario(sensor=sensor)
    with pytest.raises(ValueError, match="TM has no fixed-pattern noise for TM3, only thermal"):
        fifesim.Scenario(sensor={"noise": ["thermal", "fixed-pattern"], "noise_model": {"thermal": 0.4}})
    with pytest.raises(ValueError, match="'all' alone"):
        fifesim.sense(uniform((90, 99)), NOISY, noise=["all", "shot"])


def test_all_noise_is_every_kind_that_a_band_has():
    scene = uniform((90, 99))
    whole = fifesim.sense(scene, NOISY, noise="all", seed=3)
    np.testing.assert_array_equal(whole, fifesim.sense(scene, NOISY, noise=ALL, seed=3))
    thermal = {"noise_models": {"TM3": NoiseModel(0.8, 0.0)}, "seed": 3}
    mixed = fifesim.sense(scene, NOISY, noise="all", **thermal)
    np.testing.assert_array_equal(mixed.sel(band="TM4"), whole.sel(band="TM4"))
    alone = fifesim.sense(scene.sel(band=["TM3"]), NOISY, noise="thermal", **thermal)
    np.testing.assert_array_equal(mixed.sel(band=["TM3"]), alone)
    lai = fifesim.lai_scene(fifesim.fife_site(cell=10, window=((0, 60), (0, 60))), "burned-grazed", seed=7)
    images = fifesim.compare(lai, ["MSI", "L4TM"], fifesim.Setup(noise="all"))
    assert images["L4TM"]["dn"].attrs["history"].endswith("noise all, seed 0")


def test_noise_may_be_given():
    model = NoiseModel(0.8, 0.0)
    options = {"noise": "thermal", "seed": 1, "quantise": False}
    both = fifesim.sense(uniform(), TM, noise_models=model, **options)
    assert float(both.sel(band="TM3").std()) == pytest.approx(0.8, rel=0.03)
    mixed = fifesim.sense(uniform(), NOISY, noise_models={"TM3": model}, **options)
    np.testing.assert_array_equal(mixed.sel(band="TM3"), both.sel(band="TM3"))
    np.testing.assert_array_equal(mixed.sel(band="TM4"), fifesim.sense(uniform(), NOISY, **options).sel(band="TM4"))
    lower = fifesim.sense(uniform(), NOISY, noise_models={"tm3": model}, **options)
    np.testing.assert_array_equal(lower, mixed)
    with pytest.raises(ValueError, match="unknown band of TM 'TM33': did you mean TM3"):
        fifesim.sense(uniform((90, 99)), NOISY, noise_models={"TM33": model}, **options)


@pytest.mark.parametrize("chunk", [1, 2, 3])
def test_bands_in_chunks_of_their_own_have_the_noise_of_the_whole(chunk):
    """Each band by its number in the instrument and with its own model, wherever its chunk begins."""
    names = ["TM5", "TM1", "TM4", "TM3", "TM2"]
    models = {name: NoiseModel(0.2 + 0.1 * k, 0.01) for k, name in enumerate(names)}
    radiance = xr.DataArray(np.full((5, 9, 11), 50.0), dims=("band", "y", "x"))
    bands, kinds = TM.select(names), ("shot", "thermal")
    whole = noisy(radiance, TM, bands, kinds, 5, (3, 4), models)
    parts = noisy(radiance.chunk(band=chunk, y=4), TM, bands, kinds, 5, (3, 4), models)
    np.testing.assert_array_equal(parts, whole)
    for layer, name in enumerate(names):
        number = [band.name for band in TM.bands].index(name)
        alone = add_noise(
            radiance.values[layer], models[name], ("shot", "thermal"), seed=5, band=number, row=3, column=4
        )
        np.testing.assert_array_equal(whole[layer], alone)
