"""Instruments as text."""

from fifesim.base.messages import value_in_words
from fifesim.sensor.description.fields import TwoAxes, by_axes
from fifesim.sensor.description.provenance import UNKNOWN, uncertainty_in_words
from fifesim.sensor.description.spatial_response import knows_blur, with_response
from fifesim.sensor.description.spectral_response import half_peak
from fifesim.sensor.response.noise import ALL


def list_instruments(instruments):
    """List of instruments, one line each."""
    lines = [f"{'name':<11}{'pixels, m':>14}{'bits':>6}{'bands':>7}  instrument"]
    for item in instruments:
        pixels = ", ".join(f"{size:g}" for size in sorted({item.pixel(band) for band in item.bands}))
        lines.append(f"{item.name:<11}{pixels:>14}{item.bits:>6}{len(item.bands):>7}  {item.title}")
    return "\n".join(lines)


def instrument_in_words(instrument):
    """Text of an instrument: sampling, spatial response, radiometry, noise and sources."""
    lines = [f"{instrument.name}  {instrument.title}"]
    if instrument.aliases:
        lines.append(f"  also called {', '.join(instrument.aliases)}")
    lines += [f"  altitude {instrument.altitude / 1000:g} km, {instrument.bits} bits", *_scan(instrument)]
    lines += [*_product(instrument), *_sampling(instrument), *_radiometry(instrument)]
    lines += ["  origin of blur, noise and geolocation", *_origins(instrument)]
    lines += [f"  not known: {name}, {text}" for name, text in instrument.not_found.items()]
    lines += ["  sources", *(f"    {text}" for text in instrument.references.values())]
    return "\n".join(lines)


def names_of_bands(instrument):
    """Names of the bands; of many, the first and the last."""
    names = [band.name for band in instrument.bands]
    return ", ".join(names) if len(names) <= 24 else f"{names[0]} to {names[-1]} ({len(names)})"


def instrument_rows(instrument):
    """Name, value and meaning of the main properties of an instrument."""
    sizes = sorted({instrument.pixel(band) for band in instrument.bands})
    waves = sorted(band.wavelength for band in instrument.bands)
    rows = [
        ("altitude", f"{instrument.altitude / 1000:g} km", "above the ground"),
        ("pixel", f"{value_in_words(sizes)} m", "of the gridded product"),
        ("bits", instrument.bits, "radiometric resolution"),
        ("bands", names_of_bands(instrument), f"from {waves[0]:.3f} to {waves[-1]:.3f} µm"),
        *(("scan", text.strip(), "") for text in _scan(instrument)),
    ]
    origins = (line.strip().partition(" ") for line in _origins(instrument))
    return rows + [(name, text, "origin and source") for name, _, text in origins]


def _origins(instrument):
    """Lines on the origin of blur, noise and geolocation, one for the bands that share it."""
    lines = []
    for row in instrument.provenance:
        names = row.bands
        every = len(names) == len(instrument.bands)
        which = "all bands" if every else ", ".join(names) if len(names) < 10 else f"{names[0]} to {names[-1]}"
        parts = [row.origin, uncertainty_in_words(row), "" if row.origin == UNKNOWN else row.source]
        lines.append(f"    {row.quantity} of {which}: {'; '.join(filter(None, parts))}")
    return lines


def _scan(instrument):
    scan = instrument.scan
    if scan is None:
        return []
    parts = [f"{scan.kind}, {scan.max_angle:g} degrees to either side"]
    parts += [f"swath {scan.swath / 1000:g} km"] if scan.swath else []
    parts += [f"{instrument.detectors} detectors a band"] if instrument.detectors else []
    sums = [str(zone.aggregation) for zone in scan.zones]
    parts += [f"sums of {', '.join(sums)} samples from nadir outward"] if sums else []
    return [f"  {', '.join(parts)}"]


def _product(instrument):
    product = instrument.product
    if product is None:
        return []
    sun = "" if product.sun_corrected else " x cosine of the solar zenith angle"
    return [f"  Level-1 product: {product.gain:g} x DN {product.offset:+g} is reflectance{sun}, {product.bits} bits"]


def _sampling(instrument):
    """Lines on pixels and line spread functions, one for each group of bands that share them."""
    groups = {}
    for band in instrument.bands:
        angles = instrument.ground_intervals(band), instrument.ground_fields(band)
        seen = (instrument.pixel(band), *angles, band.lsf or instrument.lsf)
        groups.setdefault(seen, []).append(band)
    lines = []
    for (pixel, intervals, fields, response), bands in groups.items():
        kinds = by_axes(response) if isinstance(response, TwoAxes) else [response]
        which = ", ".join(band.name for band in bands) if len(groups) > 1 else "all bands"
        lines += [
            f"  {which}: pixels of {pixel:g} m in the gridded product",
            f"    own interval {_pair(intervals, '.3f')} m at nadir"
            + (f", instantaneous field of view {_pair(fields, '.2f')} m" if fields.along else ""),
            f"    line spread {' x '.join(part.kind for part in kinds)}, modulation transfer at the Nyquist frequency "
            f"of the own interval {_pair(_transfer(instrument, bands[0]), '.2f')}",
        ]
        lines += [f"    {text}: images are sharper" for text in _detector(instrument, bands[0])]
        if not knows_blur(instrument, bands[0]):
            lines.append(
                "    that of the detector alone: images are sharper than the instrument's, whose blur is not known"
            )
    return lines


