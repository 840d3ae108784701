"""Zarr store of chips: metadata written at once, and shards written one by one from chips in memory."""

import warnings
from typing import NamedTuple

import numpy as np
import xarray as xr
import zarr

from fifesim.grids import cf
from fifesim.output.blocks import block_file, checksum, fresh_store
from fifesim.output.folders import versions
from fifesim.scenario.ensemble import LIGHT, realise, realise_arrays
from fifesim.sensor.response import calibration

_ALONG_BAND = ("band", "wavelength", "gain", "offset", "compression", "solar_irradiance")

# Number of chips per batch for reflectance in double precision.
_AT_ONCE = 50

# Seven digits exceed the accuracy of a mean leaf area.
_FLOAT = np.float32


class Layout(NamedTuple):
    """Common description of the chips of a study."""

    bands: xr.Dataset  # coordinates along band
    truth: tuple[str, ...]  # names of the true quantities of the ground of the pixels
    has_ndvi: bool
    dn: np.dtype
    saturated: int  # digital number of saturated pixels
    pixels: tuple[int, int]  # rows and columns
    pixel: float  # [m]
    crs: xr.Variable  # without dimensions, whose attributes are the coordinate reference system

    @property
    def variables(self):
        """Dimensions and type of each stored variable of a chip, by name."""
        planes = ("ndvi",) * self.has_ndvi + self.truth
        found = {"dn": (("band", "y", "x"), self.dn), "toa_reflectance": (("band", "y", "x"), np.dtype(_FLOAT))}
        found |= {name: (("y", "x"), np.dtype(_FLOAT)) for name in planes}
        return found | {name: ((), np.dtype(float)) for name in LIGHT}

    def attributes(self, name):
        """Attributes of a stored variable."""
        own = {"saturated": self.saturated} if name == "dn" else {}
        return cf.attributes(name) | own | ({"cell_methods": "area: mean"} if name in self.truth else {})

    def shape(self, dims):
        """Lengths of dimensions of a chip."""
        sizes = dict(zip(("band", "y", "x"), (self.bands.sizes["band"], *self.pixels), strict=True))
        return tuple(sizes[name] for name in dims)

    @property
    def size(self):
        """Size of a chip in memory. [byte]"""
        return sum(dtype.itemsize * int(np.prod(self.shape(dims))) for dims, dtype in self.variables.values())


def layout_of(chips):
    """Layout of the chips, from the first of them."""
    nodes = realise(chips.scenario(0))
    image, truth = nodes["image"], _fullest(chips.study)
    size = chips.study.scenario.sensor.size
    return Layout(
        bands=xr.Dataset(coords={name: image[name].variable for name in _ALONG_BAND if name in image.coords}),
        truth=tuple(dict.fromkeys((*nodes["truth"].data_vars, *truth))),
        has_ndvi="ndvi" in image,
        dn=image["dn"].dtype,
        saturated=image["dn"].attrs["saturated"],
        pixels=(image.sizes["y"], image.sizes["x"]),
        pixel=size,
        crs=image["spatial_ref"].variable,
    )


def _fullest(study):
    """Names of the truth variables if no drawn property has the value 0, which would omit it."""
    drawn = {}
    for key, distribution in study.drawn.items():
        ends = distribution.extremes
        numbers = all(isinstance(value, int | float) for value in ends)
        drawn[key.path] = max(ends) if numbers and min(ends) == 0 else distribution.usual
    side = 2 * study.scenario.sensor.size
    small = {("grid", "width"): side, ("grid", "height"): side}
    return realise(study.scenario_with(drawn | small), complete=True)["truth"].data_vars


def chip_arrays(chips, numbers, layout):
    """Chips as stacked arrays in the order of their numbers, by name, shape (n, ...)."""
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
    """Uninitialized arrays of chips, by name, shape (count, ...)."""
    return {name: np.empty((count, *layout.shape(dims)), dtype) for name, (dims, dtype) in layout.variables.items()}


def _put(found, at, image, truth, layout):
    """Copy the results of a simulation to the place of a chip."""
    unknown = set(truth) - set(layout.truth)
    if unknown:
        raise ValueError(
            f"has a true property that others lack, {', '.join(sorted(unknown))}: draw it for all chips or for none"
        )
    found["dn"][at] = image["dn"]
    if layout.has_ndvi:
        found["ndvi"][at] = image["ndvi"]
    for name in layout.truth:
        # Without dead leaves, green leaves are all leaves.
        other = "fpar" if name == "green_fpar" else None
        found[name][at] = truth.get(name, truth.get(other, np.nan))
    for name in LIGHT:
        found[name][at] = image[name]


def _reflectance(found, layout):
    """Planetary reflectance of the digital numbers."""
    bands = {name: layout.bands[name].values[:, None, None] for name in layout.bands.coords if name != "band"}
    scale = (bands["gain"], bands["offset"], bands.get("compression", 0))
    radiance = calibration.dn_to_radiance(found["dn"], *scale, saturated=layout.saturated)
    sza, distance = (found[name][:, None, None, None] for name in ("sza", "earth_sun_distance"))
    mu_s = np.cos(np.radians(sza))
    return calibration.radiance_to_reflectance(radiance, bands["solar_irradiance"], mu_s, distance)


# Size of a shard in memory, and of the part of a shard that is read at once. [byte]
_SHARD, _CHUNK = 32 * 2**20, 2**19

