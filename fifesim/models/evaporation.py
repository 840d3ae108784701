"""
Evapotranspiration: conductance of a canopy, Penman-Monteith, PT-JPL, and the reference of FAO-56.

Arguments outside their possible range raise ValueError; NaN passes.
"""

from typing import NamedTuple

import numpy as np

from fifesim.models.production import TMIN_RAMP, VPD_RAMP, ramp
from fifesim.models.weather import in_range

STEFAN_BOLTZMANN = 5.67e-8  # [W m-2 K-4]
PRIESTLEY_TAYLOR = 1.26  # [1]
HEAT_CAPACITY = 1013.0  # of air at constant pressure [J kg-1 K-1], value of MOD16
WATER_PER_AIR = 0.622  # ratio of the molecular masses of water and dry air [1]


@in_range
def latent_heat(ta_k):
    """Latent heat of vaporization of water at a temperature in K, [Allen1998]_, Eq. 3-1. [J kg-1]"""
    return 2.501e6 - 2361 * (np.asarray(ta_k, float) - 273.15)


@in_range
def saturation_pressure(ta_k):
    """Saturation vapour pressure over water [Pa] and its slope [Pa K-1] by temperature [K], as rounded in [Mu2011]_."""
    tc = np.asarray(ta_k, float) - 273.15
    pressure = 610.8 * np.exp(17.27 * tc / (tc + 237.3))
    return pressure, 17.38 * 239 * pressure / (239 + tc) ** 2


class PenmanMonteith(NamedTuple):
    """Latent heat of a canopy and the terms that lead to it."""

    vpd_pa: np.ndarray
    """Vapour pressure deficit. [Pa]"""
    slope_pa_k: np.ndarray
    """Slope of the saturation pressure. [Pa K-1]"""
    gamma_pa_k: np.ndarray
    """Psychrometric constant. [Pa K-1]"""
    air_density: np.ndarray
    """[kg m-3]"""
    latent_heat: np.ndarray
    """[J kg-1]"""
    f_wet: np.ndarray
    """Wet share of the canopy. [1]"""
    r_aerodynamic: np.ndarray
    """Resistance to heat by convection and radiation. [s m-1]"""
    g_stomata: np.ndarray
    """Conductance of the stomata per leaf area. [m s-1]"""
    r_canopy: np.ndarray
    """Resistance of the dry canopy to water vapour, infinite without leaves. [s m-1]"""
    le: np.ndarray
    """Transpiration of the dry part of the canopy. [W m-2]"""


@in_range
def penman_monteith(
    ta_k, rh_percent, pressure_pa, lai, fpar, rn, tmin_k, stomata=0.0055, cuticle=1e-5, boundary=0.02,
    tmin_ramp=TMIN_RAMP, vpd_ramp=VPD_RAMP,
):  # fmt: skip
    r"""
    Transpiration of a canopy by the equation of Penman and Monteith, after MOD16.

    .. math::

        \lambda E = (1 - f_w) \, \frac{s \, \mathrm{FPAR} \, R_n + c_p \rho \, \mathrm{FPAR} \, D / r_a}
            {s + \gamma \, (1 + r_s / r_a)}

    Parameters
    ----------
    ta_k : array
        Air temperature. [K]
    rh_percent : array
        Relative humidity. [%]
    pressure_pa : array
        [Pa]
    lai : array
        NaN gives NaN. [m2 m-2]
    fpar : array
        Share of the available energy that the canopy takes. [1]
    rn : array
        Net radiation, :math:`R_n`. [W m-2]
    tmin_k : array
        Lowest air temperature of the day. [K]
    stomata, cuticle, boundary : float, optional
        Conductance per leaf area of open stomata, cuticle and leaf boundary layer, by default of grassland in
        collection 5.1. [m s-1]
    tmin_ramp, vpd_ramp : (float, float), optional
        Temperatures with closed and open stomata [degC], and deficits with open and closed stomata [Pa].

    Returns
    -------
    canopy : PenmanMonteith

    Notes
    -----
    Only the conductance of the boundary layer rises with leaf area, as in the package mod16 1.1.0. [Mu2011]_ also
    multiplies the conductance of stomata and cuticle by leaf area: with `fife_weather`, and FPAR by Beer's law, this
    gives 1.7 times as much transpiration at LAI 3, and 2.0 times at LAI 5.

    References
    ----------
    [Mu2011]_
    """
    ta_k, humidity = np.asarray(ta_k, float), np.asarray(rh_percent, float) / 100
    lai, fpar, tc = np.asarray(lai, float), np.asarray(fpar, float), np.asarray(ta_k, float) - 273.15
    saturated, slope = saturation_pressure(ta_k)
    deficit, heat = saturated * (1 - humidity), latent_heat(ta_k)
    gamma = HEAT_CAPACITY * pressure_pa / (WATER_PER_AIR * heat)
    density = (0.348444 * pressure_pa / 100 - 100 * humidity * (0.00252 * tc - 0.020582)) / ta_k
    squared = humidity * humidity  # the power of 4 takes ten times as long
    wet = np.where(humidity >= 0.7, squared * squared, 0 * humidity)
    warm = np.sqrt(ta_k / 293.15)
    to_standard = pressure_pa / 101300 / (ta_k / 293.15 * warm * np.sqrt(warm))  # the power is 1.75
    open_share = ramp(np.asarray(tmin_k, float) - 273.15, *tmin_ramp) * (1 - ramp(deficit, *vpd_ramp))
    g_stomata = stomata * to_standard * open_share
    leaf, layer = g_stomata + cuticle * to_standard, boundary * lai * (1 - wet)
    # Per ground area; without leaves the conductance is 0.
    r_canopy = np.divide(layer + leaf, layer * leaf, out=np.full(np.broadcast(layer, leaf).shape, np.inf),
                         where=layer * leaf != 0)  # fmt: skip
    g_air = boundary + 4 * STEFAN_BOLTZMANN * ta_k * ta_k * ta_k / (HEAT_CAPACITY * density)
    energy = slope * fpar * rn + HEAT_CAPACITY * density * fpar * deficit * g_air
    le = (1 - wet) * energy / (slope + gamma * (1 + r_canopy * g_air))
    return PenmanMonteith(deficit, slope, gamma, density, heat, wet, 1 / g_air, g_stomata, r_canopy, le)


