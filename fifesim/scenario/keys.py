"""All keys of a scenario: default, unit, range and meaning. `sections` adds the physical limits."""

import math
import re
from datetime import date, time
from pathlib import Path
from typing import Annotated, Literal, get_args, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, create_model, field_validator, model_validator
from pydantic.fields import FieldInfo

from fifesim.atmosphere.clouds import COVER, HEIGHT, LENGTH, THICKNESS
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import Coupling, FparLimit, MinValid, kind_of
from fifesim.base.files import check_regular, shown
from fifesim.base.geometry import PLACE, Geometry
from fifesim.base.messages import nearest
from fifesim.base.times import SITE_CORNERS, SITE_SIZE, utc
from fifesim.ground.canopy.properties import DRAWN, PROPERTIES
from fifesim.ground.landscape import ARP

_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")

# Power of ten of each unit of length. [m]
_LENGTHS = {"km": 3, "m": 0, "cm": -2}


def number(default, unit, description, **limits):
    """Field of a numeric key, optional if its default is None."""
    return Field(default, description=description, json_schema_extra={"unit": unit}, allow_inf_nan=False, **limits)


def ranged(default, known, description):
    """Field of a numeric key with the range of a description."""
    low, high = ("ge" if known.ends[0] == "[" else "gt"), ("le" if known.ends[1] == "]" else "lt")
    limits = {name: each for name, each in ((low, known.lowest), (high, known.highest)) if math.isfinite(each)}
    field = number(default, known.unit, description, **limits)
    field.json_schema_extra["range"] = known
    return field


def text(default, description):
    """Field of a key that is text or a switch."""
    return Field(default, description=description)


def seed(default, description):
    """Field of a key that is a seed."""
    return Field(default, description=description, ge=0, lt=2**63, strict=True)


def file(default, description, *, names=(), suffix=None):
    """Field of a key that is a file path, or one of several names."""
    return Field(default, description=description, json_schema_extra={"file": {"names": names, "suffix": suffix}})


