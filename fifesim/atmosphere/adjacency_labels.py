"""Adjacency effect on labelled rasters: addition and removal of the light from the surroundings."""

from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.atmosphere import adjacency, coupling
from fifesim.grids import chunks, swaths
from fifesim.grids import grid as grids
from fifesim.grids.grid import with_crs_of
from fifesim.grids.reductions import areas, regularized

# Maximum distance of the surroundings. More distant ground contributes 3e-4 of the light scattered by molecules and
# none of the light scattered by aerosol. [m]
ENVIRONMENT_REACH = 100_000.0


def environment(reflectance, weight_molecules, weight_aerosol, vza, *, surroundings=None):
    """Mean reflectance of the ground around each cell, as blurred by the atmosphere, dims (band, y, x). [1]"""
    reflectance = banded(reflectance)
    return _on_cells(_environment(reflectance, (weight_molecules, weight_aerosol), vza, surroundings), reflectance)


def apparent_reflectance_of_scene(reflectance, terms, vza, surroundings=None):
    """Apparent reflectance at the top of the atmosphere with the adjacency effect, dims (band, y, x). [1]"""
    # A lazy reflectance is computed twice: the environment of the first cell needs the whole scene.
    reflectance = banded(reflectance)
    weights = adjacency.environment_weights(terms.diffuse_up_molecules, terms.diffuse_up_aerosol)
    coarse = _environment(reflectance, weights, vza, surroundings)
    return _couple(coupling.inhomogeneous_reflectance, reflectance, coarse, _by_band(terms, reflectance))


def corrected_reflectance_of_scene(toa_reflectance, terms, vza, surroundings=None):
    """Surface reflectance corrected for the adjacency effect, the inverse of `apparent_reflectance_of_scene`. [1]"""
    # A lazy input is computed twice, as in `apparent_reflectance_of_scene`.
    toa_reflectance = banded(toa_reflectance)
    weights = adjacency.environment_weights(terms.diffuse_up_molecules, terms.diffuse_up_aerosol)
    by_band = _by_band(terms, toa_reflectance)
    each_band = (coupling.TargetTerms(*row) for row in np.stack(by_band, axis=-1).tolist())
    solve = [partial(adjacency.environment_of_target, terms=each) for each in each_band]
    coarse = _on_blocks(solve, toa_reflectance, weights, vza, surroundings, linear=True)
    return _couple(coupling.target_reflectance, toa_reflectance, coarse, by_band)


def banded(array):
    """Reflectance with a band dimension, dims (band, y, x) or (band, line, sample)."""
    array = array if "band" in array.dims else array.expand_dims("band")
    for dims in (("band", "y", "x"), ("band", *swaths.DIMS)):
        if set(array.dims) == set(dims):
            return array if array.dims == dims else array.transpose(*dims)
    raise ValueError(f"a reflectance has dimensions (band, y, x), got {array.dims}: select one layer first")


def _by_band(terms, array):
    """Terms of the equation of a target in its environment, broadcast to shape (band,)."""
    return coupling.TargetTerms(*(_per_band(values, array, "a term") for values in terms.target))


def _per_band(values, array, what):
    """Values of all bands, from one value for all or one for each."""
    values, bands = np.asarray(values, float), array.sizes["band"]
    if values.ndim and len(values) not in (1, bands):
        raise ValueError(f"{what} must be a number, or one for each of the {bands} bands, got {len(values)}")
    return np.broadcast_to(values, bands)


def _environment(reflectance, weights, vza, surroundings):
    solve = [adjacency.block_environment] * reflectance.sizes["band"]
    return _on_blocks(solve, reflectance, weights, vza, surroundings, linear=False)