class PtJpl(NamedTuple):
    """Latent heat of canopy, soil and interception, and the factors that limit each."""

    f_wet: np.ndarray
    f_green: np.ndarray
    f_temperature: np.ndarray
    f_moisture: np.ndarray
    f_soil: np.ndarray
    gamma_pa_k: np.ndarray
    """Psychrometric constant. [Pa K-1]"""
    weight_saturated: np.ndarray
    """s / (s + gamma) with the slope s of saturated air. [1]"""
    le_canopy: np.ndarray
    le_soil: np.ndarray
    le_interception: np.ndarray
    le: np.ndarray
    """All three. [W m-2]"""


# Gas constants of dry air and water vapour [J kg-1 K-1] and the heat capacities that follow, of the IFS of ECMWF
# (documentation, part IV, chapter 12), as is its formula of the saturation pressure.
_DRY, _VAPOUR = 287.0597, 461.525


@in_range
def pt_jpl(ta_k, rh_percent, pressure_pa, ndvi, fapar_max, lai, rn, g):
    r"""
    Evapotranspiration by the equation of Priestley and Taylor with the limits of PT-JPL, in its arid form.

    .. math::

        \lambda E = \alpha \, \frac{s}{s + \gamma} \left[ (1 - f_w) f_g f_T f_M R_c
            + (f_w + f_s (1 - f_w)) (R_s - G) + f_w R_c \right], \qquad R_s = R_n \, e^{-0.6 \, \mathrm{LAI}}

    Parameters
    ----------
    ta_k : array
        Air temperature. [K]
    rh_percent : array
        Relative humidity. [%]
    pressure_pa : array
        [Pa]
    ndvi : array
        Above 0.05. [1]
    fapar_max : array
        Largest FPAR of the year in the pixel. [1]
    lai : array
        NaN gives NaN. [m2 m-2]
    rn, g : array
        Net radiation, and heat flux into the ground. [W m-2]

    Returns
    -------
    fluxes : PtJpl

    Notes
    -----
    FPAR is (NDVI - 0.17) / 0.8 and intercepted light is NDVI - 0.05.

    References
    ----------
    [Fisher2008]_; [Aragon2018]_
    """
    ta_k, humidity = np.asarray(ta_k, float), np.asarray(rh_percent, float) / 100
    saturated = 611.21 * np.exp(17.502 * (ta_k - 273.16) / (ta_k - 32.19))
    slope = saturated * 17.502 * (273.16 - 32.19) / (ta_k - 32.19) ** 2
    vapour = humidity * saturated
    specific = _DRY * vapour / (_VAPOUR * (pressure_pa - vapour) + _DRY * vapour)
    heat_capacity = 3.5 * _DRY * (1 - specific) + 4 * _VAPOUR * specific
    gamma = heat_capacity * pressure_pa * _VAPOUR / (_DRY * latent_heat(ta_k))
    fapar = np.maximum((np.asarray(ndvi, float) - 0.17) / 0.8, 0.0)
    green = np.clip(fapar / (np.asarray(ndvi, float) - 0.05), 0.0, 1.0)
    moisture = np.clip(fapar / fapar_max, 0.0, 1.0)
    warmth = 1 / (1 + np.exp(0.2 * (12 - (ta_k - 273.15))))
    squared, dry_soil = humidity * humidity, humidity ** ((saturated - vapour) / 1000)
    wet = squared * squared
    soil = rn * np.exp(-0.6 * np.asarray(lai, float))
    leaves, weight = rn - soil, slope / (slope + gamma)
    alpha = PRIESTLEY_TAYLOR * weight
    le_canopy = alpha * (1 - wet) * green * warmth * moisture * leaves
    le_soil = alpha * (wet + dry_soil * (1 - wet)) * (soil - g)
    le_wet = alpha * wet * leaves
    return PtJpl(wet, green, warmth, moisture, dry_soil, gamma, weight, le_canopy, le_soil, le_wet,
                 le_canopy + le_soil + le_wet)  # fmt: skip


