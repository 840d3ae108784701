"""Noise of a detector: shot, thermal and fixed pattern, drawn by scan line from counters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self, TypeAlias

import numpy as np

from fifesim.base.arguments import MAPPING, Kind, Names, Numbers, Range, check_fields
from fifesim.base.lattice import generator

# Kinds of noise that can be requested by name.
KINDS = ("shot", "thermal", "fixed-pattern")

# Requests every kind that the noise model of a band has.
ALL = "all"

# Pixels of a scan line that are drawn together; a line's place in the counter is (0, 0, tile, line).
_TILE = 1024

# Separates the random streams from a landscape with the same seed.
_SENSOR = 2**40


_RADIANCE = Range("W m-2 sr-1 um-1", 0, np.inf, ends="[)")


@dataclass(frozen=True)
class NoiseModel:
    r"""
    Noise of one band.

    .. math:: \sigma^2(L) = \sigma_0^2 + b \, \max(L, 0)

    Thermal (read) noise is the first term, shot noise the second. Fixed pattern is a spread of gain and offset among
    the detectors, which stays from line to line.

    Parameters
    ----------
    thermal : float
        Standard deviation of the constant part, :math:`\sigma_0`. [W m-2 sr-1 um-1]
    shot : float
        Variance of the shot noise at a radiance of 1, b. [W m-2 sr-1 um-1]
    detectors : int, optional
        Number of detectors of the band.
    gain_spread : float, optional
        Standard deviation of the detectors' relative gain. [1]
    offset_spread : float, optional
        Standard deviation of the detectors' offset. [W m-2 sr-1 um-1]
    along : "columns" or "rows", optional
        Pixels of a detector: rows for a scanner that sweeps across the track, where detectors alternate by scan line;
        columns for an array that moves along the track.

    Raises
    ------
    ValueError
        If a number is negative or there is no detector.

    Examples
    --------
    >>> from fifesim import NoiseModel
    >>> NoiseModel(thermal=0.1, shot=0.01).detectors
    1
    """

    thermal: Annotated[float, _RADIANCE]
    shot: Annotated[float, _RADIANCE]
    detectors: Annotated[int, Range("1", 1, np.inf)] = 1
    gain_spread: Annotated[
        float, Range("1", 0, np.inf, (0.0, 0.2), {"percent": 0.01}, "it is relative to the gain", "[)")
    ] = 0.0
    offset_spread: Annotated[float, _RADIANCE] = 0.0
    along: Literal["columns", "rows"] = "rows"

    def __post_init__(self):
        check_fields(self)

    @classmethod
    def from_snr(cls, radiance: Numbers, snr: Numbers, shot_share: float | None = None, **fixed_pattern: Any) -> Self:
        r"""
        The model that has published signal-to-noise ratios.

        Two points determine both terms. One point determines only their sum, and ``shot_share`` is the fraction of the
        variance that is shot noise; by default all of it, so that the ratio grows with the square root of the radiance.

        .. math:: b = s \, \frac{\sigma^2(L_1)}{L_1}, \quad \sigma_0^2 = (1 - s) \, \sigma^2(L_1),
            \qquad \sigma(L_1) = \frac{L_1}{\mathrm{SNR}_1}

        Parameters
        ----------
        radiance, snr : float, or sequence of two
            [W m-2 sr-1 um-1], [1]
        shot_share : float, optional
            In [0, 1], with one point only; 0 for noise that is the same at any radiance, by default 1. [1]
        **fixed_pattern
            ``detectors``, ``gain_spread``, ``offset_spread`` and ``along`` of the model.

        Returns
        -------
        model : NoiseModel

        Raises
        ------
        ValueError
            If the points are not positive, the share is superfluous or out of range, or two points need a negative
            variance.

        Examples
        --------
        >>> model = NoiseModel.from_snr([50.0, 200.0], [100.0, 250.0])
        >>> round(float(model.snr(50.0)), 9), round(float(model.snr(200.0)), 9)
        (100.0, 250.0)
        >>> [round(float(each)) for each in NoiseModel.from_snr(22.0, 230.0).snr([22.0, 88.0])]
        [230, 460]
        """
        radiance, snr = np.atleast_1d(radiance).astype(float), np.atleast_1d(snr).astype(float)
        if radiance.shape != snr.shape or radiance.size not in (1, 2) or not (min(radiance) > 0 and min(snr) > 0):
            raise ValueError(
                f"noise needs one or two points of positive radiance and snr, got {radiance.tolist()} "
                f"and {snr.tolist()}"
            )
        variance = (radiance / snr) ** 2
        if radiance.size == 1:
            shot_share = 1.0 if shot_share is None else shot_share
            if not 0 <= shot_share <= 1:
                raise ValueError(f"shot_share must be in [0, 1], got {shot_share}: it is a share of the variance")
            thermal, shot = (1 - shot_share) * variance[0], shot_share * variance[0] / radiance[0]
        else:
            if shot_share is not None:
                raise ValueError("shot_share belongs to one published snr; two decide it: leave it out")
            if radiance[0] == radiance[1]:
                raise ValueError(f"two points of noise need two radiances, got {radiance[0]:g} twice")
            shot = np.diff(variance)[0] / np.diff(radiance)[0]
            thermal = variance[0] - shot * radiance[0]
            if min(shot, thermal) < 0:
                raise ValueError(
                    f"snr {snr.tolist()} at {radiance.tolist()} W m-2 sr-1 um-1 need a negative variance of "
                    f"{'shot' if shot < 0 else 'thermal'} noise: give one of them, with a shot_share"
                )
        return cls(float(np.sqrt(thermal)), float(shot), **fixed_pattern)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of noise that are not zero, among "shot", "thermal" and "fixed-pattern"."""
        sizes = (self.shot, self.thermal, self.gain_spread + self.offset_spread)
        return tuple(kind for kind, size in zip(KINDS, sizes, strict=True) if size > 0)

    def noise_equivalent_radiance(self, radiance: Numbers, kinds: Names = ("shot", "thermal")) -> np.ndarray:
        """
        Standard deviation of the noise of a detector.

        Parameters
        ----------
        radiance : array
            [W m-2 sr-1 um-1]
        kinds : sequence of str, optional
            Among "shot" and "thermal"; others add nothing here.

        Returns
        -------
        nedl : array, shape of radiance
            [W m-2 sr-1 um-1]
        """
        radiance = np.asarray(radiance, float)
        constant = self.thermal**2 if "thermal" in kinds else 0.0
        return np.sqrt(constant + (self.shot if "shot" in kinds else 0.0) * np.maximum(radiance, 0.0))

    def snr(self, radiance: Numbers) -> np.ndarray:
        """
        Signal-to-noise ratio of a detector.

        Parameters
        ----------
        radiance : array
            [W m-2 sr-1 um-1]

        Returns
        -------
        snr : array, shape of radiance
            Infinite without noise. [1]
        """
        with np.errstate(divide="ignore"):
            return np.asarray(radiance, float) / self.noise_equivalent_radiance(radiance)


