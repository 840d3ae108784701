"""The scenario of a run: every number with its unit and range, and what they mean."""

import os
from collections.abc import Callable
from typing import Any, ClassVar, Self

from odc.geo.geobox import GeoBox
from pydantic import Field, ValidationError, model_validator

from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes import six_s
from fifesim.atmosphere.schemes.engines import check_zenith
from fifesim.base import datasets, fife, geometry
from fifesim.base.annotations import FilePath
from fifesim.base.foreign import shown
from fifesim.ground.landscape.classes import CoverClass, fife_classes
from fifesim.ground.landscape.drawn import SHARES
from fifesim.rasters import grid as grids
from fifesim.rasters import whereabouts
from fifesim.rasters.covering import covering_grid
from fifesim.rasters.sites import on_fife_site
from fifesim.scenario import synthetic
from fifesim.scenario.colours import with_false_colour
from fifesim.scenario.ground import check_leaf_area, drawn_properties
from fifesim.scenario.ground_keys import COVARIATES
from fifesim.scenario.keys import EXTENT, GridKeys, Keys
from fifesim.scenario.sections import Air, CoverStand, Ground, Sensor, Terrain
from fifesim.scenario.toml import full_path, load_values, mistakes

# Shares of classes may miss 1 by rounding.
_WHOLE = 1e-6


