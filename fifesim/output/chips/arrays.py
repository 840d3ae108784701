"""Chips of a study in memory: images, truth and light of some of them as stacked arrays."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from fifesim.rasters import cf
from fifesim.scenario.chips import chips_of
from fifesim.scenario.ensemble import LIGHT, realise, realise_arrays
from fifesim.sensor.response import calibration

_ALONG_BAND = ("band", "wavelength", "gain", "offset", "compression", "solar_irradiance")

# Reflectance is computed of so many chips at once, in double precision.
_AT_ONCE = 50

# Seven digits are more than a mean of leaf area has.
_FLOAT = np.float32


class Layout(NamedTuple):
    """
    What chips of a study have in common.

    Parameters
    ----------
    bands : xarray.Dataset
        Coordinates along ``band``.
    truth : tuple of str
        Names of what is known of the ground of the pixels.
    has_ndvi : bool
    dn : numpy.dtype
        Of the digital numbers.
    pixels : (int, int)
        Rows and columns.
    pixel : float
        [m]
    crs : xarray.Variable
        Without dimensions, whose attributes are the coordinate reference system.
    """

    bands: xr.Dataset
    truth: tuple[str, ...]
    has_ndvi: bool
    dn: np.dtype
    pixels: tuple[int, int]
    pixel: float
    crs: xr.Variable

    @property
    def variables(self):
        """Dimensions and type of what is stored of each chip, a dict of (tuple of str, numpy.dtype) by name."""
        planes = (("ndvi",) if self.has_ndvi else ()) + self.truth
        found = {"dn": (("band", "y", "x"), self.dn), "toa_reflectance": (("band", "y", "x"), np.dtype(_FLOAT))}
        found |= {name: (("y", "x"), np.dtype(_FLOAT)) for name in planes}
        return found | {name: ((), np.dtype(float)) for name in LIGHT}

    def attributes(self, name):
        """
        Attributes of what is stored of each chip.

        Parameters
        ----------
        name : str

        Returns
        -------
        attributes : dict
        """
        return cf.attributes(name) | ({"cell_methods": "area: mean"} if name in self.truth else {})

    def shape(self, dims):
        """
        Lengths of dimensions of a chip.

        Parameters
        ----------
        dims : sequence of str

        Returns
        -------
        shape : tuple of int
        """
        sizes = dict(zip(("band", "y", "x"), (self.bands.sizes["band"], *self.pixels), strict=True))
        return tuple(sizes[name] for name in dims)

    @property
    def size(self):
        """Of a chip in memory. [byte]"""
        return sum(dtype.itemsize * int(np.prod(self.shape(dims))) for dims, dtype in self.variables.values())


def layout_of(chips):
    """
    What chips have in common, from the first of them.

    Parameters
    ----------
    chips : fifesim.scenario.chips.Chips

    Returns
    -------
    layout : Layout

    Raises
    ------
    ValueError
        If the scenario asks for what cannot be.
    """
    nodes = realise(chips.scenario(0))
    image, truth = nodes["image"], _fullest(chips.study)
    size = chips.study.scenario.sensor.size
    return Layout(
        bands=xr.Dataset(coords={name: image[name].variable for name in _ALONG_BAND if name in image.coords}),
        truth=tuple(dict.fromkeys((*nodes["truth"].data_vars, *truth))),
        has_ndvi="ndvi" in image,
        dn=image["dn"].dtype,
        pixels=(image.sizes["y"], image.sizes["x"]),
        pixel=size,
        crs=image["spatial_ref"].variable,
    )


def _fullest(study):
    """Names of the truth where no property that is drawn is 0, which leaves it out."""
    drawn = {}
    for key, distribution in study.drawn.items():
        ends = distribution.extremes
        numbers = all(isinstance(value, int | float) for value in ends)
        drawn[key.path] = max(ends) if numbers and min(ends) == 0 else distribution.usual
    side = 2 * study.scenario.sensor.size
    small = {("grid", "width"): side, ("grid", "height"): side}
    return realise(study.scenario_with(drawn | small), ("truth",), complete=True)["truth"].data_vars


def chip_arrays(chips, numbers, layout):
    """
    Chips as stacked arrays.

    Parameters
    ----------
    chips : fifesim.scenario.chips.Chips
    numbers : sequence of int, shape (n,)
        Of those that are made.
    layout : Layout

    Returns
    -------
    arrays : dict of str to array, shape (n, ...)
        As the layout has them, in the order of the numbers.

    Raises
    ------
    ValueError
        If a chip cannot be simulated, or has another truth than the layout.
    """
    count, numbers = len(numbers), np.asarray(numbers)
    found = empty_arrays(count, layout)
    # Neighbours of a landscape are cut from one tile of its field.
    for at in np.lexsort((numbers, chips.landscape[numbers])).tolist():
        chip = int(numbers[at])
        scenario = chips.scenario(chip)
        try:
            _put(found, at, *realise_arrays(scenario, complete=True), layout)
        except ValueError as error:
            raise ValueError(f"chip {chip}: {error}") from error
    for start in range(0, count, _AT_ONCE):
        part = {name: values[start : start + _AT_ONCE] for name, values in found.items()}
        part["toa_reflectance"][:] = _reflectance(part, layout)
    return found


def empty_arrays(count, layout):
    """
    Arrays of chips before they are made.

    Parameters
    ----------
    count : int
        Chips.
    layout : Layout

    Returns
    -------
    arrays : dict of str to array, shape (count, ...)
    """
    return {name: np.empty((count, *layout.shape(dims)), dtype) for name, (dims, dtype) in layout.variables.items()}


def make_shard(study, count, first, last, layout):
    """
    Arrays of some chips, on a worker that knows the study alone.

    Parameters
    ----------
    study : fifesim.scenario.studies.Study
    count, first, last : int
        Chips in all, the first of the shard, and that behind the last.
    layout : fifesim.output.chips.arrays.Layout

    Returns
    -------
    arrays : dict of str to array
    """
    return chip_arrays(chips_of(study, count), range(first, last), layout)


def _put(found, at, image, truth, layout):
    """What the arrays of a run say of a chip."""
    unknown = set(truth) - set(layout.truth)
    if unknown:
        raise ValueError(
            f"has a truth that others have not, {', '.join(sorted(unknown))}: draw it for all, or for none"
        )
    found["dn"][at] = image["dn"]
    if layout.has_ndvi:
        found["ndvi"][at] = image["ndvi"]
    for name in layout.truth:
        # Where no leaf is dead, green leaves are all leaves.
        other = "fpar" if name == "green_fpar" else None
        found[name][at] = truth.get(name, truth.get(other, np.nan))
    for name in LIGHT:
        found[name][at] = image[name]


def _reflectance(found, layout):
    """Planetary reflectance of the digital numbers."""
    bands = {name: layout.bands[name].values[:, None, None] for name in layout.bands.coords if name != "band"}
    scale = (bands["gain"], bands["offset"], bands.get("compression", 0))
    radiance = calibration.dn_to_radiance(found["dn"], *scale)
    sza, distance = (found[name][:, None, None, None] for name in ("sza", "earth_sun_distance"))
    mu_s = np.cos(np.radians(sza))
    return calibration.radiance_to_reflectance(radiance, bands["solar_irradiance"], mu_s, distance)
