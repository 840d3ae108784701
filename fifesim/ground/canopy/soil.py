"""Soil below a canopy: brightness along the soil line, and darkening by water."""

from typing import NamedTuple

import numpy as np

from fifesim.base import files
from fifesim.base.arrays import compiled, jitable, read_only
from fifesim.base.caches import cached
from fifesim.ground.canopy.leaf_area import outside, within
from fifesim.ground.canopy.prospect import interface_transmissivity
from fifesim.ground.canopy.spectra import band_means

# Reference wavelength of the soil brightness, in the middle of visible light as for aerosol and visibility. [um]
GREEN_WAVELENGTH = 0.55

# Cells that are done together, so that they stay in the nearest cache, and in the next.
_RUN, _AT_ONCE = 256, 2**14


def soil_line(bands):
    r"""
    Change of the reflectance of bands along the soil line, for a change of brightness.

    .. math:: s_b = \frac{d_b}{d(0.55 \, \mathrm{\mu m})}, \quad d = r_\mathrm{dry} - r_\mathrm{wet}

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band

    Returns
    -------
    slope : array, shape (band,)
        [1]

    Notes
    -----
    The line leads through the two soils of ``data/ground_spectra.csv``: TM4 changes by 1.20 where TM3 changes by 1.

    References
    ----------
    [Baret1993]_ for soil lines of many bands
    """
    table = files.table("ground_spectra.csv")
    wavelength, change = (each.to_numpy() for each in (table["wavelength"], table["soil_dry"] - table["soil_wet"]))
    check_soil_bands(bands, wavelength)
    return band_means(bands, wavelength, change) / np.interp(GREEN_WAVELENGTH, wavelength, change)


def brightened(reflectance, brightness, line):
    """Reflectance of a brighter or darker soil along the soil line, clipped to 0 to 1, shape (..., band). [1]"""
    return in_cells(_brighten, reflectance, brightness, np.asarray(line, float), check=check_brightness)


def in_cells(kernel, reflectance, change, *parameters, check):
    """Apply a kernel to reflectance and one number for each cell, shape (..., band), with bands first in memory."""
    reflectance, change = np.atleast_1d(np.asarray(reflectance, float)), np.asarray(change, float)
    shape = np.broadcast_shapes(reflectance.shape[:-1], change.shape)
    cells = change if change.shape == shape else np.broadcast_to(change, shape)
    bands = reflectance.shape[-1]
    if reflectance.ndim > 1:
        below = np.broadcast_to(np.moveaxis(reflectance, -1, 0), (bands, *shape)).reshape(bands, -1)
    else:
        below = reflectance[:, None]
    out = np.empty((bands, cells.size))
    if kernel(read_only(below), read_only(cells).reshape(-1), *parameters, out):
        check(change)
    return np.moveaxis(out.reshape(bands, *shape), 0, -1)


@compiled
def _brighten(reflectance, brightness, line, out):
    """Fill in the brightened reflectance, shape (band, n); return the number of impossible changes."""
    step, wrong = int(reflectance.shape[1] > 1), 0
    for first in range(0, brightness.size, _AT_ONCE):
        change = brightness[first : first + _AT_ONCE]
        wrong += outside(change, -1.0, 1.0)
        for band in range(out.shape[0]):
            before, after = reflectance[band, step * first :], out[band, first:]
            for i in range(change.size):
                value = before[step * i] + change[i] * line[band]
                # NaN is neither.
                after[i] = 0.0 if value < 0.0 else 1.0 if value > 1.0 else value
    return wrong


def check_brightness(brightness):
    """Raise ValueError for an impossible change of reflectance, or return it; NaN passes."""
    check_span(brightness, -1.0, "soil is a change of reflectance along the soil line", "soil=0.04, not percent")
    return brightness


def check_span(values, lowest, meaning, such_as):
    """Raise ValueError for values below the lowest or above 1; NaN passes."""
    values = np.asarray(values, float)
    if not within(values, lowest, 1.0):
        name = meaning.partition(" ")[0]
        wrong = np.nanmin(values) if np.nanmin(values) < lowest else np.nanmax(values)
        raise ValueError(f"{name} must be in [{lowest:g}, 1], got {wrong:g}: {meaning}; give for instance {such_as}")


def check_soil_bands(bands, wavelength):
    """Raise ValueError for bands beyond the spectra of soils."""
    for band in bands:
        if band.limits[0] < wavelength[0] or band.limits[1] > wavelength[-1]:
            raise ValueError(
                f"no soil line for band {band.name}, {band.limits[0]:g} to {band.limits[1]:g} um: its spectra have "
                f"{wavelength[0]:g} to {wavelength[-1]:g} um; give bands= without it, or soil as background= by cell"
            )


# Constants of the brightness-shape-moisture model, Yang et al. (2020): water content of the driest and the wettest
# valid soil and of the first film [% of volume]; thickness of a film [cm]; refractive index of soil grains.
DRIEST, WETTEST = 5.0, 55.0
CAPACITY = 25.0
FILM = 0.015
SOIL_INDEX = 2.0

# Half opening of the cone from which light falls on a film, as on a leaf in PROSPECT. [degree]
_CONE = 40.0

# Films on average of a soil that is saturated.
_PER_MOISTURE = (WETTEST - DRIEST) / CAPACITY

# Less than 2 % of the wettest soil has more films; this part is treated as having this number.
_FILMS = 6