class Scenario(Keys):
    """
    What a run simulates; the defaults are the paper's case, one stand of plants on the whole FIFE site.

    Parameters
    ----------
    grid, ground, landscape, classes, terrain, geometry, atmosphere, sensor : mapping
        Of keys; ``fifesim scenario`` prints all of them, with their units, meanings and defaults.

    Raises
    ------
    ValueError
        If a key is unknown or a value not allowed: one line a mistake.

    Examples
    --------
    >>> import fifesim
    >>> scenario = fifesim.Scenario(grid={"width": 900, "height": 900}, ground={"arp": 0.24})
    >>> scenario.ground.arp, scenario.atmosphere.visibility
    (0.24, 45.0)
    """

    _in_words: ClassVar[str] = "a fifesim.Scenario, as fifesim.read_scenario gives it"

    ground: Ground = Ground()
    classes: dict[str, CoverStand] = Field({})
    terrain: Terrain = Terrain()
    atmosphere: Air = Air()
    sensor: Sensor = Sensor()

    def __init__(self, /, **sections: Any) -> None:
        try:
            super().__init__(**sections)
        except ValidationError as error:
            raise ValueError(mistakes(error, sections, type(self))) from None

    @model_validator(mode="after")
    def _classes_of_a_cover(self):
        if self.landscape.cover == "none" and self.classes:
            raise ValueError('classes: are given, and landscape.cover is none: say how they lie, such as "pastures"')
        if not self.landscape.is_one() and self.ground.method == "periodic":
            raise ValueError(
                'ground.method = "periodic" is for one stand: type method = "streaming", or cover = "none"'
            )
        needing = [name for name in COVARIATES if self.landscape.covary.get(name)]
        if needing and self.terrain.dem == "flat":
            raise ValueError(f"landscape.covary: {', '.join(needing)} is of an elevation, and terrain.dem is flat")
        if self.landscape.covary and self.ground.lai_file:
            raise ValueError("landscape.covary: a lai_file goes with the ground as it does: leave covary out")
        shares = [stand.share for stand in self.classes.values()]
        if any(shares) and not all(shares):
            lacking = ", ".join(name for name, stand in self.classes.items() if stand.share is None)
            raise ValueError(f"classes: {lacking} has no share, others have: give it to all, or to none")
        if any(shares) and abs(sum(shares) - 1) > _WHOLE:
            raise ValueError(f"classes: their shares sum to {sum(shares):g}: they must sum to 1")
        return self

    def class_table(self) -> dict[str, CoverClass]:
        """Classes of cover by name, a dict of `CoverClass`; those of FIFE where the keys say none."""
        return {name: stand.cover_class(name, self.ground) for name, stand in self.classes.items()} or fife_classes()

    def geobox(self) -> GeoBox:
        """
        Grid of the ground cells.

        Returns
        -------
        grid : odc.geo.geobox.GeoBox
            That of the keys; without corner and size, that which covers the LAI file.

        Raises
        ------
        ValueError
            If there is no such grid, or a CRS of one's own comes without the corner.
        """
        grid, own = self.grid, self.grid.model_fields_set
        lacking = [key for key in EXTENT if key not in own]
        if self.ground.lai_file and len(lacking) == len(EXTENT):
            crs = grid.crs if "crs" in own else None
            return covering_grid(self.ground.lai_file, grid.cell, self.sensor.size, crs)
        box = grids.grid_at(grid.crs, grid.west, grid.north, grid.width, grid.height, grid.cell)
        corner = [key for key in ("west", "north") if key in lacking]
        if "crs" in own and corner and box.crs != fife.CORNERS["NAD83"][0]:
            raise ValueError(
                f"grid.crs = {shown(grid.crs)} is given without {' and '.join(corner)}: type the upper left corner in "
                "metres of that CRS"
            )
        return box

    def sun_and_view(self) -> geometry.Geometry:
        """Directions of sun and sensor, a `fifesim.base.geometry.Geometry`."""
        self._check_place()
        given, time = self.geometry, self._time()
        distance = 1.0 if time is None else geometry.earth_sun_distance(time)
        if given.sza is not None:
            return geometry.Geometry(given.sza, given.saa, given.vza, given.vaa, distance)
        sun = geometry.sun_position(time, *self.sun_place(), 1000 * self.atmosphere.altitude)
        return geometry.Geometry(sun.sza, sun.saa, given.vza, given.vaa, distance)

    def _time(self):
        """Date and time: as given, else that of FIFE on its site."""
        return self.geometry.time or (fife.TIME if on_fife_site(self.geobox()) else None)

    def sun_place(self) -> tuple[float, float]:
        """Latitude and longitude of the sun: as given, else FIFE's on its site, else those of the grid's middle."""
        longitude, latitude = whereabouts.middle(self.geobox())
        if on_fife_site(self.geobox()):
            longitude, latitude = fife.LONGITUDE, fife.LATITUDE
        given = self.geometry
        latitude = latitude if given.latitude is None else given.latitude
        return latitude, longitude if given.longitude is None else given.longitude

    def _check_place(self):
        """The paper's overpass, altitude and hills are those of its site: elsewhere they are asked for."""
        wanted = []
        if self.geometry.time is None and self.geometry.sza is None:
            wanted.append('geometry.time, such as "2022-06-01T10:05:00Z", or geometry.sza and saa')
        if "altitude" not in self.atmosphere.model_fields_set:
            wanted.append("atmosphere.altitude, of the ground [km]")
        if "dem" not in self.terrain.model_fields_set:
            wanted.append('terrain.dem, a file of elevation or "flat"')
        if wanted and not on_fife_site(self.geobox()):
            where = whereabouts.place_in_words(*whereabouts.middle(self.geobox()))
            raise ValueError(f"grid: its middle, {where}, is not on the site of FIFE: give {'; and '.join(wanted)}")

    def model_atmosphere(self) -> Atmosphere:
        """The atmosphere, a `fifesim.atmosphere.air.models.Atmosphere`."""
        self._check_place()
        return self.atmosphere.model()

    def complete(self) -> Self:
        """
        The same scenario with every default that a run decides written out.

        Returns
        -------
        scenario : Scenario

        Raises
        ------
        ValueError
            If the image would have fewer than 2 x 2 pixels, or pixels smaller than cells; if the grid, sun, optics or
            bands are not possible, or a file is missing.
        ImportError
            If the engine is not installed.
        """
        for place, path in self.files.items():
            if not os.path.exists(path) and not path.startswith("/vsi"):
                raise ValueError(f"{'.'.join(place)} = {shown(path)}: there is no such file")
        box, own = self.geobox(), self.sensor
        bands = [band.response for band in own.description.select(own.bands)]
        self._check_image(box)
        self._check_air()
        self._check_fields()
        check_leaf_area(self)
        ground = self.ground.model_copy(update=self.ground.complete_optics(bands))
        sensor = own.model_copy(update={"pixel": own.size, "bands": [band.name for band in bands]})
        own_time = self.geometry.model_copy(update={"time": self._time()})
        known = {"grid": grid_keys(box), "ground": ground, "geometry": own_time, "sensor": sensor}
        found = self.model_copy(update=known)
        return found.with_paths(full_path)

    def with_paths(self, change: Callable[[str], str]) -> Self:
        """
        The same with other paths of its files.

        Parameters
        ----------
        change : callable
            Gives a path for a path.

        Returns
        -------
        scenario : Scenario
        """
        changed = {place: section.with_paths(change) for place, section in self.sections().items()}
        classes = {place[1]: section for place, section in changed.items() if place[0] == "classes"}
        return self.model_copy(update={place[0]: each for place, each in changed.items()} | {"classes": classes})

    def _check_image(self, box):
        """Pixels must be at least cells, and see them."""
        own, cell = self.sensor, max(grids.cell_size(box))
        spaced = {"pixel": (own.size, own.size)}
        if own.interval == "native":
            spaced["interval"] = own.description.ground_intervals(own.description.select(own.bands)[0])
        elif own.interval != "product":
            spaced["interval"] = own.interval, own.interval
        for key, (down, across) in spaced.items():
            if min(down, across) < cell * (1 - 1e-6) and (key, own.interval) != ("interval", "native"):
                raise ValueError(
                    f"sensor.{key} = {down:g} m is smaller than a cell of the ground: type {cell:g} m or more, or a "
                    "smaller grid.cell"
                )
            fitting = int(box.shape.y * cell / down + 1e-6), int(box.shape.x * cell / across + 1e-6)
            if min(fitting) < 2:
                raise ValueError(
                    f"grid: the image must have 2 x 2 pixels or more, sensor.{key} of {down:g} x {across:g} m fits "
                    f"{fitting[0]} x {fitting[1]} times into {grids.in_words(box)}: type a larger width and height"
                )
            if any(abs(shift) >= size for shift, size in zip(own.offset, fitting, strict=True)):
                raise ValueError(
                    f"sensor.offset = {own.offset} pixels moves the image beyond the scene, which has {fitting[0]} x "
                    f"{fitting[1]}: type smaller numbers"
                )

    def _check_fields(self):
        """Shares that are drawn must be able to vary as they are asked to."""
        for name, drawn in drawn_properties(self).items():
            if name in SHARES:
                try:
                    drawn.distribution(name)
                except ValueError as error:
                    raise ValueError(f"landscape.deviations: {error}") from None

    def _check_air(self):
        """Light must come through it, by an engine that is there."""
        check_zenith("sza", self.sun_and_view().sza)
        if self.atmosphere.engine == "6S":
            six_s.check_installed()

    def provenance(self) -> str:
        """The synthetic parts of the landscape, the parts from files, and the overpass, in one line of text."""
        return synthetic.statement(self)

    @property
    def files(self) -> dict[tuple[str, ...], str]:
        """Paths of the files that the scenario reads, by the names of table and key, a dict of tuple to str."""
        return {(*place, key): path for place, table in self.sections().items() for key, path in table.files.items()}


