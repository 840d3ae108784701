"""The scenario of a run: every number with its unit and range."""

from difflib import get_close_matches
from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from fifesim.atmosphere.air import aerosols, models
from fifesim.base import geometry
from fifesim.ground.terrain.units import metres_per_unit
from fifesim.rasters import grid as grids
from fifesim.rasters import warp
from fifesim.scenario.ground import Ground
from fifesim.scenario.section import Section as _Section
from fifesim.scenario.section import number as _number
from fifesim.scenario.section import text as _text
from fifesim.scenario.sensor import Sensor
from fifesim.sensor.description.instruments import instrument


class Grid(_Section):
    """Ground cells. Without any key but cell, a scene that reads a LAI file covers that file."""

    crs: str = _text("EPSG:26914", "projected coordinate reference system in metres")
    west: float = _number(704970.0, "m", "easting of the upper left corner")
    north: float = _number(4334220.0, "m", "northing of the upper left corner")
    width: float = _number(15000.0, "m", "west to east", gt=0)
    height: float = _number(15000.0, "m", "north to south", gt=0)
    cell: float = _number(30 / 9, "m", "size of a cell", gt=0)


LAND_FORMS = ("flint-hills", "flat")


def names_a_file(key, value):
    """
    Whether the value of a key of a scenario is the path of a file.

    Parameters
    ----------
    key, value : str

    Returns
    -------
    answer : bool

    Examples
    --------
    >>> names_a_file("distribution", "burned-grazed"), names_a_file("distribution", "mine.csv")
    (False, True)
    """
    if key == "dem":
        return value not in LAND_FORMS and bool(Path(value).suffix)
    return key == "lai_file" or (key == "distribution" and value.lower().endswith(".csv"))


