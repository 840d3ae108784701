"""Experiment of Friedl et al. (1995): nine scenarios, readings of Table 1, and user-supplied inputs."""

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from math import ceil
from pathlib import Path

import numpy as np
import pandas as pd
import tomlkit

from fifesim.base import files
from fifesim.base.arguments import is_path
from fifesim.base.files import in_a_line, read_csv, shown
from fifesim.base.times import SITE_CORNERS, SITE_SIZE
from fifesim.grids.grid import as_carried
from fifesim.ground.canopy import optics as canopy_optics
from fifesim.ground.canopy.spectra import Background, spectrum_names
from fifesim.ground.landscape.distribution import lai_distribution, treatments
from fifesim.scenario.ground import light_of
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.spatial_response import CosineResponse, GaussianResponse

OPTICS = ("leaf_reflectance", "leaf_transmittance")
BACKGROUND = ("background",)


def densities_of(given):
    """Distributions of leaf area of the three treatments, from a folder of samples or a mapping."""
    names = treatments()
    if given is None:
        return {name: name for name in names}
    if is_path(given):
        folder = Path(given)
        if not folder.is_dir():
            raise ValueError(f"densities = {shown(str(given))} is no folder: it holds {_files(names)}, samples of LAI")
        given = {name: str(folder / f"{name}.csv") for name in names if (folder / f"{name}.csv").is_file()}
        where, wanted = f"the folder {in_a_line(str(folder), 150)}", "a file"
    else:
        where, wanted = "densities", "an entry"
    missing = [name for name in names if name not in given]
    other = [str(name) for name in given if name not in names]
    if missing or other:
        lacks = f"lacks {wanted} of {' and '.join(missing)}"
        problem = lacks if missing else f"has an unknown treatment {shown(other[0])}"
        raise ValueError(
            f"{where} {problem}: Table 2 needs {_files(names) if wanted == 'a file' else ', '.join(names)}"
        )
    for source in given.values():
        lai_distribution(source)
    return {name: given[name] for name in names}


def optics_by_band(given, bands, columns, what):
    """Optics by band, from a CSV file or a mapping; None stands for the defaults. [1]"""
    if given is None:
        return None
    found, where = (
        (_table(given, columns, what), f"{what} file {in_a_line(Path(given).name, 100)}")
        if is_path(given)
        else ({str(band): tuple(np.atleast_1d(values).tolist()) for band, values in given.items()}, what)
    )
    missing = [band for band in bands if band not in found]
    if missing:
        raise ValueError(
            f"{where} has no line for band {' and '.join(missing)}: it has {', '.join(found) or 'none'}; add "
            f"{', '.join(('band', *columns))}"
        )
    wrong = next((band for band in bands if len(found[band]) != len(columns)), None)
    if wrong is not None:
        raise ValueError(f"{what}: band {wrong} needs {' and '.join(columns)}, got {shown(found[wrong])}")
    check = canopy_optics.check_leaf_optics if columns == OPTICS else canopy_optics.check_background
    for band in bands:
        check(*found[band])
    return {band: found[band] for band in bands}


def background_of(given, bands):
    """Background below the canopy, by band or as shares of spectra. [1]"""
    if isinstance(given, str) and ":" in given and not os.path.exists(given):
        return dict(Background(_shares(given)).fractions)
    if isinstance(given, Mapping) and given and set(map(str, given)) <= set(spectrum_names()):
        return dict(Background(given).fractions)
    found = optics_by_band(given, bands, BACKGROUND, "background")
    return found and {band: value for band, (value,) in found.items()}


def sensor_of(name):
    """Instrument of the scenes, with the response of the paper if its file has one, and its red and infrared band."""
    description = instrument(name)
    if description.paper_lsf is not None:
        description = instrument(description, "paper")
    return description, tuple(band.name for band in description.red_and_near_infrared())


def _files(names):
    return ", ".join(f"{name}.csv" for name in names)


def _table(path, columns, what):
    """Numbers by band from a CSV file."""
    table, wanted = read_csv(path, f"the {what}"), ("band", *columns)
    name = in_a_line(Path(path).name, 100)
    lacking = [column for column in wanted if column not in table.columns]
    if lacking:
        raise ValueError(f"{what} file {name} lacks the column {' and '.join(lacking)}: it needs {', '.join(wanted)}")
    numbers = table[list(columns)].apply(pd.to_numeric, errors="coerce")
    if numbers.isna().any(axis=None):
        band = table["band"][numbers.isna().any(axis=1).idxmax()]
        raise ValueError(f"{what} file {name}: band {shown(band)} has no number in {' or '.join(columns)}")
    return dict(zip(table["band"].astype(str).str.strip(), numbers.itertuples(index=False, name=None), strict=True))


