"""Every key of a scenario: its default, unit, range and meaning. What physics says of a value is beside its meaning."""

import math
import re
from datetime import datetime
from typing import Annotated, Literal, get_args

from pydantic import Field, field_validator, model_validator

from fifesim.base import fife
from fifesim.base.foreign import shown
from fifesim.scenario.section import Section, file, nearest, number, seed, text

LAND_FORMS = ("flint-hills", "flat")
INTERVALS = ("product", "native")
COVERS = ("none", "pastures", "voronoi", "levels")
VARYING = ("soil", "moisture", "brown", "crown_cover")
COVARIATES = ("elevation", "wetness", "illumination")
EXTENT = ("west", "north", "width", "height")
ENGINES = ("5S", "successive-orders", "successive-orders-scalar", "6S")

# A date alone has no sun, and 06/07/1987 is in June or in July.
_TIME = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d{1,6})?)?(Z|[+-]\d\d:\d\d)?", re.ASCII)
_YEARS = 1700, 2200  # what dates in nanoseconds hold


# By the name of a band, a spectrum or a part of a leaf.
_ByName = dict[str, Annotated[float, Field(strict=True, allow_inf_nan=False)]]
_LONGEST_NAME = 60
_LEAF = (
    "structure [1], chlorophyll, carotenoids, anthocyanins [ug cm-2], brown [1], water [cm], dry_matter [g cm-2]"
)
_LEAST_HOTSPOT = 1e-6  # below it the hot spot is narrower than the sun


class GridKeys(Section):
    """Ground cells. Without corner and size, a scene that reads a LAI file covers that file."""

    crs: str = text(fife.CORNERS["NAD83"][0], "projected coordinate reference system in metres")
    west: float = number(fife.CORNERS["NAD83"][1], "m", "easting of the upper left corner")
    north: float = number(fife.CORNERS["NAD83"][2], "m", "northing of the upper left corner")
    width: float = number(fife.SIZE, "m", "west to east", gt=0)
    height: float = number(fife.SIZE, "m", "north to south", gt=0)
    cell: float = number(30 / 9, "m", "size of a cell", ge=0.001)


class StandKeys(Section):
    """Leaf area, leaves and what lies below them, of a stand of plants."""

    distribution: str = file("burned-grazed", "LAI distribution: a treatment, or a .csv of LAI samples", suffix=".csv")
    arp: float = number(0.15, "1", "autoregressive parameter; larger is smoother", ge=0, lt=0.25)
    leaf_angles: str = text("spherical", "leaf angle distribution")
    hotspot: float = number(0.0, "1", "leaf size over canopy height", ge=0, le=10)
    brown: float = number(0.0, "1", "share of dead leaf area", ge=0, le=1)
    dissociation: float = number(0.0, "1", "0: dead leaves are mixed with green ones; 1: lie below", ge=0, le=1)
    crown_cover: float = number(1.0, "1", "share of the ground below crowns", ge=0, le=1)
    crown_shape: float = number(1.0, "1", "diameter of a crown over the height of its middle", ge=0, le=10)
    leaf_reflectance: _ByName = text({}, "by band [1]; all bands or none")
    leaf_transmittance: _ByName = text({}, "by band [1]; all bands or none")
    background: _ByName = text({}, "reflectance below the canopy by band [1]; all bands or none")
    leaf: _ByName = text({}, f"instead of leaf optics by band: {_LEAF}")
    brown_leaf: _ByName = text({}, f"dead leaves, by default dead tallgrass: {_LEAF}")
    background_spectra: _ByName = text(
        {}, "instead of background by band: shares of soil_dry, soil_wet, dead_grass, golden_grass, shade"
    )

    @field_validator("hotspot")
    @classmethod
    def _wide_enough(cls, value):
        if 0 < value < _LEAST_HOTSPOT:
            raise ValueError(f"must be 0, for no hot spot, or at least {_LEAST_HOTSPOT:g}")
        return value

    @field_validator("leaf_reflectance", "leaf_transmittance", "background", "leaf", "brown_leaf", "background_spectra")
    @classmethod
    def _names_that_print(cls, value):
        for name in value:
            if len(name) > _LONGEST_NAME or not name.isprintable():
                raise ValueError(f"{shown(name)} is no name: names have up to {_LONGEST_NAME} characters that print")
        return value

    @model_validator(mode="after")
    def _one_description(self):
        for spectra, by_band in (("leaf", "leaf_reflectance"), ("background_spectra", "background")):
            if getattr(self, spectra) and getattr(self, by_band):
                raise ValueError(f"{spectra} and {by_band} are both given: drop one of them")
        return self


