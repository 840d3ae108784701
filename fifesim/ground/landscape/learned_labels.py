"""Learned landscapes as labelled rasters: simulation, files and comparison."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import NamedTuple

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
from fifesim.grids.opening import check_memory
from fifesim.grids.sites import made_on_site
from fifesim.ground.landscape import learning
from fifesim.ground.landscape.description import Described
from fifesim.ground.landscape.distribution import quantile_deviates
from fifesim.ground.landscape.downscaling import Marginal, SplineFields, densities_of_means
from fifesim.ground.landscape.downscaling_labels import CellModel, FieldReads, cells_within, field_grid, pixel_reads
from fifesim.ground.landscape.field_labels import labelled_property, property_values
from fifesim.ground.landscape.learned import (
    leaf_area,
    property_response,
    property_scores,
    scores,
    terrain_response,
    variance_kept,
)
from fifesim.ground.terrain.forms import COARSE, between_squares, forms_reach, land_forms, square_sums

# Maximum size of a file. [byte]
_LARGEST = 2**20

# Edge of the blocks of a landscape in memory and of the chunks of a lazy one: larger ones pay for new memory. [cell]
_BLOCK = 1008

# Rows of cells that are made at once, so that their fields stay in the cache of a processor.
_STRIP = 252

# Pixels along an axis whose frequencies are summed over.
_PIXELS = 128


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
        Random fields in addition to the terrain, and random fields of level ground, with the variance of both.
    gusts, level_gusts : dict of str to float
        Standard deviations of the logarithm by which the residual is stronger or weaker in places.
    log_scale : float
        Logarithm by which the response of the spread is reduced, so that the residual has the variance of its fields.
        [1]
    explained : float
        Share of the variance of scores that the terrain explains in squares that were left out; NaN for a map of fewer
        than two squares. [1]
    scores, lai : tuple of float
        Nodes of the function from scores to leaf area. [1], [m2 m-2]
    properties : dict of str to DeclaredProperty
        Soil brightness, dead fraction and moisture by the names of `fifesim.landscape`: a map of leaf area does not
        teach them, so that they are declared.

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
            ``lai`` [m2 m-2] and the properties of the description, such as ``soil`` and ``moisture`` [1], over (y, x),
            NaN where the elevation is. If the elevation is in memory, the attribute ``beyond_learned`` of ``lai`` is
            the share of cells whose elevation or slope is outside of the learned range.

        Raises
        ------
        ValueError
            If the grid or the seed is invalid, its cells are not square, or the elevation is on another lattice, does
            not cover the grid, or was missing when the landscape was learned.

        Warns
        -----
        UserWarning
            If ``beyond_learned`` is above 0.1, or cells are more than twice as large as the cells of the learned map.

        Notes
        -----
        A window equals a slice of the whole, for any chunks. Properties have a normal score that is a sum of the
        residual of leaf area, forms of the land and random fields; fractions have a beta distribution and the
        brightness of the soil a normal one. Nothing varies within half a cell of the map from which the landscape was
        learned. Fields that are finer than the cells are averaged before scores become leaf area.
        """
        grid, seed = grids.check_grid(grid), check_seed(seed)
        history = f"landscape: learned from {in_a_line(self.source, 100)}, seed {seed}"
        made = self._by_place(grid, grid, dem, seed, chunks, names=tuple(self.properties))
        return self._labelled(made, grid, dem, history, seed, "learned")

    def condition(
        self,
        image: xr.DataArray,
        grid: GeoBox,
        dem: xr.DataArray | None = None,
        *,
        seed: WholeNumber = 0,
        chunks: Chunks | None = None,
    ) -> xr.Dataset:
        """
        Leaf area that has the means of the pixels of a real map, and the structure of the landscape within them.

        Parameters
        ----------
        image : xarray.DataArray, dims (y, x)
            Pixel means of leaf area, such as a retrieval from an image; NaN for no data. [m2 m-2]
        grid : odc.geo.geobox.GeoBox
            Grid of square cells in the CRS of the map, with a whole number of cells per pixel:
            ``image.odc.geobox.zoom_out(1 / 3)`` has 3 x 3.
        dem, seed, chunks
            As in `simulate`. The result is also lazy if the map is.

        Returns
        -------
        land : xarray.Dataset
            ``lai`` over (y, x), 0 in pixels of 0, NaN in pixels of NaN, outside of the map and where the elevation is
            NaN; the attribute ``beyond_learned`` is as in `simulate`. [m2 m-2]

        Raises
        ------
        ValueError
            As in `simulate`, and if a pixel is not a whole number of cells, the map does not overlap the grid, or the
            map holds digital numbers; when computed, if a pixel mean is outside of the leaf area of the landscape.

        Notes
        -----
        Scores of `simulate` are replaced by the map at scales larger than a pixel, by block kriging with the fields of
        level ground, as in `fifesim.ground.downscale`. The mean of the known cells of each pixel is exact to rounding.
        The map does not tell where gusts are: the standard deviation within the highest tenth of the pixels is 3 to 13
        % too small.

        See Also
        --------
        fifesim.ground.downscale

        Examples
        --------
        >>> import fifesim
        >>> konza = fifesim.ground.Landscape.read("konza")
        >>> grid = fifesim.grid_at("EPSG:32614", 707600.0, 4331900.0, 600.0, 600.0, 10.0)
        >>> pixels = konza.simulate(grid, seed=1)["lai"].fifesim.aggregate(30)  # stands for your map
        >>> cells = konza.condition(pixels, grid, seed=2)["lai"]
        >>> bool(abs(cells.fifesim.aggregate(30) - pixels).max() < 1e-9)
        True
        """
        grid, seed = grids.check_grid(grid), check_seed(seed)
        pixels, reads = pixel_reads(image, grid)
        lattice = reads.lattice
        whole, first = field_grid(lattice, grid)
        lazy = chunks is not None or any(each is not None and each.chunks for each in (pixels, dem))
        deviation, model = self._cell_model(grids.cell_size(grid)[0], lattice.ratio)
        (field,) = self._by_place(grid, whole, dem, seed, "auto" if lazy else None, deviation)
        sizes = windows.chunk_sizes(grid, "auto" if chunks is None else chunks, tile=lattice.tile) if lazy else None
        kernel = partial(cells_within, model, seed, lattice)
        data = chunking.windows(kernel, [reads, FieldReads(field.data, lattice, first)], tuple(grid.shape), sizes)
        cells_in_a_pixel = f"{lattice.ratio[0]} x {lattice.ratio[1]} cells a pixel"
        history = f"condition: {cells_in_a_pixel}, learned from {in_a_line(self.source, 100)}, seed {seed}"
        made = grids.place(xr.DataArray(data, dims=("y", "x")), grid)
        return self._labelled([made], grid, dem, history, seed, "conditioned", image)

    def _cell_model(self, cell, ratio):
        """Standard deviation of scores, and the model of cells whose fields have the variance 1."""
        kept = [(each.spacing, each.variance * variance_kept(each.spacing, cell)) for each in self.level]
        total = sum(variance for _, variance in kept)
        fields = SplineFields(*zip(*((spacing / cell, variance / total) for spacing, variance in kept), strict=True))
        table = leaf_area(self, np.sqrt(total) * quantile_deviates())
        of_means = float(densities_of_means(fields, ratio, (_PIXELS, _PIXELS))[0].mean())
        cure = "mask such pixels, or learn the landscape from a map that has them"
        transform = Marginal.of_table(table, of_means, cure)
        return np.sqrt(total), CellModel(fields, transform, None, None, (1.0, 1.0), "learned")

    def _by_place(self, inner, grid, dem, seed, chunks, deviation=None, names=()):
        """Rasters of leaf area, or of scores over a deviation, and of properties."""
        # The elevation covers the inner grid.
        cell, across = grids.cell_size(grid)
        if abs(cell - across) > 1e-6 * cell:
            raise ValueError(f"the cells of the grid are {cell:g} x {across:g} m: give a grid of square cells")
        if dem is not None and not self.residual:
            raise ValueError("the landscape was learned without an elevation: simulate level ground, without dem=")
        if cell > 2 * self.cell:
            warn(
                f"cells of {cell:g} m are larger than twice the {self.cell:g} m of the learned map, so that forms of "
                f"the land are lost: simulate cells of {self.cell:g} m and use .fifesim.aggregate({cell:g})"
            )
        northing, easting = (grids.coordinates(grid)[axis].values for axis in ("y", "x"))
        cells = _Cells(self, seed, northing, easting, cell, grids.lattice_position(grid), deviation, names)
        reads, kernel, shape = [], partial(_simulated, cells), (1 + len(names), *grid.shape)
        if dem is not None:
            dem = grids.north_up(dem.transpose("y", "x"))
            _check_covers(dem, inner)
            reads = [_window_reads(cells, dem, grid)]
        if chunks is None and (dem is None or dem.chunks is None):
            what = "a landscape of {} x {} x {} values".format(*shape)
            check_memory(np.prod(shape), 8, what, "give chunks='auto', which makes it by parts")
            data = chunking.in_blocks(kernel, reads, shape, _BLOCK)
        else:
            sizes = windows.chunk_sizes(grid, "auto" if chunks is None else chunks, tile=_BLOCK)
            data = chunking.windows(kernel, reads, shape, sizes)
        return [grids.place(xr.DataArray(each, dims=("y", "x")), grid) for each in chunking.along_first(data)]

    def _labelled(self, made, grid, dem, history, seed, method, source=None):
        """Dataset of leaf area, and of properties if there are more rasters."""
        described = list(self.properties.items())[: len(made) - 1]
        attributes = {"rng_seed": str(seed), "learned_from": self.source, **made_on_site(grid)}
        if dem is not None and dem.chunks is None:
            attributes["beyond_learned"] = self._share_beyond(dem, grids.cell_size(grid)[0])
        if described:
            attributes["landscape"] = ", ".join(name for name, _ in described)
        land = {"lai": cf.label(made[0], "lai", history=history, source=source, method=method, **attributes)}
        for (name, each), values in zip(described, made[1:], strict=True):
            land[name] = labelled_property(name, each.field, values).assign_attrs(rng_seed=str(seed), comment=each.note)
        return xr.Dataset(land, attrs=made_on_site(grid))

    def around(self, grid: GeoBox) -> GeoBox:
        """
        Grid of the elevation on which the landscape of a grid depends: the cells within about 1 km.

        Parameters
        ----------
        grid : odc.geo.geobox.GeoBox
            Grid of square ground cells, in a projected CRS.

        Returns
        -------
        wider : odc.geo.geobox.GeoBox

        Examples
        --------
        >>> import fifesim
        >>> konza = fifesim.ground.Landscape.read("konza")
        >>> grid = fifesim.grid_at("EPSG:32614", 707600.0, 4331900.0, 600.0, 600.0, 10.0)
        >>> dem = fifesim.flint_hills(konza.around(grid), seed=1)
        >>> land = konza.simulate(grid, dem, seed=1)
        """
        cell = grids.cell_size(grids.check_grid(grid))[0]
        ratio = max(1, round(self.cell / cell))
        return grid.pad((forms_reach(ratio * cell) + COARSE) * ratio)

    def _share_beyond(self, dem, cell):
        """Share of a sample of cells outside of the learned range of elevation or slope."""
        ranges = {each.form: (each.nodes[0], each.nodes[-1]) for each in self.terrain}
        # Means of 3 x 3 cells in steps of 40 m have the slopes of a Gaussian mean of 40 m.
        step = max(1, round(4 * self.cell / cell))
        ground = np.asarray(dem.transpose("y", "x").data[::step, ::step], float)
        ground = ndimage.correlate(ground, np.full((3, 3), 1 / 9), mode="nearest")
        known = np.isfinite(ground)
        if not ranges or not known.any() or min(ground.shape) < 2:
            return 0.0
        (low, high), steepest = ranges["elevation"], ranges["slope_40"][1]
        outside = (ground < low) | (ground > high) | (np.hypot(*np.gradient(ground, step * cell)) > steepest)
        share = round(float(np.mean(outside[known])), 4)
        if share > 0.1:
            warn(
                f"{share:.0%} of the cells are higher, lower or steeper than the ground from which the landscape was "
                "learned: the response of its edge is used there"
            )
        return share

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
            if self.terrain and np.isfinite(self.explained)
            else f"  terrain        {'an unknown share of the variance' if self.terrain else 'none'}",
            f"  along contours {shares[0] / shares[1]:.0%} of the variance of the residual" if self.terrain else "",
            "  other fields   of " + ", ".join(f"{each.spacing:g}" for each in self.residual if not each.height) + " m",
            "  gusts          " + ", ".join(f"{name} {value:g}" for name, value in self.gusts.items()),
        ]
        return "\n".join(lines)