class Terrain(_Section):
    """Elevation, and the light on slopes."""

    dem: str = _text(
        "flint-hills", "flint-hills (synthetic), flat, or a raster file of elevation; flat below a lai_file by default"
    )
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = Field(7, description="of the synthetic hills")
    fill: float | None = _number(None, "m", "holes of the file are interpolated up to this distance", gt=0)
    vertical_units: str | None = _text(None, "of the file's elevation where they are not metres, such as ft")
    horizon_reach: float = _number(5000.0, "m", "greatest distance of terrain that hides the sky", ge=30, le=100_000)
    upwelling: bool = Field(True, description="with the view's cosine on slopes (Eq. 5)")

    @field_validator("vertical_units")
    @classmethod
    def _known_unit(cls, value):
        if value is not None:
            metres_per_unit(value)
        return value

    @model_validator(mode="after")
    def _options_of_a_file(self):
        for key in ("fill", "vertical_units"):
            if getattr(self, key) is not None and self.dem in LAND_FORMS:
                raise ValueError(f"{key} is for an elevation file, dem is {self.dem!r}: name a file or drop {key}")
        return self

    @field_validator("dem")
    @classmethod
    def _known_land(cls, value):
        if value not in LAND_FORMS and not names_a_file("dem", value):
            near = get_close_matches(value, LAND_FORMS, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ValueError(f"{hint}allowed are {', '.join(LAND_FORMS)}, or a raster file such as dem.tif")
        return value


class SunAndView(_Section):
    """Directions; the sun's from time and place, or given by sza and saa."""

    time: str = _text(geometry.FIFE_TIME, "UTC; a hypothetical overpass by default")
    latitude: float = _number(geometry.FIFE_LATITUDE, "degree", "north", ge=-90, le=90)
    longitude: float = _number(geometry.FIFE_LONGITUDE, "degree", "east", ge=-180, le=360)
    sza: float | None = _number(None, "degree", "solar zenith, instead of that of time and place", ge=0, lt=90)
    saa: float | None = _number(None, "degree", "solar azimuth, clockwise from north")
    vza: float = _number(0.0, "degree", "sensor zenith; 0 is nadir", ge=0, le=75)
    vaa: float = _number(0.0, "degree", "azimuth toward the sensor, clockwise from north")

    @model_validator(mode="after")
    def _whole_sun(self):
        if (self.sza is None) != (self.saa is None):
            raise ValueError("sza and saa go together: give both, or neither to have the sun of time and place")
        return self


class Air(_Section):
    """The atmosphere."""

    profile: str = _text("midlatitude-summer", "of pressure, temperature, water vapour and ozone")
    aerosol: str = _text("continental", 'aerosol model, "none", or a mixture such as "dust:0.5+soot:0.5" by volume')
    visibility: float | None = _number(45.0, "km", "meteorological range; give it or aot", ge=5, le=100)
    aot: float | None = _number(None, "1", "aerosol optical thickness at 0.55 um, instead of visibility", ge=0, le=2)
    altitude: float = _number(0.4, "km", "of the ground above the sea", ge=0, le=4)
    h2o: float | None = _number(None, "g cm-2", "water vapour, instead of the profile's", ge=0, le=10)
    o3: float | None = _number(None, "cm-atm", "ozone, instead of the profile's", ge=0, le=1)
    engine: str = _text("5S", f"one of {', '.join(models.ENGINES)}")
    adjacency: bool = Field(False, description="whether light of the surroundings is scattered into a cell's view")

    @model_validator(mode="before")
    @classmethod
    def _one_amount(cls, values):
        by_aot = isinstance(values, dict) and values.get("aot") is not None
        return values | {"visibility": values.get("visibility")} if by_aot else values

    @field_validator("profile", "engine")
    @classmethod
    def _known_name(cls, value, info):
        allowed = {"profile": models.PROFILES, "engine": models.ENGINES}[info.field_name]
        if value not in allowed:
            raise ValueError(f"must be one of {', '.join(allowed)}, got {value!r}")
        return value

    @field_validator("aerosol")
    @classmethod
    def _known_aerosol(cls, value):
        return value if value == "none" else aerosols.canonical(value)

    @model_validator(mode="after")
    def _possible(self):
        self.model()
        return self

    def model(self):
        """The atmosphere that these keys describe, a `fifesim.atmosphere.air.models.Atmosphere`."""
        return models.Atmosphere(**self.model_dump(exclude={"adjacency"}))


class Scenario(_Section):
    """
    What a run simulates; the defaults are the paper's case on the whole FIFE site.

    Parameters
    ----------
    grid : Grid
    ground : Ground
    terrain : Terrain
    geometry : SunAndView
    atmosphere : Air
    sensor : Sensor

    Raises
    ------
    pydantic.ValidationError
        If a key is unknown or a value not allowed; `scenario_file.read_scenario` turns it into one line a mistake.
    """

    grid: Grid = Grid()
    ground: Ground = Ground()
    terrain: Terrain = Terrain()
    geometry: SunAndView = SunAndView()
    atmosphere: Air = Air()
    sensor: Sensor = Sensor()

    @model_validator(mode="before")
    @classmethod
    def _no_invented_hills(cls, values):
        """A map of real ground without an elevation is flat: synthetic hills are for synthetic landscapes."""
        if not isinstance(values, dict):
            return values
        ground, terrain = (values.get(name, {}) for name in ("ground", "terrain"))
        lai_file = (
            ground.lai_file if isinstance(ground, Ground) else isinstance(ground, dict) and ground.get("lai_file")
        )
        if lai_file and isinstance(terrain, dict) and "dem" not in terrain:
            return values | {"terrain": {"dem": "flat"} | terrain}
        return values

    def geobox(self):
        """Grid of the ground cells, an `odc.geo.geobox.GeoBox`."""
        if self.ground.lai_file and not self.grid.model_fields_set - {"cell"}:
            return warp.covering_grid(self.ground.lai_file, self.grid.cell, self._pixel())
        grid = self.grid
        return grids.grid_at(grid.crs, grid.west, grid.north, grid.width, grid.height, grid.cell)

    def sun_and_view(self):
        """Directions of sun and sensor, a `fifesim.base.geometry.Geometry`."""
        place = self.geometry
        distance = geometry.earth_sun_distance(place.time)
        if place.sza is not None:
            return geometry.Geometry(place.sza, place.saa, place.vza, place.vaa, distance)
        altitude = 1000 * self.atmosphere.altitude
        sun = geometry.sun_position(place.time, place.latitude, place.longitude, altitude)
        return geometry.Geometry(sun.sza, sun.saa, place.vza, place.vaa, distance)

    def model_atmosphere(self):
        """The atmosphere, a `fifesim.atmosphere.air.models.Atmosphere`."""
        return self.atmosphere.model()

    def complete(self):
        """
        The same scenario with every default that a run decides written out.

        Returns
        -------
        scenario : Scenario

        Raises
        ------
        ValueError
            If the image would have fewer than 2 x 2 pixels, or the grid, optics or bands are not possible.
        """
        box = self.geobox()
        bands = [band.response for band in instrument(self.sensor.instrument).select(self.sensor.bands)]
        a = box.affine
        if min(grids.aligned(box, self._pixel()).shape) < 2:
            raise ValueError(
                f"grid: the image must have 2 x 2 pixels of {self._pixel():g} m or more, got {grids.describe(box)}"
            )
        grid = Grid(
            crs=f"EPSG:{box.crs.epsg}" if box.crs.epsg else box.crs.to_wkt(),
            west=a.c,
            north=a.f,
            width=a.a * box.shape.x,
            height=-a.e * box.shape.y,
            cell=a.a,
        )
        ground = self.ground.model_copy(
            update=self.ground.complete_optics(bands)
            | {
                "lai_file": _resolved("lai_file", self.ground.lai_file),
                "distribution": _resolved("distribution", self.ground.distribution),
            }
        )
        sensor = self.sensor.model_copy(update={"pixel": self._pixel(), "bands": [band.name for band in bands]})
        terrain = self.terrain.model_copy(update={"dem": _resolved("dem", self.terrain.dem)})
        return self.model_copy(update={"grid": grid, "ground": ground, "terrain": terrain, "sensor": sensor})

    def _pixel(self):
        return self.sensor.pixel or instrument(self.sensor.instrument).gsd


def _resolved(key, value):
    """A file by its full path, so that the scenario can be run from elsewhere."""
    return str(Path(value).resolve()) if value and names_a_file(key, value) else value
