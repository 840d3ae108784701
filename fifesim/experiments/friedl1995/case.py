"""Experiment of Friedl et al. (1995): nine scenarios, two readings of Table 1, and user-supplied inputs."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil

import pandas as pd

from fifesim.base import files
from fifesim.base.arguments import is_path
from fifesim.base.files import in_a_line, read_csv, shown
from fifesim.base.times import SITE_CORNERS, SITE_SIZE
from fifesim.grids.grid import as_carried
from fifesim.ground.landscape.distribution import lai_distribution, treatments
from fifesim.scenario.ground import light_of
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.description.instruments import instrument

OPTICS = ("leaf_reflectance", "leaf_transmittance")


def densities_of(given):
    """Distributions of leaf area of the three treatments, from a folder of samples or a mapping."""
    names = treatments()
    if given is None:
        return {name: name for name in names}
    if is_path(given):
        given = {name: os.path.join(given, f"{name}.csv") for name in names}
    if set(given) != set(names):
        raise ValueError(f"densities must have the treatments {', '.join(names)}, got {', '.join(map(str, given))}")
    for source in given.values():
        lai_distribution(source)
    return {name: given[name] for name in names}


def optics_of(given, bands):
    """Leaf reflectance and transmittance by band as keys of a scenario, from a CSV file or pairs by band. [1]"""
    if given is None:
        return {}
    if is_path(given):
        return _columns(given, bands, OPTICS, "optics")
    try:
        return {key: {band: given[band][k] for band in bands} for k, key in enumerate(OPTICS)}
    except (KeyError, IndexError, TypeError):
        raise ValueError(f"optics must have a pair {OPTICS} for {' and '.join(bands)}, got {shown(given)}") from None


def background_of(given, bands):
    """Background below the canopy as keys of a scenario, by band or as shares of spectra. [1]"""
    if given is None:
        return {}
    if is_path(given) and ":" in str(given) and not os.path.exists(given):
        given = _shares(str(given))
    elif is_path(given):
        return _columns(given, bands, ("background",), "background")
    return {"background" if set(given) & set(bands) else "background_spectra": dict(given)}


def _shares(text):
    """Shares of spectra from a text such as soil_dry:0.5+shade:0.5."""
    parts = [part.partition(":") for part in text.split("+")]
    try:
        return {name.strip(): float(share) for name, _, share in parts}
    except ValueError:
        raise ValueError(
            f"background = {shown(text)}: type shares such as soil_dry:0.475+shade:0.525, or a CSV file by band"
        ) from None


def _columns(path, bands, columns, what):
    """Columns of a CSV file by band; cells without a number are NaN, which scenarios refuse."""
    table = read_csv(path, f"the {what}")
    lacking = [f"the column {name}" for name in ("band", *columns) if name not in table.columns]
    table = table if lacking else table.set_index(table["band"].astype(str).str.strip())
    lacking = lacking or [f"a line for band {band}" for band in bands if band not in table.index]
    if lacking:
        raise ValueError(f"{what} file {in_a_line(path, 150)} lacks {' and '.join(lacking)}")
    return {name: pd.to_numeric(table[name], errors="coerce")[list(bands)].to_dict() for name in columns}


def sensor_of(name):
    """Instrument of the scenes, with the response of the paper if its file has one, and its red and infrared band."""
    description = instrument(name)
    if description.paper_lsf is not None:
        description = instrument(description, "paper")
    return description, tuple(band.name for band in description.red_and_near_infrared())


# Nine cells across a pixel of 30 m.
CELL = 30 / 9

_OWN_INTERVAL = "43 µrad × 705 km = 30.315 m"


@dataclass(frozen=True)
class Reading:
    """Interpretation of Table 1: position of the pixels relative to the blocks of ground."""

    name: str
    text: str
    own_interval: bool = False  # pixels at the instrument's own interval, paired with the blocks by row and column

    def in_words(self, interval, pixel):
        """Description of the reading for a sampling interval and a pixel size, in m."""
        text = self.text
        if f"{interval:.3f}" not in _OWN_INTERVAL:
            text = text.replace(_OWN_INTERVAL, f"{interval:.3f} m")
        return text.replace("30 m", f"{pixel:g} m")


NATIVE = Reading(
    "native",
    f"pixels every {_OWN_INTERVAL}, paired by row and column with the 30 m blocks of the truth",
    own_interval=True,
)
ALIGNED = Reading("aligned", "pixels of 30 m on the blocks of the truth")
READINGS = {reading.name: reading for reading in (NATIVE, ALIGNED)}

ARPS = (0.05, 0.15, 0.24)
VARIABLES = ("lai", "fpar")

# Cells along the edge of a scene. The paper states no size.
CELLS = 333
# With fewer pixels along an edge, increments have too few pixels for a standard deviation.
_FEWEST_PIXELS = 10
_COARSE_PIXELS = 12

# Position of the scene on the FIFE site, in cells from its corner. It only affects the relief.
_CORNER = 1000


@dataclass(frozen=True, eq=False)
class Case:
    """Common description of the nine scenes."""

    reading: Reading = NATIVE
    dem: str = "flat"  # or "flint-hills", or a raster file of elevation
    densities: Mapping = field(default_factory=lambda: densities_of(None))
    plants: Mapping = field(default_factory=dict)  # keys of leaves and background of the scenarios; fitted by default
    sensor: str = "TM"
    cells: int | None = None  # along the edge of a scene, 333 or 12 pixels of a coarse sensor by default
    # Upper left corner in EPSG:26914, by default 3.33 km from the corner of the site, which the paper does not give.
    west: float | None = None
    north: float | None = None

    def __post_init__(self):
        if self.cells is None:
            object.__setattr__(self, "cells", max(CELLS, ceil(_COARSE_PIXELS * self.pixel / CELL)))
        if self.cells < (fewest := ceil(_FEWEST_PIXELS * self.pixel / CELL)):
            raise ValueError(
                f"cells must be at least {fewest}, {_FEWEST_PIXELS} pixels along the edge of a scene, got "
                f"{self.cells}: samples of 200 pixels need {ceil(15 * self.pixel / CELL)}"
            )

    @cached_property
    def bands(self):
        """Names of the red and the near infrared band."""
        return sensor_of(self.sensor)[1]

    @cached_property
    def instrument(self):
        """Instrument of the scenes."""
        return sensor_of(self.sensor)[0]

    @property
    def pixel(self):
        """Size of a pixel and of a block of the truth. [m]"""
        return self.instrument.pixel(self.instrument.select(self.bands)[0])

    @property
    def interval(self):
        """Sampling interval of the instrument. [m]"""
        return max(self.instrument.ground_intervals(self.instrument.select(self.bands)[0]))

    @property
    def drift(self):
        """Distance along an axis between the last pixel and its block. [m]"""
        if not self.reading.own_interval:
            return 0.0
        return (int(self.cells * CELL / self.interval) - 1) * abs(self.interval - self.pixel)

    def scenario(self, treatment, arp, seed):
        """Scenario of one of the nine scenes."""
        # All keys of the ground are explicit, so that the scenario does not depend on defaults.
        crs, west, north = SITE_CORNERS["NAD83"]
        edge = self.cells * CELL
        first = min(_CORNER * CELL, max(SITE_SIZE - edge, 0.0))
        west = west + first if self.west is None else self.west
        north = north - first if self.north is None else self.north
        source = self.densities[treatment]
        sensor = {"interval": "native" if self.reading.own_interval else "product", "offset": [0.0, 0.0]}
        if self.instrument.paper_lsf is not None:
            sensor["response"] = "paper"
        return Scenario(
            grid={"crs": crs, "west": west, "north": north, "width": edge, "height": edge, "cell": CELL},
            # Distributions that are not files have no key.
            ground={"distribution": str(source) if is_path(source) else treatment, "arp": arp, "seed": seed}
            | {"method": "periodic"} | self.plants,
            terrain={"dem": self.dem, "upwelling": True},
            sensor={"instrument": self.sensor, "bands": list(self.bands)} | sensor,
        )  # fmt: skip

    @cached_property
    def common(self):
        """One of the nine scenarios, for their common keys."""
        return self.scenario(treatments()[0], ARPS[0], 0)

    @cached_property
    def grid(self):
        """Grid of the cells."""
        return self.common.geobox()

    @cached_property
    def setup(self):
        """Setup of ground, atmosphere and instrument, without elevation."""
        return replace(setup_of(self.common), instrument=self.instrument)

    def light(self):
        """Light on the slopes of the scenes, for `Driver.on_slopes`; None on level ground."""
        return light_of(self.common, as_carried(self.grid), self.setup.geometry)


def case_of(*, reading="native", dem="flat", densities=None, optics=None, background=None, sensor="TM", **place):
    """Case from the arguments of `fifesim.reproduce`."""
    sensor, dem = os.fspath(sensor), os.fspath(dem)
    if reading not in READINGS:
        raise ValueError(f"reading must be one of {', '.join(READINGS)}, got {reading!r}")
    if dem not in ("flat", "flint-hills") and not os.path.isfile(dem):
        raise ValueError(f'dem = {shown(dem)}: type "flat", "flint-hills", or a raster file of elevation')
    bands = sensor_of(sensor)[1]
    plants = optics_of(optics, bands) | background_of(background, bands)
    case = Case(READINGS[reading], dem, densities_of(densities), plants, sensor, **place)
    # Raises an error for invalid physics before anything is computed.
    case.common.complete()
    return case


def scenes():
    """Treatment and autoregressive parameter of the nine scenes, in the order of Table 2."""
    return [(treatment, arp) for treatment in treatments() for arp in ARPS]


def paper_table():
    """Table 2 of the paper."""
    return files.table("friedl1995_table2.csv")


def paper_text():
    """Further results in the text of the paper."""
    return files.table("friedl1995_text.csv")
