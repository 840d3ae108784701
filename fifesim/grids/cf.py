"""Names, units and provenance of variables, after the CF conventions."""

import re
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import xarray as xr

from fifesim.base.caches import cached
from fifesim.grids.grid import raster_of


@dataclass(frozen=True)
class Quantity:
    """Name, units, range and colours of a variable, for files, pictures, reports and pages."""

    units: str  # in CF spelling
    standard_name: str  # of CF, "" where none exists
    long_name: str
    comment: str = ""
    label: str = ""  # short, for axes, colour bars and tables; by default the long name
    shown_units: str = ""  # in pictures, if different from `units`
    lowest: float | None = None
    highest: float | None = None
    colours: str = "viridis"  # a colour map of matplotlib, or "land" for elevation; "gray" is for images
    middle: float | None = None  # value about which the colours diverge
    # Values of the first and the last colour in style files, the same for all files; None is a percentile.
    ends: tuple[float | None, float | None] = (None, None)

    def __post_init__(self):
        object.__setattr__(self, "label", self.label or self.long_name)


# Glint, snow and slopes in low sun have reflectance factors of up to 5, and corrections leave some below 0. Elevations
# are of land, with a margin.
QUANTITIES = {
    "lai": Quantity("1", "leaf_area_index", "leaf area index", "one-sided leaf area per ground area",
        label="LAI", shown_units="m2 m-2", lowest=0, highest=100, colours="YlGn", ends=(0, None)),
    "fpar": Quantity("1", "fraction_of_surface_downwelling_photosynthetic_radiative_flux_absorbed_by_vegetation",
        "fraction of absorbed photosynthetically active radiation",
        label="FPAR", lowest=0, highest=1, colours="YlGn", ends=(0, 1)),
    "green_fpar": Quantity("1", "", "fraction of photosynthetically active radiation that green leaves absorb",
        label="FPAR of green leaves", lowest=0, highest=1, colours="YlGn", ends=(0, 1)),
    "dead_fpar": Quantity("1", "", "fraction of photosynthetically active radiation that dead leaves absorb",
        label="light absorbed by dead leaves", lowest=0, highest=1, colours="copper_r", ends=(0, 1)),
    "ground_fpar": Quantity("1", "", "fraction of photosynthetically active radiation that the ground absorbs",
        label="light absorbed by the ground", lowest=0, highest=1, colours="YlOrBr", ends=(0, 1)),
    "reflected_par": Quantity("1", "", "fraction of photosynthetically active radiation that is reflected",
        label="reflected light", lowest=0, highest=1, colours="gray", ends=(0, 1)),
    "fcover": Quantity("1", "vegetation_area_fraction", "fraction of the ground covered by green vegetation",
        label="vegetation cover", lowest=0, highest=1, colours="YlGn", ends=(0, 1)),
    "brown": Quantity("1", "", "dead share of the leaf area", lowest=0, highest=1, colours="copper_r"),
    "dissociation": Quantity("1", "", "how far dead leaves lie below green ones", "0 mixed, 1 below",
        label="dissociation", lowest=0, highest=1, colours="copper_r"),
    "crown_cover": Quantity("1", "", "share of the ground below crowns",
        label="crown cover", lowest=0, highest=1, colours="YlGn"),
    "crown_shape": Quantity("1", "", "diameter of a crown over the height of its middle",
        label="crown shape", lowest=0, highest=10),
    "hotspot": Quantity("1", "", "leaf size over canopy height", label="hot spot", lowest=0, highest=10),
    "soil": Quantity("1", "", "brightness of the soil", "change of its reflectance at 0.55 um",
        lowest=-1, highest=1, colours="cividis"),
    "moisture": Quantity("1", "", "moisture of the soil", "0 where it is dry, 1 where it is saturated",
        lowest=0, highest=1, colours="Blues"),
    "cover": Quantity("1", "", "class of cover"),
    "class_share": Quantity("1", "area_fraction", "share of the ground of a class",
        label="class share", lowest=0, highest=1),
    "normal_score": Quantity("1", "", "standard normal deviate"),
    "surface_reflectance": Quantity("1", "surface_bidirectional_reflectance", "surface reflectance factor",
        "direct and diffuse light mixed", label="reflectance", lowest=-0.5, highest=5, colours="gray"),
    "dem": Quantity("m", "surface_altitude", "elevation of the ground",
        label="elevation", lowest=-500, highest=9000, colours="land"),
    "slope": Quantity("degree", "ground_slope_angle", "slope of the ground",
        label="slope", lowest=0, highest=90, colours="YlOrBr", ends=(0, None)),
    "aspect": Quantity("degree", "ground_slope_direction", "aspect of the ground",
        "down the slope, clockwise from true north; 0 where level",
        label="aspect", lowest=0, highest=360, colours="twilight"),
    "horizon": Quantity("degree", "", "zenith angle of the horizon",
        "of the land around, 90 where open; direction clockwise from north", label="horizon", lowest=0, highest=90),
    "sky_view": Quantity("1", "", "sky view factor", "diffuse light over that on an open plain",
        lowest=0, highest=1, colours="gray"),
    "terrain_view": Quantity("1", "", "share of land in the view of a slope", lowest=0, highest=1),
    "wetness": Quantity("1", "", "topographic wetness index",
        "logarithm of the area that drains through a metre of contour, over slope", label="wetness"),
    "illumination": Quantity("1", "", "cosine of the solar zenith angle on the slope", "0 in shadow",
        label="illumination", lowest=0, highest=1, colours="gray"),
    "shadow": Quantity("1", "", "shadow", "1 where the sun does not reach the slope",
        lowest=0, highest=1, colours="gray_r"),
    "optical_thickness": Quantity("1", "atmosphere_optical_thickness_due_to_cloud", "optical thickness of clouds",
        "vertical, toward the sensor where cast onto the ground", lowest=0, highest=100, colours="Blues_r"),
    "shadow_thickness": Quantity("1", "", "optical thickness of clouds toward the sun", "vertical",
        label="cloud thickness toward the sun", lowest=0, highest=100, colours="gray_r"),
    "overhead_thickness": Quantity("1", "", "optical thickness of clouds overhead", lowest=0, highest=100),
    "cloud": Quantity("1", "", "cloud", "1 where a cloud hides the ground from the sensor, or the share of a pixel",
        lowest=0, highest=1, colours="Blues_r"),
    "cloud_shadow": Quantity("1", "", "shadow of clouds", "1 where a cloud hides the sun, or the share of a pixel",
        lowest=0, highest=1, colours="gray_r"),
    "cloud_base": Quantity("m", "", "height of the base of clouds above the ground", label="cloud base",
        lowest=0),
    "cloud_top": Quantity("m", "", "height of the top of clouds above the ground", label="cloud top",
        lowest=0),
    "kt": Quantity("1", "", "topographic correction factor", "irradiance on the slope over that on level ground",
        label="Kt", lowest=0, colours="RdBu_r", middle=1),
    "topographic_c": Quantity("1", "", "constant of the C correction", "intercept over slope of reflectance on cos i"),
    "topographic_k": Quantity("1", "", "exponent of the Minnaert correction"),
    "toa_reflectance": Quantity("1", "toa_bidirectional_reflectance",
        "apparent reflectance at the top of the atmosphere", "the cosine of the solar zenith angle is divided out",
        label="reflectance", lowest=-0.5, highest=5, colours="gray"),
    "toa_radiance": Quantity("W m-2 sr-1 um-1", "toa_outgoing_radiance_per_unit_wavelength",
        "radiance at the top of the atmosphere", label="radiance", lowest=0, colours="gray"),
    "toa_radiance_std": Quantity("W m-2 sr-1 um-1", "toa_outgoing_radiance_per_unit_wavelength standard_error",
        "standard deviation of the radiance by noise", label="noise of the radiance", lowest=0),
    "toa_reflectance_std": Quantity("1", "toa_bidirectional_reflectance standard_error",
        "standard deviation of the reflectance by noise", label="noise of the reflectance", lowest=0),
    "ndvi_std": Quantity("1", "normalized_difference_vegetation_index standard_error",
        "standard deviation of NDVI by noise", label="noise of NDVI", lowest=0),
    "dn": Quantity("1", "", "digital number", "0 is no data; radiance = gain * dn + offset", lowest=0, colours="gray"),
    "ndvi": Quantity("1", "normalized_difference_vegetation_index", "normalized difference vegetation index",
        label="NDVI", lowest=-1, highest=1, colours="viridis", ends=(0, 1)),
    "evi": Quantity("1", "", "enhanced vegetation index", label="EVI", colours="viridis", ends=(0, 1)),
    "evi2": Quantity("1", "", "enhanced vegetation index of two bands", label="EVI2", colours="viridis", ends=(0, 1)),
    "savi": Quantity("1", "", "soil-adjusted vegetation index", "L = 0.5",
        label="SAVI", colours="viridis", ends=(0, 1)),
    "msavi": Quantity("1", "", "modified soil-adjusted vegetation index",
        label="MSAVI", colours="viridis", ends=(0, 1)),
    "ndwi": Quantity("1", "", "normalized difference water index", "green and near infrared, McFeeters (1996)",
        label="NDWI", lowest=-1, highest=1, colours="YlGnBu"),
    "ndmi": Quantity("1", "", "normalized difference moisture index", "near and shortwave infrared, Gao's water index",
        label="NDMI", lowest=-1, highest=1, colours="YlGnBu"),
    "nirv": Quantity("1", "", "near infrared reflectance of vegetation", label="NIRv", colours="viridis", ends=(0, 1)),
    "ndvi_bias": Quantity("1", "", "mean NDVI less NDVI of the mean reflectance",
        label="NDVI bias", colours="RdBu_r", middle=0),
    "fpar_bias": Quantity("1", "", "mean FPAR less FPAR of the mean leaf area index",
        label="FPAR bias", colours="RdBu_r", middle=0),
    "gpp": Quantity("g m-2 d-1", "gross_primary_productivity_of_biomass_expressed_as_carbon",
        "gross primary production, mass of carbon",
        label="GPP", shown_units="g C m-2 d-1", lowest=0, colours="YlGn", ends=(0, None)),
    "evapotranspiration": Quantity("kg m-2 d-1", "water_evapotranspiration_flux", "evapotranspiration",
        label="ET", shown_units="mm d-1", colours="YlGnBu", ends=(0, None)),
    "albedo": Quantity("1", "surface_albedo", "albedo of the ground", "direct and diffuse light mixed",
        label="albedo", lowest=0, highest=1, colours="gray"),
    "ren": Quantity("1", "", "relative equivalent noise", "uncertainty of an inferred variable over its value",
        label="REN", lowest=0),
    "sza": Quantity("degree", "solar_zenith_angle", "solar zenith angle", lowest=0, highest=180),
    "saa": Quantity("degree", "solar_azimuth_angle", "solar azimuth angle", "toward the sun, clockwise from north",
        lowest=0, highest=360),
    "vza": Quantity("degree", "sensor_zenith_angle", "sensor zenith angle", lowest=0, highest=90),
    "vaa": Quantity("degree", "sensor_azimuth_angle", "sensor azimuth angle", "toward the sensor, clockwise from north",
        lowest=0, highest=360),
    "earth_sun_distance": Quantity("astronomical_unit", "", "distance of Earth and Sun", lowest=0),
    "wavelength": Quantity("um", "sensor_band_central_radiation_wavelength", "response-weighted wavelength of the band",
        label="wavelength", lowest=0),
    "solar_irradiance": Quantity("W m-2 um-1", "solar_irradiance_per_unit_wavelength",
        "extraterrestrial solar irradiance of the band at 1 AU", label="solar irradiance", lowest=0),
    "adjustment_error": Quantity("1", "", "standard error of the surface reflectance from another instrument's bands",
        label="adjustment error", lowest=0),
    "contrast_left": Quantity("1", "", "contrast at the Nyquist frequency relative to an image of the ground itself",
        label="contrast left", lowest=0),
    "gain": Quantity("W m-2 sr-1 um-1", "", "radiance of one digital count", label="gain"),
    "offset": Quantity("W m-2 sr-1 um-1", "", "radiance of digital number 0", label="offset"),
    "compression": Quantity("1", "", "largest digital number of a scale of square roots",
        "if not 0, (dn^2 + 1/4) / compression stands for dn", label="compression", lowest=0),
}  # fmt: skip

