"""Elevation models of the user: checks of their numbers, their spline on a grid, and their coverage of it."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import xarray as xr
from scipy import ndimage

from fifesim.base.lattice import centres
from fifesim.base.messages import warn
from fifesim.grids import cf, projection
from fifesim.grids import grid as grids
from fifesim.grids.source import OnGrid, open_source
from fifesim.ground.terrain import spline
from fifesim.ground.terrain.slope import metres_per_unit

# Elevations of exactly 0 among others that are all farther from it may be voids. [m]
_CLIFF = 50.0


def check_heights(name, values):
    """Raise ValueError for heights that do not occur on land, and warn of voids of 0."""
    # Whole numbers have no infinity, and unsigned ones no difference.
    values, land = np.asarray(values, float), cf.QUANTITIES["dem"]
    wrong = values[(values < land.lowest) | (values > land.highest)]
    if wrong.size:
        raise ValueError(
            f"{name} holds elevations such as {wrong.flat[0]:.0f} m, land has {land.lowest} to {land.highest} m: if it "
            "marks no data, declare it (gdal_edit.py -a_nodata, .rio.write_nodata); if the unit is another, give "
            "vertical_units="
        )
    void = values == 0
    if void.any() and np.fmin.reduce(np.abs(values[~void]), initial=np.inf) > _CLIFF:
        warn(
            f"{name} holds elevations of exactly 0 m beside others that all differ from it by more than {_CLIFF:g} m: "
            "if 0 marks no data, declare it (gdal_edit.py -a_nodata 0, .rio.write_nodata(0))"
        )


REFERENCE = "Dozier and Frew (1990), doi:10.1109/36.58986"

# Elevations that all differ by more from the altitude of the atmosphere are in another place or unit. [m]
_APART = 500.0
# Nearer ones may still be in another unit: 150 m are 492 feet. [m]
_NOT_FEET = 150.0
# Relief of a scene in kilometres is less, and only the flattest coasts have so little in metres.
_RELIEF_IN_KM = 1.0

_UNITS_IN_WORDS = {"ft": "feet", "dm": "decimetres", "km": "kilometres"}


def likely_unit(low, high, at):
    """Unit in which elevations that are far from an altitude [m] agree with it, or None."""
    if low - _NOT_FEET <= at <= high + _NOT_FEET:
        return None
    for unit in _UNITS_IN_WORDS:
        metres = metres_per_unit(unit)
        agree = metres * low - _APART / 5 < at < metres * high + _APART / 5
        if agree and (unit != "km" or high - low < _RELIEF_IN_KM):
            return unit
    return None


def elevation_grid(dem):
    """Grid of an elevation model."""
    if not isinstance(dem, xr.DataArray):
        raise TypeError(
            f"a dem is an xarray.DataArray, got {type(dem).__name__}: bring it onto the grid with fifesim.fine_dem"
        )
    if dem.ndim != 2:
        raise ValueError(f"a dem has dimensions (y, x), got {dem.dims}: select one layer, such as .isel(band=0)")
    cf.check_quantity(dem, "dem")
    if dem.chunks is None:
        check_heights("the dem", dem.values)
    return grids.geobox(dem)


def beside_altitude(dem, altitude):
    """Elevation model that warns if it disagrees with the altitude of the atmosphere, when it is computed if lazy."""
    if dem.chunks is None:
        look_at_altitude(dem.values, altitude)
        return dem
    warned = []
    data = dem.data.map_blocks(look_at_altitude, altitude, warned, dtype=dem.dtype, meta=np.empty((0, 0), dem.dtype))
    return dem.copy(data=data)


def look_at_altitude(cells, altitude, warned=()):
    """Warn once if elevations disagree with the altitude of the atmosphere, and return them."""
    low, high = (float(end.reduce(cells, axis=None)) for end in (np.fmin, np.fmax))
    at = 1000 * altitude
    unit = likely_unit(low, high, at)
    if not warned and (unit or low > at + _APART or high < at - _APART):
        warned += [True] if isinstance(warned, list) else ()
        other = ""
        if unit:
            words, metres = _UNITS_IN_WORDS[unit], metres_per_unit(unit)
            other = (
                f"where they are {words}, take dem * {metres:g} (vertical_units = '{unit}' of a file); where metres, "
            )
        warn(
            f"the dem has elevations of {low:.4g} to {high:.4g} m beside an altitude of the atmosphere of {altitude:g} "
            f"km: {other}give fifesim.Atmosphere(altitude={np.clip((low + high) / 2000, 0, None):.1f})"
        )
    return cells


def source_resolution(dem, given=None):
    """Resolution of the source of an elevation model: given, from the attribute, or the smaller side of a cell. [m]"""
    known = dem.attrs.get("source_resolution") if given is None else given
    found = min(grids.cell_size(grids.geobox(dem))) if known is None else float(known)
    least = 0.0 if given is None else min(grids.cell_size(grids.geobox(dem))) / 50
    if not (found > 0 and least <= found < np.inf):
        raise ValueError(
            f"the resolution of an elevation's source must be positive metres, and if given at least 1/50 of a cell, "
            f"got {found:g}: give metres, not km"
        )
    return found


# Positions in another CRS are a polynomial through this number of Chebyshev nodes along each axis of a tile.
_NODES = 12

# Filling goes outward ring by ring. [source cell]
_MOST_FILLED = 250

# Largest number of rows and columns of the grid at which coverage is checked, and of those that are read together.
_LOOKS = 2000
_PART = 512

# A model that ends farther inside the grid than this should be replaced, not extrapolated. [m]
_NEAR = 150


@dataclass(frozen=True, eq=False)
class Model(OnGrid):
    """Elevation on a grid: a spline through averaged cells of a source, whose gaps are filled up to a distance. [m]"""

    blocks: tuple[int, int] = (1, 1)  # source cells down and across that are averaged
    fill: tuple[float, float] = (0, 0)  # distance from known elevation [source cell]
    resolution: float = 0.0  # [m]
    linear: bool = False  # interpolate linearly, which does not overshoot
    covers: bool = True  # unknown elevation is an error

    TILE = 504

    @property
    def parallel(self):
        """Whether rows and columns of the grid are parallel to those in the source."""
        return self.back is None and not (self.source.affine.b or self.source.affine.d)

    def positions(self, rows, columns):
        """Positions of cells in the source, from its first centre, shape (m, 1), (1, n) if parallel, else (m, n)."""
        a = self.grid.affine
        y, x = centres(a.f, a.e, rows), centres(a.c, a.a, columns)
        if self.parallel:
            inverse = ~self.source.affine
            return (inverse.e * y + inverse.f - 0.5)[:, None], (inverse.a * x + inverse.c - 0.5)[None, :]
        (y_nodes, from_y), (x_nodes, from_x) = _chebyshev(y), _chebyshev(x)
        across, down = self.source_places(*np.meshgrid(x_nodes, y_nodes))
        return from_y @ (down - 0.5) @ from_x.T, from_y @ (across - 0.5) @ from_x.T

    def cell_size(self):
        """Size of a source cell in the middle of the grid, down and across. [m]"""
        x, y = projection.transform_points(self.grid.affine, self.grid.shape.x / 2, self.grid.shape.y / 2)
        step = 10.0
        columns, rows = self.source_places(np.array([x, x + step, x]), np.array([y, y, y + step]))
        return tuple(float(step / np.hypot(*(axis[1:] - axis[0]))) for axis in (rows, columns))

    def reads(self, rows, columns):
        """Rows and columns of the source that positions need, in whole blocks."""
        found = []
        parts = zip((rows, columns), self.blocks, self.fill, self.source.shape, strict=True)
        for positions, count, fill, size in parts:
            low, high = ((edge + 0.5) / count - 0.5 for edge in (positions.min(), positions.max()))
            # A gap must be read completely, with the surrounding cells that determine its values.
            around = spline.SPLINE_MARGIN + int(np.ceil((2 * fill + 6) / count) if fill else 0)
            # The model is unknown beyond its margin.
            first = max(int(np.floor(low)) - 2, -around) - around
            last = min(int(np.floor(high)) + 4, -(-size // count) + around) + around
            found.append(slice(first * count, max(last, first) * count))
        return found

    def tile_window(self, top, left):
        """Rows and columns of the source that a tile reads."""
        outline = np.linspace(0, self.TILE - 1, 17).round().astype(int)
        # A curved edge may bulge between the points of the outline.
        return [
            slice(part.start - 2, part.stop + 2) for part in self.reads(*self.positions(top + outline, left + outline))
        ]

    def read(self, rows, columns, fill=True):
        """Elevation of source cells with filled gaps, NaN where unknown, shape (rows, columns). [m]"""
        with self.source.opened() as read:
            values = read(rows, columns)
        check_heights(self.source.name, values)
        return spline.fill_gaps(values, self.fill) if fill and any(self.fill) else values

    def make(self, top, left):
        """Elevation of a tile, NaN where unknown, shape (TILE, TILE). [m]"""
        down, across = self.blocks
        cells = np.arange(self.TILE)
        rows, columns = self.positions(top + cells, left + cells)
        window = self.reads(rows, columns)
        values = self.read(*window)
        known = np.isfinite(values)
        if not known.any():
            return np.full((self.TILE, self.TILE), np.nan)
        rows, columns = rows - window[0].start, columns - window[1].start
        found = _looked_up(known, rows, columns)
        # Places past the window are unknown; they are moved into it to be passed over.
        rows = rows.clip(3 * down, values.shape[0] - 4 * down)
        columns = columns.clip(3 * across, values.shape[1] - 4 * across)
        if down > 1 or across > 1:
            values = spline.block_means(spline.extend(values, 2 * max(self.blocks), rest=False), down, across)
        values = spline.extend(values, spline.SPLINE_MARGIN)
        in_blocks = (rows + 0.5) / down - 0.5, (columns + 0.5) / across - 0.5
        if self.linear:
            return np.where(found, ndimage.map_coordinates(values, np.broadcast_arrays(*in_blocks), order=1), np.nan)
        coefficients = spline.spline_coefficients(values)
        if self.parallel:
            out = spline.spline_grid(coefficients, *(axis.ravel() for axis in in_blocks))
        else:
            out = spline.spline_points(coefficients, *in_blocks)
        return np.where(found, out, np.nan)

    def __call__(self, row, column, shape):
        """Elevation from a row and column of the grid on, shape (rows, columns). [m]"""
        values = super().__call__(row, column, shape)
        if self.covers and (unknown := np.isnan(values)).any():
            grid = self.grid[row : row + shape[0], column : column + shape[1]]
            _raise_for_gaps(self, grid, unknown, np.arange(shape[0]), np.arange(shape[1]))
        return values

    def known(self, rows, columns):
        """Mask of the known elevations at some rows and columns of the grid, read by parts."""
        out = np.empty((rows.size, columns.size), bool)
        for top, left in product(range(0, rows.size, _PART), range(0, columns.size, _PART)):
            part = slice(top, top + _PART), slice(left, left + _PART)
            down, across = self.positions(rows[part[0]], columns[part[1]])
            window = self.reads(down, across)
            known = np.isfinite(self.read(*window))
            out[part] = _looked_up(known, down - window[0].start, across - window[1].start)
        return out


def model_under(grid, raster, fill, vertical_units, allow_remote=False):
    """Elevation model below a grid."""
    grids.check_grid(grid)
    if fill is not None and (isinstance(fill, bool) or not fill > 0):
        raise ValueError(f"fill is a distance from known elevation, above 0 m, got {fill!r}: give for instance fill=60")
    source = open_source(raster, "dem", allow_remote)
    cf.check_words(source.name, source.words, "dem")
    unit = source.units or source.height_units or "metre"
    if vertical_units is None:
        try:
            metres = metres_per_unit(unit)
        except ValueError:
            metres = None
        if metres != 1.0:
            raise ValueError(
                f"{source.name} says that its elevations are in {unit!r}, not in metres: give their units, for "
                f"instance vertical_units='us-ft', and they are converted, or vertical_units='m' if it is wrong"
            )
    source = replace(source, factor=metres_per_unit(vertical_units or unit))
    back = projection.operation(grid.crs.to_wkt(), source.crs, projection.degrees(grid))
    model = Model(source, grid, back)
    sizes = model.cell_size()
    most = round(_MOST_FILLED * min(sizes), 6)
    if (fill or 0) > most:
        raise ValueError(
            f"fill={fill:g} is more than {_MOST_FILLED} cells of {source.name}, of {min(sizes):.3g} m: give at most "
            f"fill={most:g}"
        )
    blocks = tuple(max(1, round(float(np.mean(grids.cell_size(grid))) / size)) for size in sizes)
    resolution = round(float(np.mean([count * size for count, size in zip(blocks, sizes, strict=True)])), 6)
    return replace(model, blocks=blocks, fill=tuple((fill or 0) / size for size in sizes), resolution=resolution)


def _chebyshev(values):
    """Chebyshev nodes over the range of some values, and the interpolation matrix from nodes to values."""
    middle, half = (values.max() + values.min()) / 2, max(np.ptp(values) / 2, 1.0)
    nodes = np.polynomial.chebyshev.chebpts1(_NODES)
    matrix = np.linalg.solve(
        np.polynomial.chebyshev.chebvander(nodes, _NODES - 1).T,
        np.polynomial.chebyshev.chebvander((values - middle) / half, _NODES - 1).T,
    ).T
    return middle + half * nodes, matrix


def _looked_up(known, rows, columns):
    """Mask of places in known cells, False outside of all cells."""
    if not known.size:
        return np.zeros(np.broadcast_shapes(rows.shape, columns.shape), bool)
    row, column = np.rint(rows).astype(int), np.rint(columns).astype(int)
    inside = (row >= 0) & (row < known.shape[0]) & (column >= 0) & (column < known.shape[1])
    return inside & known[row.clip(0, known.shape[0] - 1), column.clip(0, known.shape[1] - 1)]


def check_cover(model):
    """Raise ValueError if a model does not cover its grid, before it is used."""
    step = max(0.5 * model.resolution / max(model.blocks) / min(grids.cell_size(model.grid)), 1.0)
    looks = [
        np.unique(np.linspace(0, size - 1, min(int(size / step) + 2, _LOOKS)).round().astype(int))
        for size in model.grid.shape
    ]
    unknown = ~model.known(*looks)
    if unknown.any():
        _raise_for_gaps(model, model.grid, unknown, *looks)


def _raise_for_gaps(model, grid, unknown, rows, columns):
    """Raise ValueError that names the part of a grid which a model lacks."""
    source, name = model.source, model.source.name
    if unknown.all():
        raise ValueError(
            f"{name} holds no elevation on the grid, which spans {grids.extent(grid)} in "
            f"{projection.name_of(grid.crs.proj)}; it spans "
            f"{projection.lies_in_words(source.affine, source.shape, source.crs)}"
        )
    down, across = grids.cell_size(grid)
    height, width = np.gradient(rows.astype(float)) * down, np.gradient(columns.astype(float)) * across
    words = [
        *_short_sides(model, unknown, height, width),
        *_covered(grid, unknown, rows, columns),
        *_holes(grid, unknown, rows, columns, height, width),
    ]
    raise ValueError(f"{name} does not cover the grid, which spans {grids.extent(grid)}; " + "; ".join(words))


def _short_sides(model, unknown, height, width):
    """Text of the distances by which a model ends inside a grid."""
    leads = {
        "north": _lead(unknown, height),
        "south": _lead(unknown[::-1], height[::-1]),
        "west": _lead(unknown.T, width),
        "east": _lead(unknown.T[::-1], width[::-1]),
    }
    if not any(leads.values()):
        return
    sides = ", ".join(f"{metres:.0f} m in the {side}" for side, metres in leads.items() if metres > 0)
    filled = max(cells * size for cells, size in zip(model.fill, model.cell_size(), strict=True))
    # Filling counts from the centre of the last known cell.
    near = int(np.ceil((max(leads.values()) + model.resolution + filled) / 10 + 1)) * 10
    carried = f", or fill={near} carries it on" if near <= _NEAR else ""
    yield f"it lacks up to {sides}: take a smaller grid or a model that reaches farther{carried}"


def _covered(grid, unknown, rows, columns):
    """Text of the part of a grid that a model covers."""
    first, last, start, stop = 0, rows.size, 0, columns.size
    # Edge by edge, the one that lacks the larger share goes first, until the rest is known.
    while last - first > 2 and stop - start > 2:
        part = unknown[first:last, start:stop]
        shares = [part[0].mean(), part[-1].mean(), part[:, 0].mean(), part[:, -1].mean()]
        worst = int(np.argmax(shares))
        if not shares[worst]:
            break
        first, last = first + (worst == 0), last - (worst == 1)
        start, stop = start + (worst == 2), stop - (worst == 3)
    if (first, last, start, stop) == (0, rows.size, 0, columns.size) or unknown[first:last, start:stop].any():
        return
    down, across = grids.cell_size(grid)
    top, bottom = rows[first], rows[last - 1] + 1
    left, right = columns[start], columns[stop - 1] + 1
    west, north = projection.transform_points(grid.affine, left, top)
    yield (
        f"it covers west={west:.10g}, north={north:.10g}, width={(right - left) * across:.6g}, "
        f"height={(bottom - top) * down:.6g}"
    )


def _lead(unknown, sizes):
    """Longest run of unknown rows from the first on, apart from columns that are completely unknown."""
    partly = unknown[:, ~unknown.all(axis=0)]
    runs = np.cumsum(np.logical_and.accumulate(partly, axis=0) * sizes[:, None], axis=0)[-1]
    return float(runs.max())


def _holes(grid, unknown, rows, columns, height, width):
    """Text of the location of the largest visible hole."""
    labels, _ = ndimage.label(unknown, structure=np.ones((3, 3)))
    holes = [
        (height[down].sum(), width[across].sum(), down, across)
        for down, across in ndimage.find_objects(labels)
        if down.start > 0 and across.start > 0 and down.stop < rows.size and across.stop < columns.size
    ]
    if not holes:
        return
    tall, wide, down, across = max(holes, key=lambda hole: max(hole[:2]))
    row, column = rows[(down.start + down.stop) // 2], columns[(across.start + across.stop) // 2]
    east, north = projection.transform_points(grid.affine, column + 0.5, row + 0.5)
    fill = int(np.ceil(max(tall, wide) / 20 + 1)) * 10
    number = "a hole" if len(holes) == 1 else f"{len(holes)} holes, the largest"
    yield f"it has {number} of {tall:.0f} x {wide:.0f} m at {east:.0f} E {north:.0f} N: fill={fill} interpolates it"
