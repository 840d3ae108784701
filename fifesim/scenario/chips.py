"""Chips of a study: their landscapes, windows and drawn values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np
import xarray as xr

from fifesim.base.arguments import Range, check, kind_of
from fifesim.base.lattice import generator
from fifesim.grids import grid as grids
from fifesim.grids.sites import made_on_site
from fifesim.ground.landscape.autoregression import FIELD_TILE
from fifesim.scenario.distributions import points
from fifesim.scenario.scenario import NamedKey, in_text
from fifesim.scenario.simulation import setup_of, with_margin
from fifesim.scenario.studies import Study


def first_cell_of_chip(number, size, corner, tile, margin=(0, 0)):
    """First row and column of a chip on the lattice of its landscape."""
    # Chips do not overlap. They fill the tiles of the lattice in squares around the tile of the corner. A tile also
    # holds the margin around its chips, so a chip never needs two tiles.
    fitting = [max(tile - 2 * around, 0) // length for length, around in zip(size, margin, strict=True)]
    if not all(fitting):
        down, across = ring_place(number)
        return corner[0] + down * size[0], corner[1] + across * size[1]
    at, inside = divmod(number, math.prod(fitting))
    down, across = ring_place(at)
    row, column = divmod(inside, fitting[1])
    return (
        (corner[0] // tile + down) * tile + margin[0] + row * size[0],
        (corner[1] // tile + across) * tile + margin[1] + column * size[1],
    )


def ring_place(number):
    """Row and column of the n-th position on a square spiral."""
    if not number:
        return 0, 0
    ring = (math.isqrt(number) + 1) // 2
    side, step = divmod(number - (2 * ring - 1) ** 2, 2 * ring)
    # A ring starts up its right side, then goes left, down and right.
    along = step - ring + 1
    return [(-along, ring), (-ring, -along), (along, -ring), (ring, along)][side]


# Streams of random numbers, as `fifesim.base.lattice` lists them.
_OF_CHIPS, _OF_LANDSCAPES, _ORDER, _SPLIT = 3, 4, 5, 6


@dataclass(frozen=True)
class Chips:
    """
    Chips of a study, from `chips_of`.

    Parameters
    ----------
    study : fifesim.scenario.studies.Study
    landscape : array of int, shape (n,)
        Landscape number of each chip.
    split : array of str, shape (n,)
        Part of the dataset to which the chip belongs. All chips of a landscape belong to the same part.
    corners : array, shape (n, 2)
        Easting and northing of the upper left corner. [m]
    columns : mapping of NamedKey to list
        Drawn values, by chip.
    """

    study: Study
    landscape: np.ndarray
    split: np.ndarray
    corners: np.ndarray
    columns: Mapping[NamedKey, list]

    def __len__(self):
        return len(self.landscape)

    def scenario(self, chip):
        """Scenario of one chip."""
        drawn = {key.path: column[chip] for key, column in self.columns.items()}
        west, north = self.corners[chip].tolist()
        drawn |= {("grid", "west"): west, ("grid", "north"): north}
        try:
            scenario = self.study.scenario_with(drawn)
        except ValueError as error:
            raise ValueError(f"chip {chip}: {error}") from None
        scenario._made_on = made_on_site(self.study.scenario.geobox())
        return scenario

    def table(self):
        """Drawn values and locations of the chips, dims (chip,), by full key name."""
        variables = {
            "landscape": (self.landscape, {"long_name": "landscape number; chips of a landscape belong to one split"}),
            "split": (self.split, {"long_name": "part of the dataset"}),
            "west": (self.corners[:, 0], {"long_name": "easting of the upper left corner", "units": "m"}),
            "north": (self.corners[:, 1], {"long_name": "northing of the upper left corner", "units": "m"}),
        }
        for key, column in self.columns.items():
            values = [in_text(value) for value in column]
            kind = object if any(isinstance(value, str) for value in values) else None
            variables[key.name] = np.asarray(values, kind), key.attributes
        found = {name: ("chip", values, attributes) for name, (values, attributes) in variables.items()}
        return xr.Dataset(found, coords={"chip": np.arange(len(self))})


_Count: TypeAlias = Annotated[int, Range("1", 1, np.inf)]


def chips_of(study: Study, n: _Count) -> Chips:
    """
    Chips of a study.

    Parameters
    ----------
    study : fifesim.Study
    n : int
        Number of chips.

    Returns
    -------
    chips : Chips
        The first chips do not depend on `n`.

    Raises
    ------
    ValueError
        If `n` is below 1.

    Notes
    -----
    Chips are assigned in rounds. Each round has one chip from every landscape, in random order. In a fixed order, the
    points of the sequence assigned to one landscape could cluster in part of the parameter space.

    References
    ----------
    [Sobol1967]_, scrambled after [Matousek1998]_

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> chip = fifesim.Scenario(grid={"width": 180, "height": 180}, terrain={"dem": "flat"})
    >>> study = fifesim.Study(chip, {"visibility": {"uniform": [10, 60]}}, landscapes=10)
    >>> chips = fifesim.scenario.chips_of(study, 20)
    >>> np.bincount(chips.landscape).tolist()
    [2, 2, 2, 2, 2, 2, 2, 2, 2, 2]
    >>> drawn = chips.table()["atmosphere.visibility"]
    >>> chips.scenario(3).atmosphere.visibility == float(drawn[3])
    True
    """
    check("n", n, kind_of(_Count))
    count, landscapes = int(n), study.landscapes
    rounds = -(-count // landscapes)
    orders = [generator(study.seed, _ORDER, (0, each, 0, 0)).permutation(landscapes) for each in range(rounds)]
    landscape = np.concatenate(orders)[:count]
    parts = np.repeat(np.array(list(study.split), object), list(study.quotas().values()))
    parts = parts[generator(study.seed, _SPLIT).permutation(landscapes)]
    return Chips(
        study,
        landscape,
        parts[landscape],
        _corners(study, rounds)[np.arange(count) // landscapes],
        _drawn(study, count, landscape) | _seeds(study, count, landscape),
    )


def _corners(study, rounds):
    """Upper left corners of the chips of a landscape. [m]"""
    grid = study.scenario.geobox()
    here, (down, across) = np.array(grids.lattice_position(grid)), grids.cell_size(grid)
    _, _, inside = with_margin(study.scenario, setup_of(study.scenario))
    tiling = tuple(grid.shape), tuple(here.tolist()), FIELD_TILE, tuple(each.start for each in inside.values())
    places = [first_cell_of_chip(number, *tiling) for number in range(rounds)]
    rows, columns = (np.array(places) - here).T
    return np.stack([grid.affine.c + across * columns, grid.affine.f - down * rows], axis=1)


def _drawn(study, count, landscape):
    """Values of the drawn keys, one for each chip."""
    shared = {key: distribution for key, distribution in study.drawn.items() if is_of_a_landscape(key)}
    own = {key: distribution for key, distribution in study.drawn.items() if key not in shared}
    found = {}
    for keys, stream, number in ((shared, _OF_LANDSCAPES, study.landscapes), (own, _OF_CHIPS, count)):
        shares = points(study.sequence, study.seed, stream, number, len(keys))
        for at, (key, distribution) in enumerate(keys.items()):
            found[key] = distribution.quantile(shares[:, at])
    return {key: [found[key][at] for at in landscape] if key in shared else found[key] for key in study.drawn}


def is_of_a_landscape(key):
    """Whether a key is drawn once for each landscape, because it determines the random field shared by its chips."""
    return key.key == "arp" or (key.key == "seed" and key.place not in (("sensor",), ("clouds",)))


def _seeds(study, count, landscape):
    """Seeds of the landscapes, synthetic hills and noise that the scenario uses."""
    scenario = study.scenario
    found = {NamedKey(("ground",), "seed"): [scenario.ground.seed + int(at) for at in landscape]}
    if scenario.terrain.dem == "flint-hills":
        found[NamedKey(("terrain",), "seed")] = [scenario.terrain.seed + int(at) for at in landscape]
    if scenario.sensor.noise or any(key.path == ("sensor", "noise") for key in study.drawn):
        found[NamedKey(("sensor",), "seed")] = [scenario.sensor.seed + chip for chip in range(count)]
    if scenario.clouds.cloud_cover or any(key.path == ("clouds", "cloud_cover") for key in study.drawn):
        found[NamedKey(("clouds",), "seed")] = [scenario.clouds.seed + chip for chip in range(count)]
    return found
