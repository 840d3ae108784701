"""
Gross primary production: light use efficiency, photosynthesis of a canopy, and the biochemistry of C3 and C4 leaves.

Arguments outside their possible range raise ValueError; NaN passes.
"""

from typing import NamedTuple

import numpy as np

from fifesim.models.weather import in_range

# Grassland of MOD17, collection 5.1 [Running2004]: efficiency [kg MJ-1] and ends of the ramps [degC, Pa].
LIGHT_USE = 0.001215
TMIN_RAMP = (-8.0, 12.02)
VPD_RAMP = (650.0, 4200.0)

CARBON = 12.011e-6
"""Mass of carbon in a micromole. [g]"""


def ramp(values, low, high):
    """Linear rise from 0 at one value to 1 at another, constant beyond. [1]"""
    return np.clip((np.asarray(values, float) - low) / (high - low), 0.0, 1.0)


@in_range
def light_use_gpp(tmin_c, vpd_pa, fpar, par_mj, lue_kg_mj=LIGHT_USE, tmin_ramp=TMIN_RAMP, vpd_ramp=VPD_RAMP):
    r"""
    Gross primary production of a day from absorbed light, after MOD17.

    .. math:: \mathrm{GPP} = \epsilon_{max} \, m(T_{min}) \, m(\mathrm{VPD}) \, \mathrm{FPAR} \cdot \mathrm{PAR}

    Parameters
    ----------
    tmin_c : array
        Lowest air temperature of the day. [degC]
    vpd_pa : array
        Vapour pressure deficit of the daylight hours. [Pa]
    fpar : array
        [1]
    par_mj : array
        Photosynthetically active radiation. [MJ m-2 d-1]
    lue_kg_mj : float, optional
        Largest light use efficiency, by default of grassland. [kg MJ-1]
    tmin_ramp, vpd_ramp : (float, float), optional
        Temperatures with no and full production [degC], and deficits with full and no production [Pa].

    Returns
    -------
    gpp : array, shape of the broadcast inputs
        [g m-2 d-1], of carbon

    References
    ----------
    [Running2004]_
    """
    limits = ramp(tmin_c, *tmin_ramp) * (1 - ramp(vpd_pa, *vpd_ramp))
    return 1000 * lue_kg_mj * limits * (np.asarray(fpar, float) * par_mj)


@in_range
def canopy_photosynthesis(lai, extinction, par, quantum_yield, p_max):
    r"""
    Photosynthesis of a canopy whose leaves respond to light by a rectangular hyperbola.

    .. math::

        \int_0^L \frac{a I P}{a I + P} \, dl = \frac{P}{K} \, \ln \frac{a K I_0 + P}{a K I_0 \, e^{-K L} + P},
        \qquad I = K I_0 \, e^{-K l}

    Parameters
    ----------
    lai : array
        :math:`L`. NaN gives NaN. [m2 m-2]
    extinction : array
        :math:`K`, above 0. [1]
    par : array
        Photon flux above the canopy, :math:`I_0`. [umol m-2 s-1]
    quantum_yield : array
        Slope of the response at no light, :math:`a`. [mol mol-1]
    p_max : array
        Photosynthesis of a leaf in full light, :math:`P`. [umol m-2 s-1]

    Returns
    -------
    photosynthesis : array, shape of the broadcast inputs
        [umol m-2 s-1]

    References
    ----------
    [MonsiSaeki1953]_
    """
    k, p = np.asarray(extinction, float), np.asarray(p_max, float)
    top = quantum_yield * k * par
    # log1p of the light absorbed keeps the digits of thin canopies and weak light.
    return p / k * np.log1p(-top * np.expm1(-k * lai) / (top * np.exp(-k * lai) + p))


# Leaf biochemistry at 25 degC and its activation energies [J mol-1], from Tables 2 and 3 of [DePury1997].
_GAS = 8.314
_KC, _KC_ENERGY = 40.4, 59400.0  # Michaelis constant of carboxylation [Pa]
_KO, _KO_ENERGY = 24.8e3, 36000.0  # and of oxygenation [Pa]
_OXYGEN = 20.5e3  # [Pa]
_V_ENERGY = 64800.0
_J_PER_V = 2.1
_J_ENERGY, _J_HIGH, _J_ENTROPY = 37000.0, 220000.0, 710.0
_CURVATURE, _LOST = 0.7, 0.15  # of electron transport, and share of the light that it does not use
_NITROGEN = 0.713  # decline of capacity from the top of the canopy to its bottom
_SCATTERED, _DIFFUSE_REFLECTED = 0.15, 0.036
_BEAM, _BEAM_SCATTERED, _DIFFUSE = 0.5, 0.46, 0.719  # extinction of black and of real leaves


class TwoLeaves(NamedTuple):
    """Light [umol m-2 s-1] and capacity [umol m-2 s-1] of sunlit and shaded leaves, per ground area."""

    light_sun: np.ndarray
    light_shade: np.ndarray
    capacity_sun: np.ndarray
    capacity_shade: np.ndarray