# Least number of shards, to be spread over workers, unless they would have fewer chips than the second number.
_SHARDS, _FEWEST = 4, 20

ROOT = "zarr.json"


class Shards:
    """Division of the chips of a dataset into shards, by the size of a chip [byte] and how many are made together."""

    def __init__(self, count, size, together):
        self._count = count
        wanted = min(count, together, max(_FEWEST, -(-count // _SHARDS)), max(_SHARD // size, 1))
        self.chunk = max(min(10, _CHUNK // size, wanted), 1)
        self.length = -(-wanted // self.chunk) * self.chunk

    def __len__(self):
        return -(-self._count // self.length)

    def range_of(self, shard):
        """First chip of a shard, and the chip after its last."""
        return shard * self.length, min((shard + 1) * self.length, self._count)

    def shard_of(self, chips):
        """Shard numbers of chips."""
        return np.asarray(chips) // self.length


def make_store(folder, chips, layout, shards):
    """Create a store whose chips have no values yet, or repair its metadata; existing shards stay."""
    table = chips.table()
    with fresh_store(folder) as fresh:
        group = zarr.create_group(fresh, zarr_format=3, attributes=_global_attributes(chips, layout, table))
        for name, (dims, values, attributes) in _known_variables(chips, layout, table).items():
            dtype, shape = str if values.dtype == object else values.dtype, values.shape
            array = group.create_array(
                name, shape=shape, dtype=dtype, chunks=shape, dimension_names=dims, attributes=attributes,
                compressors=(zarr.codecs.ZstdCodec(level=0, checksum=False), checksum()),
            )  # fmt: skip
            array[...] = values
        # A fifth smaller than bytes shuffled, in half the time of level 5.
        blosc = zarr.codecs.BloscCodec(cname="zstd", clevel=3, shuffle="bitshuffle")
        for name, (dims, dtype) in layout.variables.items():
            inside, number = layout.shape(dims), dtype.kind != "f"
            group.create_array(
                name,
                shape=(len(chips), *inside),
                dtype=dtype,
                # One number per chip is fast to read.
                chunks=(shards.chunk if dims else shards.length, *inside),
                shards=(shards.length, *inside) if dims else None,
                # With the checksum, zarr refuses to read damaged numbers.
                compressors=(blosc, checksum()),
                fill_value=0 if number else np.nan,
                dimension_names=("chip", *dims),
                attributes=layout.attributes(name) | ({"_FillValue": 0} if number else {}),
            )
        with warnings.catch_warnings():
            # Readers of Zarr 3 ignore unknown fields.
            warnings.filterwarnings("ignore", "Consolidated metadata is currently not part")
            zarr.consolidate_metadata(fresh)


def stored_names(chips, layout):
    """Names of the arrays of a store, which are folders."""
    return [*_known_variables(chips, layout, chips.table()), *layout.variables]


def chips_in(folder):
    """Number of chips in a store."""
    return zarr.open_array(folder, path="chip", mode="r").shape[0]


def incomplete_variables(folder):
    """Names of the variables of chips without the file of a shard, whose numbers would be read as no data."""
    found = []
    for name, array in zarr.open_group(folder, mode="r").arrays():
        if "_FillValue" in array.attrs or str(array.fill_value) == "nan":
            shards = range(-(-array.shape[0] // (array.shards or array.chunks)[0]))
            found += [name] * (not all(block_file(array, (shard,)).is_file() for shard in shards))
    return sorted(found)


def _known_variables(chips, layout, table):
    """Dimensions, values and attributes of all variables known before chips are computed, by name."""
    down, across = ((np.arange(size) + 0.5) * layout.pixel for size in layout.pixels)
    found = {"chip": (("chip",), table["chip"].values, {"long_name": "number of the chip"})}
    for name, word, values in (("y", "northing", -down), ("x", "easting", across)):
        words = f"{word} from the upper left corner of the chip"
        found[name] = ((name,), values, {"long_name": words, "units": "m", "axis": name.upper()})
    for name, variable in layout.bands.coords.items():
        values = variable.values.astype(object) if variable.dtype.kind == "U" else variable.values
        known = dict(cf.attributes(name)) if name in cf.QUANTITIES else {"long_name": "band"}
        found[str(name)] = (("band",), values, known)
    crs = {key: value for key, value in layout.crs.attrs.items() if key != "GeoTransform"}
    found["spatial_ref"] = ((), np.asarray(layout.crs.values, np.int64), crs)
    return found | {str(name): (("chip",), each.values, each.attrs) for name, each in table.data_vars.items()}


def _global_attributes(chips, layout, table):
    """Global attributes of the dataset."""
    study, (rows, columns) = chips.study, layout.pixels
    of_bands = (name for name in layout.bands.coords if name != "band")
    coordinates = [*table.data_vars, *LIGHT, "spatial_ref", *of_bands]
    return {
        "Conventions": "CF-1.11",
        "title": f"{len(chips)} simulated chips of {rows} x {columns} pixels of {layout.pixel:g} m",
        "source": f"fifesim {versions()['fifesim']}, simulated; no measurement",
        "references": "Friedl et al. (1995), doi:10.1016/0034-4257(95)00156-5",
        "instrument": study.scenario.sensor.instrument,
        "sequence": study.sequence,
        "seed": study.seed,
        "study": study.to_toml(),
        "coordinates": " ".join(map(str, coordinates)),
    }
