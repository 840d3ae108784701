"""The experiment of Friedl et al. (1995): nine scenarios that differ in the ground, and all that they share."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil

from fifesim.base import datasets, fife
from fifesim.base.foreign import shown
from fifesim.base.kinds import is_path
from fifesim.experiments.friedl1995 import inputs
from fifesim.experiments.friedl1995.readings import CELL, NATIVE, TABLE_1, Reading, reading_of
from fifesim.ground.landscape.distribution import treatments
from fifesim.scenario.land import elevation, in_memory
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import setup_of

ARPS = (0.05, 0.15, 0.24)
VARIABLES = ("lai", "fpar")

# Along the edge of a scene. The paper states no size; the report shows what others give.
CELLS = 333
# With fewer pixels along an edge increments hold too few for a deviation.
_FEWEST_PIXELS = 10
_COARSE_PIXELS = 12

# Where in the FIFE site the scene lies, in cells from its corner: only the relief depends on it.
_CORNER = 1000


@dataclass(frozen=True, eq=False)
class Case:
    """
    What the nine scenes have in common.

    Parameters
    ----------
    reading : Reading
        Of Table 1.
    dem : str
        "flat", "flint-hills" or a raster file of elevation.
    densities : mapping of str
        By treatment, what `fifesim.lai_distribution` takes.
    optics : mapping of str to (float, float), optional
        Leaf reflectance and transmittance by band; by default fifesim's own. [1]
    background : mapping of str to float, optional
        By band, or shares of spectra; by default fifesim's own. [1]
    sensor : str
        Name of an instrument, or its file.
    cells : int, optional
        Along the edge of a scene; 333, or 12 pixels of a coarse sensor, by default.
    bits : int, optional
        Of digital numbers; the instrument's by default.
    upwelling : bool, optional
        With the view's cosine on slopes (Eq. 5).
    west, north : float, optional
        Upper left corner of the scenes in EPSG:26914, on which the relief depends; by default 3.33 km from that of the
        site, which the paper does not give. [m]

    Raises
    ------
    ValueError
        If a scene would have fewer than 10 pixels along its edge, or the sensor lacks a red or near infrared band.
    """

    reading: Reading = NATIVE
    dem: str = "flat"
    densities: Mapping = field(default_factory=lambda: inputs.densities_of(None))
    optics: Mapping | None = None
    background: Mapping | None = None
    sensor: str = TABLE_1
    cells: int | None = None
    bits: int | None = None
    upwelling: bool = True
    west: float | None = None
    north: float | None = None

    def __post_init__(self):
        if self.cells is None:
            object.__setattr__(self, "cells", max(CELLS, ceil(_COARSE_PIXELS * self.pixel / CELL)))
        fewest = ceil(_FEWEST_PIXELS * self.pixel / CELL)
        if self.cells < fewest:
            raise ValueError(
                f"cells must be at least {fewest}, {_FEWEST_PIXELS} pixels along the edge of a scene, got "
                f"{self.cells}: samples of 200 pixels need {ceil(15 * self.pixel / CELL)}"
            )

    @cached_property
    def bands(self):
        """Names of the red and the near infrared band, a tuple of str."""
        return inputs.sensor_of(self.sensor)[1]

    @cached_property
    def instrument(self):
        """As the reading has it, a `fifesim.sensor.description.instrument_file.Instrument`."""
        found = self.reading.instrument(inputs.sensor_of(self.sensor)[0])
        return found if self.bits is None else replace(found, bits=self.bits)

    @property
    def pixel(self):
        """Size of a pixel, and of a block of the truth. [m]"""
        description, (red, _) = inputs.sensor_of(self.sensor)
        return description.pixel(description.select([red])[0])

    @property
    def interval(self):
        """Distance between the instrument's own samples. [m]"""
        return max(self.instrument.ground_intervals(self.instrument.select(self.bands)[0]))

    @property
    def drift(self):
        """How far along an axis the last pixel lies from its block. [m]"""
        if not self.reading.own_interval:
            return 0.0
        return (int(self.cells * CELL / self.interval) - 1) * abs(self.interval - self.pixel)

    def scenario(self, treatment, arp, seed):
        """
        One of the nine, which `fifesim simulate` runs.

        Parameters
        ----------
        treatment : str
        arp : float
            [1]
        seed : int

        Returns
        -------
        scenario : fifesim.scenario.scenario.Scenario
            All that matters to the ground is said, whatever the defaults are. A response of the reading, other bits and
            a density without a name are not in it.
        """
        crs, west, north = fife.CORNERS["NAD83"]
        edge = self.cells * CELL
        first = min(_CORNER * CELL, max(fife.SIZE - edge, 0.0))
        west = west + first if self.west is None else self.west
        north = north - first if self.north is None else self.north
        grid = {"crs": crs, "west": west, "north": north, "width": edge, "height": edge, "cell": CELL}
        source = self.densities[treatment]
        ground = {"distribution": str(source) if is_path(source) else treatment, "arp": arp, "seed": seed}
        ground |= {"method": "periodic"} | self._leaves()
        sensor = {"instrument": self.sensor, "bands": list(self.bands)}
        sensor |= {"interval": "native" if self.reading.own_interval else "product"}
        sensor |= {"offset": [self.reading.offset * CELL / self.pixel] * 2}
        return Scenario(grid=grid, ground=ground, terrain={"dem": self.dem, "upwelling": self.upwelling}, sensor=sensor)

    @cached_property
    def common(self):
        """What the nine scenarios share, one of them, a `fifesim.scenario.scenario.Scenario`."""
        return self.scenario(treatments()[0], ARPS[0], 0)

    @cached_property
    def grid(self):
        """Grid of the cells, an `odc.geo.geobox.GeoBox`."""
        return self.common.geobox()

    @cached_property
    def setup(self):
        """Ground, air and instrument, without elevation, a `fifesim.chain.setup.Setup`."""
        return replace(setup_of(self.common), instrument=self.instrument)

    def land(self):
        """
        Elevation of the scenes, which is one for all, and the horizon around.

        Returns
        -------
        dem, horizon : xarray.DataArray or None
            As `fifesim.scenario.land.in_memory` gives them.
        """
        return in_memory(*elevation(self.common, self.grid)[:2])

    def _leaves(self):
        keys = {}
        if self.optics is not None:
            for number, name in enumerate(inputs.OPTICS):
                keys[name] = {band: float(pair[number]) for band, pair in self.optics.items()}
        if self.background is not None:
            by_band = set(self.background) & set(self.bands)
            keys["background" if by_band else "background_spectra"] = dict(self.background)
        return keys


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
    """
    A case of what a reader gives.

    Parameters
    ----------
    reading, dem, densities, optics, background, sensor, cells, west, north : optional
        As in `fifesim.reproduce`.

    Returns
    -------
    case : Case

    Raises
    ------
    ValueError
        If one of them is not right.
    """
    sensor = os.fspath(sensor)
    description, bands = inputs.sensor_of(sensor)
    case = Case(
        reading=reading_of(reading, description.name),
        dem=os.fspath(dem),
        densities=inputs.densities_of(densities),
        optics=inputs.by_band(optics, bands, inputs.OPTICS, "optics"),
        background=inputs.background_of(background, bands),
        sensor=sensor,
        cells=cells,
        west=west,
        north=north,
    )
    if case.dem not in ("flat", "flint-hills") and not os.path.isfile(case.dem):
        raise ValueError(f'dem = {shown(case.dem)}: type "flat", "flint-hills", or a raster file of elevation')
    # Physics refuses what cannot be before anything is computed.
    case.common.complete()
    return case


def scenes():
    """
    Treatment and autoregressive parameter of the nine scenes, in the order of Table 2.

    Returns
    -------
    scenes : list of (str, float)

    Examples
    --------
    >>> len(scenes()), scenes()[0]
    (9, ('burned-grazed', 0.05))
    """
    return [(treatment, arp) for treatment in treatments() for arp in ARPS]


def paper_table():
    """
    Table 2 of the paper.

    Returns
    -------
    table : pandas.DataFrame
        Columns variable, distribution, arp, intercept, slope and r2.
    """
    return datasets.table("friedl1995_table2.csv")


def paper_text():
    """
    Further results in the paper's text.

    Returns
    -------
    table : pandas.DataFrame
        Columns quantity, variable, arp and value.
    """
    return datasets.table("friedl1995_text.csv")