@in_range
def reference_evapotranspiration(tmin, tmax, ea_kpa, rs_mj, u2, elevation, latitude, day_of_year, wind_height=2.0):
    r"""
    Reference evapotranspiration of short grass in a day, after FAO-56 and ASCE.

    .. math::

        ET_0 = \frac{0.408 \, \Delta \, R_n + \gamma \, \frac{900}{T + 273} \, u_2 \, (e_s - e_a)}
            {\Delta + \gamma \, (1 + 0.34 \, u_2)}

    Parameters
    ----------
    tmin, tmax : array
        Lowest and highest air temperature of the day. [degC]
    ea_kpa : array
        Vapour pressure. [kPa]
    rs_mj : array
        Incoming shortwave radiation. [MJ m-2 d-1]
    u2 : array
        Wind at ``wind_height``. [m s-1]
    elevation : array
        [m]
    latitude : array
        [degree]
    day_of_year : array
        1 on the first of January.
    wind_height : float, optional
        [m]

    Returns
    -------
    et : array, shape of the broadcast inputs
        [mm d-1]

    Notes
    -----
    The constants are from ASCE and differ from FAO-56 in the last printed digit. The logarithmic profile, Eq. 47 of
    FAO-56, is applied at any height; at 2 m its rounded constants give a factor of 1.0004.

    References
    ----------
    [Allen1998]_, Eqs. 6 and 47; [ASCE2005]_
    """
    tmin, tmax = np.asarray(tmin, float), np.asarray(tmax, float)
    u2 = np.asarray(u2, float) * 4.87 / np.log(67.8 * wind_height - 5.42)
    mean = (tmin + tmax) / 2
    pressure = 101.3 * ((293 - 0.0065 * np.asarray(elevation, float)) / 293) ** 5.26
    gamma = 0.000665 * pressure
    rise = np.exp(17.27 * mean / (mean + 237.3))
    slope = 2503 * rise / (mean + 237.3) ** 2
    saturated = sum(0.6108 * np.exp(17.27 * each / (each + 237.3)) for each in (tmin, tmax)) / 2
    clear = (0.75 + 2e-5 * np.asarray(elevation, float)) * _extraterrestrial(latitude, day_of_year)
    clearness = np.divide(rs_mj, clear, out=np.ones(np.broadcast(rs_mj, clear).shape), where=clear != 0)
    cloud = 1.35 * np.clip(clearness, 0.3, 1.0) - 0.35
    emitted = 4.901e-9 * ((tmax + 273.16) ** 4 + (tmin + 273.16) ** 4) / 2
    net = 0.77 * np.asarray(rs_mj, float) - emitted * cloud * (0.34 - 0.14 * np.sqrt(ea_kpa))
    deficit = np.maximum(saturated - ea_kpa, 0.0)
    wind = gamma * 900 / (mean + 273) * u2 * deficit
    return (0.408 * slope * net + wind) / (slope + gamma * (1 + 0.34 * u2))


def _extraterrestrial(latitude, day_of_year):
    """Solar radiation of a day at the top of the atmosphere [MJ m-2 d-1], [Allen1998]_, Eq. 21."""
    phi, angle = np.radians(latitude), 2 * np.pi / 365 * np.asarray(day_of_year, float)
    declination = 0.409 * np.sin(angle - 1.39)
    sunset = np.arccos(np.clip(-np.tan(phi) * np.tan(declination), -1, 1))
    height = sunset * np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.sin(sunset)
    return 24 / np.pi * 4.92 * (1 + 0.033 * np.cos(angle)) * height
