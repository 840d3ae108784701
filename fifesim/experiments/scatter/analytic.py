"""Scatter budget of a scenario without simulation, from the covariances of its pixels."""

from itertools import product

import numpy as np
from scipy.interpolate import CubicSpline

from fifesim.chain.driver import shared_operators
from fifesim.experiments.analytic import FIELD_NODES, Footprint, Pixel, coefficients, prepare, tangents_of
from fifesim.experiments.scatter.stages import STEP, VARIABLES, along_tangent, scene_of, working_stages
from fifesim.grids import grid as grids
from fifesim.grids.reductions import areas
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table
from fifesim.sensor.labels import noise_models
from fifesim.sensor.response.noise import radiance_std

# Harmonics of the series of rounding: the next ones have 1/50 of the first.
_HARMONICS = 6
# Variance of the phase beyond which a harmonic is below 1e-8. [turn2]
_SMOOTH = 1.0
_DEVIATES = np.linspace(-6.0, 6.0, 1201)


def obstacles(scenario):
    """Reasons for which the budget of a complete scenario needs simulation, each with what to give instead."""
    own, land, air = scenario.sensor, scenario.ground, scenario.atmosphere
    down, across = grids.cell_size(scenario.geobox())
    ratio = own.size / down
    found = {
        "ground.lai_file is a map: give ground.distribution and arp": bool(land.lai_file),
        "the landscape is learned: give landscape.learned = 'none'": bool(scenario.learned),
        "the ground has classes or other varying properties: give landscape.cover = 'none' without deviations": (
            not scenario.learned and not scenario.is_one()
        ),
        f"ground.arp is {land.arp:g}: give at most {LARGEST_STREAMING_ARP}": land.arp > LARGEST_STREAMING_ARP,
        "ground.method is 'periodic': give 'streaming'": land.method == "periodic",
        "the ground is not level: give terrain.dem = 'flat'": scenario.terrain.dem != "flat",
        "there are clouds: give clouds.cloud_cover = 0": scenario.clouds.cloud_cover > 0,
        "atmosphere.coupling is not 'lambert'": air.coupling != "lambert",
        "light comes from adjacent cells: give atmosphere.adjacency = false": bool(air.adjacency),
        "pixels drift along the grid: give sensor.interval = 'product'": own.interval not in ("product", own.size),
        f"a pixel has {ratio:.4g} cells along an edge: give a grid.cell that divides sensor.pixel": (
            abs(ratio - round(ratio)) > 1e-6 or down != across
        ),
    }
    return [reason for reason, holds in found.items() if holds]