@in_range
def two_leaves(lai, par, diffuse_fraction, sza, vcmax25):
    r"""
    Light absorbed by sunlit and by shaded leaves, and their capacity of carboxylation.

    Parameters
    ----------
    lai : array
        [m2 m-2]
    par : array
        Photon flux above the canopy. [umol m-2 s-1]
    diffuse_fraction : array
        Diffuse fraction of the photon flux. [1]
    sza : array
        Below 90. [degree]
    vcmax25 : array
        Capacity of the uppermost leaves at 25 degC. [umol m-2 s-1]

    Returns
    -------
    leaves : TwoLeaves

    References
    ----------
    [DePury1997]_, Eqs. 20 to 23
    """
    lai, mu = np.asarray(lai, float), np.cos(np.radians(sza))
    kb, kbs, kd = _BEAM / mu, _BEAM_SCATTERED / mu, _DIFFUSE
    beam, sky = par * (1 - np.asarray(diffuse_fraction, float)), par * np.asarray(diffuse_fraction, float)
    horizontal = (1 - np.sqrt(1 - _SCATTERED)) / (1 + np.sqrt(1 - _SCATTERED))
    reflected = 1 - np.exp(-2 * horizontal * kb / (1 + kb))
    direct_through, beam_through, sky_through = (np.exp(-k * lai) for k in (kb, kbs, kd))
    total = (1 - reflected) * beam * (1 - beam_through) + (1 - _DIFFUSE_REFLECTED) * sky * (1 - sky_through)
    direct = beam * (1 - _SCATTERED) * (1 - direct_through)
    diffuse = sky * (1 - _DIFFUSE_REFLECTED) * (1 - sky_through * direct_through) * (kd / (kd + kb))
    again = (1 - reflected) * (1 - beam_through * direct_through) * (kbs / (kbs + kb))
    scattered = beam * (again - (1 - _SCATTERED) * (1 - direct_through * direct_through) / 2)
    light_sun = direct + diffuse + scattered
    of_area = np.asarray(vcmax25, float) * lai
    capacity = of_area * (-np.expm1(-_NITROGEN) / _NITROGEN)
    capacity_sun = of_area * (1 - np.exp(-_NITROGEN) * direct_through) / (_NITROGEN + kb * lai)
    return TwoLeaves(light_sun, total - light_sun, capacity_sun, capacity - capacity_sun)


@in_range
def farquhar_canopy(lai, par, diffuse_fraction, sza, ta_k, vcmax25=60.0, ci_pa=24.5):
    r"""
    Gross photosynthesis of a canopy of C3 leaves: the biochemistry of sunlit and of shaded leaves.

    .. math::

        A = \min \left( V_c \, \frac{C_i - \Gamma^*}{C_i + K_c (1 + O / K_o)}, \;
            \frac{J}{4} \, \frac{C_i - \Gamma^*}{C_i + 2 \Gamma^*} \right), \qquad
        \theta J^2 - (I_e + J_m) J + I_e J_m = 0

    Parameters
    ----------
    lai : array
        NaN gives NaN. [m2 m-2]
    par : array
        Photon flux above the canopy. [umol m-2 s-1]
    diffuse_fraction : array
        Diffuse fraction of the photon flux. [1]
    sza : array
        Below 90. [degree]
    ta_k : array
        Temperature of the leaves, assumed equal to the air temperature. [K]
    vcmax25 : array, optional
        Capacity of carboxylation of the uppermost leaves at 25 degC; the default is a typical C3 grass (assumed).
        [umol m-2 s-1]
    ci_pa : array, optional
        Partial pressure of carbon dioxide in the leaves; the default is 0.7 of 35 Pa. [Pa]

    Returns
    -------
    photosynthesis : array, shape of the broadcast inputs
        Without the respiration of the leaves. [umol m-2 s-1]

    References
    ----------
    [DePury1997]_; [Farquhar1980]_
    """
    ta_k = np.asarray(ta_k, float)
    leaves = two_leaves(lai, par, diffuse_fraction, sza, vcmax25)
    warm = (ta_k - 298.15) / (298.15 * _GAS * ta_k)
    michaelis = _KC * np.exp(_KC_ENERGY * warm) * (1 + _OXYGEN / (_KO * np.exp(_KO_ENERGY * warm)))
    tc = ta_k - 298.15
    compensation = 3.69 + 0.188 * tc + 0.0036 * tc**2
    of_v = np.exp(_V_ENERGY * warm) * (ci_pa - compensation) / (ci_pa + michaelis)
    of_j = (ci_pa - compensation) / (4 * (ci_pa + 2 * compensation))
    high = (1 + np.exp((_J_ENTROPY * 298.15 - _J_HIGH) / (_GAS * 298.15))) / (
        1 + np.exp((_J_ENTROPY * ta_k - _J_HIGH) / (_GAS * ta_k))
    )
    of_jmax = _J_PER_V * np.exp(_J_ENERGY * warm) * high
    total = 0.0
    for light, capacity in ((leaves.light_sun, leaves.capacity_sun), (leaves.light_shade, leaves.capacity_shade)):
        used, largest = light * (1 - _LOST) / 2, capacity * of_jmax
        transport = _smaller_root(used, largest, _CURVATURE)
        total = total + np.minimum(capacity * of_v, transport * of_j)
    return total