class _Cells(NamedTuple):
    """Cells of a grid on which a landscape is simulated."""

    landscape: Landscape
    seed: int
    northing: np.ndarray
    easting: np.ndarray
    cell: float
    first: tuple[int, int]  # place of the first cell on the lattice
    deviation: float | None  # by which scores are divided; None for leaf area
    names: tuple[str, ...]  # of properties

    @property
    def ratio(self):
        """Cells along a node of the forms of the land."""
        return max(1, round(self.landscape.cell / self.cell))

    @property
    def margin(self):
        """Nodes around a node on which its forms depend."""
        return forms_reach(self.ratio * self.cell)

    def begin(self, at):
        """First cell on the lattice of the window that a cell reads, which begins with a whole square of the forms."""
        return (at // self.ratio // COARSE * COARSE - self.margin) * self.ratio


def _check_covers(dem, grid):
    """Raise an error unless an elevation covers a grid."""
    own = grids.geobox(dem)
    offset = grids.lattice_offset(own, grid)
    if any(start < 0 or start + size > n for start, size, n in zip(offset, grid.shape, own.shape, strict=True)):
        raise ValueError(
            f"dem spans {grids.extent(own)} and the grid {grids.extent(grid)}: give an elevation that covers the grid"
        )


def _window_reads(cells, dem, grid):
    """Windows of whole nodes of an elevation around each cell."""
    offset = grids.lattice_offset(grids.geobox(dem), grid)
    bounds = []
    for start, shift, size in zip(cells.first, offset, grid.shape, strict=True):
        at = start + np.arange(size)
        end = (at // cells.ratio + 1 + cells.margin) * cells.ratio
        bounds.append((cells.begin(at) - start + shift, end - start + shift))
    return Reads(dem.data, *bounds)


def _simulated(cells, rows, columns, ground=None):
    """Leaf area or scores, and properties of cells, from a window of elevation around them or on level ground."""
    landscape, ratio = cells.landscape, cells.ratio
    properties = [(name, landscape.properties[name].field) for name in cells.names]
    # Cells lie between nodes that are at most one outside of the margin.
    outside = cells.margin - 1
    if ground is not None:
        total, count = square_sums(np.ascontiguousarray(ground, float), ratio)
        nodes = np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)
        forms = land_forms(nodes, ratio * cells.cell, outside)
        layers = [*terrain_response(landscape, forms)]
        layers += [property_response(landscape, name, forms) for name in cells.names]
    # Numbers of the cells from the first cell of the window.
    down, across = (
        start + np.arange(block.start, block.stop) - cells.begin(start + block.start)
        for start, block in zip(cells.first, (rows, columns), strict=True)
    )
    out = np.empty((1 + len(properties), down.size, across.size))
    for first in range(0, down.size, _STRIP):
        strip = slice(first, first + _STRIP)
        own, mean, spread, responses = None, 0.0, 0.0, [None] * len(properties)
        if ground is not None:
            at = down[strip] - outside * ratio, across - outside * ratio
            mean, spread, *responses = (between_squares(each, ratio, *at) for each in layers)
            own = ground[down[strip][0] : down[strip][-1] + 1, across[0] : across[-1] + 1]
        place = cells.northing[rows][strip], cells.easting[columns]
        found = scores(landscape, *place, cells.seed, own, mean, spread, cells.cell)
        out[0, strip] = leaf_area(landscape, found) if cells.deviation is None else found / cells.deviation
        for k, (name, field) in enumerate(properties):
            score = property_scores(landscape, name, *place, cells.seed, found - mean, responses[k], cells.cell)
            out[k + 1, strip] = property_values(name, field)(score)
    return out


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
        If the cells of the maps differ in size, a map has fewer than 2,000 known cells, or the elevation is on other
        cells.

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
    if dem is not None:
        one, other, dem = chunking.aligned([grids.north_up(each) for each in (one, other, dem)])
    maps = [np.asarray(grids.north_up(each.transpose("y", "x")).values, float) for each in (one, other)]
    ground = None if dem is None else np.asarray(dem.transpose("y", "x").values, float)
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