class GroundKeys(StandKeys):
    """Leaf area, leaves and what lies below them."""

    seed: int = seed(7, "of the random fields, a whole number")
    method: Literal["streaming", "periodic"] = text("streaming", "streaming, or the paper's periodic (in memory)")
    lai_file: str | None = file(None, "a LAI map to use instead of a random field")
    fpar_inf: float = number(0.94, "1", "FPAR of an infinitely thick canopy", gt=0, le=1)


class ClassKeys(StandKeys):
    """A class of cover; what it leaves out is that of [ground]."""

    share: float | None = number(None, "1", "of the ground, where cover is drawn; by default all have the same", gt=0, le=1)
    code: int | None = text(None, "in the map of cover; by default classes count from 1")


class LandscapeKeys(Section):
    """Classes of cover, and properties of the ground that vary; without them one stand is everywhere."""

    cover: str = file(
        "none",
        "how classes lie: none; pastures, voronoi or levels, which are drawn; or a raster file of their codes",
        names=COVERS,
        suffix="*",
    )
    size: float = number(1200.0, "m", "of a pasture or patch that is drawn, along an edge or across", gt=0)
    moisture: float = number(0.0, "1", "of the soil, 0 dry to 1 saturated", ge=0, le=1)
    deviations: _ByName = text(
        {}, f"standard deviations [1] of what varies in fields that are drawn: {', '.join(VARYING)}"
    )
    arps: _ByName = text({}, "autoregressive parameters [1] of these fields; by default that of [ground]")
    covary: _ByName = text({}, f"correlations [1] of leaf area with {', '.join(COVARIATES + VARYING)}")

    @field_validator("cover")
    @classmethod
    def _known_cover(cls, value):
        if value not in COVERS and not cls.names_a_file("cover", value):
            raise ValueError(f"{nearest(value, COVERS)}allowed are {', '.join(COVERS)}, or a raster file such as cover.tif")
        return value

    @field_validator("deviations", "arps", "covary")
    @classmethod
    def _known_properties(cls, values, info):
        known = VARYING + (COVARIATES if info.field_name == "covary" else ())
        low, high = {"deviations": (0, 1), "arps": (0, 0.2498), "covary": (-1, 1)}[info.field_name]
        for name, value in values.items():
            if name not in known:
                raise ValueError(f"unknown name {shown(name)}: {nearest(name, known)}allowed are {', '.join(known)}")
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: must be in [{low:g}, {high:g}]")
        return values

    @model_validator(mode="after")
    def _drawn_fields(self):
        for key in ("arps", "covary"):
            for name in getattr(self, key):
                if name in VARYING and name not in self.deviations:
                    raise ValueError(f"{key}.{name} is for a field that is drawn: give deviations.{name} too")
        return self


