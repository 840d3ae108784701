"""Learned landscapes as labelled rasters: simulation, files and comparison."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from odc.geo.geobox import GeoBox
from pydantic import ValidationError
from scipy import ndimage

from fifesim.base import files
from fifesim.base.arguments import Chunks, FilePath, WholeNumber
from fifesim.base.files import in_a_line, read_bounded, reading, whole_file
from fifesim.base.lattice import check_seed
from fifesim.base.messages import warn
from fifesim.grids import cf, windows
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.chunks import Reads
from fifesim.grids.sites import made_on_site
from fifesim.ground.landscape import learning
from fifesim.ground.landscape.description import Described
from fifesim.ground.landscape.learned import leaf_area, scores, terrain_response
from fifesim.ground.terrain.forms import REACH, land_forms

# Maximum size of a file. [byte]
_LARGEST = 2**20

# Edge of the blocks of a landscape in memory. [cell]
_BLOCK = 1008


class Landscape(Described, frozen=True):
    """
    A landscape learned from a map and an elevation model.

    `learn_landscape` makes it, and `Landscape.read` reads it from a file.

    Attributes
    ----------
    source : str
        Source of the map and the elevation model.
    cell : float
        Cell size at which forms of the land are computed. [m]
    terrain : tuple of TerrainResponse
        Responses to forms of the land.
    beds : Beds or None
        Response to elevation and slope.
    residual, level : tuple of Residual
        Random fields in addition to the terrain, and those of level ground, which vary as much as both.
    gusts, level_gusts : dict of str to float
        Standard deviations of the logarithm by which the residual is stronger or weaker in places.
    log_scale : float
        Logarithm by which the response of the spread is reduced, so that the variance of the residual is that of its
        fields. [1]
    explained : float
        Share of the variance of scores that the terrain explains in squares that were left out. [1]
    scores, lai : tuple of float
        Nodes of the function from scores to leaf area. [1], [m2 m-2]

    See Also
    --------
    fifesim.learn_landscape, fifesim.ground.compare_landscapes

    Examples
    --------
    >>> import fifesim
    >>> konza = fifesim.ground.Landscape.read("konza")
    >>> grid = fifesim.grid_at("EPSG:32614", 707600.0, 4331900.0, 600.0, 600.0, 10.0)
    >>> konza.simulate(grid, seed=1)["lai"].dims
    ('y', 'x')
    """

    def simulate(
        self,
        grid: GeoBox,
        dem: xr.DataArray | None = None,
        *,
        seed: WholeNumber = 0,
        chunks: Chunks | None = None,
    ) -> xr.Dataset:
        """
        Leaf area of the landscape on a grid.

        Parameters
        ----------
        grid : odc.geo.geobox.GeoBox
            Grid of square ground cells, in a projected CRS.
        dem : xarray.DataArray, dims (y, x), optional
            Elevation on cells of the same lattice. It may extend beyond the grid: forms of the land within 1 km of the
            border of the elevation are less certain. By default the ground is level. [m]
        seed : int, optional
            Seed of the random fields, in [0, 2**63).
        chunks : mapping or int or "auto", optional
            Chunks of a lazy landscape; in memory by default, unless ``dem`` is lazy.

        Returns
        -------
        land : xarray.Dataset
            ``lai`` over (y, x), NaN where the elevation is. The attribute ``beyond_learned`` is the share of cells
            whose elevation or slope is outside of the range that the landscape was learned from. [m2 m-2]

        Raises
        ------
        ValueError
            If the grid or the seed is invalid, or the elevation is on another lattice or does not cover the grid.

        Warns
        -----
        UserWarning
            If ``beyond_learned`` is above 0.1.

        Notes
        -----
        Leaf area depends only on seed, position and the elevation within 1 km, so that a window equals a slice of the
        whole, for any chunks. Cells smaller than half a cell of the map that it was learned from have no structure of
        their own. Fields that are finer than the cells are averaged before the map from score to leaf area.
        """
        grid, seed = grids.check_grid(grid), check_seed(seed)
        cell = min(grids.cell_size(grid))
        place = [grids.coordinates(grid)[axis].values for axis in ("y", "x")]
        made = partial(_cells, self, seed, place, cell)
        attributes = {"rng_seed": str(seed), "learned_from": self.source, **made_on_site(grid)}
        history = f"landscape: learned from {in_a_line(self.source, 100)}, seed {seed}"
        if dem is None:
            tile = partial(_level, made)
            found = windows.tiles(tile, grid, chunks, tile=_BLOCK)
        else:
            reads, nodes = _window_reads(dem, grid, max(1, round(self.cell / cell)), cell)
            attributes["beyond_learned"] = share = round(self._beyond(dem, cell), 4)
            if share > 0.1:
                warn(
                    f"{share:.0%} of the cells are higher, lower or steeper than the ground from which the landscape "
                    "was learned: the response of its edge is used there"
                )
            kernel, shape = partial(_on_terrain, made, *nodes), tuple(grid.shape)
            lazy = chunks is not None or dem.chunks is not None
            sizes = windows.chunk_sizes(grid, "auto" if chunks is None else chunks, tile=_BLOCK) if lazy else None
            data = (
                chunking.windows(kernel, [reads], shape, sizes)
                if lazy
                else chunking.in_blocks(kernel, [reads], shape, _BLOCK)
            )
            found = grids.place(xr.DataArray(data, dims=("y", "x")), grid)
        return xr.Dataset({"lai": cf.label(found, "lai", history=history, method="learned", **attributes)})

    def _beyond(self, dem, cell):
        """Share of a sample of cells outside of the learned range of elevation or slope."""
        ranges = {each.form: (each.nodes[0], each.nodes[-1]) for each in self.terrain}
        # Slopes are those of the cell size at which forms are computed, and on a scale that its smoothing leaves.
        step = max(1, round(4 * self.cell / cell))
        ground = np.asarray(dem.transpose("y", "x").data[::step, ::step], float)
        known = np.isfinite(ground)
        if not self.terrain or not known.any() or min(ground.shape) < 2:
            return 0.0
        slope = np.hypot(*np.gradient(ground, step * cell))
        outside = (
            (ground < ranges["elevation"][0]) | (ground > ranges["elevation"][1]) | (slope > ranges["slope_40"][1])
        )
        return float(np.mean(outside[known]))

    def save(self, path: FilePath) -> None:
        """
        Write the landscape to a JSON file.

        Parameters
        ----------
        path : str or path
            Ends in ``.json``.
        """
        files.check_suffix(Path(path), "landscape", ".json")
        with whole_file(path) as new:
            new.write_text(self.model_dump_json(indent=1) + "\n")

    @classmethod
    def read(cls, path: FilePath) -> Landscape:
        """
        Read a landscape from a JSON file.

        Parameters
        ----------
        path : str or path
            From `Landscape.save`, or "konza", which belongs to fifesim.

        Returns
        -------
        landscape : Landscape

        Raises
        ------
        ValueError
            If the file is missing or is not a landscape.
        """
        if str(path) == "konza":
            path = files.path("landscapes") / "konza.json"
        with reading("the landscape", path):
            text = read_bounded(path, _LARGEST, "a landscape")
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"])) or "the file"
            raise ValueError(
                f"{in_a_line(str(path), 200)} is not a landscape: {place}: {first['msg']}: write it with "
                "fifesim.learn_landscape(...).save(path)"
            ) from None

    def __str__(self):
        shares = (
            sum(each.variance for each in self.residual if each.height),
            sum(each.variance for each in self.residual),
        )
        low, high = next(
            ((each.nodes[0], each.nodes[-1]) for each in self.terrain if each.form == "elevation"), (np.nan,) * 2
        )
        lines = [
            f"Landscape learned from {self.source}",
            f"  leaf area      {self.lai[0]:.2f} to {self.lai[-1]:.2f}, median "
            f"{self.lai[len(self.lai) // 2]:.2f} m2 m-2",
            f"  elevation      {low:.0f} to {high:.0f} m",
            f"  terrain        {self.explained:.0%} of the variance of scores"
            if self.terrain
            else "  terrain        none",
            f"  along contours {shares[0] / shares[1]:.0%} of the variance of the residual" if self.terrain else "",
            "  other fields   of " + ", ".join(f"{each.spacing:g}" for each in self.residual if not each.height) + " m",
            "  gusts          " + ", ".join(f"{name} {value:g}" for name, value in self.gusts.items()),
        ]
        return "\n".join(lines)


def _cells(landscape, seed, place, cell, rows, columns, **terrain):
    """Leaf area of the cells in slices of the grid."""
    found = scores(landscape, place[0][rows], place[1][columns], seed, cell=cell, **terrain)
    return leaf_area(landscape, found)


def _level(made, row, column, shape):
    return made(slice(row, row + shape[0]), slice(column, column + shape[1]))


def _window_reads(dem, grid, ratio, cell):
    """Windows of whole nodes of an elevation around each cell, and the first node and the margin of each axis."""
    dem = grids.north_up(dem.transpose("y", "x"))
    own = grids.geobox(dem)
    offset = grids.lattice_offset(own, grid)
    if any(start < 0 or start + size > n for start, size, n in zip(offset, grid.shape, own.shape, strict=True)):
        raise ValueError(
            f"dem spans {grids.extent(own)} and the grid {grids.extent(grid)}: give an elevation that covers the grid"
        )
    margin = int(np.ceil(REACH / (ratio * cell))) + 2
    windows_of, first = [], grids.lattice_position(grid)
    for start, shift, size in zip(first, offset, grid.shape, strict=True):
        node = (start + np.arange(size)) // ratio
        begin = (node - margin) * ratio - start + shift
        windows_of.append((begin, begin + (2 * margin + 1) * ratio))
    return Reads(dem.data, *windows_of), (first, ratio, margin, cell)


def _on_terrain(made, first, ratio, margin, cell, rows, columns, ground):
    """Leaf area of cells from a window of elevation around them."""
    landscape = made.args[0]
    blocks = ground.reshape(ground.shape[0] // ratio, ratio, ground.shape[1] // ratio, ratio)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    nodes = np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)
    fields = terrain_response(landscape, land_forms(nodes, ratio * cell))
    inner, weights = [], []
    for start, block in zip(first, (rows, columns), strict=True):
        cells = start + np.arange(block.start, block.stop)
        begin = (cells[0] // ratio - margin) * ratio
        inner.append(slice(cells[0] - begin, cells[-1] - begin + 1))
        at = (cells - begin + 0.5) / ratio - 0.5
        low = np.floor(at).astype(int)
        weights.append((low, at - low))
    (i, u), (j, v) = weights
    mean, spread = (_between(each, i, u[:, None], j, v) for each in fields)
    return made(rows, columns, elevation=ground[tuple(inner)], mean=mean, spread=spread)


def _between(values, i, u, j, v):
    """Bilinear interpolation between nodes."""
    lines = (1 - u) * values[i] + u * values[i + 1]
    return (1 - v) * lines[:, j] + v * lines[:, j + 1]


def compare_landscapes(one: xr.DataArray, other: xr.DataArray, dem: xr.DataArray | None = None) -> pd.DataFrame:
    """
    Compare the spatial structure of two maps, such as a real and a simulated one.

    Parameters
    ----------
    one, other : xarray.DataArray, dims (y, x)
        Maps of leaf area or of a vegetation index, each on square cells of the same size; they need not cover the same
        area unless ``dem`` is given.
    dem : xarray.DataArray, dims (y, x), optional
        Elevation on the cells of both maps. [m]

    Returns
    -------
    table : pandas.DataFrame
        Columns ``one``, ``other`` and ``difference``. Rows: quantiles and standard deviation in the unit of the maps;
        the variogram over the variance by distance; ``variogram`` and ``spectrum``, root mean squares of the logarithm
        of the ratio to the first map; ``terrain_r2``, the share of the variance of normal scores that the forms of the
        land explain in squares of 600 m that were left out; area-weighted size [ha] of patches above the 80 % and below
        the 20 % quantile, and the elongation of the former; and the excess kurtosis of differences between neighbours.

    Raises
    ------
    ValueError
        If the cells of the maps differ in size, or a map has fewer than 2,000 known cells.

    See Also
    --------
    fifesim.learn_landscape

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.grid_at("EPSG:32614", 707600.0, 4331900.0, 900.0, 900.0, 10.0)
    >>> konza = fifesim.ground.Landscape.read("konza")
    >>> maps = [konza.simulate(grid, seed=seed)["lai"] for seed in (1, 2)]
    >>> bool(fifesim.ground.compare_landscapes(*maps).loc["variogram", "other"] < 0.1)
    True
    """
    sizes = [grids.cell_size(grids.geobox(each)) for each in (one, other)]
    if not np.allclose(sizes[0], sizes[1], rtol=1e-3):
        raise ValueError(
            f"the cells of the maps are {sizes[0][1]:g} and {sizes[1][1]:g} m: bring one map to the cells of the other "
            "with .fifesim.aggregate"
        )
    maps = [np.asarray(each.transpose("y", "x").values, float) for each in (one, other)]
    ground = None if dem is None else np.asarray(dem.transpose("y", "x").values, float)
    if ground is not None and {each.shape for each in maps} != {ground.shape}:
        raise ValueError("dem lies on other cells than the maps: give one on the cells of both maps")
    columns, curves = [], []
    for name, values in zip(("one", "other"), maps, strict=True):
        known = np.isfinite(values)
        learning.check_enough(known, name)
        filled, variance = np.where(known, values, 0.0), values[known].var()
        lags = learning.lags_of(values.shape)
        by_lag = learning.statistics(filled, known)[: len(lags)] / variance
        curves.append((by_lag, learning.ring_spectrum(filled, known) / variance))
        rows = {f"quantile_{q:g}": np.quantile(values[known], q) for q in (0.05, 0.5, 0.95)} | {"sd": np.sqrt(variance)}
        rows |= {f"variogram_{lag * sizes[0][1]:g}_m": each for lag, each in zip(lags, by_lag, strict=True)}
        rows |= {
            name: _log_ratio(a, b) for name, a, b in zip(("variogram", "spectrum"), curves[0], curves[-1], strict=True)
        }
        if ground is not None:
            rows["terrain_r2"] = learning.explained(values, ground, sizes[0][1])
        rows |= _patches(filled, known, sizes[0][1])
        rows["kurtosis_of_differences"] = learning.kurtosis(filled, known)
        columns.append(rows)
    table = pd.DataFrame({"one": columns[0], "other": columns[1]})
    return table.assign(difference=table["other"] - table["one"])


def _log_ratio(one, other):
    """Root mean square of the logarithm of a ratio."""
    size = min(one.size, other.size)
    return float(np.sqrt(np.mean(np.log(other[:size] / one[:size]) ** 2))) if size else np.nan


def _patches(values, known, cell):
    """Area-weighted size [ha] of patches of high and of low values, and the elongation of the former."""
    found = {}
    for name, inside in (
        ("high", (values > np.quantile(values[known], 0.8)) & known),
        ("low", (values < np.quantile(values[known], 0.2)) & known),
    ):
        labels, _ = ndimage.label(inside, np.ones((3, 3)))
        sizes = np.bincount(labels.ravel())[1:]
        found[f"{name}_patch_ha"] = float(np.sum(sizes**2) / np.sum(sizes)) * cell**2 / 1e4
        if name == "high":
            longer = []
            for patch in np.argsort(sizes)[::-1][:20] + 1:
                place = np.array(np.nonzero(labels == patch))
                if place.shape[1] > 10:
                    # A twelfth is the variance within a cell.
                    axes = np.linalg.eigvalsh(np.cov(place) + np.eye(2) / 12)
                    longer.append(np.sqrt(axes[1] / axes[0]))
            found["high_patch_elongation"] = float(np.mean(longer)) if longer else np.nan
    return found
