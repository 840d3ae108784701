"""Scatter budget of a scenario without simulation, from the covariances of its pixels."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from fifesim.chain.driver import shared_operators
from fifesim.experiments.analytic import (
    DEVIATES,
    FIELD_NODES,
    Footprint,
    Pixel,
    correlation_of,
    mean_of_cells,
    moments,
    prepare,
    reach_of,
)
from fifesim.experiments.scatter.stages import STEP, VARIABLES, along_tangent, scene_of, working_stages
from fifesim.grids import grid as grids
from fifesim.grids.reductions import areas
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table
from fifesim.ground.landscape.learned import correlation_of_scores, leaf_area, scores_of
from fifesim.scenario.ground import drawn_properties, learned_landscape
from fifesim.sensor.labels import noise_models
from fifesim.sensor.response.noise import radiance_std

# Harmonics of the series of rounding: the next ones have 1/50 of the first.
_HARMONICS = 6
# Variance of the phase beyond which a harmonic is below 1e-8. [turn2]
_SMOOTH = 1.0
# Standard normal deviates of a signal, over which its rounding is averaged.
_SIGNALS = np.linspace(-6.0, 6.0, 1201)
# Names of the bands and of their index.
_SEEN = ("red", "nir", "ndvi")


def obstacles(scenario):
    """Reasons for which the scatter of a complete scenario needs simulation, each with what to give instead."""
    own, land, air = scenario.sensor, scenario.ground, scenario.atmosphere
    down, across = grids.cell_size(scenario.geobox())
    varying = list(drawn_properties(scenario)) if scenario.learned else []
    found = {
        "ground.lai_file is a map: give ground.distribution and arp": bool(land.lai_file),
        "the ground has classes or other varying properties: give landscape.cover = 'none' without deviations": (
            not scenario.learned and not scenario.is_one()
        ),
        f"{', '.join(varying)} vary: give numbers for ground.{', ground.'.join(varying)}": bool(varying),
        f"ground.arp is {land.arp:g}: give at most {LARGEST_STREAMING_ARP}": (
            not scenario.learned and land.arp > LARGEST_STREAMING_ARP
        ),
        "ground.method is 'periodic': give 'streaming'": land.method == "periodic",
        "the ground is not level: give terrain.dem = 'flat'": scenario.terrain.dem != "flat",
        "there are clouds: give clouds.cloud_cover = 0": scenario.clouds.cloud_cover > 0,
        "atmosphere.coupling is not 'lambert'": air.coupling != "lambert",
        "light comes from adjacent cells: give atmosphere.adjacency = false": bool(air.adjacency),
        "pixels drift along the grid: give sensor.interval = 'product'": own.interval not in ("product", own.size),
        f"cells are {down:g} x {across:g} m: give a grid of squares": down != across,
    }
    return [reason for reason, holds in found.items() if holds]


# Compared by identity, because truths with the same table have the same variance.
@dataclass(frozen=True, eq=False)
class Table:
    """Quantity of a pixel by the mean leaf area of its cells."""

    areas: np.ndarray
    values: np.ndarray

    def __call__(self, means):
        return np.interp(means[0], self.areas, self.values)


class Recording(NamedTuple):
    """Line from the reflectance of both bands to the recorded one, each (2, 1), and covariances of its remainders."""

    gain: np.ndarray | float = 1.0
    shift: np.ndarray | float = 0.0
    rest: np.ndarray | float = 0.0
    """Variance by rounding to digital numbers of each band."""
    shared: float = 0.0
    """Covariance of the rounding errors of both bands."""


class Covariances:
    """Prepared covariances of a scenario: the line of a truth on NDVI for any set of stages."""

    def __init__(self, scenario, reach=0):
        self.stages, self.scene = working_stages(scenario), scene_of(scenario)
        self.driver, setup = self.scene.driver, self.scene.setup
        given = self.driver.instrument, self.driver.bands, setup.noise, setup.noise_models
        self.noisy = noise_models(*given) if setup.noise else []
        self.lai, strata, correlation = _field(scenario)
        lai, self.areas = self.lai, np.linspace(0.0, self.lai.max(), 2001)
        absorbed = self.driver.fpar(self.areas, scenario.ground.fpar_inf)
        # Properties by leaf area, and in the air and without it (1 and 0): reflectance of both bands and NDVI.
        self.by_area = {"lai": Table(self.areas, self.areas), "fpar": Table(self.areas, absorbed)}
        properties, self.curvatures = {"lai": lai, "square": lai**2}, []
        for hazy in (0, 1):
            seen = self._seen(self.driver.reflectance(self.areas[None]), hazy)[:, 0]
            self.by_area |= {f"{name}{hazy}": Table(self.areas, row) for name, row in zip(_SEEN, seen, strict=True)}
            self.curvatures.append(Table(self.areas, self._curvature(self.areas, hazy)))
        properties |= {name: table(lai[None]) for name, table in self.by_area.items() if name != "lai"}
        self.square = self._footprints(False, False)[0]
        self.seen = {state: self._footprints(*state) for state in product((False, True), repeat=2)}
        self.even = self._footprints("point spread" in self.stages, "registration" in self.stages, even=True)
        reach = max(reach, reach_of([self.square, *self.even, *(each for pair in self.seen.values() for each in pair)]))
        window = self.scene.grid.shape
        self.prepared = prepare(correlation, properties, strata=strata, window=window, reach=reach)
        self.recordings = {}

    def lines(self, at_work):
        """Regressions of the variables on NDVI with some stages active."""
        truths = [Pixel((name,), (self.square,), mean_of_cells) for name in VARIABLES]
        if "non-linearity" not in at_work:
            truths = self._uniform()
        seen = self.seen["point spread" in at_work, "registration" in at_work]
        return self.prepared.regressions(truths, self._image(seen, at_work))

    def uniform_lines(self):
        """Regressions with all stages active over ground that is uniform within each pixel."""
        at_work = {*self.stages, "NDVI scaling"} - {"non-linearity"}
        return self.prepared.regressions(self._uniform(), self._image(self.even, at_work))

    def _uniform(self):
        """Variables of a pixel whose cells have the mean leaf area."""
        return [Pixel(("lai",), (self.square,), self.by_area[name]) for name in VARIABLES]

    def _image(self, seen, at_work):
        """NDVI of pixels with some stages active."""
        hazy, curved = int("atmosphere" in at_work), "non-linearity" in at_work
        bands = tuple(
            Pixel((f"{name}{hazy}",), (footprint,), mean_of_cells)
            if curved
            else Pixel(("lai",), (footprint,), self.by_area[f"{name}{hazy}"])
            for name, footprint in zip(_SEEN, seen, strict=False)
        )
        key = seen, hazy, curved, "quantisation" in at_work, "noise" in at_work
        if key not in self.recordings:
            self.recordings[key] = self._recording(bands, at_work)
        image = IndexImage(self, hazy, bands, self.recordings[key], "noise" in at_work)
        if "NDVI scaling" in at_work:
            return Pixel(sum((each.names for each in bands), ()), seen, image.ndvi, image.noise)
        names = f"ndvi{hazy}" if curved else "square", *(each.names[0] for each in bands)
        scaled = image.plus_cells if curved else image.plus_tangent
        return Pixel(names, (seen[0], *seen), scaled, image.noise)

    def grains(self, reflectance):
        """Variance of the noise of the detector for the reflectance of each band."""
        white = self.white
        radiance = zip(white * reflectance, self.noisy, strict=True)
        return np.array([radiance_std(each, *own) ** 2 for each, own in radiance]) / white**2

    @property
    def white(self):
        """Radiance of a reflectance of one, shape (2, 1)."""
        return self.driver.radiance(np.ones((2, 1, 1)))[:, 0]

    def _seen(self, reflectance, hazy):
        seen = self.driver.toa(reflectance) if hazy else reflectance
        return np.concatenate([seen, self.driver.ndvi(seen, linear=True)[None]])

    def _curvature(self, middle, hazy):
        """Second derivative by leaf area of NDVI along the tangent of reflectance at a middle."""
        sides = []
        for step in (-STEP, 0.0, STEP):
            seen = along_tangent(self.driver.reflectance, middle[None] + step, middle[None])
            sides.append(self._seen(seen, hazy)[2, 0])
        return (sides[0] - 2 * sides[1] + sides[2]) / STEP**2

    def _recording(self, bands, at_work):
        """Rounding of a normal signal to digital numbers, which is a line and an uncorrelated remainder."""
        if "quantisation" not in at_work:
            return Recording()
        driver = self.driver
        _, values, rest = self.prepared.given(bands[0].footprints[0], bands)
        mean, covariance = (each[..., None] for each in moments(values, rest, self.prepared.node_shares))
        variance = np.diagonal(covariance[..., 0])[:, None]
        if "noise" in at_work:
            variance = variance + self.grains(mean)
            rest[[0, 1], [0, 1]] += self.grains(values)
        spread = np.sqrt(variance)
        signal = mean + spread * _SIGNALS
        counted = driver.planetary(driver.recorded(driver.radiance(signal[:, None])))[:, 0]
        if np.isnan(counted).any():
            raise ValueError("pixels are saturated: give method='simulate'")
        share = np.exp(-(_SIGNALS**2) / 2)
        share = share / share.sum()
        center = (counted @ share)[:, None]
        gain = ((counted * _SIGNALS) @ share)[:, None] / spread
        left = ((counted**2) @ share)[:, None] - center**2 - (gain * spread) ** 2
        return Recording(gain, center - gain * mean, left, self._shared_rounding(values, rest))

    def _shared_rounding(self, middle, covariance):
        """Covariance of the rounding errors of both bands, from the Fourier series of rounding."""
        white, (gain, offset, _) = self.white, self.driver.scale
        step = gain[:, None] / white
        fine = np.linspace(-4.5, 4.5, 1801)
        numbers = (white * middle - offset[:, None]) / gain[:, None]
        waves = [(k, sign * m) for k, m in product(range(1, _HARMONICS + 1), repeat=2) for sign in (-1, 1)]
        at_nodes = (covariance / (step * step.T)[..., None]).reshape(4, -1)
        waves = [wave for wave in waves if (_phase(wave) @ at_nodes).min() <= _SMOOTH]
        # Nodes of each stratum.
        both = [each.reshape(len(each), -1, FIELD_NODES.size) for each in (numbers, at_nodes)]
        numbers, spread = (CubicSpline(FIELD_NODES, each, axis=-1)(fine).reshape(len(each), -1) for each in both)
        share, found = np.multiply.outer(self.prepared.strata, np.exp(-(fine**2) / 2)).ravel(), 0.0
        for k, m in waves:
            wave = np.cos(2 * np.pi * (k * numbers[0] + m * numbers[1]))
            seen_wave = wave * np.exp(-2 * np.pi**2 * np.maximum(_phase((k, m)) @ spread, 0.0))
            found -= (-1) ** (k + m) / (2 * np.pi**2 * k * m) * (share @ seen_wave)
        return found / share.sum() * step[0, 0] * step[1, 0]

    def _footprints(self, blurred, displaced, even=False):
        """Footprints of the red and the near infrared band of a pixel in the middle, from the cells of the scene."""
        scene, setup = self.scene, self.scene.setup
        own = [setup.instrument.line_spreads(band) for band in self.driver.bands]
        spreads = own if blurred else [areas(scene.blocks)] * 2
        return footprints(spreads, scene.grid, scene.blocks, setup.offset if displaced else (0.0, 0.0), even)


def _phase(wave):
    """Factors of the four covariances of both bands in the variance of the phase of a wave."""
    return np.multiply.outer(wave, wave).ravel()


def _field(scenario):
    """Leaf area at the deviates of a field by stratum, shares of the strata, and the correlation of the field."""
    if scenario.learned:
        land, cell = learned_landscape(scenario.learned), scenario.grid.cell
        scores, strata = scores_of(land, DEVIATES, cell)
        return leaf_area(land, scores), strata, correlation_of_scores(land, cell)
    quantiles = quantile_table(lai_distribution(scenario.ground.distribution))
    return quantile_map(DEVIATES, quantiles)[None], (1.0,), correlation_of(scenario.ground.arp)


def footprints(spreads, cells, blocks, offset, even=False):
    """Footprint of the pixel in the middle of blocks for each pair of line spreads, displaced by pixels."""
    shifts = tuple(float(part * size) for part, size in zip(offset, grids.cell_size(blocks), strict=True))
    found = {}
    for pair in spreads:
        lines, first = [], []
        along = shared_operators(pair, cells, blocks, shifts)
        for axis, size, cell in zip(along, grids.cell_size(blocks), grids.cell_size(cells), strict=True):
            middle = len(axis) // 2
            line, start = axis.weights[middle][: axis.count[middle]], int(axis.start[middle])
            if even:
                line, start = _even(line, start, round(size / cell))
            lines.append(line / line.sum())
            first.append(start)
        found.setdefault(pair, Footprint(*lines, tuple(first)))
    return tuple(found[pair] for pair in spreads)


@dataclass(frozen=True, eq=False)
class IndexImage:
    """NDVI of pixels as functions of the means of properties of their cells, the last two of which are of the bands."""

    of: Covariances
    hazy: int
    bands: tuple[Pixel, Pixel]
    recording: Recording
    noisy: bool

    def reflectance(self, means):
        """Reflectance of both bands before recording."""
        return np.array([band.function(each[None]) for band, each in zip(self.bands, means[-2:], strict=True)])

    def recorded(self, means):
        """Recorded reflectance of both bands."""
        return self.recording.gain * self.reflectance(means) + self.recording.shift

    def ndvi(self, means):
        """NDVI of the recorded reflectance."""
        return self.of.driver.ndvi(self.recorded(means), linear=True)

    def plus_cells(self, means):
        """Mean NDVI of the cells, the first of the means, and the change of NDVI by recording."""
        return self.ndvi(means) + means[0] - self.of.driver.ndvi(self.reflectance(means), linear=True)

    def plus_tangent(self, means):
        """As `plus_cells` to second order for cells along a tangent, from their mean square, the first of the means."""
        return self.ndvi(means) + 0.5 * self.of.curvatures[self.hazy](means[1:]) * (means[0] - means[1] ** 2)

    def noise(self, means):
        """Variances of NDVI by rounding and by noise in red and near infrared."""
        red, nir = self.recorded(means)
        own, weights = self.recording, 4 * np.stack([nir, red]) ** 2 / (nir + red) ** 4
        grains = self.of.grains(self.reflectance(means)) if self.noisy else np.zeros((2, 1))
        rounding = (weights * own.rest).sum(axis=0) - 8 * red * nir * own.shared / (nir + red) ** 4
        return np.stack([rounding, *(weights * own.gain**2 * grains)])


def _even(line, start, cells):
    """Weights with their mean in each pixel of a number of cells, and the first cell."""
    before = start % cells
    after = -(before + len(line)) % cells
    padded = np.pad(line, (before, after)).reshape(-1, cells)
    return np.repeat(padded.mean(axis=1), cells), start - before


# Largest scatter by digital numbers alone, beyond which they are no small errors of a normal signal.
_LARGEST_ROUNDING = 0.1


def scatters(scenario):
    """Stages of a complete scenario, the scatter of each variable for all sets of them, and over uniform pixels."""
    reasons, ratio = obstacles(scenario), scenario.sensor.size / scenario.grid.cell
    if abs(ratio - round(ratio)) > 1e-6:
        reasons.append(f"a pixel has {ratio:.4g} cells along an edge: give a grid.cell that divides sensor.pixel")
    if reasons:
        raise ValueError(f"method='analytic' does not hold: {'; '.join(reasons)}. Or give method='simulate'")
    covariances = Covariances(scenario)
    stages = covariances.stages
    if "quantisation" in stages:
        rounding = covariances.lines({"quantisation"})[0].scatter - covariances.lines(set())[0].scatter
        if rounding > _LARGEST_ROUNDING:
            raise ValueError(
                f"method='analytic' does not hold: digital numbers alone give a scatter of {rounding:.2g}, at most "
                f"{_LARGEST_ROUNDING} is allowed: give method='simulate'"
            )
    found = np.empty((len(VARIABLES), *(2,) * len(stages)))
    for state in product((0, 1), repeat=len(stages)):
        at_work = {stage for stage, active in zip(stages, state, strict=True) if active}
        found[:, *state] = [line.scatter for line in covariances.lines(at_work)]
    uniform = [line.scatter for line in covariances.uniform_lines()]
    return stages, dict(zip(VARIABLES, found, strict=True)), dict(zip(VARIABLES, uniform, strict=True))
