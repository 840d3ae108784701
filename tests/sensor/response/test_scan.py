"""Sweeps, edges of footprints and orbits compared with published values; nominal overpasses, sampling and growth."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.base.footprints import Boxcar
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.scan import (
    DAY,
    EARTH_RADIUS,
    Footprints,
    Orbit,
    ScanPattern,
    Track,
    apply_operator,
    footprint_operator,
    ground_track,
    passes,
    swath_width,
    view_from_ground,
    view_from_scan,
)
from fifesim.sensor.response.spatial import CosineSpread

VIIRS = instrument("VIIRS")

# ------------------------------------------------------------------------------------------ sweeps


def test_view_beyond_the_horizon_is_missing():
    assert np.isnan(view_from_scan(70.0, 833e3)[0])
    assert np.isnan(view_from_ground(30.0, 833e3)).all()
    horizon = np.degrees(np.arcsin(EARTH_RADIUS / (EARTH_RADIUS + 705e3)))
    assert np.isnan(swath_width(705e3, horizon + 0.01)) and np.isfinite(swath_width(705e3, horizon - 0.01))


@pytest.mark.parametrize("band", ["I1", "M5"])
def test_sample_positions_and_scan_angles_are_inverse(band):
    """Zones from the SDR User's Guide 1.2: 31.72, 44.86 and 56.28 degrees; samples from viirs_pxcvt.c of OCSSW."""
    pattern = VIIRS.scan_pattern(VIIRS.select(band)[0])
    half = {"I1": (1184, 1920, 3200), "M5": (592, 960, 1600)}[band]
    np.testing.assert_allclose(pattern.scan_angle(np.array(half)), (31.72, 44.86, 56.28), rtol=0, atol=0.015)
    position = np.array([-half[2], -half[0] - 7.5, -0.5, 0.0, 0.5, half[0] + 7.5, half[1] + 3.5])
    np.testing.assert_allclose(pattern.position(pattern.scan_angle(position)), position, rtol=1e-14, atol=0)
    assert float(pattern.position(60.0)) == half[2]
    ends = np.array([-half[1] - 1, -half[1], -half[0] - 1, -half[0], 0, half[0] - 1, half[0], half[1]])
    assert pattern.zone_of(ends).tolist() == [2, 1, 1, 0, 0, 0, 1, 2]


@pytest.mark.parametrize(
    ("band", "lines", "samples", "zones"),
    [
        ("I1", 32, 6400, [((0, 1, 30, 31), 2016, 4384), ((2, 3, 28, 29), 1280, 5120)]),
        ("M5", 16, 3200, [((0, 15), 1008, 2192), ((1, 14), 640, 2560)]),
    ],
)
def test_deleted_pixels_agree_with_granules(band, lines, samples, zones):
    """Rows of a scan and their remaining columns in granules (CoastWatch, VIIRSBowtieFilter)."""
    expected = np.zeros((lines, samples), bool)
    for rows, first, last in zones:
        expected[list(rows), :first] = expected[list(rows), last:] = True
    pattern = VIIRS.scan_pattern(VIIRS.select(band)[0])
    line, sample = np.arange(-3 * lines, -2 * lines)[:, None], np.arange(samples) - samples // 2
    np.testing.assert_array_equal(pattern.is_deleted(line, sample), expected)


def test_pushbroom_and_single_detector_sweep_one_line():
    for name in ("OLI", "MSI", "AVHRR"):
        item = instrument(name)
        pattern = item.scan_pattern(item.bands[0])
        assert pattern.lines == 1 and pattern.track_angle() == [0.0] and not pattern.zones
    assert not ScanPattern(1e-3, 1e-3).is_deleted(np.arange(3)[:, None], np.arange(2)).any()


@pytest.mark.parametrize(("name", "sample"), [("I1", 0.35), ("M5", 0.25)])
def test_viirs_mtf_is_sample_mtf_times_aggregation(name, sample):
    """At 0.5 cycles per n samples, a sample passes m^(1 / n^2) and the sum of samples 1 / (n sin(pi / 2 n))."""
    item = VIIRS
    (band,) = item.select(name)
    step = item.ground_intervals(band).across / 3
    for count in (1, 2, 3):
        expected = sample ** (1 / count**2) / (count * np.sin(np.pi / (2 * count)))
        found = float(item.line_spreads(band, count).across.mtf(0.5 / (count * step)))
        assert found == pytest.approx(expected, rel=1e-6)
    spread = item.line_spreads(band)
    assert spread == item.line_spreads(band, 3) != item.line_spreads(band, 2), "three samples at nadir"
    assert float(spread.along.mtf(0.5 / item.ground_intervals(band).along)) == pytest.approx(0.42, rel=1e-9)


def test_footprint_beyond_the_edge_and_over_missing_cells_has_a_share():
    """Two pixels of 30 m on cells of 3.3 m, in the middle and at the edge of the scene."""
    c, s = np.cos(np.radians(14.0)) * 10 / 3, np.sin(np.radians(14.0)) * 10 / 3
    frames = np.stack([[[c, s], [-s, c]]] * 2)
    pixels = Footprints(np.array([30.3, 2.0]), np.full(2, 28.7), frames, CosineSpread(30.32), Boxcar(30.0))
    operator = footprint_operator(pixels, slice(0, 60), slice(0, 60))
    share = operator.sum(axis=1)
    assert share[0] == pytest.approx(1.0, rel=1e-12) and 0.5 < share[1] < 0.98
    constant = np.full((2, 3600), 0.3)
    constant[1, 30 * 60 + 28] = np.nan
    means = apply_operator(operator, constant, 0.9)
    assert means[:, 0] == pytest.approx(0.3, rel=1e-14)
    assert np.isnan(means[:, 1]).all()
    assert np.isfinite(apply_operator(operator, constant, 0.5)).all()