def _pair(values, form):
    """Two values, along and across the track, or one where they are equal."""
    along, across = values
    return f"{along:{form}}" if along == across else f"{along:{form}} along x {across:{form}} across"


def sensor_in_words(instrument, bands):
    """Description of an instrument and its view in some bands, in one or two sentences."""
    names = [f"{band.name} ({band.wavelength:.2f} µm)" for band in instrument.select(bands)]
    text = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    kind = {"whiskbroom": ", a whiskbroom scanner", "pushbroom": ", a pushbroom scanner"}
    scans = kind.get(instrument.scan.kind, "") if instrument.scan else ""
    return f"{instrument.title}{scans}, {instrument.altitude / 1000:g} km up, in {text}; {instrument.bits} bits"


def blur_in_words(instrument, bands):
    """Known spatial response of some bands, in one line."""
    chosen = instrument.select(bands)
    found = {band.name: _pair(_transfer(instrument, band), ".2f") for band in chosen}
    same = len(set(found.values())) == 1
    transfers = [found[chosen[0].name]] if same else [f"{name} {text}" for name, text in found.items()]
    text = f"modulation transfer at the Nyquist frequency {', '.join(transfers)}"
    unknown = [band.name for band in chosen if not knows_blur(instrument, band)]
    if unknown:
        text += f"; only the detector of {', '.join(unknown)} is known, so the image is too sharp"
        text += _published(instrument, "blur")
    alone = {band.name: text for band in chosen for text in _detector(instrument, band)}
    if alone:
        text += f"; {next(iter(alone.values()))}: the image of {', '.join(alone)} is sharper"
    return text


def _transfer(instrument, band):
    """Modulation transfer at the Nyquist frequency of the sampling interval, along and across the track."""
    pairs = zip(instrument.line_spreads(band), instrument.ground_intervals(band), strict=True)
    return [float(spread.mtf(0.5 / step)) for spread, step in pairs]


def _detector(instrument, band):
    """Line on the transfer of the detector alone, if it is below that in the band."""
    passed = _transfer(instrument, band)
    detector = with_response(instrument, "detector")
    alone = _transfer(detector, *detector.select([band.name]))
    # Rounded to the two printed digits.
    return [f"the detector alone has {_pair(alone, '.2f')}"] if max(passed) > max(alone) + 0.005 else []


def noise_in_words(instrument, bands, kinds=()):
    """Noise added to some bands, or its absence, in one line."""
    if kinds:
        return "all known components" if tuple(kinds) == (ALL,) else ", ".join(kinds)
    unknown = [band.name for band in instrument.select(bands) if band.noise is None]
    if not unknown:
        return "none"
    return f"none; the noise of {', '.join(unknown)} is unknown{_published(instrument, 'noise')}"


def _published(instrument, quantity):
    """Publisher of a quantity that is missing in the instrument file, as text."""
    return f", {instrument.not_found[quantity]}" if quantity in instrument.not_found else ""


def _radiometry(instrument):
    lines = [
        "  band      wavelength    at half peak      radiance of DN 0 and full scale      step   solar irradiance"
        "    SNR at radiance",
        "                    um              um                     W m-2 sr-1 um-1            W m-2 um-1 (G173)",
    ]
    for band in instrument.bands:
        low, high = half_peak(band.response)
        step = (band.full_scale_radiance - band.min_radiance) / (2**instrument.bits - 1)
        noise = ""
        if band.noise is not None:
            noise = f"{band.noise.radiance / band.noise.equivalent_radiance:>9.0f} at {band.noise.radiance:g}"
            if band.noise.high_snr is not None:
                noise += f", {band.noise.high_snr:.0f} at {band.noise.high_radiance:g}"
        gain = f"  {band.gain} gain; also {', '.join(band.gains)}" if band.gains else ""
        gain += f"  {band.compression} scale" if band.compression else ""
        lines.append(
            f"  {band.name:<8}{band.wavelength:>12.4f}{low:>9.3f} - {high:.3f}{band.min_radiance:>18.2f}"
            f"{band.full_scale_radiance:>16.2f}{step:>12.4f}{band.solar_irradiance:>11.1f} "
            f"({band.spectrum_irradiance:.1f}){noise}{gain}"
        )
    return lines
