"""Plausibility of the units of an instrument file: kilometres, degrees and nanometres are detected."""

import numpy as np

from fifesim.sensor.description.fields import by_axes
from fifesim.sensor.description.spectral_response import half_peak
from fifesim.sensor.response.scan import swath_width

# Angles between samples above this one are degrees, or no imager's [rad].
_WIDEST = 0.02

# Smaller angles are below the diffraction limit of a mirror of 5 m: gsd is in kilometres [rad].
_FINEST = 1e-7

# The pixel size of a product is usually within a factor of 3 of the interval. A ratio within a factor of 3 of these
# values indicates a wrong unit.
_UNITS = {
    1000.0: ("altitude", "metres", "kilometres, so multiply by 1000"),
    1e-3: ("interval", "radians", "milliradians, so multiply by 1e-3, unless gsd is in kilometres"),
    1e-6: ("interval", "radians", "microradians, so multiply by 1e-6"),
    np.pi / 180: ("interval", "radians", "degrees, so multiply by pi / 180"),
}

# The agencies' solar spectra differ from ASTM G173 by up to 6 % in a band; units differ by 10 and more.
_SOLAR = 0.15

# Radiance of the largest digital number, relative to a white surface below an overhead sun. Bands for the ocean
# saturate early, but not all bands of an instrument do; Landsat's tables of 1986 in mW cm-2 sr-1 um-1 reach 0.06.
_RADIANCE = (0.02, 5.0)
_BRIGHTEST = 0.1

# Share of the line spread within one interval of its centre, below which it is too wide, and narrowest support in
# intervals. Detectors fill at least a third of their interval, and no response is wider than ten intervals.
_SHARE = 0.1
_NARROWEST = 0.1

# Response at the ends of its table, in its maximum, above which the table was cut inside the band.
_END = 0.2

# Published swaths are round numbers. A swath on a plane is up to 20 % narrower than on the sphere.
_SWATH = 0.25

# Samples times interval and the angle of the scan: published swaths, from which angles are derived, are rounded.
_SAMPLED = 0.05


def check_instrument_units(instrument):
    """Raise ValueError for numbers in a wrong unit, or a response that does not cover its band."""
    check_sampling(instrument)
    for number, band in enumerate(instrument.bands, 1):
        key = f"bands.{number}."
        try:
            _check_response(band)
            _check_radiance(band)
            _check_spread(instrument, band)
        except ValueError as error:
            raise ValueError(f"{key}{error}") from None
    ratios = [band.full_scale_radiance / band.spectrum_irradiance * np.pi for band in instrument.bands]
    if max(ratios) < _BRIGHTEST:
        raise ValueError(
            f"bands.full_scale_radiance: it is in W m-2 sr-1 um-1, and no band records more than {max(ratios):.0%} of "
            "a white surface; mW cm-2 sr-1 um-1 times 10"
        )
    if instrument.scan is not None:
        _check_scan(instrument)


def check_sampling(instrument):
    """Raise ValueError for an altitude, pixels or intervals in a wrong unit."""
    _check_sampling(instrument, instrument.interval, instrument.gsd, "")
    for number, band in enumerate(instrument.bands, 1):
        _check_sampling(instrument, band.interval or instrument.interval, instrument.pixel(band), f"bands.{number}.")


def _check_sampling(instrument, interval, gsd, key):
    for angle in by_axes(interval):
        if angle > _WIDEST:
            raise ValueError(
                f"{key}interval = {angle:g}: angles are in radians (43 urad is 43e-6); degrees times pi / 180. Without "
                f"interval it is gsd = {gsd:g} over altitude = {instrument.altitude:g}, both in metres"
            )
        if angle < _FINEST:
            raise ValueError(
                f"{key}interval = {angle:g}: no telescope resolves less than {_FINEST:g} radians. gsd = {gsd:g} is in "
                "metres; if it is kilometres, multiply by 1000"
            )
        ratio = gsd / (angle * instrument.altitude)
        for factor, (name, unit, remedy) in _UNITS.items():
            if abs(np.log(ratio / factor)) < np.log(2.5):
                place = "altitude" if name == "altitude" else f"{key}interval"
                value = instrument.altitude if name == "altitude" else angle
                raise ValueError(
                    f"{place} = {value:g}: it is in {unit}. Samples would lie {angle * instrument.altitude:g} m apart "
                    f"beside pixels of {gsd:g} m; it looks like {remedy}"
                )