class TerrainKeys(Section):
    """Elevation, and the light on slopes."""

    dem: str = file(
        "flint-hills",
        "flint-hills (synthetic), flat, or a raster file of elevation; flat below a lai_file by default",
        names=LAND_FORMS,
        suffix="*",
    )
    seed: int = seed(7, "of the synthetic hills")
    fill: float | None = number(None, "m", "holes of the file are interpolated up to this distance", gt=0)
    vertical_units: str | None = text(None, "of the file's elevation where they are not metres, such as ft")
    horizon_reach: float = number(5000.0, "m", "greatest distance of terrain that hides the sky", ge=30, le=50_000)
    upwelling: bool = text(True, "with the view's cosine on slopes (Eq. 5)")

    @model_validator(mode="after")
    def _options_of_a_file(self):
        for key in ("fill", "vertical_units"):
            if getattr(self, key) is not None and self.dem in LAND_FORMS:
                raise ValueError(f"{key} is for an elevation file, dem is {self.dem!r}: name a file or drop {key}")
        return self

    @field_validator("dem")
    @classmethod
    def _known_land(cls, value):
        if value not in LAND_FORMS and not cls.names_a_file("dem", value):
            allowed = f"allowed are {', '.join(LAND_FORMS)}, or a raster file such as dem.tif"
            raise ValueError(nearest(value, LAND_FORMS) + allowed)
        return value


class SunAndViewKeys(Section):
    """Directions; the sun's from time and place, or given by sza and saa."""

    time: str | None = text(
        None,
        "date and time of day, UTC without an offset such as -05:00; by default a hypothetical overpass of FIFE, on "
        "its site only; elsewhere, where sza and saa are given instead, the sun is 1 astronomical unit away",
    )
    latitude: float | None = number(None, "degree", "north; by default the grid's own", ge=-90, le=90)
    longitude: float | None = number(None, "degree", "east; by default the grid's own", ge=-180, le=360)
    sza: float | None = number(None, "degree", "solar zenith, instead of that of time and place", ge=0, lt=90)
    saa: float | None = number(None, "degree", "solar azimuth, clockwise from north", ge=-360, le=360)
    vza: float = number(0.0, "degree", "sensor zenith; 0 is nadir", ge=0, le=75)
    vaa: float = number(0.0, "degree", "azimuth toward the sensor, clockwise from north", ge=-360, le=360)

    @field_validator("time", mode="before")
    @classmethod
    def _full_date(cls, value):
        if value is None:
            return value
        # TOML has dates of its own.
        written = value.isoformat() if isinstance(value, datetime) else value
        try:
            if _TIME.fullmatch(written) and _YEARS[0] <= datetime.fromisoformat(written).year < _YEARS[1]:
                return written
        except (TypeError, ValueError):
            pass
        raise ValueError(
            f"must be a date and a time of day from {_YEARS[0]} to {_YEARS[1]}, such as '1987-06-06T16:35:00Z' or "
            "'1987-06-06 11:35-05:00'"
        )

    @model_validator(mode="after")
    def _whole_sun(self):
        if (self.sza is None) != (self.saa is None):
            raise ValueError("sza and saa go together: give both, or neither to have the sun of time and place")
        return self


class AirKeys(Section):
    """The atmosphere."""

    profile: str = text("midlatitude-summer", "of pressure, temperature, water vapour and ozone")
    aerosol: str = file(
        "continental",
        'aerosol model, "none", a mixture such as "dust:0.5+soot:0.5" by volume, or a .nc or .csv file of your own '
        "tables, which needs aot",
        suffix=(".nc", ".csv"),
    )
    visibility: float | None = number(45.0, "km", "meteorological range; give it or aot", ge=5, le=100)
    aot: float | None = number(None, "1", "aerosol optical thickness at 0.55 um, instead of visibility", ge=0, le=2)
    altitude: float = number(0.4, "km", "of the ground above the sea; by default FIFE's, on its site only", ge=0, le=4)
    h2o: float | None = number(None, "g cm-2", "water vapour, instead of the profile's", ge=0, le=10)
    o3: float | None = number(None, "cm-atm", "ozone, instead of the profile's", ge=0, le=1)
    engine: str = text("5S", f"one of {', '.join(ENGINES)}")
    adjacency: bool = text(False, "whether light of the surroundings is scattered into a cell's view")

    @model_validator(mode="before")
    @classmethod
    def _one_amount(cls, values):
        if not isinstance(values, dict):
            return values
        by_aot = values.get("aot") is not None or cls.names_a_file("aerosol", values.get("aerosol"))
        return values | {"visibility": values.get("visibility")} if by_aot else values


