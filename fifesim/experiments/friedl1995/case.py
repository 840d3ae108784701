"""The experiment of Friedl et al. (1995): nine scenes, what the sensor makes of them, and Table 2."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from odc.geo.geobox import GeoBox

from fifesim.analysis.rasters.means import aggregate
from fifesim.base import datasets
from fifesim.chain import steps as chain
from fifesim.chain.images import ndvi
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.ground.canopy import raster as ground
from fifesim.ground.landscape.distribution import treatments, truncated_normal
from fifesim.ground.landscape.raster import lai_scene
from fifesim.ground.terrain.rasters.hills import flint_hills
from fifesim.rasters import sites
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.spatial_response import CosineResponse

ARPS = (0.05, 0.15, 0.24)
VARIABLES = ("lai", "fpar")
BANDS = ("TM3", "TM4")

# Nine cells across a pixel of 30 m.
CELL = 30 / 9
PIXEL = 30.0

# Along the edge of a scene. The paper states no size; the report shows what others give.
CELLS = 333
# With fewer than a hundred pixels increments hold too few for a deviation.
FEWEST_CELLS = 90

# Where in the FIFE site the scene lies, in cells from its corner: only the relief depends on it.
_CORNER = 1000
_HILLS_SEED = 7


@dataclass(frozen=True)
class Reading:
    """
    How the pixels of Table 1 lie on the blocks of ground that they are compared with.

    Parameters
    ----------
    name : str
    text : str
        What it takes Table 1 to say.
    own_interval : bool
        Pixels at the instrument's own sampling interval, paired with the blocks by row and column.
    count : int, optional
        Number of angles of the line spread function; the instrument's by default.
    offset : float
        Constant displacement of the image, southward and eastward. [cell]
    topography : bool
        Slopes change the light on the ground (Eqs. 4 and 5).
    """

    name: str
    text: str
    own_interval: bool = False
    count: int | None = None
    offset: float = 0.0
    topography: bool = False


USED = Reading(
    "native interval",
    "pixels every 43 µrad × 705 km = 30.315 m, paired by row and column with the 30 m blocks of the truth",
    own_interval=True,
)
READINGS = (
    USED,
    Reading("aligned", "pixels of 30 m on the blocks of the truth"),
    Reading("narrow response", "aligned, with a line spread of 7 of the 9 angles (23.6 m)", count=7),
    Reading("constant offset", "aligned, then displaced by 2 cells (6.7 m) along both axes", offset=2.0),
    Reading("aligned with relief", "aligned, on the synthetic Flint Hills", topography=True),
    Reading("native interval with relief", "native interval, on the synthetic Flint Hills", True, topography=True),
)


def _setup():
    """That of the experiment, with its leaf optics."""
    optics = {band: tuple(pair) for band, *pair in datasets.table("friedl1995_optics.csv").itertuples(index=False)}
    return Setup(instrument=find_instrument("TM"), bands=BANDS, leaf_optics=optics)


def densities(shift=0.0, factor=1.0, bound=0.0):
    """
    Distributions of LAI of the experiment, or changed ones.

    Parameters
    ----------
    shift : float, optional
        Added to mean and bounds. [m2 m-2]
    factor : float, optional
        Of the standard deviation. [1]
    bound : float, optional
        By how many standard deviations the bounds move outward; a lower one of 0 stays. [1]

    Returns
    -------
    densities : dict of str to frozen scipy distribution
        By treatment.
    """
    found = {}
    for name, mean, deviation, low, high in datasets.table("friedl1995_densities.csv").itertuples(index=False):
        moved = low + shift - bound * deviation if low else low, high + shift + bound * deviation
        found[name] = truncated_normal(mean + shift, factor * deviation, *moved)
    return found


@dataclass(frozen=True)
class Case:
    """
    What the nine scenes have in common.

    Parameters
    ----------
    cells : int
        Along the edge of a scene.
    reading : Reading
    densities : mapping of str to frozen scipy distribution
        Of LAI, by treatment.
    setup : fifesim.chain.setup.Setup
        On level ground, as Table 1 has it before it is read.
    """

    cells: int = CELLS
    reading: Reading = USED
    densities: Mapping = field(default_factory=densities)
    setup: Setup = field(default_factory=_setup)

    def __post_init__(self):
        if self.cells < FEWEST_CELLS:
            raise ValueError(
                f"cells must be at least {FEWEST_CELLS}, 10 pixels along the edge of a scene, got {self.cells}: "
                "samples of 200 pixels need 135"
            )

    @property
    def grid(self):
        """Grid of the cells, an `odc.geo.geobox.GeoBox`."""
        site = sites.fife_site(CELL)
        first = min(_CORNER, max(site.shape.y - self.cells, 0))
        return GeoBox((self.cells, self.cells), site[first:, first:].affine, site.crs)

    @property
    def read(self):
        """The setup as the reading of Table 1 has it, a `fifesim.chain.setup.Setup`."""
        instrument, reading = self.setup.instrument, self.reading
        if reading.count is not None:
            lsf = instrument.lsf
            instrument = replace(instrument, lsf=CosineResponse(kind=lsf.kind, step=lsf.step, count=reading.count))
        return replace(
            self.setup,
            instrument=instrument,
            dem=_relief(self.grid) if reading.topography else None,
            interval="native" if reading.own_interval else None,
            offset=(reading.offset * CELL / PIXEL,) * 2,
        )


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


def landscape(case, treatment, arp, seed):
    """
    Leaf area of a scene and the light that it absorbs.

    Parameters
    ----------
    case : Case
    treatment : str
    arp : float
        [1]
    seed : int

    Returns
    -------
    lai, fpar : xarray.DataArray, dims (y, x)
        By the paper's own route: one Fourier transform of the scene, and exact ranks.
    """
    lai = lai_scene(case.grid, case.densities[treatment], arp=arp, seed=seed, method="periodic")
    return lai, ground.fpar(lai)


def pixel_values(truth, *images):
    """
    Pixels of several rasters paired by row and column, without those where one has no data.

    Parameters
    ----------
    truth, *images : xarray.DataArray, dims (y, x)

    Returns
    -------
    values : array, shape (rasters, pixels)
    """
    rasters = (truth, *images)
    rows, columns = min(raster.sizes["y"] for raster in rasters), min(raster.sizes["x"] for raster in rasters)
    values = np.stack([raster.values[:rows, :columns].ravel() for raster in rasters])
    return values[:, np.isfinite(values).all(axis=0)]


def run(case, treatment, arp, seed):
    """
    Pixels of one scene, as Table 2 regresses them.

    Parameters
    ----------
    case : Case
    treatment : str
    arp : float
        [1]
    seed : int

    Returns
    -------
    pixels : array, shape (3, n)
        True LAI, true FPAR, and NDVI at the top of the atmosphere.
    cells : array, shape (3, 2)
        Least and largest of the same in the cells; NDVI at the top of the atmosphere, too.
    """
    lai, fpar = landscape(case, treatment, arp, seed)
    reflectance = reflectance_of(case.read, lai)
    image = image_of(case.read, reflectance)
    truth = [aggregate(array, PIXEL) for array in (lai, fpar)]
    of_cells = ndvi(chain.to_toa(reflectance))
    limits = [(float(array.min()), float(array.max())) for array in (lai, fpar, of_cells)]
    return pixel_values(*truth, ndvi(image)), np.array(limits)


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


@lru_cache(maxsize=1)
def _relief(grid):
    """Elevation of the synthetic hills, with a cell more on each side for the slopes at the border."""
    return flint_hills(grid.pad(1), _HILLS_SEED)