_LONG_NAMES = {quantity.standard_name: quantity.long_name for quantity in QUANTITIES.values() if quantity.standard_name}

TIME_ATTRIBUTES = {"standard_name": "time", "long_name": "time, UTC"}
"""Attributes of a coordinate of times; units are the dates' own."""

# Attributes copied from inputs to results; all other attributes are replaced.
PROVENANCE = (
    "site", "rng_seed", "arp", "lai_distribution", "method", "leaf_angles", "background", "soil", "moisture",
    "atmosphere", "instrument", "instrument_description", "recorded_by", "composite", "saturated_pixels",
    "references",
)  # fmt: skip

# Other spellings of units.
_SAME_UNITS = dict.fromkeys(("", "m2 m-2", "dimensionless", "unitless", "reflectance"), "1") | dict.fromkeys(
    ("metre", "metres", "meter", "meters"), "m"
)


# Words in names and descriptions that identify a quantity; the first alone decide, where no standard name does.
_KNOWN_BY_NAME = {"lai", "ndvi", "fpar", "dem", "slope", "aspect"}
_WORDS = {name: name for name in (*_KNOWN_BY_NAME, "evi", "evi2", "savi", "msavi", "ndwi", "ndmi", "nirv")}
_WORDS |= {"fapar": "fpar", "elevation": "dem", "altitude": "dem", "reflectance": "surface_reflectance"}
_WORDS |= {"radiance": "toa_radiance"} | dict.fromkeys(("quality", "qa", "qc", "flag", "flags", "mask"), "quality")
_OTHER_UNITS = {"%", "percent", "m", "metre", "metres", "meter", "meters", "ft", "feet", "degree", "degrees", "k"}