class SensorKeys(Section):
    """The instrument."""

    instrument: str = file("TM", "see: fifesim sensors", suffix=".toml")
    bands: list[str] = text(["TM3", "TM4"], "names of bands; by default red and near infrared")
    pixel: float | None = number(
        None,
        "m",
        "size of a pixel; by default the bands' gridded product; the footprint stays the instrument's",
        gt=0,
    )
    interval: str | float = Field(
        "product",
        description="between pixels: product, that of their size; native, the instrument's own; or metres",
        json_schema_extra={"unit": "m"},
    )
    offset: list[float] = Field(
        [0.0, 0.0],
        description="registration error southward and eastward: pixels see the ground beside them",
        json_schema_extra={"unit": "pixel"},
        min_length=2,
        max_length=2,
    )
    response: str | None = text(None, "spatial: system, what is known of the instrument; detector; or paper, for TM")
    noise: list[str] = text([], "of the detectors: shot, thermal, fixed-pattern")
    noise_model: _ByName = text(
        {},
        "of every band, instead of the instrument's: thermal [W m-2 sr-1 um-1], shot [W m-2 sr-1 um-1], detectors, "
        "gain_spread [1], offset_spread [W m-2 sr-1 um-1]",
    )
    seed: int = seed(0, "of the noise")
    min_valid: float = number(0.98, "1", "share of its footprint that a pixel needs on valid cells", ge=0, le=1)

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
        raise ValueError(f"must be {' or '.join(INTERVALS)}, or metres above 0 between pixels")

    @field_validator("offset")
    @classmethod
    def _finite_offset(cls, value):
        if not all(map(math.isfinite, value)):
            raise ValueError("must be two finite numbers of pixels")
        return value


class Keys(Section):
    """The sections of a scenario, spelled as they may be; that of each class is ``[classes.NAME]``."""

    grid: GridKeys = GridKeys()
    ground: GroundKeys = GroundKeys()
    landscape: LandscapeKeys = LandscapeKeys()
    classes: dict[str, ClassKeys] = {}
    terrain: TerrainKeys = TerrainKeys()
    geometry: SunAndViewKeys = SunAndViewKeys()
    atmosphere: AirKeys = AirKeys()
    sensor: SensorKeys = SensorKeys()

    @field_validator("classes")
    @classmethod
    def _words(cls, value):
        for name in value:
            if len(name) > _LONGEST_NAME or not name.isprintable() or len(name.split()) != 1:
                raise ValueError(f"{shown(name)} is no name of a class: names are one word of up to {_LONGEST_NAME} characters")
        return value

    @classmethod
    def section(cls, place):
        """
        What knows the keys of a table.

        Parameters
        ----------
        place : sequence of str
            ``("ground",)``, or ``("classes", NAME)``.

        Returns
        -------
        section : type, or None
            Where there is none.
        """
        name, *inside = place
        if name not in cls.model_fields or (name == "classes") != bool(inside):
            return None
        annotation = cls.model_fields[name].annotation
        return get_args(annotation)[1] if inside else annotation

    def sections(self):
        """The tables of a scenario, a dict of `Section` by place as in `section`."""
        found = {}
        for name in type(self).model_fields:
            value = getattr(self, name)
            found |= {(name, key): each for key, each in value.items()} if name == "classes" else {(name,): value}
        return found

    @model_validator(mode="before")
    @classmethod
    def _no_invented_hills(cls, values):
        """A map of real ground without an elevation is flat: synthetic hills are for synthetic landscapes."""
        if not isinstance(values, dict):
            return values
        ground, terrain = values.get("ground", {}), values.get("terrain", {})
        lai_file = (
            ground.lai_file if isinstance(ground, GroundKeys) else isinstance(ground, dict) and ground.get("lai_file")
        )
        if lai_file and isinstance(terrain, dict) and "dem" not in terrain:
            return values | {"terrain": {"dem": "flat"} | terrain}
        return values
