"""Scenario of a run, its keys by name, and a summary in words."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from odc.geo.geobox import GeoBox
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from fifesim.atmosphere.engines import check_zenith
from fifesim.atmosphere.models import Atmosphere
from fifesim.base import geometry
from fifesim.base.arguments import FilePath
from fifesim.base.files import in_a_line, shown
from fifesim.base.messages import nearest
from fifesim.base.times import SITE_CORNERS, SITE_LATITUDE, SITE_LONGITUDE, SITE_TIME, utc
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.grids.opening import covering_grid
from fifesim.grids.sites import on_fife_site
from fifesim.ground.landscape.classes import SHARES, CoverClass, fife_classes
from fifesim.ground.landscape.distribution import treatments
from fifesim.scenario.ground import check_leaf_area, drawn_properties, learned_landscape
from fifesim.scenario.keys import EXTENT, OFFSET_PARTS, STAND, ByName, GridKeys, Keys
from fifesim.scenario.sections import Air, CoverStand, Ground, Sensor, Terrain
from fifesim.scenario.toml import full_path, in_html, in_lines, load_values, mistakes
from fifesim.sensor.description.fields import false_colour_bands
from fifesim.sensor.description.instruments import instrument

_DEFAULT = "TM"
_BY_BAND = ("leaf_reflectance", "leaf_transmittance", "background")


def with_false_colour(values):
    """Values of a file with the default bands green, red and near infrared."""
    # Unchanged if bands are named, if the instrument is unknown or has no green band on the same grid, if optics are
    # given by band without green, or if a noise model is given.
    sensor = values.get("sensor", {})
    if not isinstance(sensor, Mapping) or "bands" in sensor:
        return values
    bands = _found(sensor.get("instrument", _DEFAULT))
    if len(bands) < 3 or any(bands[0].name not in each for each in _given_by_band(values)):
        return values
    if sensor.get("noise") and not sensor.get("noise_model") and bands[0].noise is None:
        return values
    return values | {"sensor": sensor | {"bands": [band.name for band in bands]}}


def _found(name):
    """Bands of an instrument; empty if it is unknown, which is reported when the scenario is created."""
    if not isinstance(name, str) or (name.endswith(".toml") and not os.path.isfile(name)):
        return ()
    try:
        return false_colour_bands(instrument(name))
    except (ValueError, OSError):
        return ()


def _given_by_band(values):
    classes = values.get("classes", {})
    stands = [values.get("ground"), *(classes.values() if isinstance(classes, Mapping) else ())]
    tables = (stand.get(key) for stand in stands if isinstance(stand, Mapping) for key in _BY_BAND)
    return [table for table in tables if isinstance(table, Mapping) and table]


_PATTERNS = {"pastures": "fields", "voronoi": "patches", "levels": "patches"}
_VARYING = {"soil": "soil brightness", "moisture": "soil moisture", "brown": "dead leaves"}
_PLURALS = {*_PATTERNS.values(), "dead leaves", "hills"}
_COUNTS = {1: "grass type", 2: "two grass types", 3: "three grass types"}


def statement(scenario):
    """Sentence on the synthetic parts of a scenario, the parts from files, and the overpass."""
    # The same for a scenario and its completed form, unless a LAI file determines the grid.
    synthetic, given = _parts(scenario)
    clauses = [f"{_listed(synthetic)} {_are(synthetic)} synthetic"] if synthetic else []
    if given:
        clauses.append(f"{_listed(given)} {_are(given)} from {'files' if len(given) > 1 else 'a file'}")
    if scenario.terrain.dem == "flat":
        clauses.append("the ground is level")
    of_fife = () if given else _of_fife(scenario)
    if of_fife:
        clauses.append(f"only {_listed(of_fife)} {_are(of_fife)} FIFE's")
    text = ": ".join(filter(None, [_landscape(synthetic, given), "; ".join(clauses)]))
    learned = f" Leaf area was learned from {_learned_from(scenario)}." if scenario.learned else ""
    return f"{text[0].upper()}{text[1:]}.{learned} {_overpass(scenario)}".rstrip()


def summary(scenario):
    """Short text on the synthetic parts of a scenario, for a title; empty if there are none."""
    overpass = "hypothetical overpass" if _is_hypothetical(scenario) else ""
    return ", ".join(filter(None, (_landscape(*_parts(scenario)), overpass)))


def _parts(scenario):
    """Names of the synthetic parts of the landscape, and of the parts from files."""
    ground, cover, dem = scenario.ground, scenario.landscape.cover, scenario.terrain.dem
    synthetic, given = [], ["leaf area"] if ground.lai_file else []
    if scenario.learned:
        synthetic.append("ground")
    elif cover in _PATTERNS:
        synthetic.append(_PATTERNS[cover])
    else:
        synthetic += [] if ground.lai_file else ["leaf area"]
        given += [] if cover == "none" else ["land cover"]
        varying = list(drawn_properties(scenario))
        synthetic += [_VARYING.get(name, name.replace("_", " ")) for name in varying]
    if dem == "flint-hills":
        synthetic.append("hills")
    elif dem != "flat":
        given.append("elevation")
    return synthetic, given


def _landscape(synthetic, given):
    if not synthetic:
        return ""
    return "partly synthetic landscape" if given else "synthetic landscape"


def _learned_from(scenario):
    """Source of the learned landscape that belongs to fifesim, or the name of its file."""
    name = scenario.learned
    return learned_landscape(name).source if name == "konza" else Path(name).name


def _of_fife(scenario):
    """Parts of a landscape without files that come from FIFE."""
    types = set() if scenario.learned else _distributions(scenario)
    found = [f"the {_COUNTS[len(types)]}"] if types and types <= set(treatments()) else []
    return found + ["the location"] * is_on_site(scenario)


def _distributions(scenario):
    """Sources of the leaf area of a landscape without files."""
    if scenario.landscape.cover == "none":
        return {scenario.ground.distribution}
    return {stand.lai_source(scenario.ground) for stand in scenario.classes.values()} or set(treatments())


def is_on_site(scenario):
    """Whether the scenario is known to be on the FIFE site, without opening a file."""
    if scenario.ground.lai_file and not scenario.grid.model_fields_set.intersection(EXTENT):
        return False
    try:
        return on_fife_site(scenario.geobox())
    except ValueError:
        # An invalid grid raises an error when the scenario is completed.
        return False


def _is_hypothetical(scenario):
    """Whether the time is the default on the FIFE site, at which no Landsat passed."""
    given = scenario.geometry
    default = given.time is None or utc(given.time)[0] == utc(SITE_TIME)[0]
    return given.sza is None and default and is_on_site(scenario)


def _overpass(scenario):
    given = scenario.geometry
    if given.sza is not None:
        return "Sun angles as given."
    if _is_hypothetical(scenario):
        return f"Hypothetical overpass, {time_in_words(SITE_TIME)}."
    return "" if given.time is None else f"Time as given, {time_in_words(given.time)}."


def time_in_words(time):
    """Day and time in UTC as text."""
    (known,) = utc(time)
    return f"{known.day} {known.month_name()} {known.year} {known:%H:%M} UTC"


def _listed(names):
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _are(names):
    plural = len(names) > 1 or names[0] in _PLURALS or names[0].endswith("types")
    return "are" if plural else "is"


# Tolerance for the sum of area fractions. [1]
_WHOLE = 1e-6


class Scenario(Keys):
    """
    Parameters of a simulation. The defaults are a learned landscape on synthetic hills of the FIFE site, and TM.

    ``Scenario(base="paper")`` has the case of the paper: one stand, and the response of TM of its Table 1. Leaf area
    given in another way, such as ``ground={"arp": 0.24}``, replaces the learned landscape.

    Parameters
    ----------
    grid, ground, landscape, classes, terrain, geometry, atmosphere, sensor : mapping
        Keys of each section. ``fifesim scenario`` prints all keys with unit, meaning and default.
    base : {"landscape", "paper"}, optional
        Defaults of the keys that are not given.

    Raises
    ------
    ValueError
        If a key is unknown or a value is not allowed. The message has one line per mistake.

    Examples
    --------
    >>> import fifesim
    >>> scenario = fifesim.Scenario(grid={"width": 900, "height": 900}, ground={"arp": 0.24})
    >>> scenario.ground.arp, scenario.atmosphere.visibility
    (0.24, 45.0)
    """

    _in_words: ClassVar[str] = "a fifesim.Scenario, as fifesim.scenario.read_scenario gives it"
    # Attributes of a chip beside the site, whose landscape continues that of a study on the site.
    _made_on: dict = PrivateAttr(default_factory=dict)

    ground: Ground = Ground()
    classes: dict[str, CoverStand] = Field({})
    terrain: Terrain = Terrain()
    atmosphere: Air = Air()
    sensor: Sensor = Sensor()  # type: ignore[call-arg]

    def __init__(self, /, **sections: Any) -> None:
        try:
            super().__init__(**sections)
        except ValidationError as error:
            raise ValueError(mistakes(error, sections, type(self))) from None

    def __repr__(self):
        return in_lines(self)

    __str__ = __repr__

    def _repr_html_(self):
        return in_html(self)

    @model_validator(mode="after")
    def _classes_of_a_cover(self):
        if self.landscape.cover == "none" and self.classes:
            raise ValueError('classes are given, but landscape.cover is none: choose a layout, such as "pastures"')
        if self.learned and (given := self._of_a_stand()):
            raise ValueError(
                f"landscape.learned = {shown(self.learned)} and {', '.join(given)} are given: a learned landscape has "
                "its own leaf area: remove one of them"
            )
        if not self.is_one() and self.ground.method == "periodic":
            raise ValueError(
                'ground.method = "periodic" needs a single stand: use method = "streaming" or cover = "none"'
            )
        stands = [self.ground, *self.classes.values()]
        if self.atmosphere.coupling == "directional" and any(stand.model != "sail" for stand in stands):
            raise ValueError('atmosphere.coupling = "directional" needs model = "sail": the other has one direction')
        shares = [stand.share for stand in self.classes.values()]
        if any(shares) and not all(shares):
            lacking = ", ".join(name for name, stand in self.classes.items() if stand.share is None)
            raise ValueError(f"classes: {lacking} has no share but others have: give shares to all classes or to none")
        if any(shares) and abs(sum(shares) - 1) > _WHOLE:
            raise ValueError(f"classes: shares sum to {sum(shares):g}: they must sum to 1")
        return self

    def _of_a_stand(self):
        """Names of the given keys that describe leaf area in another way than a learned landscape."""
        ground, own = self.ground, self.landscape
        keys = [key for key in STAND if key in ground.model_fields_set and getattr(ground, key) is not None]
        return [f"ground.{key}" for key in keys] + ["landscape.cover"] * (own.cover != "none")

    @property
    def learned(self) -> str | None:
        """Name or file of the learned landscape; None for a stand or classes."""
        name = self.landscape.learned
        if name is None:
            return None if self._of_a_stand() else "konza"
        return None if name == "none" else name

    def is_one(self) -> bool:
        """Whether one stand covers the scene and only its LAI varies."""
        own = self.landscape
        return not self.learned and own.cover == "none" and not any(own.deviations.values())

    def class_table(self) -> dict[str, CoverClass]:
        """Classes of cover by name, a dict of `CoverClass`; by default the classes of FIFE."""
        return {name: stand.cover_class(name, self.ground) for name, stand in self.classes.items()} or fife_classes()

    def geobox(self) -> GeoBox:
        """
        Grid of the ground cells.

        Returns
        -------
        grid : odc.geo.geobox.GeoBox
            From the keys of [grid]; without corner and size, the extent of the LAI file.

        Raises
        ------
        ValueError
            If the grid is invalid, or a CRS is given without the corner.
        """
        grid, own = self.grid, self.grid.model_fields_set
        lacking = [key for key in EXTENT if key not in own]
        if self.ground.lai_file and len(lacking) == len(EXTENT):
            crs = grid.crs if "crs" in own else None
            return covering_grid(self.ground.lai_file, grid.cell, self.sensor.size, crs)
        box = grids.grid_at(grid.crs, grid.west, grid.north, grid.width, grid.height, grid.cell)
        corner = [key for key in ("west", "north") if key in lacking]
        if "crs" in own and corner and box.crs != SITE_CORNERS["NAD83"][0]:
            raise ValueError(
                f"grid.crs = {shown(grid.crs)} is given without {' and '.join(corner)}: give the upper left corner in "
                "the metres of this CRS"
            )
        return box

    def sun_and_view(self) -> geometry.Geometry:
        """Directions of sun and sensor, a `fifesim.base.geometry.Geometry`."""
        self._check_place()
        given, time = self.geometry, self.overpass_time()
        distance = 1.0 if time is None else geometry.earth_sun_distance(time)
        if given.sza is not None:
            return geometry.Geometry(given.sza, given.saa, given.vza, given.vaa, distance)
        sun = geometry.sun_geometry(time, *self.sun_place(), 1000 * self.atmosphere.altitude)
        return geometry.Geometry(sun.sza, sun.saa, given.vza, given.vaa, distance)

    def overpass_time(self) -> str | None:
        """Date and time as given; by default the FIFE overpass if the scene is on the site."""
        return self.geometry.time or (SITE_TIME if on_fife_site(self.geobox()) else None)

    def sun_place(self) -> tuple[float, float]:
        """Latitude and longitude for the position of the sun; by default FIFE's on its site, else the grid centre."""
        longitude, latitude = projection.middle(self.geobox())
        if on_fife_site(self.geobox()):
            longitude, latitude = SITE_LONGITUDE, SITE_LATITUDE
        given = self.geometry
        latitude = latitude if given.latitude is None else given.latitude
        return latitude, longitude if given.longitude is None else given.longitude

    def _check_place(self):
        """Raise ValueError if the FIFE defaults for overpass, altitude and hills would be used at another site."""
        wanted = []
        if self.geometry.time is None and self.geometry.sza is None:
            wanted.append('geometry.time, such as "2022-06-01T10:05:00Z", or geometry.sza and saa')
        if "altitude" not in self.atmosphere.model_fields_set:
            wanted.append("atmosphere.altitude, the ground elevation [km]")
        if "dem" not in self.terrain.model_fields_set:
            wanted.append('terrain.dem, an elevation file or "flat"')
        if wanted and not on_fife_site(self.geobox()):
            where = projection.place_in_words(*projection.middle(self.geobox()))
            raise ValueError(f"grid: its centre, {where}, is not on the FIFE site: give {'; and '.join(wanted)}")

    def model_atmosphere(self) -> Atmosphere:
        """The atmosphere, a `fifesim.atmosphere.models.Atmosphere`."""
        self._check_place()
        return self.atmosphere.model()

    def complete(self) -> Self:
        """
        Scenario with all defaults that depend on other keys written out.

        Returns
        -------
        scenario : Scenario

        Raises
        ------
        ValueError
            If the image would have fewer than 2 x 2 pixels, or pixels smaller than cells; if the grid, sun, optics or
            bands are not possible, or a file is missing.
        """
        for place, path in self.files.items():
            if not os.path.exists(path) and not path.startswith("/vsi"):
                raise ValueError(f"{'.'.join(place)} = {shown(path)}: the file does not exist")
        box, own = self.geobox(), self.sensor
        bands = [band.response for band in own.description.select(own.bands)]
        self._check_image(box)
        check_zenith("sza", self.sun_and_view().sza)
        self._check_fields()
        check_leaf_area(self)
        drawn = drawn_properties(self)
        means = {name: each.mean for name, each in drawn.items()}
        ground = self.ground.model_copy(update=means | self.ground.complete_optics(bands))
        sensor = own.model_copy(update={"pixel": own.size, "bands": [band.name for band in bands]})
        own_time = self.geometry.model_copy(update={"time": self.overpass_time()})
        deviations = self.landscape.deviations | {name: each.sd for name, each in drawn.items()}
        land = self.landscape.model_copy(update={"learned": self.learned or "none", "deviations": deviations})
        update = {"grid": grid_keys(box), "ground": ground, "geometry": own_time, "sensor": sensor, "landscape": land}
        return self.model_copy(update=update).with_paths(full_path)

    def replace(self, /, **changes: Any) -> Self:
        """
        The same scenario with other values of some keys.

        Parameters
        ----------
        **changes
            New values by the names of keys, such as ``visibility=20``. Names with a dot are given in a dictionary, such
            as ``**{"sensor.seed": 3}``: the section is needed for a key of several sections, for a key of a class,
            ``"classes.grass.brown"``, and for an entry of a key that is a table, ``"ground.leaf.chlorophyll"``.

        Returns
        -------
        scenario : Scenario
            Checked as a whole, so that keys that belong together can be changed together.

        Raises
        ------
        ValueError
            If a name is no key, is a key of several sections or is given twice, if there is no such class, or if a
            value is not allowed.

        Examples
        --------
        >>> import fifesim
        >>> scenario = fifesim.Scenario(ground={"arp": 0.24})
        >>> changed = scenario.replace(visibility=20, **{"sensor.seed": 3})
        >>> changed.ground.arp, changed.atmosphere.visibility, changed.sensor.seed, scenario.sensor.seed
        (0.24, 20.0, 3, 0)
        """
        values = values_of(self)
        names: dict[Any, str] = {}
        for name, value in changes.items():
            key = find_key(name, called="replace:")
            if key.place[0] == "classes" and key.place[1] not in self.classes:
                hint = nearest(key.place[1], self.classes)
                raise ValueError(
                    f"replace: {name} is of a class that the scenario does not have: {hint}its classes are "
                    f"{', '.join(self.classes) or 'none'}"
                )
            if key in names:
                raise ValueError(f"replace: {names[key]} and {name} are one key, {key.name}: give it once")
            names[key] = name
            put(values, key.path, value)
        return type(self)(**values)

    def with_paths(self, change: Callable[[str], str]) -> Self:
        """
        Scenario with modified file paths.

        Parameters
        ----------
        change : callable
            Function from the old path to the new one.

        Returns
        -------
        scenario : Scenario
        """
        changed = {place: section.with_paths(change) for place, section in self.sections().items()}
        classes = {place[1]: section for place, section in changed.items() if place[0] == "classes"}
        return self.model_copy(update={place[0]: each for place, each in changed.items()} | {"classes": classes})

    def _check_image(self, box):
        """Check that pixels are at least as large as cells, and that the image has enough pixels."""
        own, cell = self.sensor, max(grids.cell_size(box))
        spaced = {"pixel": (own.size, own.size)}
        if own.interval == "native":
            spaced["interval"] = own.description.ground_intervals(own.description.select(own.bands)[0])
        elif own.interval != "product":
            spaced["interval"] = own.interval, own.interval
        for key, (down, across) in spaced.items():
            if min(down, across) < cell * (1 - 1e-6) and (key, own.interval) != ("interval", "native"):
                raise ValueError(
                    f"sensor.{key} = {down:g} m is smaller than a ground cell: use {cell:g} m or more, or a "
                    "smaller grid.cell"
                )
            fitting = int(box.shape.y * cell / down + 1e-6), int(box.shape.x * cell / across + 1e-6)
            if min(fitting) < 2:
                raise ValueError(
                    f"grid: the image must have 2 x 2 pixels or more, sensor.{key} of {down:g} x {across:g} m fits "
                    f"{fitting[0]} x {fitting[1]} times into {grids.in_words(box)}: use a larger width and height"
                )
            if any(abs(shift) >= size for shift, size in zip(own.offset, fitting, strict=True)):
                raise ValueError(
                    f"sensor.offset = {own.offset} pixels moves the image out of the scene, which has {fitting[0]} x "
                    f"{fitting[1]} pixels: use a smaller offset"
                )

    def _check_fields(self):
        """Check that the standard deviations of drawn fractions are feasible."""
        varying = drawn_properties(self)
        if self.ground.model != "sail" and "brown" in varying:
            raise ValueError(
                f"ground.model = {self.ground.model!r} needs one share of dead leaves: type for instance brown = 0 in "
                "[ground], or model = 'sail'"
            )
        if self.terrain.slopes == "upright" and varying:
            raise ValueError(
                f"terrain.slopes = 'upright' needs uniform {', '.join(varying)}: type for instance "
                f"{', '.join(f'{name} = 0' for name in varying)} in [ground], or slopes = 'kt'"
            )
        for name, drawn in varying.items():
            if name in SHARES:
                try:
                    drawn.distribution(name)
                except ValueError as error:
                    raise ValueError(f"landscape.deviations: {error}") from None

    def provenance(self) -> str:
        """One line on the synthetic parts of the landscape, the parts from files, and the overpass."""
        return statement(self)

    @property
    def unused(self) -> dict[tuple[str, ...], tuple[str, ...]]:
        """Keys that have no effect, by section."""
        return {("ground",): STAND} if self.learned else {}

    @property
    def files(self) -> dict[tuple[str, ...], str]:
        """Paths of the files that the scenario reads: a dict from (table, key) to str."""
        return {(*place, key): path for place, table in self.sections().items() for key, path in table.files.items()}


