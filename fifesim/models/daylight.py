"""Sun of a day: its path over a place, and the light of each position by the atmosphere."""

from typing import NamedTuple

import numpy as np

from fifesim.base.caches import cached
from fifesim.base.messages import warn
from fifesim.chain.absorbed_light import par_at_ground

_OBLIQUITY = 23.45  # largest declination of the sun [degree]
# Gauss points between sunrise and sunset. Six are wrong by up to 1.3 % in photosynthesis and 2.3 % in biochemistry.
_COUNT = 16
_LOWEST = np.radians(89.9)  # of a sun at the horizon, where paths become infinite


class Suns(NamedTuple):
    """Positions of the sun in a day that has a length, with the weight and the light of each; none without a sun."""

    sza: tuple[float, ...] = ()
    """[degree]"""
    weight: tuple[float, ...] = ()
    """Share of the day [1]; for one instant the inverse of the day, which turns the sum of a day into a flux [s-1]."""
    light: tuple[float, ...] = ()
    """Photosynthetically active light on level ground over its mean between sunrise and sunset. [1]"""
    sky: tuple[float, ...] = ()
    """Diffuse fraction of this light under a clear sky. [1]"""
    mean_sky: float = 0.0
    """Diffuse fraction of the light of the day under a clear sky. [1]"""
    hours: float = 0.0
    """Time between sunrise and sunset. [h]"""

    def weighted(self, values):
        """Sum of values over the suns, weighted by time and light."""
        return sum(w * light * each for w, light, each in zip(self.weight, self.light, values, strict=True))

    def diffuse_fraction(self, number, of_day):
        """Diffuse fraction at a sun: in proportion to a clear sky, with the given mean of the day."""
        sky, mean = self.sky[number], self.mean_sky
        return np.where(of_day < mean, of_day * sky / mean, 1 - (1 - of_day) * (1 - sky) / (1 - mean))


def declination(sza, saa, latitude, name="the raster"):
    r"""
    Declination of a sun that stands over a latitude, at most that of the solstice, with a warning. [degree]
    :math:`\sin \delta = \sin \phi \cos \theta + \cos \phi \sin \theta \cos A`
    """
    theta, azimuth, phi = np.radians([sza, saa, latitude])
    sine = np.sin(phi) * np.cos(theta) + np.cos(phi) * np.sin(theta) * np.cos(azimuth)
    found = float(np.degrees(np.arcsin(np.clip(sine, -1, 1))))
    # The angles of an image are rounded, or means.
    if abs(found) > _OBLIQUITY + 1:
        warn(
            f"the sun never stands at sza {sza:g} and saa {saa:g} over latitude {latitude:.2f} of {name}: taking the "
            "day of the solstice; give the sun of a date, geometry=fifesim.sun_position(time, latitude, longitude)"
        )
    return float(np.clip(found, -_OBLIQUITY, _OBLIQUITY))


def half_day(latitude, declination):
    r"""Hour angle of sunset, :math:`\cos H = -\tan\phi\tan\delta`, 0 without sunrise and pi without sunset."""
    return float(np.arccos(np.clip(-np.tan(np.radians(latitude)) * np.tan(np.radians(declination)), -1, 1)))


@cached(64, "sun of a day")
def suns_of_day(atmosphere, latitude, declination):
    """Suns at the Gauss points between sunrise and sunset; morning and afternoon are alike, so that half are enough."""
    sunset = half_day(latitude, declination)
    if sunset == 0:
        return Suns()
    points, weights = (each[_COUNT // 2 :] for each in np.polynomial.legendre.leggauss(_COUNT))
    phi, delta = np.radians([latitude, declination])
    cosine = np.sin(phi) * np.sin(delta) + np.cos(phi) * np.cos(delta) * np.cos(sunset * points)
    sza = tuple(np.degrees(np.minimum(np.arccos(np.clip(cosine, -1, 1)), _LOWEST)).tolist())
    flux, sky = np.transpose([_light(atmosphere, each) for each in sza])
    mean = weights @ flux
    light, of_sky = (flux / mean).tolist(), float(weights @ (flux * sky) / mean)
    return Suns(sza, tuple(weights.tolist()), tuple(light), tuple(sky.tolist()), of_sky, 24 / np.pi * sunset)


def sun_at(day, atmosphere, sza):
    """One sun of a day, whose sum over a day is a flux; none below the horizon."""
    if not day.sza or sza >= 90:
        return Suns()
    sza = min(float(sza), float(np.degrees(_LOWEST)))
    flux, sky = _light(atmosphere, sza)
    # The first sun of the day has known light.
    light = flux / _light(atmosphere, day.sza[0])[0] * day.light[0]
    return day._replace(sza=(sza,), weight=(1 / (3600 * day.hours),), light=(light,), sky=(sky,))


def _light(atmosphere, sza):
    """Relative photosynthetically active light on level ground, and its diffuse fraction."""
    flux, sky = par_at_ground(atmosphere, sza)
    return np.cos(np.radians(sza)) * flux.sum(), float(flux @ sky / flux.sum())