# ------------------------------------------------------------------------------------------ overpasses

PLACE, DIMS = (39.06, -96.54), ("band", "line", "sample")
LANDSAT = Orbit(233 / 16, 9.75, False, 98.2, 705e3)


def days(name, start, end, place=PLACE):
    return fifesim.sensor.overpasses(name, f"{start}T00:00Z", f"{end}T00:00Z", place)


@pytest.mark.parametrize(
    ("name", "cycle", "per_cycle"), [("TM", 16, 1), ("OLI", 16, 2), ("MSI", 10, 1), ("MODIS", 16, 18)]
)
def test_tracks_repeat_after_the_cycle(name, cycle, per_cycle):
    """Published repeat cycles and number of passes per cycle; dates do not depend on the start of the period."""
    first, later = days(name, "1987-06-01", "1987-06-17"), days(name, "1987-06-01", "1987-07-19")
    shifted = set((first.time.values + np.timedelta64(cycle, "D")).astype("M8[s]").tolist())
    assert shifted <= set(later.time.values.astype("M8[s]").tolist())
    assert per_cycle <= first.sizes["time"] <= 2 * per_cycle
    part = days(name, "1987-06-03", "1987-07-19")
    assert set(part.time.values.tolist()) <= set(later.time.values.tolist())


def test_landsat_has_the_local_time_and_track_spacing_of_its_orbit():
    found = days("TM", "1987-06-01", "1987-07-19", (0.0, 20.0))
    hour = (found.time.dt.hour + found.time.dt.minute / 60 + 20 / 15) % 24
    assert abs(hour - 9.75).max() < 0.1
    _, nodes = ground_track(LANDSAT, np.arange(233) * DAY * 16 / 233)
    assert np.abs(nodes).max() <= 180
    np.testing.assert_allclose(np.diff(np.sort(nodes % 360)), 360 / 233, rtol=1e-6)


def test_ground_track_has_the_heading_of_a_circular_orbit():
    """0.1 degrees: `Track` uses the sidereal day, the orbital plane the solar day."""
    seconds = np.linspace(0, DAY * 16 / 233, 20001)
    latitude, longitude = ground_track(LANDSAT, seconds)
    at = np.flatnonzero((latitude[:-1] > 39) & (latitude[1:] <= 39))[0]
    north = latitude[at + 1] - latitude[at]
    east = (longitude[at + 1] - longitude[at]) * np.cos(np.radians(39))
    heading = np.degrees(np.arctan2(east, north)) % 360
    assert abs(heading - Track.from_inclination(39.0, 0.0, 98.2, 705e3).heading) < 0.1


def test_view_agrees_with_the_scan_geometry():
    """Scan angle from the view zenith by the sine rule; view azimuth perpendicular to the track."""
    orbit = Orbit(233 / 16, 10.5, False, 98.2, 705e3)
    _, vza, vaa, ascending = passes(orbit, 0.0, 16 * DAY, *PLACE, 55.0)
    scan = np.degrees(np.arcsin(np.sin(np.radians(vza)) * 6371.0 / (6371.0 + 705.0)))
    assert scan.max() <= 55.01 and vza.max() > 60
    heading = Track.from_inclination(39.06, 0.0, 98.2, 705e3).heading
    across = np.abs(((vaa[~ascending] - heading) % 180) - 90)
    # Far from the track, the great circle across the track changes its azimuth.
    assert across[vza[~ascending] < 20].max() < 4


def test_gac_averages_four_of_five_samples_in_every_third_line():
    """Compared with explicit loops; mean longitudes across the date line lie between the samples."""
    rng = np.random.default_rng(2)
    values = rng.random((2, 7, 2048))
    values[0, 3, 7] = np.nan
    longitude = (179.9 + 0.0001 * np.arange(2048) + 180) % 360 - 180
    swath = xr.DataArray(values, dims=DIMS, coords={"longitude": (DIMS[1:], np.tile(longitude, (7, 1)))})
    found = fifesim.sensor.to_gac(swath)
    assert found.shape == (2, 3, 409)
    means = [[[row[5 * k : 5 * k + 4].mean() for k in range(409)] for row in band[::3]] for band in values]
    np.testing.assert_allclose(found.values, means, rtol=1e-12)
    turned = (found.longitude.values[0] - 179.9 + 180) % 360 - 180
    np.testing.assert_allclose(turned, 0.0001 * (5 * np.arange(409) + 1.5), atol=1e-9)


def test_phenology_is_half_at_green_up_and_senescence():
    dates = ["1987-05-05T00:00Z", "1987-10-07T00:00Z", "1987-07-20T00:00Z", "1987-01-02T00:00Z"]
    found = fifesim.ground.phenology(dates, green_up=125, senescence=280, winter=0.2, width=8)
    np.testing.assert_allclose(found, [0.6, 0.6, 1.0, 0.2], atol=1e-3)
