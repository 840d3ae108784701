"""Every key of a scenario: its default, unit, range and meaning. What physics says of a value is beside its meaning."""

import math
from datetime import date, time
from typing import get_args

from pydantic import Field, field_validator, model_validator

from fifesim.atmosphere.air import ENGINES
from fifesim.base import fife
from fifesim.base.foreign import shown
from fifesim.base.spelling import nearest
from fifesim.base.times import utc
from fifesim.scenario.ground_keys import LONGEST_NAME, ByName, ClassKeys, GroundKeys, LandscapeKeys
from fifesim.scenario.section import Section, file, number, seed, text

LAND_FORMS = ("flint-hills", "flat")
INTERVALS = ("product", "native")
EXTENT = ("west", "north", "width", "height")


class GridKeys(Section):
    """Ground cells. Without corner and size, a scene that reads a LAI file covers that file."""

    crs: str = text(fife.CORNERS["NAD83"][0], "projected coordinate reference system in metres")
    west: float = number(fife.CORNERS["NAD83"][1], "m", "easting of the upper left corner")
    north: float = number(fife.CORNERS["NAD83"][2], "m", "northing of the upper left corner")
    width: float = number(fife.SIZE, "m", "west to east", gt=0)
    height: float = number(fife.SIZE, "m", "north to south", gt=0)
    cell: float = number(30 / 9, "m", "size of a cell", ge=0.001)


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
        written = value.isoformat() if isinstance(value, date | time) else value
        utc(written)  # refuses what it cannot read
        return written

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
    bands: list[str] = text(["TM3", "TM4"], "names of bands; by default red and near infrared, in a file green too")
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
    noise: list[str] = text(
        [], "of the detectors: shot, thermal, fixed-pattern; or all, the kinds that the instrument has"
    )
    noise_model: ByName = text(
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
    classes: dict[str, ClassKeys] = Field({})
    terrain: TerrainKeys = TerrainKeys()
    geometry: SunAndViewKeys = SunAndViewKeys()
    atmosphere: AirKeys = AirKeys()
    sensor: SensorKeys = SensorKeys()

    @field_validator("classes")
    @classmethod
    def _words(cls, value):
        for name in value:
            if len(name) > LONGEST_NAME or not name.isprintable() or len(name.split()) != 1:
                raise ValueError(
                    f"{shown(name)} is no name of a class: names are one word of up to {LONGEST_NAME} characters"
                )
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
