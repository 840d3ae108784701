"""Nominal overpasses compared with orbit properties, sampling of global area coverage, and phenology."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.sensor.response.scan import DAY, Orbit, Track, ground_track, passes

PLACE, DIMS = (39.06, -96.54), ("band", "line", "sample")


def days(name, start, end, place=PLACE, **options):
    return fifesim.sensor.overpasses(name, f"{start}T00:00Z", f"{end}T00:00Z", place, **options)


@pytest.mark.parametrize(
    ("name", "cycle", "per_cycle"), [("TM", 16, 1), ("OLI", 16, 2), ("MSI", 10, 1), ("MODIS", 16, 18)]
)
def test_tracks_repeat_after_the_cycle(name, cycle, per_cycle):
    """Published repeat cycles and number of passes per cycle."""
    first, later = days(name, "1987-06-01", "1987-06-17"), days(name, "1987-06-01", "1987-07-19")
    shifted = set((first.time.values + np.timedelta64(cycle, "D")).astype("M8[s]").tolist())
    assert shifted <= set(later.time.values.astype("M8[s]").tolist())
    assert per_cycle <= first.sizes["time"] <= 2 * per_cycle


def test_landsat_has_the_local_time_and_track_spacing_of_its_orbit():
    found = days("TM", "1987-06-01", "1987-07-19", (0.0, 20.0))
    hour = (found.time.dt.hour + found.time.dt.minute / 60 + 20 / 15) % 24
    assert abs(hour - 9.75).max() < 0.1
    orbit = Orbit(233 / 16, 9.75, False, 98.2, 705e3)
    _, nodes = ground_track(orbit, np.arange(233) * DAY * 16 / 233)
    assert np.abs(nodes).max() <= 180
    spacing = np.diff(np.sort(nodes % 360))
    np.testing.assert_allclose(spacing, 360 / 233, rtol=1e-6)


def test_ground_track_has_the_heading_of_a_circular_orbit():
    """0.1 degrees: `Track` uses the sidereal day, the orbital plane the solar day."""
    orbit = Orbit(233 / 16, 9.75, False, 98.2, 705e3)
    seconds = np.linspace(0, DAY * 16 / 233, 20001)
    latitude, longitude = ground_track(orbit, seconds)
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


def test_dates_do_not_depend_on_the_start_of_the_period():
    for name in ("TM", "AVHRR"):
        whole, part = days(name, "1987-05-01", "1987-07-19"), days(name, "1987-06-03", "1987-07-19")
        assert set(part.time.values.tolist()) <= set(whole.time.values.tolist())


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: days("HRV", "1987-05-01", "1987-07-19"), "the orbit of HRV is unknown, known are TM"),
        (lambda: days("TM", "1987-07-19", "1987-05-01"), "end must be after start"),
        (lambda: days("TM", "1987-05-01", "1987-07-19", (-96.54, 39.06)), r"latitude must be in \[-90, 90\] .*swap"),
        (
            lambda: days("TM", "1987-05-01", "1987-07-19", (86.0, 39.06)),
            r"latitude must be in \[-85, 85\] degrees, got 86: closer to a pole",
        ),
        (
            lambda: days("TM", "1987-05-01", "1987-07-19", phase=np.nan),
            "phase must be a finite number of days, got nan",
        ),
        (lambda: days("MODIS", "1987-12-01", "1987-12-20", (80.0, 10.0)), "no pass by day over 80, 10 in this period"),
        (lambda: fifesim.sensor.to_gac(xr.DataArray(np.ones((1, 3, 9), "u2"), dims=DIMS)), "got digital numbers"),
        (
            lambda: fifesim.ground.phenology(["1987-05-05T00:00Z"], green_up=280, senescence=125),
            "senescence must be after green_up",
        ),
    ],
)
def test_invalid_arguments_raise(call, said):
    with pytest.raises(ValueError, match=said):
        call()


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