def default_scenario() -> Scenario:
    """
    The landscape of the FIFE site that a run without a scenario simulates, ``data/fife.toml``.

    Returns
    -------
    scenario : Scenario

    Examples
    --------
    >>> import fifesim
    >>> sorted(fifesim.default_scenario().classes)
    ['burned-grazed', 'burned-ungrazed', 'unburned-ungrazed']
    """
    return read_scenario(datasets.path("fife.toml"))


def grid_keys(box):
    """
    Keys of a scenario that make a grid.

    Parameters
    ----------
    box : odc.geo.geobox.GeoBox
        Of square cells.

    Returns
    -------
    keys : GridKeys
    """
    a = box.affine
    crs = f"EPSG:{box.crs.epsg}" if box.crs.epsg else box.crs.to_wkt()
    return GridKeys(crs=crs, west=a.c, north=a.f, width=a.a * box.shape.x, height=-a.e * box.shape.y, cell=a.a)


def parse_scenario(values):
    """
    Scenario of nested mappings.

    Parameters
    ----------
    values : mapping
        As TOML gives it.

    Returns
    -------
    scenario : Scenario

    Raises
    ------
    ValueError
        One line a mistake.

    Examples
    --------
    >>> parse_scenario({"atmosphere": {"visibility": "23 km"}}).atmosphere.visibility
    23.0
    """
    return Scenario(**values)


def read_scenario(path: FilePath) -> Scenario:
    """
    Scenario of a TOML file.

    Parameters
    ----------
    path : str or path
        Files that it names lie relative to it. Where it names no bands, green is seen beside red and near infrared,
        for a picture in false colours.

    Returns
    -------
    scenario : Scenario

    Raises
    ------
    ValueError
        If it is missing or not TOML, or a key or value is wrong: one line a mistake, with the key, the value and what
        is allowed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> path = Path(mkdtemp()) / "mine.toml"
    >>> _ = path.write_text("[ground]\\narp = 0.24\\n")
    >>> fifesim.read_scenario(path).ground.arp
    0.24
    """
    return parse_scenario(with_false_colour(load_values(path)))