# Steps from a standard name to a quantity, for messages.
_STEPS = {
    ("toa_bidirectional_reflectance", "surface_reflectance"): ".fifesim.to_surface(atmosphere) of it first",
    ("surface_bidirectional_reflectance", "toa_reflectance"): ".fifesim.to_toa(atmosphere) of it first",
    ("leaf_area_index", "surface_reflectance"): ".fifesim.surface_reflectance(instrument) of it first",
    ("leaf_area_index", "toa_reflectance"): ".fifesim.surface_reflectance(instrument).fifesim.to_toa() of it first",
}


@cached(256, "CF attributes")
def attributes(name):
    """CF attributes of a quantity, read-only."""
    quantity, keys = QUANTITIES[name], ("standard_name", "long_name", "units", "comment")
    return MappingProxyType({key: getattr(quantity, key) for key in keys if getattr(quantity, key)})


def label(array, name, *, history, source=None, **provenance):
    """Name an array and replace its attributes; provenance and history of `source` are kept."""
    before = source.attrs if source is not None else {}
    attrs = dict(attributes(name))
    for key in PROVENANCE:
        if key in before:
            attrs[key] = before[key]
    attrs |= provenance
    # An instrument description must belong to the instrument of the array.
    if "instrument" in provenance and "instrument_description" not in provenance:
        attrs.pop("instrument_description", None)
    cited = [*before.get("references", "").split("; "), *provenance.get("references", "").split("; ")]
    attrs |= {"references": "; ".join(dict.fromkeys(filter(None, cited)))} if any(cited) else {}
    attrs["history"] = "\n".join(filter(None, [before.get("history", ""), history]))
    out = raster_of(array.variable, array.coords.variables, array.xindexes, name)
    out.attrs = attrs
    return out