def _check_spread(instrument, band):
    for field, step in zip(instrument.ground_fields(band), instrument.ground_intervals(band), strict=True):
        if field is not None and not _NARROWEST < field / step < 1 / _NARROWEST:
            raise ValueError(
                f"ifov = {field / instrument.altitude:g}: it is in radians, and {field / step:.3g} times the interval; "
                "degrees times pi / 180, milliradians times 1e-3, microradians times 1e-6"
            )
    for spread, step in zip(instrument.line_spreads(band), instrument.ground_intervals(band), strict=True):
        within = float(spread.cumulative(step) - spread.cumulative(-step))
        if within < _SHARE or 2 * spread.half_width < _NARROWEST * step:
            raise ValueError(
                f"lsf: its angles are in radians, and it is {2 * spread.half_width:g} m wide beside samples {step:g} m "
                "apart; degrees times pi / 180, milliradians times 1e-3, microradians times 1e-6"
            )


def _check_response(band):
    response = np.array(band.response.response) / max(band.response.response)
    wavelength = band.response.wavelength
    if max(response[0], response[-1]) > _END:
        end = 0 if response[0] > response[-1] else -1
        raise ValueError(
            f"srf: the response does not cover the band: at {wavelength[end]:g} um, where its table ends, it still is "
            f"{response[end]:.0%} of its maximum; add the wavelengths where it falls to zero"
        )
    if band.limits is None:
        return
    low, high = band.limits
    if low > 100:
        raise ValueError(f"limits = {list(band.limits)}: wavelengths are in um, these look like nm: divide by 1000")
    if wavelength[0] > low or wavelength[-1] < high or not low < band.wavelength < high:
        first, last = half_peak(band.response)
        raise ValueError(
            f"srf: the response does not cover the band from {low:g} to {high:g} um: it is tabulated from "
            f"{wavelength[0]:g} to {wavelength[-1]:g} um and above its half from {first:g} to {last:g} um; name "
            "another response or correct limits"
        )


def _check_radiance(band):
    expected = band.spectrum_irradiance
    if abs(band.solar_irradiance / expected - 1) > _SOLAR:
        raise ValueError(
            f"solar_irradiance = {band.solar_irradiance:g}: it is in W m-2 um-1, and the sun has {expected:.1f} over "
            "this response; mW cm-2 um-1 times 10, W m-2 nm-1 times 1000"
        )
    white = expected / np.pi
    if not _RADIANCE[0] <= band.full_scale_radiance / white <= _RADIANCE[1]:
        raise ValueError(
            f"full_scale_radiance = {band.full_scale_radiance:g}: it is in W m-2 sr-1 um-1, and a white surface has "
            f"{white:.1f} in this band; mW cm-2 sr-1 um-1 times 10"
        )
    for key in ("radiance", "high_radiance"):
        value = getattr(band.noise, key, None)
        if value is not None and not band.min_radiance < value < band.full_scale_radiance:
            raise ValueError(
                f"noise.{key} = {value:g}: it is in W m-2 sr-1 um-1 and must lie between min_radiance and "
                f"full_scale_radiance, {band.min_radiance:g} and {band.full_scale_radiance:g}"
            )


def _check_scan(instrument):
    scan = instrument.scan
    width = swath_width(instrument.altitude, scan.max_angle)
    if not np.isfinite(width):
        raise ValueError(
            f"scan.max_angle = {scan.max_angle:g}: at that angle from nadir, in degrees, the line of sight misses the "
            f"earth from an altitude of {instrument.altitude:g} m"
        )
    samples, first = scan.elementary_samples(), instrument.bands[0]
    if samples is not None:
        step = by_axes(first.interval or instrument.interval).across
        half = np.degrees(samples * step / 2)
        # A flat row of detectors has equal steps of the tangent.
        flat = np.degrees(np.arctan(samples * step / 2)) if scan.kind == "pushbroom" else half
        if not any(abs(each / scan.max_angle - 1) <= _SAMPLED for each in (half, flat)):
            raise ValueError(
                f"scan: samples of {first.name} times interval, {samples} x {step:g} radians, reach {half:.3g} degrees "
                f"to either side, and max_angle = {scan.max_angle:g} degrees from nadir; radians times 180 / pi, count "
                "the samples of the first band, and describe sums of samples on board by [[scan.zones]]"
            )
    if scan.swath is not None and abs(np.log(width / scan.swath)) > np.log(1 + _SWATH):
        raise ValueError(
            f"scan: max_angle = {scan.max_angle:g} degrees gives a swath of {width / 1000:.0f} km from this altitude, "
            f"and swath = {scan.swath:g} m; the angle is from nadir, in degrees, and the swath in metres"
        )
