"""The Zarr store of chips: metadata that are made at once, and shards that are written one by one."""

import os
import shutil
import warnings
import zlib

import numpy as np

from fifesim.output.provenance import versions
from fifesim.rasters import cf
from fifesim.scenario.ensemble import LIGHT

# Of a shard in memory, and of the part of one that is read at once. [byte]
_SHARD, _CHUNK = 32 * 2**20, 2**19

# A run has so many shards at least, to be spread over workers, unless they had fewer chips than this.
_SHARDS, _FEWEST = 4, 20

ROOT = "zarr.json"


class Shards:
    """
    How chips of a dataset are cut into shards.

    Parameters
    ----------
    count : int
        Chips in all.
    size : int
        Of a chip. [byte]
    together : int
        Chips that are made fastest together.
    """

    def __init__(self, count, size, together):
        self._count = count
        wanted = min(count, together, max(_FEWEST, -(-count // _SHARDS)), max(_SHARD // size, 1))
        self.chunk = max(min(10, _CHUNK // size, wanted), 1)
        self.length = -(-wanted // self.chunk) * self.chunk

    def __len__(self):
        return -(-self._count // self.length)

    def range_of(self, shard):
        """
        Chips of a shard.

        Parameters
        ----------
        shard : int

        Returns
        -------
        first, last : int
            The first of them, and that behind the last.
        """
        return shard * self.length, min((shard + 1) * self.length, self._count)

    def shard_of(self, chips):
        """
        Shards that chips lie in.

        Parameters
        ----------
        chips : array of int
            Their numbers.

        Returns
        -------
        shards : array of int
        """
        return np.asarray(chips) // self.length


def make_store(folder, chips, layout, shards):
    """
    Make a store whose chips have no values yet, or mend the metadata of one; shards that are there stay.

    Parameters
    ----------
    folder : pathlib.Path
        Of the store.
    chips : fifesim.scenario.chips.Chips
    layout : fifesim.output.chips.arrays.Layout
    shards : Shards
    """
    import zarr  # slow, and few runs write chips

    fresh = folder / "fresh.partial"
    shutil.rmtree(fresh, ignore_errors=True)
    table = chips.table()
    group = zarr.create_group(fresh, zarr_format=3, attributes=_about(chips, layout, table))
    for name, (dims, values, attributes) in _known(chips, layout, table).items():
        text = values.dtype == object
        array = group.create_array(
            name,
            shape=values.shape,
            dtype=str if text else values.dtype,
            chunks=values.shape,
            dimension_names=dims,
            attributes=attributes,
        )
        array[...] = values
    # A fifth smaller than bytes shuffled, in half the time of level 5.
    codec = zarr.codecs.BloscCodec(cname="zstd", clevel=3, shuffle="bitshuffle")
    for name, (dims, dtype) in layout.variables.items():
        inside, number = layout.shape(dims), dtype.kind != "f"
        group.create_array(
            name,
            shape=(len(chips), *inside),
            dtype=dtype,
            # One number a chip is no work to read.
            chunks=(shards.chunk if dims else shards.length, *inside),
            shards=(shards.length, *inside) if dims else None,
            compressors=codec,
            fill_value=0 if number else np.nan,
            dimension_names=("chip", *dims),
            attributes=layout.attributes(name) | ({"_FillValue": 0} if number else {}),
        )
    with warnings.catch_warnings():
        # All readers of Zarr 3 pass over what they do not know.
        warnings.filterwarnings("ignore", "Consolidated metadata is currently not part")
        zarr.consolidate_metadata(fresh)
    _move(fresh, folder)


def stored_names(chips, layout):
    """
    Names of the arrays of a store, which are folders.

    Parameters
    ----------
    chips : fifesim.scenario.chips.Chips
    layout : fifesim.output.chips.arrays.Layout

    Returns
    -------
    names : list of str
    """
    return [*_known(chips, layout, chips.table()), *layout.variables]


def chips_in(folder):
    """
    Number of chips in a store.

    Parameters
    ----------
    folder : pathlib.Path

    Returns
    -------
    count : int
    """
    import zarr  # slow, and few runs write chips

    return zarr.open_array(folder, path="chip", mode="r").shape[0]


def write_shard(folder, first, arrays):
    """
    Write a shard.

    Parameters
    ----------
    folder : pathlib.Path
        Of the store.
    first : int
        Its first chip.
    arrays : mapping of str to array
        All chips of the shard.
    """
    import zarr  # slow, and few runs write chips

    for name, values in arrays.items():
        array = zarr.open_array(folder, path=name, mode="r+")
        # What may lie there of a run that was stopped would be read first.
        _file(folder / name / "c" / str(first // (array.shards or array.chunks)[0])).unlink(missing_ok=True)
        array[first : first + len(values)] = values


def checksums(folder, names, shard):
    """
    Checksums of the files of a shard.

    Parameters
    ----------
    folder : pathlib.Path
        Of the store.
    names : sequence of str
        Of its arrays.
    shard : int

    Returns
    -------
    checksums : array of uint32

    Raises
    ------
    OSError
        If a file is missing.
    """
    found = []
    for name in names:
        found.append(zlib.crc32(_file(folder / name / "c" / str(shard)).read_bytes()))
    return np.array(found, np.uint32)


def _file(path):
    """File of a shard, which lies as deep as its array has dimensions."""
    while path.is_dir():
        path = path / "0"
    return path


def _known(chips, layout, table):
    """Dimensions, values and attributes of all that is known before chips are made, by name."""
    down, across = ((np.arange(size) + 0.5) * layout.pixel for size in layout.pixels)
    found = {"chip": (("chip",), table["chip"].values, {"long_name": "number of the chip"})}
    for name, word, values in (("y", "northing", -down), ("x", "easting", across)):
        words = f"{word} from the upper left corner of the chip"
        found[name] = ((name,), values, {"long_name": words, "units": "m", "axis": name.upper()})
    for name, variable in layout.bands.coords.items():
        values = variable.values.astype(object) if variable.dtype.kind == "U" else variable.values
        known = cf.attributes(name) if name in cf.QUANTITIES else {"long_name": "band"}
        found[str(name)] = (("band",), values, known)
    crs = {key: value for key, value in layout.crs.attrs.items() if key != "GeoTransform"}
    found["spatial_ref"] = ((), np.asarray(layout.crs.values, np.int64), crs)
    return found | {str(name): (("chip",), each.values, each.attrs) for name, each in table.data_vars.items()}


def _about(chips, layout, table):
    """Attributes of the dataset."""
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


def _move(fresh, folder):
    """Files of a store to their places, one by one: each is whole, and an earlier one is the same."""
    for path in sorted(fresh.rglob("*")):
        if path.is_file():
            target = folder / path.relative_to(fresh)
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(path, target)
    shutil.rmtree(fresh)