def check_quantity(array, *names):
    """Raise ValueError for an array of another quantity; missing metadata are accepted."""
    if is_counts(array) and "dn" not in names:
        raise ValueError(
            f"{array.name or 'the array'} holds digital numbers, where {QUANTITIES[names[0]].long_name} is needed: "
            "convert it with .fifesim.to_reflectance()"
        )
    stated, key, cure = array.attrs.get("standard_name"), "standard_name", "remove .attrs['standard_name']"
    wanted = [QUANTITIES[name].standard_name for name in names]
    if stated not in _LONG_NAMES or stated in wanted:
        check_units(array, *names)
        # Names of reflectance do not tell its level, and a name is weaker than a unit.
        has_unit = "units" in array.attrs and QUANTITIES[names[0]].units != "1"
        found = set() if has_unit else named(str(array.name)) & _KNOWN_BY_NAME
        if stated in _LONG_NAMES or not found:
            return
        stated, key, cure = QUANTITIES[min(found)].standard_name, "name", f"type .rename({names[0]!r})"
        if stated in wanted:
            return
    step = _STEPS.get((stated, names[0]), "the raster of that quantity")
    raise ValueError(
        f"{array.name or 'the array'} is {_LONG_NAMES[stated]} by its {key}, where "
        f"{QUANTITIES[names[0]].long_name} is needed: take {step}, "
        f"or {cure} if it is wrong"
    )