def default_scenario() -> Scenario:
    """
    Scenario of ``fifesim simulate``: a learned landscape on synthetic hills, in green, red and near infrared.

    Returns
    -------
    scenario : Scenario

    Examples
    --------
    >>> import fifesim
    >>> fifesim.scenario.default_scenario().learned
    'konza'
    """
    return parse_scenario(with_false_colour({}))


def grid_keys(box):
    """[grid] section of a scenario, from a grid of square cells."""
    a = box.affine
    crs = f"EPSG:{box.crs.epsg}" if box.crs.epsg else box.crs.to_wkt()
    return GridKeys(crs=crs, west=a.c, north=a.f, width=a.a * box.shape.x, height=-a.e * box.shape.y, cell=a.a)


def parse_scenario(values):
    """Scenario from nested mappings with the structure of the TOML file."""
    return Scenario(**values)


def read_scenario(path: FilePath) -> Scenario:
    """
    Read a scenario from a TOML file.

    Parameters
    ----------
    path : str or path
        TOML file. Paths in it are relative to its folder. If it names no bands, green is added to red and near
        infrared, for a false-colour image.

    Returns
    -------
    scenario : Scenario

    Raises
    ------
    ValueError
        If the file is missing or not TOML, or a key or value is wrong. The message names the file and has one line per
        mistake, with the key, the value and the allowed range.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> path = Path(mkdtemp()) / "mine.toml"
    >>> _ = path.write_text("[ground]\\narp = 0.24\\n")
    >>> fifesim.scenario.read_scenario(path).ground.arp
    0.24
    """
    values = with_false_colour(load_values(path))
    try:
        return parse_scenario(values)
    except ValueError as error:
        raise ValueError(f"{in_a_line(Path(path).name)}: {error}") from None