def _on_blocks(solve, array, weights, vza, surroundings, *, linear):
    """Environment at the blocks and a ring around them, dims (band, y, x), with one task for each band."""
    grid = grids.geobox(array)
    along = _blocks(grid)
    margin, fars, outer = _surroundings(surroundings, array, along)
    molecules, aerosol = (_per_band(values, array, "a weight").tolist() for values in weights)
    pieces, sums = _sums(array, along, linear)
    kernels = []
    for band, angle in enumerate(_per_band(vza, array, "vza").tolist()):
        weights = molecules[band], aerosol[band]
        spread = partial(adjacency.spread_over, *along, grids.cell_size(grid), margin, angle, *weights)
        kernels.append(partial(_whole, solve[band], pieces, spread, fars[band]))
    shape = tuple(axis.count + 2 for axis in along)
    lazy = array.chunks is not None or (outer is not None and outer.chunks is not None)
    reads = [chunks.whole_reads(each, shape) for each in ([sums] if outer is None else [sums, outer.data])]
    return chunks.windows_by_band(kernels, reads, (1,) * len(kernels), shape, _one_chunk(shape) if lazy else None)


def _blocks(grid):
    place = zip(grids.lattice_position(grid), grids.cell_size(grid), grid.shape, strict=True)
    return tuple(adjacency.blocks_along(*axis) for axis in place)


def _one_chunk(shape):
    return tuple((size,) for size in shape)


def _whole(solve, pieces, spread, far, rows, columns, sums, outer=None):
    """Environment at all blocks of one band."""
    around = far if outer is None else outer[0]
    return solve(adjacency.whole_blocks(sums[0], *pieces), around, spread())[None]


def _sums(array, along, linear):
    """Integer sums over pieces of blocks, by chunk, so that each chunk is released before the next is made."""
    cuts = array.chunks or _one_chunk(array.shape)
    pieces, sizes = zip(*(axis.pieces(cut) for axis, cut in zip(along, cuts[1:], strict=True)), strict=True)
    along_y, along_x = pieces
    kernel = partial(adjacency.block_sums, along_y=along_y, along_x=along_x, linear=linear)
    reads = [chunks.Reads(array.data, (along_y.start, along_y.stop), (along_x.start, along_x.stop))]
    leading = (2, 3, 3) if linear else (2, 1, 1)
    shape = (*leading, along_y.start.size, along_x.start.size)
    sizes = None if array.chunks is None else sizes
    return pieces, chunks.windows_by_band([kernel] * len(cuts[0]), reads, cuts[0], shape, sizes)


def _on_cells(coarse, array):
    """Environment interpolated to the cells, in the chunks of the array."""
    along_y, along_x = (axis.interpolation for axis in _blocks(grids.geobox(array)))
    kernel = partial(adjacency.on_cells, along_y=along_y, along_x=along_x)
    reads = [chunks.Reads(coarse, *((axis.start, axis.start + axis.count) for axis in (along_y, along_x)))]
    sizes = array.chunks or _one_chunk(array.shape)
    cuts = None if isinstance(coarse, np.ndarray) else sizes[1:]
    data = chunks.windows_by_band([kernel] * len(sizes[0]), reads, sizes[0], array.shape[1:], cuts)
    # xarray would take over dask's name.
    out = xr.DataArray(data, dims=("band", "y", "x"), coords=chunks.other_coordinates(array)).rename(None)
    return grids.place(out, grids.geobox(array))


def _couple(equation, array, coarse, by_band):
    """Apply an equation of `coupling` to the cells and their environment."""

    def kernel(cells, environment, *terms):
        return equation(cells, environment, coupling.TargetTerms(*terms))

    cells = chunks.second_pass(array, coarse), _on_cells(coarse, array)
    plain = [each.drop_vars("band", errors="ignore") for each in cells]
    out = chunks.pointwise(kernel, *plain, *(xr.DataArray(values, dims="band") for values in by_band))
    if "band" in array.coords:
        out = out.assign_coords(band=array["band"])
    return grids.place(out, grids.geobox(array))