def _shares(text):
    """Shares of spectra from a text such as soil_dry:0.5+shade:0.5."""
    parts = [part.partition(":") for part in text.split("+")]
    try:
        return {name.strip(): float(share) for name, _, share in parts}
    except ValueError:
        raise ValueError(
            f"background = {shown(text)}: type shares such as soil_dry:0.475+shade:0.525, or a CSV file by band"
        ) from None


# Nine cells across a pixel of 30 m.
CELL = 30 / 9

# Instrument of Table 1, from which variants with other responses are derived.
TABLE_1 = "TM"
_FILE = "instruments/tm.toml"

_OWN_INTERVAL = "43 µrad × 705 km = 30.315 m"

_BLUR = (
    "a Gaussian of {eifov:g} m effective field of view, measured in flight over the San Mateo Bridge "
    "(Schowengerdt et al. 1985, Landsat-4 TM)"
)


@dataclass(frozen=True)
class Reading:
    """Interpretation of Table 1: position and spatial response of the pixels relative to the blocks of ground."""

    name: str
    text: str
    own_interval: bool = False  # pixels at the instrument's own interval, paired with the blocks by row and column
    count: int | None = None  # angles of the line spread function, instead of Table 1's
    eifov: float | None = None  # effective field of view of a Gaussian instead of this function [m]
    offset: float = 0.0  # constant displacement of the image, southward and eastward [cell]

    @property
    def other_response(self):
        """Whether the spatial response differs from the instrument file."""
        return self.count is not None or self.eifov is not None

    def in_words(self, interval, pixel):
        """Description of the reading for a sampling interval and a pixel size, in m."""
        text = self.text
        if f"{interval:.3f}" not in _OWN_INTERVAL:
            text = text.replace(_OWN_INTERVAL, f"{interval:.3f} m")
        return text.replace("30 m", f"{pixel:g} m")

    def instrument(self, description):
        """Instrument with the spatial response of the reading."""
        if self.count is not None:
            lsf = description.lsf
            return replace(description, lsf=CosineResponse(kind="cosine", step=lsf.step, count=self.count))
        if self.eifov is not None:
            angle = self.eifov / description.altitude
            return replace(description, lsf=GaussianResponse(kind="gaussian", eifov=angle))
        return description

    def instrument_file(self):
        """TOML text of an instrument file with the response of the reading and all other values from Table 1."""
        document = tomlkit.parse(files.path(_FILE).read_text(encoding="utf-8"))
        response = asdict(self.instrument(instrument(TABLE_1, "paper")).lsf)
        document["lsf"] = {name: value for name, value in response.items() if value is not None}
        document["lsf"].comment(self.text)
        document["origin"]["blur"] = tomlkit.inline_table() | {"kind": "assumed"}
        document["sources"]["lsf"] = self.name
        document["references"][self.name] = self.text
        return tomlkit.dumps(document)


# Statements of the paper on cells and pixels, by section. They support the aligned reading.
PASSAGES = {
    "Ground Scene Model": "9² ground cells per simulated sensor pixel",
    "Analyses": "81 (9²) ground scene elements per 30-m TM pixel",
}

NATIVE = Reading(
    "native",
    f"pixels every {_OWN_INTERVAL}, paired by row and column with the 30 m blocks of the truth",
    own_interval=True,
)
ALIGNED = Reading("aligned", "pixels of 30 m on the blocks of the truth")
READINGS = {
    reading.name: reading
    for reading in (
        NATIVE,
        ALIGNED,
        Reading("narrow", "aligned, with a line spread of 7 steps (23.6 m) instead of 9 (30.3 m)", count=7),
        Reading("offset", "aligned, then displaced by 2 cells (6.7 m) along both axes", offset=2.0),
        Reading("blur-40.8", "aligned, with " + _BLUR.format(eifov=40.8), eifov=40.8),
        Reading("blur-48.6", "aligned, with " + _BLUR.format(eifov=48.6), eifov=48.6),
    )
}


def reading_of(name, sensor):
    """Reading by name, which must be possible for the sensor."""
    if name not in READINGS:
        raise ValueError(f"reading must be one of {', '.join(READINGS)}, got {name!r}")
    found = READINGS[name]
    if found.other_response and sensor != TABLE_1:
        rest = ", ".join(each.name for each in READINGS.values() if not each.other_response)
        raise ValueError(f"the reading {name!r} of Table 1 applies to TM only: for {sensor} use {rest}")
    return found