# C4 leaves, [Collatz1992]: values as used by later codes for maize, not compared with the printed table.
_C4_VMAX = 39.0  # capacity at 25 degC [umol m-2 s-1]
_C4_YIELD = 0.067  # mol of carbon per mol of absorbed photons
_C4_SLOPE = 0.7 / 39e-6  # initial response to the mole fraction of carbon dioxide, 0.7 mol m-2 s-1, over the capacity
_C4_LIGHT_CURVATURE, _C4_CARBON_CURVATURE = 0.83, 0.93
_C4_COLD, _C4_WARM = 13.0, 36.0  # temperatures of half of the capacity [degC]


def c4_photosynthesis(light, capacity, ta_k, ci_pa=14.0, pressure_pa=101325.0):
    r"""
    Gross photosynthesis of C4 leaves: smooth minimum of capacity, light, and carbon dioxide.

    .. math::

        \theta M^2 - (V_T + \alpha I) M + V_T \alpha I = 0, \qquad
        \beta A^2 - (M + k_T C_i / P) A + M k_T C_i / P = 0, \qquad
        V_T = \frac{V \, 2^{(T - 25) / 10}}{(1 + e^{0.3 (13 - T)}) (1 + e^{0.3 (T - 36)})}

    Parameters
    ----------
    light : array
        Absorbed photons, :math:`I`. [umol m-2 s-1]
    capacity : array
        :math:`V` at 25 degC; :math:`k_T` is in proportion to it, with :math:`2^{(T - 25) / 10}`. [umol m-2 s-1]
    ta_k : array
        Leaf temperature. [K]
    ci_pa : array, optional
        Partial pressure of carbon dioxide in the leaves; the default is 0.4 of 35 Pa (assumed). [Pa]
    pressure_pa : array, optional
        Air pressure, :math:`P`. [Pa]

    Returns
    -------
    photosynthesis : array, shape of the broadcast inputs
        Without the respiration of the leaves. [umol m-2 s-1]

    Notes
    -----
    Quantum yield 0.067, curvatures 0.83 and 0.93, and 0.7 mol m-2 s-1 of :math:`k` at a capacity of 39 umol m-2 s-1 are
    from the paper, as later codes quote it. The cold and warm limits are those of the land models CABLE and MOSES.

    References
    ----------
    [Collatz1992]_, Eqs. 2B and 3B
    """
    tc = np.asarray(ta_k, float) - 273.15
    rise = 2 ** ((tc - 25) / 10)
    most = capacity * rise / ((1 + np.exp(0.3 * (_C4_COLD - tc))) * (1 + np.exp(0.3 * (tc - _C4_WARM))))
    lit = _smaller_root(most, _C4_YIELD * np.asarray(light, float), _C4_LIGHT_CURVATURE)
    return _smaller_root(lit, _C4_SLOPE * capacity * rise * ci_pa / pressure_pa, _C4_CARBON_CURVATURE)


def _smaller_root(one, other, curvature):
    """Smooth minimum of two rates. [umol m-2 s-1]"""
    both = one + other
    return (both - np.sqrt(both**2 - 4 * curvature * one * other)) / (2 * curvature)


@in_range
def c4_canopy(lai, par, diffuse_fraction, sza, ta_k, vcmax25=_C4_VMAX, ci_pa=14.0, pressure_pa=101325.0):
    """
    Gross photosynthesis of a canopy of C4 leaves: `c4_photosynthesis` of the sunlit and shaded leaves of `two_leaves`.

    Parameters
    ----------
    lai : array
        NaN gives NaN. [m2 m-2]
    par : array
        Photon flux above the canopy. [umol m-2 s-1]
    diffuse_fraction : array
        Diffuse fraction of the photon flux. [1]
    sza : array
        Below 90. [degree]
    ta_k : array
        Temperature of the leaves, assumed equal to the air temperature. [K]
    vcmax25 : array, optional
        Capacity of the uppermost leaves at 25 degC; it declines with depth as of C3 leaves (assumed). [umol m-2 s-1]
    ci_pa : array, optional
        Partial pressure of carbon dioxide in the leaves. [Pa]
    pressure_pa : array, optional
        Air pressure. [Pa]

    Returns
    -------
    photosynthesis : array, shape of the broadcast inputs
        Without the respiration of the leaves. [umol m-2 s-1]

    References
    ----------
    [Collatz1992]_; [DePury1997]_
    """
    leaves = two_leaves(lai, par, diffuse_fraction, sza, vcmax25)
    both = (leaves.light_sun, leaves.capacity_sun), (leaves.light_shade, leaves.capacity_shade)
    return sum(c4_photosynthesis(*each, ta_k, ci_pa, pressure_pa) for each in both)
