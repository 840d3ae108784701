"""
A hyperspectral cube as the bands of OLI, lazily: time and peak memory.

The cube is made on the fly, 426 bands of single precision in chunks, and the bands are streamed into a Zarr folder.
"""

import argparse
import resource
import tempfile
import time

import dask
import dask.array as da
import numpy as np
import xarray as xr

import fifesim  # noqa: F401  registers .fifesim

# The bands of NEON's and AVIRIS-NG's spectrometers, about: 5 nm from 0.38 to 2.51 um.
BANDS, FIRST, LAST = 426, 0.38, 2.51


def cube(size, chunks):
    """Smooth spectra with a texture, made chunk by chunk."""

    def block(block_info=None):
        (bands, rows, columns) = block_info[None]["array-location"]
        wavelength = np.linspace(FIRST, LAST, BANDS, dtype=np.float32)[slice(*bands), None, None]
        row, column = (np.arange(*each, dtype=np.float32) for each in (rows, columns))
        # One array of the block's size, as a reader makes it.
        values = np.empty((wavelength.size, row.size, column.size), np.float32)
        np.multiply(np.sin(row / 17)[:, None], 0.05 * np.cos(column / 23), out=values)
        values += 0.2 + 0.1 * np.sin(3 * wavelength)
        return values

    sizes = tuple(da.core.normalize_chunks(chunks, (BANDS, size, size)))
    data = da.map_blocks(block, chunks=sizes, dtype=np.float32, meta=np.empty((0, 0, 0), np.float32))
    return xr.DataArray(data, dims=("band", "y", "x"), coords={"wavelength": ("band", np.linspace(FIRST, LAST, BANDS))})


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=4000, help="rows and columns")
    parser.add_argument("--chunks", type=int, nargs=3, default=(426, 250, 250), help="bands, rows, columns")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    with tempfile.TemporaryDirectory() as folder, dask.config.set(num_workers=arguments.workers):
        clock, processor = time.perf_counter(), time.process_time()
        bands = cube(arguments.size, tuple(arguments.chunks)).fifesim.to_bands("OLI")
        graph = time.perf_counter() - clock
        bands.to_dataset(name="reflectance").to_zarr(folder, mode="w")
        clock, processor = time.perf_counter() - clock, time.process_time() - processor
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    print(f"{BANDS} x {arguments.size} x {arguments.size}, chunks {tuple(arguments.chunks)}")
    print(f"graph {graph:.1f} s, all {clock:.0f} s, processor {processor:.0f} s")
    print(f"peak memory {peak:.2f} GB, of which {before:.2f} GB before the cube")


if __name__ == "__main__":
    main()
