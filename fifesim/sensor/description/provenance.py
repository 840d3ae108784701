"""
Origin of the spatial response, the noise and the geolocation of instruments.

A comparison of instruments is fair only if their descriptions are of one kind: an instrument of which only the detector
is known looks sharper than one whose blur was measured.
"""

from typing import Literal, NamedTuple

from pydantic.dataclasses import dataclass

from fifesim.sensor.description.fields import CONFIG, Positive
from fifesim.sensor.description.spatial_response import knows_blur

# Numbers of an instrument file by the name of the quantity that they describe.
NUMBER_OF = {"blur": "lsf", "noise": "noise", "geolocation": "geolocation"}

DescribedQuantity = Literal["blur", "noise", "geolocation"]

# Origin of a quantity that the instrument file does not have.
UNKNOWN = "unknown"


@dataclass(frozen=True, config=CONFIG)
class Origin:
    """Origin of one quantity of an instrument, from the best available source."""

    # Measured in flight, measured before launch, required by the mission, or assumed. A figure that was recalled
    # without reading its source is assumed.
    kind: Literal["in-flight", "pre-launch", "required", "assumed"]
    # Blur: largest error of the modulation transfer at the Nyquist frequency, up or down [1]. Noise: factor by which
    # the standard deviation may be larger or smaller [1]. Geolocation: largest error of the root mean square [m].
    uncertainty: Positive | None = None


class Provenance(NamedTuple):
    """Origin of one quantity, "blur", "noise" or "geolocation", in the bands that share it."""

    quantity: str
    bands: tuple[str, ...]
    origin: str  # kind as in `Origin`; "assumed" if the file has the quantity and no origin; "unknown" without both
    uncertainty: float | None  # as in `Origin`; None if it is not stated
    source: str  # publication or reason; for an unknown quantity the result of the search for it, if the file states it


def band_provenance(instrument, quantity, band):
    """Origin of a quantity in one band."""
    known = {
        "blur": knows_blur(instrument, band),
        "noise": band.noise is not None,
        "geolocation": instrument.geolocation is not None,
    }
    if not known[quantity]:
        return Provenance(quantity, (band.name,), UNKNOWN, None, instrument.not_found.get(quantity, ""))
    origin = band.origin.get(quantity) or instrument.origin.get(quantity) or Origin("assumed")
    source = instrument.source(NUMBER_OF[quantity], band)
    return Provenance(quantity, (band.name,), origin.kind, origin.uncertainty, source)


def provenance_of(instrument, bands=None):
    """Origins of blur, noise and geolocation in some bands of an instrument, one row for the bands that share one."""
    groups: dict[Provenance, list[str]] = {}
    for quantity in NUMBER_OF:
        for band in instrument.select(bands):
            groups.setdefault(band_provenance(instrument, quantity, band)._replace(bands=()), []).append(band.name)
    return tuple(row._replace(bands=tuple(names)) for row, names in groups.items())


def uncertainty_in_words(row):
    """Uncertainty of a quantity with its unit, empty if it is not stated."""
    if row.uncertainty is None:
        return ""
    forms = {
        "blur": f"± {row.uncertainty:g}",
        "noise": f"within a factor of {row.uncertainty:g}",
        "geolocation": f"± {row.uncertainty:g} m",
    }
    return forms[row.quantity]


# Shown in tables for a quantity that is unknown.
DASH = "–"


def origin_text(instrument, quantity, bands=None):
    """Origin of a quantity in some bands with its uncertainty, as text; a dash if it is unknown in all of them."""
    rows = [row for row in provenance_of(instrument, bands) if row.quantity == quantity]
    found = {}
    for row in rows:
        found.setdefault((row.origin, uncertainty_in_words(row)), []).extend(row.bands)
    if set(found) == {(UNKNOWN, "")}:
        return DASH
    texts = [" ".join(filter(None, key)) for key in found]
    if len(texts) == 1:
        return texts[0]
    return "; ".join(f"{text} ({', '.join(names)})" for text, names in zip(texts, found.values(), strict=True))


def origins_in_words(instrument, bands=None):
    """Origins of blur, noise and geolocation of some bands, in one line."""
    texts = {each: f"{each} {origin_text(instrument, each, bands)}" for each in NUMBER_OF}
    if instrument.geolocation is not None:
        texts["geolocation"] = f"geolocation error {geolocation_in_words(instrument)}"
    return "; ".join(texts.values())


def geolocation_in_words(instrument):
    """Geolocation error of an instrument with its origin, empty if it is unknown."""
    if instrument.geolocation is None:
        return ""
    return f"{instrument.geolocation:g} m ({origin_text(instrument, 'geolocation')})"


def mixed_origins(selected, quantities):
    """Message about quantities whose origin differs among instruments, from pairs of them and bands; empty if none."""
    parts = []
    for quantity in quantities:
        by_origin = {}
        for instrument, bands in selected:
            origins = {row.origin for row in provenance_of(instrument, bands) if row.quantity == quantity}
            by_origin.setdefault(" and ".join(sorted(origins)), []).append(instrument.name)
        if len(by_origin) > 1:
            texts = [f"{origin} ({', '.join(names)})" for origin, names in by_origin.items()]
            parts.append(f"{quantity} {', '.join(texts)}")
    if not parts:
        return ""
    return (
        f"the descriptions of the instruments have different origins: {'; '.join(parts)}. A difference between images "
        "may be a difference in knowledge: compare response='sharpest' and 'softest' of each, see fifesim.instrument"
    )