class Section(BaseModel):
    """A table of the scenario. Numbers may have a unit, as in ``"45 km"``; lengths are in km, m or cm."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _strip_units(cls, values):
        if not isinstance(values, dict):
            raise ValueError(f"expected a table of keys, got {shown(values)}")
        return {key: cls.in_unit(key, value) for key, value in values.items()}

    @classmethod
    def in_unit(cls, key, value):
        """Value of a key in its unit, from a number or text such as ``"45 km"``."""
        unit = cls.unit(key) if key in cls.model_fields else ""
        if unit and isinstance(value, bool):
            raise ValueError(f"{key} = {value}: {key} is in {unit}; write a number")
        if not unit or not isinstance(value, str):
            return value
        match = _QUANTITY.fullmatch(value.strip())
        if match is None and str in get_args(cls.model_fields[key].annotation):
            # Such a key also accepts words.
            return value
        given = (match[2] or unit) if match else None
        if given != unit and not {given, unit} <= set(_LENGTHS):
            units = " or ".join(repr(each) for each in (_LENGTHS if unit in _LENGTHS else [unit]))
            raise ValueError(f"{key} = {shown(value)}: {key} is in {unit}; write a number, or a number and {units}")
        # Division by a power of ten is exact where possible.
        value, shift = float(match[1]), 0 if given == unit else _LENGTHS[given] - _LENGTHS[unit]
        return value * 10**shift if shift > 0 else value / 10**-shift

    @classmethod
    def unit(cls, key):
        """Unit of a key; empty if it has none."""
        return (cls.model_fields[key].json_schema_extra or {}).get("unit", "")

    @classmethod
    def names_a_file(cls, key, value):
        """Whether the value of a key is a file path."""
        if not isinstance(value, str) or key not in cls.model_fields:
            return False
        kind = (cls.model_fields[key].json_schema_extra or {}).get("file")
        if kind is None or value in kind["names"]:
            return False
        found, suffix = Path(value).suffix.lower(), kind["suffix"]
        if suffix in (None, "*"):
            return suffix is None or bool(found)
        return found in suffix if isinstance(suffix, tuple) else found == suffix

    @field_validator("*")
    @classmethod
    def _openable(cls, value, info):
        """Check a path, or a name in its place. Missing files are reported by their reader."""
        key = info.field_name
        kind = (cls.model_fields[key].json_schema_extra or {}).get("file") or {}
        names, is_file = kind.get("names"), cls.names_a_file(key, value)
        if names and value is not None and value not in names and not is_file:
            suffix = kind["suffix"]
            example = f"a raster file such as {key}.tif" if suffix == "*" else f"a file such as mine{suffix}"
            raise ValueError(f"{nearest(value, names)}use {', '.join(names)}, or {example}")
        if is_file:
            if not value:
                raise ValueError("name a file, or remove the key")
            value.encode()  # ValueError if it cannot be encoded
            try:
                check_regular(value)
            except (FileNotFoundError, NotADirectoryError):
                pass
            except OSError as error:
                raise ValueError(f"the file cannot be opened: {error.strerror}") from None
        return value

    def __dir__(self):
        """Names without those of pydantic."""
        return sorted(set(super().__dir__()) - {name for name in dir(BaseModel) if not name.startswith("__")})

    @property
    def written(self):
        """Keys of the table in order."""
        return type(self).model_fields

    @property
    def files(self):
        """Paths of the files named in the section, by key."""
        return {key: value for key, value in self if self.names_a_file(key, value)}

    def with_paths(self, change):
        """Section with modified file paths."""
        return self.model_copy(update={key: change(value) for key, value in self.files.items()})


def keys_of(description, names, base=Section, **changed):
    """Section with keys for fields of a dataclass: their types, ranges, meanings and defaults, unless changed."""
    hints, found = get_type_hints(description, include_extras=True), {}
    for name in names.split():
        default = changed.get(name, getattr(description, name, None))
        if isinstance(default, FieldInfo):
            found[name] = type(default.default), default
            continue
        (kind, *_, meaning), known = get_args(hints[name]), kind_of(hints[name]).known
        field = ranged(default, known, meaning) if known else text(default, meaning)
        found[name] = kind | None if default is None else kind, field
    return create_model("_Keys", __base__=base, **found)


COVERS = ("none", "pastures", "voronoi", "levels")
VARYING = tuple(DRAWN)
KEYS = {name: known for name, known in PROPERTIES.items() if known.default is not None}
"""Canopy properties that are single keys of a scenario."""
BASES = {
    "landscape": {},
    "paper": {"ground": {"distribution": "burned-grazed"}, "sensor": {"response": "paper"}},
}
"""Keys that differ from the defaults, by the name of the base of a scenario."""
STAND = ("distribution", "arp", "method", "lai_file")
"""Keys of [ground] for leaf area that is not of a learned landscape."""
FIELD_LIMITS = {"deviations": (0, 1)}
"""Smallest and largest number in the tables of a landscape. [1]"""

# Values by the name of a band, spectrum or leaf constituent.
ByName = dict[str, Annotated[float, Field(strict=True, allow_inf_nan=False)]]
LONGEST_NAME = 60
_LEAF = "structure [1], chlorophyll, carotenoids, anthocyanins [ug cm-2], brown [1], water [cm], dry_matter [g cm-2]"


class _LeafArea(Section):
    """Leaf area of a stand."""

    distribution: str = file("burned-grazed", "LAI distribution: a treatment, or a .csv of LAI samples", suffix=".csv")
    arp: float = ranged(0.15, ARP, "autoregressive parameter; larger values give smoother fields")


def _key(known):
    """Type and field of the key for a canopy property."""
    number = float, ranged(known.default, known, known.meaning)
    return number if known.unit else (str, text(known.default, known.meaning))


_Structure = create_model("_Structure", __base__=_LeafArea, **{name: _key(known) for name, known in KEYS.items()})


# mypy cannot follow classes built from a table.
class StandKeys(_Structure):  # type: ignore[misc, valid-type]
    """Leaf area, leaves and background of a stand."""

    leaf_reflectance: ByName = text({}, "by band [1]; all bands or none")
    leaf_transmittance: ByName = text({}, "by band [1]; all bands or none")
    background: ByName = text({}, "reflectance below the canopy by band [1]; all bands or none")
    leaf: ByName = text({}, f"instead of leaf optics by band: {_LEAF}")
    brown_leaf: ByName = text({}, f"dead leaves, by default dead tallgrass: {_LEAF}")
    background_spectra: ByName = text(
        {}, "instead of background by band: shares of soil_dry, soil_wet, dead_grass, golden_grass, shade"
    )

    @field_validator("leaf_reflectance", "leaf_transmittance", "background", "leaf", "brown_leaf", "background_spectra")
    @classmethod
    def _names_that_print(cls, value):
        for name in value:
            if len(name) > LONGEST_NAME or not name.isprintable():
                raise ValueError(f"{shown(name)} is not a name: names have up to {LONGEST_NAME} printable characters")
        return value

    @model_validator(mode="after")
    def _one_description(self):
        for spectra, by_band in (("leaf", "leaf_reflectance"), ("background_spectra", "background")):
            if getattr(self, spectra) and getattr(self, by_band):
                raise ValueError(f"{spectra} and {by_band} are both given: remove one of them")
        return self


class GroundKeys(StandKeys):
    """Leaf area, leaves and background."""

    seed: int = seed(7, "seed of the random fields")
    method: Literal["streaming", "periodic"] = text("streaming", "streaming, or periodic as in the paper (in memory)")
    lai_file: str | None = file(None, "LAI map to use instead of a random field")
    fpar_inf: float = ranged(0.94, kind_of(FparLimit).known, "FPAR of an infinitely thick canopy")


class ClassKeys(StandKeys):
    """A land cover class. Missing keys are taken from [ground]."""

    share: float | None = number(None, "1", "area fraction if cover is drawn; equal fractions by default", gt=0, le=1)
    code: int | None = text(None, "code in the cover map; by default classes are numbered from 1")

    @property
    def written(self):
        """Keys that differ from [ground]."""
        return {key: known for key, known in super().written.items() if key in self.model_fields_set}


class LandscapeKeys(Section):
    """A landscape learned from a map, or land cover classes, and ground properties that vary."""

    learned: str | None = file(
        None,
        "landscape learned from a map: konza; a .json file of Landscape.save; or none. By default konza, unless "
        "distribution, arp, method or lai_file of [ground], or cover is given",
        names=("konza", "none"),
        suffix=".json",
    )
    cover: str = file(
        "none",
        "layout of the classes: none; pastures, voronoi or levels, which are drawn; or a raster file of class codes",
        names=COVERS,
        suffix="*",
    )
    size: float = number(1200.0, "m", "side of a drawn pasture, or width of a drawn patch", gt=0)
    deviations: ByName = text({}, f"standard deviations [1] of properties drawn as fields: {', '.join(VARYING)}")

    @field_validator("deviations")
    @classmethod
    def _known_properties(cls, values, info):
        low, high = FIELD_LIMITS[info.field_name]
        for name, value in values.items():
            if name not in VARYING:
                hint = nearest(name, VARYING)
                raise ValueError(f"unknown name {shown(name)}: {hint}allowed are {', '.join(VARYING)}")
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: must be in [{low:g}, {high:g}]")
        return values


LAND_FORMS = ("flint-hills", "flat")
INTERVALS = ("product", "native")
EXTENT = ("west", "north", "width", "height")


class GridKeys(Section):
    """Ground cells. Without corner and size, a scene that reads a LAI file covers that file."""

    crs: str = text(SITE_CORNERS["NAD83"][0], "projected coordinate reference system in metres")
    west: float = number(SITE_CORNERS["NAD83"][1], "m", "easting of the upper left corner")
    north: float = number(SITE_CORNERS["NAD83"][2], "m", "northing of the upper left corner")
    width: float = number(SITE_SIZE, "m", "west to east", gt=0)
    height: float = number(SITE_SIZE, "m", "north to south", gt=0)
    cell: float = number(30 / 9, "m", "size of a cell", ge=0.001)


class TerrainKeys(Section):
    """Elevation, and illumination of slopes."""

    dem: str = file(
        "flint-hills",
        "flint-hills (synthetic), flat, or a raster file of elevation; flat below a lai_file by default",
        names=LAND_FORMS,
        suffix="*",
    )
    seed: int = seed(7, "seed of the synthetic hills")
    fill: float | None = number(
        None, "m", "interpolate gaps of the file up to this distance; by default they stay", gt=0
    )
    vertical_units: str | None = text(None, "units of the elevation file if they are not metres, such as ft")
    horizon_reach: float = number(5000.0, "m", "maximum distance of terrain that blocks the sky", ge=30, le=50_000)
    upwelling: bool = text(True, "apply the cosine of the view angle on slopes (Eq. 5)")
    slopes: Literal["kt", "upright"] = text(
        "kt", "reflectance of slopes: kt (Eq. 4), or upright (SAIL, upright plants)"
    )

    @model_validator(mode="after")
    def _options_of_a_file(self):
        for key in ("fill", "vertical_units"):
            if getattr(self, key) is not None and self.dem in LAND_FORMS:
                raise ValueError(f"{key} needs an elevation file, dem is {self.dem!r}: name a file or remove {key}")
        if self.slopes != "kt" and self.dem == "flat":
            raise ValueError(f"slopes = {self.slopes!r} needs an elevation, dem is 'flat': name hills or remove slopes")
        return self


class _TimeAndPlace(Section):
    """Time and place of the overpass."""

    time: str | None = text(
        None,
        "date and time, UTC unless it has an offset such as -05:00; by default a hypothetical overpass, on the FIFE "
        "site only. With sza and saa instead, the distance to the sun is 1 astronomical unit",
    )
    latitude: float | None = ranged(None, PLACE["latitude"], "degrees north; by default from the grid")
    longitude: float | None = ranged(None, PLACE["longitude"], "degrees east; by default from the grid")


class SunAndViewKeys(keys_of(Geometry, "sza saa vza vaa", _TimeAndPlace, sza=None, saa=None)):  # type: ignore[misc]
    """Directions of sun and sensor. The sun follows from time and place, or from sza and saa."""

    @field_validator("time", mode="before")
    @classmethod
    def _full_date(cls, value):
        if value is None:
            return value
        # TOML has a date type.
        written = value.isoformat() if isinstance(value, date | time) else value
        utc(written)  # ValueError for an unreadable time
        return written

    @model_validator(mode="after")
    def _whole_sun(self):
        if (self.sza is None) != (self.saa is None):
            raise ValueError("sza and saa go together: give both, or neither to compute the sun from time and place")
        return self


_AEROSOL = file(
    "continental",
    'aerosol model, "none", a mixture such as "dust:0.5+soot:0.5" by volume, or a .nc or .csv file with aerosol '
    "optical properties, which needs aot",
    suffix=(".nc", ".csv"),
)
_Air = keys_of(Atmosphere, "profile aerosol visibility aot altitude h2o o3 engine", visibility=45.0, aerosol=_AEROSOL)


class AirKeys(_Air):  # type: ignore[misc, valid-type]
    """The atmosphere."""

    coupling: Coupling = text(
        "lambert",
        "reflectance of the ground toward the sky: lambert (one factor), four-stream (isotropic sky) or directional",
    )
    adjacency: bool = text(False, "adjacency effect: light from the surroundings is scattered into the line of sight")

    @model_validator(mode="before")
    @classmethod
    def _one_amount(cls, values):
        if not isinstance(values, dict):
            return values
        by_aot = values.get("aot") is not None or cls.names_a_file("aerosol", values.get("aerosol"))
        return values | {"visibility": values.get("visibility")} if by_aot else values


class CloudKeys(Section):
    """Water clouds and their shadows."""

    cloud_cover: float = ranged(0.0, COVER, "cover of clouds over 100 km; 0 is a clear sky")
    thickness: float = ranged(8.0, THICKNESS, "mean optical thickness within clouds")
    deviation: float | None = ranged(None, THICKNESS, "its standard deviation; by default the mean")
    length: float = ranged(2000.0, LENGTH, "distance at which the correlation has fallen to 0.05")
    base: float = ranged(1200.0, HEIGHT, "height of the base above the altitude of the atmosphere")
    top: float = ranged(1800.0, HEIGHT, "height of the top")
    seed: int = seed(7, "seed of the clouds; each date has an independent sky")
    # The limit of the cloud mask of MODIS (Ackerman et al., 2008, doi:10.1175/2007JTECHA1053.1).
    mask: float = ranged(0.4, THICKNESS, "optical thickness from which a budget leaves out clouds and shadows")

    @model_validator(mode="after")
    def _base_below_top(self):
        if self.base > self.top:
            raise ValueError(f"base = {self.base:g} is above top = {self.top:g}: swap them")
        return self


OFFSET_PARTS = ("down", "across")
"""Names of the two parts of ``sensor.offset``, each of which a study may draw."""


class SensorKeys(Section):
    """The instrument."""

    instrument: str = file("TM", "instrument name, see: fifesim sensors", suffix=".toml")
    bands: list[str] = text(["TM3", "TM4"], "band names; by default red and near infrared, in a file also green")
    pixel: float | None = number(
        None,
        "m",
        "pixel size; by default the size in the gridded product of the bands; does not change the footprint",
        gt=0,
    )
    interval: str | float = Field(
        "product",
        description="distance between pixels: product, the pixel size; native, as the instrument samples; or metres",
        json_schema_extra={"unit": "m"},
    )
    offset: list[float] = Field(
        [0.0, 0.0],
        description="registration error southward and eastward, which shifts the footprints",
        json_schema_extra={"unit": "pixel"},
        min_length=2,
        max_length=2,
    )
    response: str | None = text(None, "spatial response: system, sharpest, softest, detector, or paper (TM)")
    noise: list[str] = text(
        [], "detector noise: shot, thermal, fixed-pattern; or all that are known for the instrument"
    )
    noise_model: ByName = text(
        {},
        "noise of all bands, replacing the instrument's: thermal [W m-2 sr-1 um-1], shot [W m-2 sr-1 um-1], detectors, "
        "gain_spread [1], offset_spread [W m-2 sr-1 um-1]",
    )
    seed: int = seed(0, "seed of the noise")
    min_valid: float = ranged(0.98, kind_of(MinValid).known, "minimum fraction of a pixel's footprint on valid cells")

    @field_validator("bands")
    @classmethod
    def _some_bands(cls, value):
        if not value:
            raise ValueError("name at least one band")
        return value

    @field_validator("interval")
    @classmethod
    def _known_interval(cls, value):
        if value in INTERVALS or (not isinstance(value, str) and 0 < value < math.inf):
            return value
        raise ValueError(f"must be {' or '.join(INTERVALS)}, or a positive distance between pixels in metres")

    @field_validator("offset", mode="before")
    @classmethod
    def _named_offset(cls, value):
        if isinstance(value, dict):
            if set(value) != set(OFFSET_PARTS):
                raise ValueError(f"must have {' and '.join(OFFSET_PARTS)}, or be a list of both")
            return [value[name] for name in OFFSET_PARTS]
        return value

    @field_validator("offset")
    @classmethod
    def _finite_offset(cls, value):
        if not all(map(math.isfinite, value)):
            raise ValueError("must be two finite numbers of pixels")
        return value


class Keys(Section):
    """The sections of a scenario as written in TOML; each class has a section ``[classes.NAME]``."""

    grid: GridKeys = GridKeys()
    ground: GroundKeys = GroundKeys()
    landscape: LandscapeKeys = LandscapeKeys()
    classes: dict[str, ClassKeys] = Field({})
    terrain: TerrainKeys = TerrainKeys()
    geometry: SunAndViewKeys = SunAndViewKeys()
    atmosphere: AirKeys = AirKeys()
    clouds: CloudKeys = CloudKeys()
    sensor: SensorKeys = SensorKeys()  # type: ignore[call-arg]

    @field_validator("classes")
    @classmethod
    def _words(cls, value):
        for name in value:
            if len(name) > LONGEST_NAME or not name.isprintable() or len(name.split()) != 1:
                raise ValueError(
                    f"{shown(name)} is not a valid class name: names are one word of up to {LONGEST_NAME} characters"
                )
        return value

    @classmethod
    def section(cls, place):
        """Section type of a table by its place; None if it is unknown."""
        name, *inside = place
        if name not in cls.model_fields or (name == "classes") != bool(inside):
            return None
        annotation = cls.model_fields[name].annotation
        return get_args(annotation)[1] if inside else annotation

    def sections(self):
        """Sections of a scenario by place."""
        found = {}
        for name, value in self:
            found |= {(name, key): section for key, section in value.items()} if name == "classes" else {(name,): value}
        return found

    @model_validator(mode="before")
    @classmethod
    def _with_base(cls, values):
        """Replace the key base by its keys, unless they are given."""
        if not isinstance(values, dict) or "base" not in values:
            return values
        values = dict(values)
        if (base := values.pop("base")) not in BASES:
            raise ValueError(f"base = {shown(base)}: must be {' or '.join(BASES)}")
        for section, keys in BASES[base].items():
            own = values.get(section, {})
            if isinstance(own, dict) and "instrument" not in own:
                values[section] = keys | own
        return values

    @model_validator(mode="before")
    @classmethod
    def _no_invented_hills(cls, values):
        """Set terrain to flat for a LAI map without elevation. Synthetic hills would not match a real landscape."""
        if not isinstance(values, dict):
            return values
        ground, terrain = values.get("ground"), values.get("terrain", {})
        lai_file = ground.get("lai_file") if isinstance(ground, dict) else getattr(ground, "lai_file", None)
        if lai_file and isinstance(terrain, dict) and "dem" not in terrain:
            return values | {"terrain": {"dem": "flat"} | terrain}
        return values