# One model for all bands, or by band.
NoiseModels: TypeAlias = Annotated[
    NoiseModel | Mapping[str, NoiseModel],
    Kind(
        "a fifesim.NoiseModel, or one for each band", lambda given: isinstance(given, NoiseModel) or MAPPING.fits(given)
    ),
]


def check_kinds(kinds):
    """Check the names of kinds of noise, and return a tuple."""
    kinds = (kinds,) if isinstance(kinds, str) else tuple(kinds)
    unknown = [str(kind) for kind in kinds if kind not in (*KINDS, ALL)]
    if unknown:
        raise ValueError(
            f"unknown noise {', '.join(unknown)}: there are {', '.join(KINDS)}, or {ALL!r} for all of them"
        )
    if ALL in kinds and len(kinds) > 1:
        raise ValueError(f"noise must be {ALL!r} alone or a list of kinds, got {', '.join(kinds)}")
    return kinds


def fixed_pattern(model, seed, band):
    """Gain [1] and offset [W m-2 sr-1 um-1] of each detector, shape (detectors,)."""
    # Apart from the lines: there, the second word of the counter is 0.
    drawn = _normals(seed, band, (0, 1, 0, 0), (2, model.detectors))
    return 1 + model.gain_spread * drawn[0], model.offset_spread * drawn[1]