class Covariances:
    """Prepared covariances of a scenario: the line of a truth on NDVI for any set of stages."""

    def __init__(self, scenario):
        self.stages, self.known = working_stages(scenario), {}
        self.scene = scene_of(scenario)
        self.driver, self.scenario = self.scene.driver, scenario
        self.table = quantile_table(lai_distribution(scenario.ground.distribution))
        setup, driver = self.scene.setup, self.driver
        self.noisy = (
            noise_models(driver.instrument, driver.bands, setup.noise, setup.noise_models) if setup.noise else []
        )
        self.areas = np.linspace(0.0, self.table[-1], 2001)
        self.mean = coefficients(self.leaf_area)[0]
        self.square = self._footprints(False, False)[0]
        self.seen = {state: self._footprints(*state) for state in product((False, True), repeat=2)}
        widest = max(len(line) for pair in self.seen.values() for each in pair for line in each[:2])
        self.prepared = prepare(
            scenario.ground.arp,
            {
                "lai": self.leaf_area,
                **{
                    f"tangent{hazy:d}": lambda z, hazy=hazy: self.along_tangent(self.leaf_area(z), hazy)
                    for hazy in (0, 1)
                },
                "fpar": lambda z: self.fpar(self.leaf_area(z)),
                **{
                    f"{name}{hazy:d}": lambda z, layer=layer, hazy=hazy: self.cells(self.leaf_area(z), hazy)[layer]
                    for layer, name in enumerate(("red", "nir", "ndvi"))
                    for hazy in (False, True)
                },
            },
            window=self.scene.grid.shape,
            widest=widest,
        )

    def leaf_area(self, z):
        """Leaf area of deviates of the field, shape as z."""
        return quantile_map(z, self.table)

    def fpar(self, lai):
        """FPAR of leaf area, shape as lai."""
        return self._interpolated(
            "fpar", lai, lambda area: self.driver.fpar(area, self.scenario.ground.fpar_inf)[None]
        )[0]

    def cells(self, lai, hazy):
        """Red and near infrared reflectance and NDVI of cells, shape (3, ...)."""
        return self._interpolated(
            f"cells{hazy:d}", lai, lambda area: self._seen(self.driver.reflectance(area[None]), hazy)[:, 0]
        )

    def _interpolated(self, name, lai, function):
        """Rows of a function of leaf area, interpolated between areas of a table, shape (row, ...)."""
        if name not in self.known:
            self.known[name] = function(self.areas)
        return np.array([np.interp(lai, self.areas, row) for row in self.known[name]])

    def along_tangent(self, lai, hazy, middle=None):
        """NDVI of cells whose reflectance is linear in leaf area, along the tangent at a middle or the field's mean."""
        area = np.atleast_2d(lai)
        at = np.full_like(area, self.mean) if middle is None else np.atleast_2d(np.clip(middle, 0.0, self.table[-1]))
        return self._seen(along_tangent(self.driver.reflectance, area, at), hazy)[2].reshape(np.shape(lai))

    def _of_tangent(self, mean, area, hazy):
        """Mean NDVI of cells along the tangent at their mean area less NDVI there, from that along one tangent."""

        def both(area):
            def curvature(middle):
                sides = [self.along_tangent(area + step, hazy, middle) for step in (-STEP, 0.0, STEP)]
                return sides[0] - 2 * sides[1] + sides[2]

            return np.array([self.along_tangent(area, hazy), curvature(area) / curvature(None)])

        along, ratio = self._interpolated(f"tangent{hazy:d}", area, both)
        return (mean - along) * ratio

    def _seen(self, reflectance, hazy):
        seen = self.driver.toa(reflectance) if hazy else reflectance
        return np.concatenate([seen, self.driver.ndvi(seen, linear=True)[None]])

    def line(self, variable, at_work):
        """Regression of a variable on NDVI with some stages active."""
        hazy, curved = "atmosphere" in at_work, "non-linearity" in at_work
        seen = self.seen["point spread" in at_work, "registration" in at_work]
        if curved:
            truth = Pixel((variable,), (self.square,), lambda means: means[0])
        else:
            truth = self._of_leaf_area(variable, self.square)
        return self.prepared.regression(truth, self._image(seen, at_work, hazy, curved))

    def uniform_line(self, variable):
        """Regression with all stages active over ground that is uniform within each pixel."""
        at_work = set(self.stages)
        seen = self._footprints("point spread" in at_work, "registration" in at_work, even=True)
        truth = self._of_leaf_area(variable, self.square)
        return self.prepared.regression(truth, self._image(seen, at_work, "atmosphere" in at_work, False, even=True))

    def _of_leaf_area(self, variable, footprint):
        function = {"lai": lambda means: means[0], "fpar": lambda means: self.fpar(means)[0]}[variable]
        return Pixel(("lai",), (footprint,), function)

    def _image(self, seen, at_work, hazy, curved, even=False):
        """NDVI of pixels, from the reflectance of their cells or from that of the mean leaf area of each footprint."""
        scaled = "NDVI scaling" not in at_work and not even
        names = (f"red{hazy:d}", f"nir{hazy:d}") if curved else ("lai", "lai")

        def bands(means):
            own = means[scaled:]
            return (
                np.asarray(own)
                if curved
                else np.array([self.cells(area, hazy)[layer] for layer, area in enumerate(own)])
            )

        # Footprints are kept too, so that their ids stay theirs.
        key = names, id(seen), hazy, "quantisation" in at_work, "noise" in at_work
        if key not in self.known:
            self.known[key] = (
                self._recorded(names, seen, lambda means: bands([0.0, *means] if scaled else means), at_work),
                seen,
            )
        gain, shift, noise, shared = self.known[key][0]

        def recorded(means):
            return gain * bands(means) + shift

        def value(means):
            found = self.driver.ndvi(recorded(means), linear=True)
            if not scaled:
                return found
            if curved:
                return found + means[0] - self.driver.ndvi(bands(means), linear=True)
            return found + self._of_tangent(means[0], means[1], hazy)

        def variance(means):
            red, nir = recorded(means)
            of_red, of_nir = noise(bands(means))
            return 4 * (nir**2 * of_red + red**2 * of_nir - 2 * red * nir * shared) / (nir + red) ** 4

        if scaled:
            names, seen = (f"{'ndvi' if curved else 'tangent'}{hazy:d}", *names), (seen[0], *seen)
        return Pixel(names, seen, value, variance)

    def _recorded(self, names, seen, bands, at_work):
        """
        Gain, shift, shape (2, 1), variance of the recorded reflectance of each band, a function of reflectance, and the
        covariance of both.

        Rounding to digital numbers of a normal signal is a line and an uncorrelated remainder.
        """
        driver, of_truth = self.driver, self._of_leaf_area("lai", self.square)
        white = driver.radiance(np.ones((2, 1, 1)))[:, 0]

        def grains(means):
            if "noise" not in at_work:
                return np.zeros_like(means)
            radiance = white * means
            return (
                np.array([radiance_std(each, *own) ** 2 for each, own in zip(radiance, self.noisy, strict=True)])
                / white**2
            )

        if "quantisation" not in at_work:
            return 1.0, 0.0, grains, 0.0
        lines = [
            self.prepared.regression(of_truth, Pixel(names, seen, lambda means, k=k: bands(means)[k])) for k in (0, 1)
        ]
        mean = np.array([[line.image_mean] for line in lines])
        spread = np.sqrt(np.array([[line.image_variance] for line in lines]) + grains(mean))
        signal = mean + spread * _DEVIATES
        counted = driver.planetary(driver.recorded(driver.radiance(signal[:, None])))[:, 0]
        if np.isnan(counted).any():
            raise ValueError("pixels are saturated: give method='simulate'")
        share = np.exp(-(_DEVIATES**2) / 2)
        share = share / share.sum()
        center = counted @ share
        gain = ((counted * _DEVIATES) @ share / spread[:, 0])[:, None]
        rest = ((counted**2) @ share - center**2)[:, None] - (gain * spread) ** 2
        shared = self._shared_rounding(names, seen, bands, grains)
        return gain, center[:, None] - gain * mean, lambda means: gain**2 * grains(means) + rest, shared

    def _shared_rounding(self, names, seen, bands, grains):
        """Covariance of the rounding errors of both bands, from the Fourier series of rounding."""
        driver, (gain, offset, _) = self.driver, self.driver.scale
        white = driver.radiance(np.ones((2, 1, 1)))[:, 0]
        means, rest = self.prepared.split(names, seen)
        steps = np.sqrt(np.maximum(np.diag(rest), 0.0)) / 3 + 1e-4 * np.abs(means).max(axis=1)
        slopes = np.array([tangents_of(lambda m, k=k: bands(m)[k], means, steps) for k in (0, 1)])
        covariance = np.einsum("piz,qjz,ij->pqz", slopes, slopes, rest)
        middle = bands(means)
        covariance[[0, 1], [0, 1]] += grains(middle)
        step = gain[:, None] / white
        fine = np.linspace(-4.5, 4.5, 1801)
        numbers = CubicSpline(FIELD_NODES, (white * middle - offset[:, None]) / gain[:, None], axis=1)(fine)
        spread = CubicSpline(FIELD_NODES, covariance / (step * step.T)[..., None], axis=2)(fine)
        share, found = np.exp(-(fine**2) / 2), 0.0
        for k, m in product(range(1, _HARMONICS + 1), repeat=2):
            for sign in (-1, 1):
                power = k**2 * spread[0, 0] + m**2 * spread[1, 1] + 2 * sign * k * m * spread[0, 1]
                if power.min() > _SMOOTH:
                    continue
                wave = np.cos(2 * np.pi * (k * numbers[0] + sign * m * numbers[1]))
                seen_wave = wave * np.exp(-2 * np.pi**2 * np.maximum(power, 0.0))
                found -= sign * (-1) ** (k + m) / (2 * np.pi**2 * k * m) * (share @ seen_wave)
        return found / share.sum() * step[0, 0] * step[1, 0]

    def _footprints(self, blurred, displaced, even=False):
        """Footprints of the red and the near infrared band of a pixel in the middle, from the cells of the scene."""
        scene, setup = self.scene, self.scene.setup
        size = grids.cell_size(scene.blocks)
        shifts = tuple(offset * each for offset, each in zip(setup.offset, size, strict=True))
        found = []
        for band in self.driver.bands:
            spreads = setup.instrument.line_spreads(band) if blurred else areas(scene.blocks)
            along = shared_operators(
                spreads, scene.grid, scene.blocks, tuple(map(float, shifts)) if displaced else (0.0, 0.0)
            )
            lines, first = [], []
            for axis, each in zip(along, size, strict=True):
                middle = len(axis) // 2
                line, start = axis.weights[middle][: axis.count[middle]], int(axis.start[middle])
                if even:
                    cells = round(each / grids.cell_size(scene.grid)[0])
                    line, start = _even(line, start, cells)
                lines.append(line / line.sum())
                first.append(start)
            found.append(Footprint(*lines, tuple(first)))
        return tuple(found)


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
    if reasons := obstacles(scenario):
        raise ValueError(f"method='analytic' does not hold: {'; '.join(reasons)}. Or give method='simulate'")
    covariances = Covariances(scenario)
    stages = covariances.stages
    if "quantisation" in stages:
        rounding = covariances.line("lai", {"quantisation"}).scatter - covariances.line("lai", set()).scatter
        if rounding > _LARGEST_ROUNDING:
            raise ValueError(
                f"method='analytic' does not hold: digital numbers alone give a scatter of {rounding:.2g}, at most "
                f"{_LARGEST_ROUNDING} is allowed: give method='simulate'"
            )
    found = {name: np.empty((2,) * len(stages)) for name in VARIABLES}
    for variable, values in found.items():
        for state in np.ndindex(values.shape):
            at_work = {stage for stage, active in zip(stages, state, strict=True) if active}
            values[state] = covariances.line(variable, at_work).scatter
    return stages, found, {name: covariances.uniform_line(name).scatter for name in VARIABLES}