class WaterFilms(NamedTuple):
    """Optics of water films on a soil in bands."""

    surface: np.ndarray  # reflectance of the upper side of the water for light from the air, shape (band,). [1]
    inside: np.ndarray  # reflectance of the lower side for diffuse light from below, shape (band,). [1]
    entrance: np.ndarray  # light that enters the soil's grains from water over that from air, shape (band,). [1]
    passed: np.ndarray  # light that one to six films let pass down and up, shape (band, 6). [1]


@cached(64, "optics of water films")
def water_films(bands):
    """Optics of water films in bands."""
    water, absorbing = files.table("water_index.csv"), files.table("prospect_d.csv")
    wavelength, absorption = absorbing["wavelength"].to_numpy(), absorbing["water"].to_numpy()
    check_soil_bands(bands, wavelength)
    index = np.interp(wavelength, water["wavelength"], water["refractive_index"])
    upward = interface_transmissivity(index, 90.0) / index**2
    entrance = interface_transmissivity(SOIL_INDEX / index, 90.0) / interface_transmissivity(SOIL_INDEX, 90.0)
    deep = np.arange(1, _FILMS + 1)[:, None]
    spectra = [1 - interface_transmissivity(index, _CONE), 1 - upward, entrance, *np.exp(-2 * absorption * FILM * deep)]
    surface, inside, entrance, *passed = band_means(bands, wavelength, np.array(spectra))
    return WaterFilms(surface, inside, entrance, np.ascontiguousarray(np.transpose(passed)))


@jitable
def below_film(below, passed, inside):
    """Light below a water film after one passage, and the share not reflected back; their quotient is the sum. [1]"""
    up = passed * below
    return up, 1 - inside * up


@jitable
def grains_in_water(dry, entrance):
    r"""
    Reflectance of a soil with grains in water, which refracts light less than air does. [1] :math:`r_b = 1 - (1 - r) \,
    (r e + 1 - r)` with the reflectance r of the dry soil, and e the light that enters the grains from water over that
    from air, [Lekner1988]_.
    """
    return 1 - (1 - dry) * (dry * entrance + 1 - dry)


def moistened(dry, moisture, films):
    r"""
    Reflectance of a moist soil, in parts dry and in parts below one, two and more water films.

    .. math:: r = \sum_k \frac{\mu^k e^{-\mu}}{k!} \, r_k, \quad \mu = \frac{\theta - 5}{25}

    where :math:`r_0` is dry, and :math:`\theta` from 5 to 55 percent of the volume is a moisture of 0 to 1.

    Parameters
    ----------
    dry : array, shape (band,) or (..., band)
        Reflectance of the dry soil; NaN gives NaN. [1]
    moisture : array, shape (...)
        0 is dry and 1 saturated; NaN gives NaN. [1]
    films : WaterFilms

    Returns
    -------
    reflectance : array, shape (..., band)
        Equal to the dry soil to the bit at moisture 0. [1]

    Notes
    -----
    Absorption uses the mean transmittance of films over a band, in which the dry soil is taken as flat. The surface of
    the water reflects 2 %: a soil darker than 4 % becomes brighter. More than six films count as six.

    References
    ----------
    [Yang2020]_, after [Verhoef2018]_; [HaleQuerry1973]_ and [Feret2017]_ for water
    """
    return in_cells(_moisten, dry, moisture, *films, check=check_moisture)


def _moisten(dry, moisture, surface, inside, entrance, passed, out):
    wrong = 0
    for start in range(0, moisture.size, _AT_ONCE):
        bare = np.exp(moisture[start : start + _AT_ONCE] * -_PER_MOISTURE)
        wrong += _films(dry, moisture, start, bare, surface, inside, entrance, passed, out)
    return wrong


# No divisor is 0; without this check the loop is vectorized.
@compiled
def _films(dry, moisture, start, bare, surface, inside, entrance, passed, out):
    covered, by_cell, wrong = np.empty((_FILMS, _RUN)), dry.shape[1] > 1, 0
    for begin in range(0, bare.size, _RUN):
        free = bare[begin : begin + _RUN]
        run = slice(start + begin, start + begin + free.size)
        wrong += outside(moisture[run], 0.0, 1.0)
        _covered(moisture[run], free, covered)
        for band in range(out.shape[0]):
            soil, wet = dry[band, run] if by_cell else dry[band], out[band, run]
            above_all, back, entering = surface[band], inside[band], entrance[band]
            through = (1 - above_all) * (1 - back)
            for i in range(free.size):
                own = soil[i if by_cell else 0]
                below, above, under = grains_in_water(own, entering), 0.0, 1.0
                # The sum of the quotients of all films as one of two products: a division takes longer than the rest.
                for k in range(_FILMS):
                    up, kept = below_film(below, passed[band, k], back)
                    above = above * kept + covered[k, i] * up * under
                    under *= kept
                wet[i] = free[i] * own + (1 - free[i]) * above_all + through * above / under
    return wrong


@jitable
def _covered(moisture, bare, covered):
    """Shares of a soil below one water film, two and more."""
    for i in range(moisture.size):
        mean = moisture[i] * _PER_MOISTURE
        share, rest = bare[i], 1.0 - bare[i]
        for k in range(1, _FILMS):
            share *= mean * (1.0 / k)
            covered[k - 1, i] = share
            rest -= share
        covered[_FILMS - 1, i] = rest


def check_moisture(moisture):
    """Raise ValueError if a moisture is outside 0 to 1; NaN passes."""
    check_span(moisture, 0.0, "moisture is 0 where the soil is dry and 1 where it is saturated", "moisture=0.3")