def line_noise(seed, band, line, column, size, epoch=0):
    """Standard normal deviates of a part of a scan line, the same for each pixel in any part, shape (size,)."""
    first, last = column // _TILE, (column + size - 1) // _TILE
    # Skip 1, the stream of the fixed pattern.
    image = epoch + (epoch > 0)
    tiles = [_normals(seed, band, (0, image, tile, line), _TILE) for tile in range(first, last + 1)]
    start = column - first * _TILE
    return np.concatenate(tiles)[start : start + size]


def add_noise(radiance, model, kinds, *, seed, band, row=0, column=0, epoch=0):
    r"""
    Radiance measured by a noisy detector.

    .. math:: L' = g_d \, (L + \sigma(L) \, z) + o_d

    with z a standard normal deviate, and gain g and offset o of the pixel's detector d.

    Parameters
    ----------
    radiance : array, shape (y, x)
        [W m-2 sr-1 um-1]
    model : NoiseModel
    kinds : sequence of str
        Among `KINDS`.
    seed : int
    band : int
        Number of the band in its instrument.
    row, column : int, optional
        Place of the first pixel in the lattice of pixels, which decides noise and detectors.
    epoch : int, optional
        Which of several images of one place: 0, or a number of seconds. The fixed pattern stays.

    Returns
    -------
    radiance : array, shape (y, x)
        NaN where it was. [W m-2 sr-1 um-1]

    References
    ----------
    [Schowengerdt2007]_, section 3.2
    """
    radiance = np.asarray(radiance, float)
    out = radiance.copy()
    rows, columns = radiance.shape
    if "shot" in kinds or "thermal" in kinds:
        sigma = model.noise_equivalent_radiance(radiance, kinds)
        for i in range(rows):
            out[i] += sigma[i] * line_noise(seed, band, row + i, column, columns, epoch)
    if "fixed-pattern" in kinds:
        gain, offset = fixed_pattern(model, seed, band)
        place = row + np.arange(rows)[:, None] if model.along == "rows" else column + np.arange(columns)
        detector = place % model.detectors
        out = gain[detector] * out + offset[detector]
    return out


def radiance_std(radiance, model, kinds, step=0.0):
    r"""
    Standard deviation of a measured radiance over many images of one scene by other detectors.

    .. math:: s^2 = \sigma^2(L) + s_g^2 L^2 + s_o^2 + \frac{\Delta^2}{12}

    The terms are shot and thermal noise, the fixed pattern of gain and offset, and rounding to steps of
    :math:`\Delta`. Products of noise and gain are of second order, and are left out.

    Parameters
    ----------
    radiance : array
        [W m-2 sr-1 um-1]
    model : NoiseModel
    kinds : sequence of str
        Among `KINDS`.
    step : array, optional
        Radiance between digital numbers; 0 without digitising. [W m-2 sr-1 um-1]

    Returns
    -------
    std : array, shape of radiance
        NaN where the radiance is. [W m-2 sr-1 um-1]

    Notes
    -----
    Rounding is a uniform error if the other noise is larger than about half of a step.

    References
    ----------
    [Schowengerdt2007]_, section 3.2; [JCGM2008]_, 4.3.7 and 5.1.2
    """
    radiance = np.asarray(radiance, float)
    variance = model.noise_equivalent_radiance(radiance, kinds) ** 2 + np.asarray(step, float) ** 2 / 12
    if "fixed-pattern" in kinds:
        variance = variance + (model.gain_spread * radiance) ** 2 + model.offset_spread**2
    return np.sqrt(variance)


def _normals(seed, band, place, size):
    return generator(seed, _SENSOR + band, place).standard_normal(size)