def _surroundings(surroundings, array, along):
    """Number of margin blocks, and the reflectance beyond them and on them, dims (band, y, x) or None."""
    bands = array.sizes["band"]
    if surroundings is None:
        return (1, 1), [None] * bands, None
    if isinstance(surroundings, xr.DataArray) and {"y", "x"} <= set(surroundings.dims):
        margin, outer = _outer(surroundings, array, along)
        return margin, [None] * bands, outer
    if isinstance(surroundings, xr.DataArray) and "band" in surroundings.dims:
        surroundings = same_bands(surroundings, array)
    numbers = _per_band(surroundings, array, "surroundings")
    if not np.all((numbers >= 0) & (numbers <= 1)):
        raise ValueError(f"surroundings must be reflectances from 0 to 1, got {numbers.tolist()}")
    return (1, 1), numbers.tolist(), None


def _outer(surroundings, array, along):
    """Number of margin blocks, and the means of a raster of the surroundings on the blocks of scene and margin."""
    surroundings = with_crs_of(surroundings, array)
    there, here = grids.geobox(surroundings), grids.geobox(array)
    if there.crs != here.crs:
        raise ValueError(
            f"the surroundings must be in the CRS of the scene, {here.crs}, got {there.crs}: reproject them"
        )
    a, b = here.affine, there.affine
    along_y, along_x = along
    down = _outer_axis(along_y, a.f, a.e, b.f, b.e, there.shape.y)
    across = _outer_axis(along_x, a.c, a.a, b.c, b.a, there.shape.x)
    if down is None or across is None:
        raise ValueError(
            f"the surroundings must lie within {ENVIRONMENT_REACH / 1000:g} km of the scene, {grids.extent(here)}, "
            f"got {grids.extent(there)}"
        )
    shape = along_y.count + 2 * down.margin, along_x.count + 2 * across.margin
    grid = GeoBox(shape, Affine(across.block, 0.0, across.edge, 0.0, down.block, down.edge), here.crs)
    means = regularized(same_bands(surroundings, array), areas(grid), grid, min_valid=0.0)
    return (down.margin, across.margin), means


class _OuterAxis(NamedTuple):
    """Blocks along one axis to which a raster of the surroundings is averaged."""

    edge: float  # first [m]
    block: float  # signed size [m]
    margin: int  # blocks before the scene's, and behind


def _outer_axis(along, origin, cell, outer_origin, outer_cell, outer_cells):
    """Blocks of the scene and its margin up to the edge of a raster; None if the raster is beyond the reach."""
    direction, size = np.sign(cell), along.cells * abs(cell)
    before = direction * (origin - outer_origin)
    behind = abs(outer_cells * outer_cell) - before - abs(along.n_cells * cell)
    if min(before + abs(along.n_cells * cell), behind + abs(along.n_cells * cell)) <= -ENVIRONMENT_REACH:
        return None
    margin = max(1, int(np.ceil(min(max(before, behind), ENVIRONMENT_REACH) / size)))
    first = origin - direction * (along.offset * abs(cell) + margin * size)
    return _OuterAxis(first, direction * size, margin)


def same_bands(surroundings, array):
    """Surroundings with the bands of the scene; a single layer is repeated."""
    if "band" not in surroundings.dims:
        surroundings = surroundings.drop_vars("band", errors="ignore")
        return surroundings.expand_dims(band=array.sizes["band"])
    if "band" in surroundings.coords and "band" in array.coords:
        wanted, found = ([str(name) for name in each["band"].values] for each in (array, surroundings))
        if set(wanted) <= set(found):
            return surroundings.isel(band=[found.index(name) for name in wanted])
        raise ValueError(f"the surroundings have the bands {', '.join(found)}, the scene {', '.join(wanted)}")
    if surroundings.sizes["band"] != array.sizes["band"]:
        raise ValueError(f"the surroundings have {surroundings.sizes['band']} bands, the scene {array.sizes['band']}")
    return surroundings
