"""Pixels of a scan on the cells of a map: nearest pixels and area-weighted means."""

from itertools import pairwise

import numpy as np

from fifesim.base.arrays import compiled, jitable

# Corners that a quadrilateral may have once it is cut along four lines: each cut doubles them at most.
_MOST = 64


def corners(row, column, sweep=None):
    """Corners of pixels half way between centres of one sweep, by line, its two edges, and sample + 1. [cell]"""
    if min(np.shape(row)) < 2:
        raise ValueError(
            f"a swath of {' x '.join(map(str, np.shape(row)))} pixels does not tell how large they are: "
            "take at least 2 lines and 2 samples"
        )
    sweep = np.zeros(len(row), int) if sweep is None else np.asarray(sweep)
    starts = [0, *(np.flatnonzero(np.diff(sweep)) + 1).tolist(), len(sweep)]
    out = []
    for places in (row, column):
        across = _between(np.asarray(places, float).T).T
        edges = np.empty((len(row), 2, across.shape[1]))
        for start, stop in pairwise(starts):
            lines = across[start:stop]
            if stop - start == 1:  # as high as the lines of the neighbouring sweep
                pair = min(1, len(row) - 2) if start == 0 else max(start - 2, 0)
                lines = lines + across[pair : pair + 2] - across[pair]
            limits = _between(lines)
            edges[start:stop, 0], edges[start:stop, 1] = limits[: stop - start], limits[1 : stop - start + 1]
        out.append(edges)
    return tuple(out)


def _between(values):
    """Values half way between the rows of an array, and extrapolated beyond the first and the last row."""
    inside = (values[1:] + values[:-1]) / 2
    return np.concatenate([values[:1] * 1.5 - values[1:2] / 2, inside, values[-1:] * 1.5 - values[-2:-1] / 2])


def reach(row, column, edges, cell):
    """Distance from the centre of each pixel to its farthest corner, shape (line, sample). [m]"""
    rows, columns = edges
    farthest = np.zeros(np.shape(row))
    for edge in (0, 1):
        for right in (slice(-1), slice(1, None)):
            away = (rows[:, edge, right] - row) * cell[0], (columns[:, edge, right] - column) * cell[1]
            farthest = np.maximum(farthest, np.hypot(*away))
    return farthest


@compiled
def nearest_pixels(row, column, reach, cell, rows, columns):
    """Number of the pixel nearest to each cell among the pixels that reach it, -1 if none does."""
    number = np.full((rows[1] - rows[0], columns[1] - columns[0]), -1)
    least = np.full(number.shape, np.inf)
    for pixel in range(row.size):
        far = reach[pixel]
        # Rounding must not lose a cell that lies on the circle.
        limit = far * far * (1 + 1e-9)
        top, bottom = _between_cells(row[pixel], far / cell[0], rows)
        left, right = _between_cells(column[pixel], far / cell[1], columns)
        for i in range(top, bottom):
            for j in range(left, right):
                down, across = (i + 0.5 - row[pixel]) * cell[0], (j + 0.5 - column[pixel]) * cell[1]
                distance = down * down + across * across
                if distance <= limit and distance < least[i - rows[0], j - columns[0]]:
                    least[i - rows[0], j - columns[0]] = distance
                    number[i - rows[0], j - columns[0]] = pixel
    return number


@jitable
def _between_cells(center, half, limits):
    """Range of cells within a half width of a place and inside a window; empty if the place is not finite."""
    if not np.isfinite(center + half):
        return 0, 0
    first = max(np.floor(center - half) - 1, limits[0])
    last = min(np.ceil(center + half) + 1, limits[1])
    return int(min(first, limits[1])), int(max(last, limits[0]))


@compiled
def covered_means(values, row, column, rows, columns):
    """Area-weighted means of the valid pixels over cells, and the covered share, shape (band, rows, columns)."""
    shape = values.shape[0], rows[1] - rows[0], columns[1] - columns[0]
    total, covered = np.zeros(shape), np.zeros(shape)
    pixel, cut, other = np.empty((4, 2)), np.empty((_MOST, 2)), np.empty((_MOST, 2))
    for line in range(values.shape[1]):
        for sample in range(values.shape[2]):
            for k in range(4):
                edge, right = k // 2, sample + (k + 1) // 2 % 2
                pixel[k, 0], pixel[k, 1] = row[line, edge, right], column[line, edge, right]
            top, bottom = _touched(pixel[:, 0], rows)
            left, right = _touched(pixel[:, 1], columns)
            for i in range(top, bottom):
                for j in range(left, right):
                    area = _area_in_cell(pixel, i, j, cut, other)
                    for band in range(values.shape[0]):
                        value = values[band, line, sample]
                        if area > 0 and np.isfinite(value):
                            total[band, i - rows[0], j - columns[0]] += area * value
                            covered[band, i - rows[0], j - columns[0]] += area
    return np.where(covered > 0, total / np.where(covered > 0, covered, 1.0), np.nan), covered


@jitable
def _touched(places, limits):
    """Range of cells along an axis that a polygon touches inside a window."""
    low, high = places.min(), places.max()
    return _between_cells((low + high) / 2, (high - low) / 2, limits)


@jitable
def _area_in_cell(pixel, i, j, cut, other):
    """Area of a pixel inside the cell of row i and column j: clipped to its four sides, then the shoelace formula."""
    count = _cut(pixel, 4, cut, 0, i, 1.0)
    count = _cut(cut, count, other, 0, i + 1.0, -1.0)
    count = _cut(other, count, cut, 1, j, 1.0)
    count = _cut(cut, count, other, 1, j + 1.0, -1.0)
    area = 0.0
    # Relative to the first corner, to keep precision far from the origin.
    for k in range(2, count):
        down, right = other[k - 1, 0] - other[0, 0], other[k - 1, 1] - other[0, 1]
        area += down * (other[k, 1] - other[0, 1]) - right * (other[k, 0] - other[0, 0])
    return abs(area) / 2


@compiled
def _cut(polygon, corners, kept, axis, limit, side):
    """Clip a polygon to one side of a line along an axis; return the number of corners that are written."""
    count, before = 0, corners - 1
    for here in range(corners):
        inside, was_inside = side * (polygon[here, axis] - limit), side * (polygon[before, axis] - limit)
        if (inside >= 0) != (was_inside >= 0):
            share = was_inside / (was_inside - inside)
            kept[count, 1 - axis] = polygon[before, 1 - axis] + share * (
                polygon[here, 1 - axis] - polygon[before, 1 - axis]
            )
            kept[count, axis] = limit
            count += 1
        if inside >= 0:
            kept[count, 0], kept[count, 1] = polygon[here, 0], polygon[here, 1]
            count += 1
        before = here
    return count