def beside(reading):
    """Requested reading, and a second one for comparison: aligned, or native if the first is aligned."""
    return [reading, NATIVE if reading == ALIGNED else ALIGNED]


ARPS = (0.05, 0.15, 0.24)
VARIABLES = ("lai", "fpar")

# Cells along the edge of a scene. The paper states no size; the report shows results for other sizes.
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
    optics: Mapping | None = None  # leaf reflectance and transmittance by band, fitted by default [1]
    background: Mapping | None = None  # by band, or fractions of spectra; fitted by default [1]
    sensor: str = TABLE_1
    cells: int | None = None  # along the edge of a scene, 333 or 12 pixels of a coarse sensor by default
    bits: int | None = None
    # Upper left corner in EPSG:26914, by default 3.33 km from the corner of the site, which the paper does not give.
    west: float | None = None
    north: float | None = None

    def __post_init__(self):
        if self.cells is None:
            object.__setattr__(self, "cells", max(CELLS, ceil(_COARSE_PIXELS * self.pixel / CELL)))
        if self.cells < self.fewest_cells:
            raise ValueError(
                f"cells must be at least {self.fewest_cells}, {_FEWEST_PIXELS} pixels along the edge of a scene, got "
                f"{self.cells}: samples of 200 pixels need {ceil(15 * self.pixel / CELL)}"
            )

    @property
    def fewest_cells(self):
        """Smallest number of cells along the edge of a scene."""
        return ceil(_FEWEST_PIXELS * self.pixel / CELL)

    @cached_property
    def bands(self):
        """Names of the red and the near infrared band."""
        return sensor_of(self.sensor)[1]

    @cached_property
    def instrument(self):
        """Instrument of the reading."""
        found = self.reading.instrument(sensor_of(self.sensor)[0])
        return found if self.bits is None else replace(found, bits=self.bits)

    @property
    def own_densities(self):
        """Whether the densities are the defaults."""
        return dict(self.densities) == densities_of(None)

    @property
    def pixel(self):
        """Size of a pixel and of a block of the truth. [m]"""
        description, (red, _) = sensor_of(self.sensor)
        return description.pixel(description.select([red])[0])

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
        # All keys of the ground are explicit, so that the scenario does not depend on defaults. The response of the
        # reading, the number of bits and unnamed densities have no key.
        crs, west, north = SITE_CORNERS["NAD83"]
        edge = self.cells * CELL
        first = min(_CORNER * CELL, max(SITE_SIZE - edge, 0.0))
        west = west + first if self.west is None else self.west
        north = north - first if self.north is None else self.north
        grid = {"crs": crs, "west": west, "north": north, "width": edge, "height": edge, "cell": CELL}
        source = self.densities[treatment]
        ground = {"distribution": str(source) if is_path(source) else treatment, "arp": arp, "seed": seed}
        ground["method"] = "periodic"
        for number, name in enumerate(OPTICS if self.optics is not None else ()):
            ground[name] = {band: float(pair[number]) for band, pair in self.optics.items()}
        if self.background is not None:
            by_band = set(self.background) & set(self.bands)
            ground["background" if by_band else "background_spectra"] = dict(self.background)
        interval, offset = "native" if self.reading.own_interval else "product", self.reading.offset * CELL / self.pixel
        sensor = {"instrument": self.sensor, "bands": list(self.bands), "interval": interval, "offset": [offset] * 2}
        if sensor_of(self.sensor)[0].paper_lsf is not None and not self.reading.other_response:
            sensor["response"] = "paper"
        return Scenario(grid=grid, ground=ground, terrain={"dem": self.dem, "upwelling": True}, sensor=sensor)

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


def case_of(
    reading="native",
    dem="flat",
    densities=None,
    optics=None,
    background=None,
    sensor=TABLE_1,
    cells=None,
    west=None,
    north=None,
):
    """Case from the arguments of `fifesim.reproduce`."""
    sensor = os.fspath(sensor)
    description, bands = sensor_of(sensor)
    case = Case(
        reading=reading_of(reading, description.name),
        dem=os.fspath(dem),
        densities=densities_of(densities),
        optics=optics_by_band(optics, bands, OPTICS, "optics"),
        background=background_of(background, bands),
        sensor=sensor,
        cells=cells,
        west=west,
        north=north,
    )
    if case.dem not in ("flat", "flint-hills") and not os.path.isfile(case.dem):
        raise ValueError(f'dem = {shown(case.dem)}: type "flat", "flint-hills", or a raster file of elevation')
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
