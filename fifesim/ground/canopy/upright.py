"""SAIL on slopes whose plants grow upright, with the light that slopes exchange."""

import numpy as np

from fifesim.base.arrays import numbers
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.sail_model import (
    LeafScattering,
    bidirectional_gap,
    folded,
    leaf_angle_sums,
    scattered_again,
    with_background,
)

_LEAST_COSINE = 1e-3  # of sun and view on the slope; below, the slope is as good as parallel to the light [1]


def upright_reflectance(
    lai, leaf_reflectance, leaf_transmittance, background, *, sza, vza, raa, cosine, mu_s_local, mu_v_local, sky_view,
    terrain_view, diffuse_fraction=0.0, leaf_angles="spherical", hotspot=0.0,
):  # fmt: skip
    r"""
    Reflectance factor of a canopy of upright plants on a slope, relative to the irradiance of level ground.

    .. math::

        \rho &= E_s r_{so} + E_d r_{do}
            + r_{do} \, C_t \frac{E_s r_{sd} + E_d r_{dd}}{1 - r_{dd} C_t} \\
        E_s &= (1 - f) \, \mu_s' / \mu_s, \qquad E_d = f \, V_d

    Along a beam, leaves of upright plants have the path length of the slope: the extinction is
    :math:`k' = k \mu / \mu'` for the leaf area of the slope, :math:`L \cos S`.

    Parameters
    ----------
    lai : array
        Leaf area index, per level area. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance, background : array
        [1]
    sza, vza, raa : float
        On level ground. [degree]
    cosine : array
        Cosine of the slope, :math:`\cos S`. [1]
    mu_s_local, mu_v_local : array
        Cosines of the zenith angles of sun and sensor on the slope, :math:`\mu'`; 0 in shadow or hidden. [1]
    sky_view, terrain_view : array
        :math:`V_d` and :math:`C_t`. [1]
    diffuse_fraction : array, optional
        :math:`f` on level ground. [1]
    leaf_angles : optional
        Whatever `leaf_angle_classes` accepts; inclinations from the vertical of the plants.
    hotspot : float, optional
        Ratio of leaf size to canopy height. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        0 where the slope is hidden from the sensor. [1]

    Notes
    -----
    The surroundings are as bright as the slope, and their light is summed over all reflections. The leaf angle
    distribution keeps its axis in all coefficients, with the mean of the normals' outer products.

    References
    ----------
    [Yin2017]_, path length; [Sirguey2009]_, light between slopes; [Verhoef1984]_

    Examples
    --------
    Bare ground in a pit, which sees as much land as sky, in full skylight:

    >>> slope = {"cosine": 1.0, "mu_s_local": 1.0, "mu_v_local": 1.0, "sky_view": 0.5, "terrain_view": 0.5}
    >>> given = {"sza": 0.0, "vza": 0.0, "raa": 0.0, "diffuse_fraction": 1.0}
    >>> float(round(upright_reflectance(0.0, 0.1, 0.1, 0.4, **given, **slope), 12))
    0.25
    """
    leaves, raa = leaf_angle_classes(leaf_angles), folded(raa)
    seen = np.asarray(mu_v_local) > 0
    sun, view = (np.maximum(each, _LEAST_COSINE) for each in (mu_s_local, mu_v_local))
    mu_s, mu_v = np.cos(np.radians([sza, vza]))
    sums = leaf_angle_sums(sza, vza, raa, leaves)
    c = _on_slope(leaf_reflectance, leaf_transmittance, sums, cosine, mu_s / sun, mu_v / view)
    depth = numbers(lai) * cosine
    gaps, sunlit_and_seen = bidirectional_gap(depth, c.ks, c.ko, _decay(sza, vza, raa, sun, view, cosine, c, hotspot))
    layer = scattered_again(depth, c)
    layer = layer._replace(rso=c.w * sunlit_and_seen + layer.rso, tsstoo=gaps)
    r = with_background(layer, background)
    direct, sky = (1 - diffuse_fraction) * np.maximum(mu_s_local, 0) / mu_s, diffuse_fraction * sky_view
    around = terrain_view * (direct * r.rsd + sky * r.rdd) / (1 - r.rdd * terrain_view)
    return seen * (direct * r.rso + (sky + around) * r.rdo)


def _on_slope(rho, tau, sums, cosine, sun_path, view_path):
    """Coefficients of the four-stream equations along the normal of a slope, per leaf area."""
    # The mean outer product of the leaf normals has bf along the vertical and `across` along both horizontal axes.
    across = (1 - sums.bf) / 2
    ks, ko, upright = sums.ks * sun_path, sums.ko * view_path, (sums.bf - across) * cosine
    to_sun, to_view, both = across + upright * sun_path, across + upright * view_path, across + upright * cosine
    sigma, absorbed = ((1 + both) * rho + (1 - both) * tau) / 2, 1 - rho - tau
    return LeafScattering(
        ks=ks,
        ko=ko,
        a=absorbed + sigma,
        sigma=sigma,
        m=np.sqrt(np.maximum(absorbed, 0) * (absorbed + 2 * sigma)),
        sf=((ks - to_sun) * rho + (ks + to_sun) * tau) / 2,
        sb=((ks + to_sun) * rho + (ks - to_sun) * tau) / 2,
        vf=((ko - to_view) * rho + (ko + to_view) * tau) / 2,
        vb=((ko + to_view) * rho + (ko - to_view) * tau) / 2,
        w=(sums.reflected * rho + sums.transmitted * tau) * sun_path * view_path,
    )


def _decay(sza, vza, raa, sun, view, cosine, c, hotspot):
    """Decay of the correlation of the gaps with depth below the slope, as `sail_model.hotspot_decay`."""
    if not hotspot > 0:
        return np.inf
    sza, vza, raa = np.radians([sza, vza, raa])
    chord = 4 * (np.sin((sza - vza) / 2) ** 2 + np.sin(sza) * np.sin(vza) * np.sin(raa / 2) ** 2)
    distance = np.sqrt((1 / sun - 1 / view) ** 2 + chord / (sun * view))
    return 2 * distance * cosine / ((c.ks + c.ko) * hotspot)
