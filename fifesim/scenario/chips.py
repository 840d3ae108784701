"""The chips of a study: which landscape each lies in and where, and what is drawn for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from fifesim.base.seeds import generator
from fifesim.ground.landscape.field import TILE
from fifesim.rasters import grid as grids
from fifesim.scenario.chip_places import place_of
from fifesim.scenario.named_keys import NamedKey, in_text
from fifesim.scenario.sequences import points
from fifesim.scenario.simulation import setup_of, with_margin
from fifesim.scenario.studies import Study

# Streams of random numbers, as `fifesim.base.seeds` lists them.
_OF_CHIPS, _OF_LANDSCAPES, _ORDER, _SPLIT = 3, 4, 5, 6


@dataclass(frozen=True)
class Chips:
    """
    Chips of a study, from `chips_of`.

    Parameters
    ----------
    study : fifesim.scenario.studies.Study
    landscape : array of int, shape (n,)
        Number of the landscape of each.
    split : array of str, shape (n,)
        Which part of the dataset it belongs to: that of its landscape.
    corners : array, shape (n, 2)
        Easting and northing of the upper left corner. [m]
    columns : mapping of NamedKey to list
        What is drawn, by chip.
    """

    study: Study
    landscape: np.ndarray
    split: np.ndarray
    corners: np.ndarray
    columns: Mapping[NamedKey, list]

    def __len__(self):
        return len(self.landscape)

    def scenario(self, chip):
        """
        Scenario of one chip.

        Parameters
        ----------
        chip : int

        Returns
        -------
        scenario : fifesim.scenario.scenario.Scenario
            ``fifesim.simulate(scenario, complete=True)`` gives the chip.

        Raises
        ------
        ValueError
            If what is drawn cannot be together, or the chip lies where its CRS does not hold.
        """
        drawn = {key.path: column[chip] for key, column in self.columns.items()}
        west, north = self.corners[chip].tolist()
        drawn |= {("grid", "west"): west, ("grid", "north"): north}
        try:
            return self.study.scenario_with(drawn)
        except ValueError as error:
            raise ValueError(f"chip {chip}: {error}") from None

    def table(self):
        """
        What is drawn, and where chips lie.

        Returns
        -------
        table : xarray.Dataset, dims (chip,)
            By the whole name of a key what is drawn, with its unit; ``landscape``, ``split``, ``west`` and ``north``
            [m]. Values that are lists stand as text.
        """
        variables = {
            "landscape": (self.landscape, {"long_name": "number of the landscape, which chips of one split share"}),
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


def chips_of(study: Study, n: int) -> Chips:
    """
    Chips of a study.

    Parameters
    ----------
    study : fifesim.Study
    n : int
        How many.

    Returns
    -------
    chips : Chips
        The first are the same however many there are, unless they are drawn from a Latin hypercube.

    Raises
    ------
    ValueError
        If there is none.

    Notes
    -----
    Every round of as many chips as there are landscapes has one chip of each, in a drawn order: points of a sequence
    that a landscape took in turn would lie in one part of the space.

    References
    ----------
    [Sobol1967]_, scrambled after [Matousek1998]_; [McKay1979]_

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> chip = fifesim.Scenario(grid={"width": 180, "height": 180}, terrain={"dem": "flat"})
    >>> study = fifesim.Study(chip, {"visibility": {"uniform": [10, 60]}}, landscapes=10)
    >>> chips = fifesim.chips_of(study, 20)
    >>> np.bincount(chips.landscape).tolist()
    [2, 2, 2, 2, 2, 2, 2, 2, 2, 2]
    >>> drawn = chips.table()["atmosphere.visibility"]
    >>> chips.scenario(3).atmosphere.visibility == float(drawn[3])
    True
    """
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
        raise ValueError(f"n must be a whole number of chips from 1 up, got {n!r}")
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
    tiling = tuple(grid.shape), tuple(here.tolist()), TILE, tuple(each.start for each in inside.values())
    places = [place_of(number, *tiling) for number in range(rounds)]
    rows, columns = (np.array(places) - here).T
    return np.stack([grid.affine.c + across * columns, grid.affine.f - down * rows], axis=1)


def _drawn(study, count, landscape):
    """Values of the keys that are drawn, by landscape or by chip."""
    shared = {key: distribution for key, distribution in study.drawn.items() if is_of_a_landscape(key)}
    own = {key: distribution for key, distribution in study.drawn.items() if key not in shared}
    found = {}
    for keys, stream, number in ((shared, _OF_LANDSCAPES, study.landscapes), (own, _OF_CHIPS, count)):
        shares = points(study.sequence, study.seed, stream, number, len(keys))
        for at, (key, distribution) in enumerate(keys.items()):
            found[key] = distribution.quantile(shares[:, at])
    return {key: [found[key][at] for at in landscape] if key in shared else found[key] for key in study.drawn}


def is_of_a_landscape(key):
    """
    Whether a key is drawn for each landscape: it makes the random field itself, whose tiles are shared by chips.

    Parameters
    ----------
    key : fifesim.scenario.named_keys.NamedKey

    Returns
    -------
    answer : bool
    """
    return key.key in ("arp", "arps") or (key.key == "seed" and key.place != ("sensor",))


def _seeds(study, count, landscape):
    """Seeds of landscapes, of hills where they are synthetic, and of noise where there is some."""
    scenario = study.scenario
    found = {NamedKey(("ground",), "seed"): [scenario.ground.seed + int(at) for at in landscape]}
    if scenario.terrain.dem == "flint-hills":
        found[NamedKey(("terrain",), "seed")] = [scenario.terrain.seed + int(at) for at in landscape]
    if scenario.sensor.noise or any(key.path == ("sensor", "noise") for key in study.drawn):
        found[NamedKey(("sensor",), "seed")] = [scenario.sensor.seed + chip for chip in range(count)]
    return found