def is_counts(array):
    """Whether an array holds digital numbers: by its standard name, its name, and the coordinates of a calibration."""
    stated, name = array.attrs.get("standard_name") in _LONG_NAMES, getattr(array, "name", None)
    return "gain" in array.coords and not (stated or (name != "dn" and name in QUANTITIES))


def check_words(raster, texts, name, units=""):
    """Raise ValueError if metadata clearly name another quantity; unknown names and values that are no text pass."""
    for text in texts:
        if not isinstance(text, str):
            continue
        found = named(text)
        if (found and name not in found) or found & {"quality"}:
            raise ValueError(
                f"{raster} is named {text!r}, where {QUANTITIES[name].long_name} is needed: take the raster or band of "
                f"that quantity, or, if the name is wrong, correct it (.rename({name!r}) and .attrs, or the band "
                "description of the file)"
            )
    if units.strip().lower() in _OTHER_UNITS - {QUANTITIES[name].units}:
        raise ValueError(
            f"{raster} has units {units!r}, where {QUANTITIES[name].long_name} is needed, in "
            f"{QUANTITIES[name].units!r}: take the raster of that quantity, or correct .attrs['units']"
        )


def named(text):
    """Quantities that a text names."""
    words = re.findall("[a-z]+[0-9]?", text.lower().replace("_", " ").replace("leaf area", "lai"))
    return {*map(_WORDS.get, words)} - {None}


def units_of(array, default):
    """Units of an array in CF spelling."""
    units = array.attrs.get("units", default)
    # rioxarray lists the units of the bands.
    units = str(units[0] if isinstance(units, tuple | list) and len(set(units)) == 1 else units).strip()
    return _SAME_UNITS.get(units, units)


def check_units(array, *names):
    """Raise ValueError for an array with other units than any of some quantities; missing units are accepted."""
    units = units_of(array, QUANTITIES[names[0]].units)
    if units in {QUANTITIES[name].units for name in names}:
        return
    wanted = " or ".join(dict.fromkeys(repr(QUANTITIES[name].units) for name in names))
    raise ValueError(
        f"{array.name or 'the array'} has units {units!r}, {names[0]} needs {wanted}: "
        "convert it, then set .attrs['units']"
    )


def band_coordinates(**values):
    """Coordinates along the band dimension."""
    found = {"band": _band_axis(tuple(map(str, values.pop("band")))).copy(deep=False)}
    for name, value in values.items():
        found[name] = xr.Variable("band", np.asarray(value, float), attributes(name))
    return found


# Cached, because an index of text takes 0.2 ms.
@cached(256, "names of bands")
def _band_axis(names):
    return xr.IndexVariable("band", np.array(names, object), {"long_name": "band"})