class NamedKey(NamedTuple):
    """Key of a scenario, or an entry of a table, such as ``ground.leaf.chlorophyll``."""

    place: tuple[str, ...]
    key: str
    entry: str | None = None

    @property
    def path(self):
        """Names from the section to the key."""
        return (*self.place, self.key) + (() if self.entry is None else (self.entry,))

    @property
    def name(self):
        """Names joined by dots."""
        return ".".join(self.path)

    @property
    def section(self):
        """Section of the key."""
        return Keys.section(self.place)

    @property
    def attributes(self):
        """Meaning and unit of the key as attributes of a coordinate, for plots."""
        # The description's first words name the key; ranges and hints follow them.
        meaning = self.section.model_fields[self.key].description.split(";")[0]
        entry = f"{self.key.replace('_', ' ')}: {self.entry}"
        found = {"long_name": entry if self.entry else meaning, "units": self.section.unit(self.key)}
        return {name: text for name, text in found.items() if text}


def find_key(name, called="the axis"):
    """Key of a scenario by name, such as ``visibility``, ``ground.seed`` or ``ground.leaf.chlorophyll``."""
    parts = tuple(str(name).split("."))
    tables = [(each,) for each in Keys.model_fields if each != "classes"]
    if parts[0] == "classes":
        tables, parts = [parts[:2]], parts[2:]
    elif parts[:1] in tables and len(parts) > 1:
        tables, parts = [parts[:1]], parts[1:]
    found = [NamedKey(table, *parts) for table in tables if _section_has_key(Keys.section(table), parts)]
    if len(found) == 1:
        return found[0]
    if found:
        written = " or ".join(each.name for each in found)
        raise ValueError(f"{called} {shown(name)} exists in several sections: use {written}")
    places = [*Scenario().sections(), *(table for table in tables if len(table) == 2)]
    # A name with its section is compared with whole names.
    known = {(*place, key) for place in places for key in Keys.section(place).model_fields}
    hint = nearest(name, sorted(".".join(each) if "." in str(name) else each[-1] for each in known))
    raise ValueError(f"{called} {shown(name)} is not a key of a scenario: {hint}`fifesim scenario` lists all keys")


def _section_has_key(section, parts):
    """Whether a section has a key, and, if an entry is named, whether the key has entries."""
    if section is None or not parts or parts[0] not in section.model_fields or "" in parts:
        return False
    if len(parts) != 2:
        return len(parts) == 1
    return section.model_fields[parts[0]].annotation == ByName or (parts[0] == "offset" and parts[1] in OFFSET_PARTS)


def values_of(scenario):
    """Explicit values of a scenario, without defaults, as nested mappings."""
    return scenario.model_dump(exclude_unset=True)


def put(values, path, value):
    """Set a value in nested mappings in place, converting numpy numbers to Python numbers."""
    *tables, last = path
    for name in tables:
        values = values.setdefault(name, {})
    values[last] = value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def in_text(value):
    """Value as a table cell: lists become text."""
    if np.ndim(value) == 0:
        return value
    return ", ".join(str(part) for part in np.ravel(value).tolist()) or "none"
