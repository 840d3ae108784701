"""Checks of canopies: limits, energy, theory and other codes, also for crowns and two kinds of leaf."""

from functools import partial
from itertools import pairwise

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq

from fifesim.ground.canopy import layers
from fifesim.ground.canopy.crowns import SHAPE, clumped, crown_shares, crown_terms, crowns_over_background
from fifesim.ground.canopy.layers import light_budget, two_layers
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes, leaf_projection
from fifesim.ground.canopy.reflectance_table import canopy_reflectance, directional_reflectance
from fifesim.ground.canopy.sail_model import (
    exponential_chain,
    over_background,
    sail,
    volume_scattering,
    with_background,
)
from verification import tables
from verification.deviations import Deviation, largest

_deviation = partial(Deviation, "canopy")

# Canopies from bare to closed, leaves from white to black, sun and view from the zenith to grazing.
_LAI = np.array([0, 0.01, 0.5, 2, 8, 20])[:, None, None, None]
_RHO = np.linspace(0, 1, 6)[:, None, None]
_SZA = np.array([0, 28.5, 60, 85])[:, None]
_VZA = np.array([0, 30, 75])
_SHAPES = ("spherical", "planophile", "erectophile")


def _limits():
    """Check physical limits of the canopy, within rounding for up to 20 optical thicknesses."""
    bare = with_background(sail(0.0, _RHO, 1 - _RHO, sza=_SZA, vza=_VZA, hotspot=0.05), 0.15)
    yield _deviation("no leaves show the background", np.max([largest(r, 0.15) for r in bare]), 0.0, "1", "theory")
    white = [sail(_LAI, _RHO, 1 - _RHO, sza=_SZA, vza=_VZA, raa=50, leaf_angles=shape) for shape in _SHAPES]
    lost = np.max(
        [largest(out, 1) for c in white for out in (c.rdd + c.tdd, c.rsd + c.tsd + c.tss, c.rdo + c.tdo + c.too)]
    )
    yield _deviation("leaves that absorb nothing lose no light", lost, 1e-12, "1", "energy budget")
    over_white = [with_background(canopy, 1.0) for canopy in white]
    kept = np.max([largest(r, 1) for surface in over_white for r in (surface.rdd, surface.rsd, surface.rdo)])
    yield _deviation("and reflect all of it over white ground", kept, 1e-12, "1", "energy budget")


def _reciprocity():
    given = {"raa": 50, "hotspot": 0.05}
    there, back = (
        with_background(sail(_LAI, 0.9 * _RHO, 0.9 - 0.9 * _RHO, sza=s, vza=v, **given), 0.2).rso
        for s, v in ((_SZA, _VZA), (_VZA, _SZA))
    )
    yield _deviation("sun and view may be exchanged", largest(there, back, relative=True), 1e-12, "1", "reciprocity")


def _half_space():
    """Check the half-space by tracing light through leaves of one inclination, with their mean squared cosine."""
    rho, tau = np.array([[0.07, 0.45, 0.6], [0.04, 0.42, 0.1]])
    worst = 0.0
    for inclination in (0.0, 35.0, 57.0, 90.0):
        squared = np.cos(np.radians(inclination)) ** 2
        back = ((1 + squared) * rho + (1 - squared) * tau) / 2
        loss = 1 - ((1 + squared) * tau + (1 - squared) * rho) / 2
        thick = sail(400.0, rho, tau, sza=30.0, leaf_angles=f"{inclination:g}: 1")
        worst = np.maximum(worst, largest(thick.rdd, (loss - np.sqrt(loss**2 - back**2)) / back))
    yield _deviation("reflectance of a canopy without end", worst, 1e-12, "1", "Kubelka and Munk (1931)")


def _spherical_leaves():
    """Check spherical leaves against the closed form, which 900 classes reproduce to 1e-5."""
    leaves = leaf_angle_classes("spherical", classes=900)
    inclination, fraction = np.array(leaves.inclination), np.array(leaves.fraction)
    worst = 0.0
    for sza, vza, raa in ((28.5, 0, 0), (60, 45, 90), (75, 75, 180), (30, 30, 0)):
        found = np.pi * (np.array(volume_scattering(inclination, sza, vza, raa)) @ fraction)
        s, v, azimuth = np.radians([sza, vza, raa])
        cosine = np.cos(s) * np.cos(v) + np.sin(s) * np.sin(v) * np.cos(azimuth)
        between = np.arccos(np.clip(cosine, -1, 1))
        ross = np.sin(between) - between * np.cos(between)
        worst = np.maximum(worst, largest(found, np.array([ross + np.pi * np.cos(between), ross]) / (3 * np.pi)))
    yield _deviation("single scattering by spherical leaves", worst, 1e-5, "1", "Ross (1981), closed form")


def _ellipsoidal_leaves():
    """Check the ellipsoidal distribution by the normals of a spheroid, whose axes follow from their mean."""

    def share(log_ratio, low, high, power=0):
        """Unnormalized integral over normals between two inclinations, times a power of the inclination [rad]."""
        ratio = np.exp(2 * log_ratio)
        return quad(lambda t: t**power * np.sin(t) / (np.cos(t) ** 2 + ratio * np.sin(t) ** 2) ** 2, low, high)[0]

    edges, worst = np.radians(np.linspace(0, 90, 19)), 0.0
    for mean in (30.0, 57.0, 75.0):
        found = leaf_angle_classes(("campbell", mean), classes=18).fraction
        ratio = brentq(lambda r: share(r, 0, np.pi / 2, 1) / share(r, 0, np.pi / 2) - np.radians(mean), -3, 3)  # noqa: B023
        expected = [share(ratio, low, high) / share(ratio, 0, np.pi / 2) for low, high in pairwise(edges)]
        worst = np.maximum(worst, largest(found, expected))
    yield _deviation("leaves as on ellipsoids", worst, 1e-9, "1", "Campbell (1990), density by quadrature")


def _hot_spot():
    """Check the contribution of the hot spot to single scattering, by adaptive quadrature over the depth."""
    leaves = leaf_angle_classes("spherical")
    inclination, fraction = np.array(leaves.inclination), np.array(leaves.fraction)
    worst = 0.0
    for sza, vza, raa, lai, size in ((28.5, 0, 0, 2, 0.1), (45, 30, 10, 0.5, 0.3), (60, 60, 0, 5, 0.05)):
        mu_s, mu_v = np.cos(np.radians([sza, vza]))
        ks, ko = (leaf_projection(inclination, a) @ fraction / mu for a, mu in ((sza, mu_s), (vza, mu_v)))
        w = [0.5, 0.3] @ (np.pi / (mu_s * mu_v) * (np.array(volume_scattering(inclination, sza, vza, raa)) @ fraction))
        tan_s, tan_v = np.tan(np.radians([sza, vza]))
        apart = 2 * abs(tan_s - tan_v * np.exp(1j * np.radians(raa))) / (size * (ks + ko))
        seen = lai * quad(_gap, 0, 1, args=(ks, ko, lai, apart), epsabs=1e-14, epsrel=1e-11, limit=200)[0]
        plain = -np.expm1(-(ks + ko) * lai) / (ks + ko)
        spot, none = (sail(lai, 0.5, 0.3, sza=sza, vza=vza, raa=raa, hotspot=h).rso for h in (size, 0.0))
        worst = np.maximum(worst, largest(spot - none, w * (seen - plain)))
    yield _deviation("hot spot", worst, 1e-9, "1", "Kuusk (1991), by quadrature")


def _gap(depth, ks, ko, lai, apart):
    """Probability that sun and observer both see a relative depth."""
    overlap = depth if apart < 1e-9 else -np.expm1(-apart * depth) / apart
    return np.exp(-(ks + ko) * lai * depth + np.sqrt(ks * ko) * lai * overlap)


def _other_sail():
    """Check SAIL against another code, whose leaf angle classes come from an iteration that stops at 1e-8."""
    table = tables.table("sail.csv")
    worst = 0.0
    for row in table.itertuples():
        leaves = leaf_angle_classes(("verhoef", row.a, row.b), classes=18)
        angles = {"sza": row.sza, "vza": row.vza, "raa": row.raa}
        canopy = sail(row.lai, row.leaf_reflectance, row.leaf_transmittance, **angles, leaf_angles=leaves)
        surface = with_background(canopy, row.background)
        found = [surface.rdd, surface.rsd, surface.rdo, surface.rso, canopy.tss]
        worst = np.maximum(worst, largest(found, [row.rdd, row.rsd, row.rdo, row.rso, row.tss]))
    yield _deviation(f"{len(table)} canopies of any leaf angles", worst, 1e-7, "1", "SAIL of prosail 2.0.5")


def _exact_transfer():
    """Check the four-stream model against exact transfer, within the model error that the documentation states."""
    table = tables.table("canopy_transfer.csv")
    angles = {name: table[name].to_numpy() for name in ("sza", "vza", "raa")}
    canopy = sail(table["lai"], table["leaf_reflectance"], table["leaf_transmittance"], **angles)
    found = 100 * (with_background(canopy, table["background"].to_numpy()).rso / table["reflectance"] - 1)
    infrared, nadir = table["band"] == "nir", table["vza"] == 0
    parts = (
        ("red reflectance at nadir and 45 degrees", ~infrared, 0.5),
        ("near infrared reflectance at nadir", infrared & nadir, 3.0),
        ("near infrared reflectance at 45 degrees", infrared & ~nadir, 5.0),
    )
    for what, rows, bound in parts:
        yield _deviation(what, largest(found[rows], 0), bound, "%", "exact radiative transfer")


def _absorption():
    sza = np.array([0, 25, 28.5, 45, 60, 80])
    cosine, tangent = np.cos(np.radians(sza)), np.tan(np.radians(sza))
    spherical = largest(layers.extinction_coefficient(sza), 0.5 / cosine)
    yield _deviation("extinction by spherical leaves", spherical, 0.0, "1", "theory, 0.5 / cos(sza)")
    vertical = largest(layers.extinction_coefficient(sza, "90: 1"), 2 / np.pi * tangent)
    yield _deviation("extinction by vertical leaves", vertical, 1e-12, "1", "theory, 2 tan(sza) / pi")
    taken = [0.94 * quad(lambda depth: 0.569 * np.exp(-0.569 * depth), 0, lai)[0] for lai in (0.5, 2.5, 8)]
    fpar = largest(layers.beer_fpar([0.5, 2.5, 8], 0.569), taken)
    yield _deviation("light that leaves take, layer by layer", fpar, 1e-12, "1", "quadrature of Beer's law")


def _chains():
    """Check exponential chains, with equal and distant rates."""
    # The corner of the exponential of a bidiagonal matrix is a divided difference.
    worst = 0.0
    for gap in (0.0, 1e-9, 0.01, 0.6, 0.7, 3.0, 100.0):
        for rates in ((0.3, gap), (0.3, 0.3 + gap, 0.1, 0.3, 0.2 + 2 * gap)):
            corner = expm(3.0 * (np.diag(-np.array(rates)) + np.diag(np.ones(len(rates) - 1), 1)))[0, -1]
            worst = np.maximum(worst, largest(exponential_chain(3.0, *rates), corner, relative=True))
    yield _deviation("light attenuated in stages", worst, 1e-11, "1", "matrix exponential, Opitz (1964)")


def _tables():
    """Check the reflectance tables: one background, one for each cell, exact evaluation, and directions by cell."""
    rng, sky, leaf = np.random.default_rng(6), np.array([0.2, 0.1]), (np.array([0.07, 0.45]), np.array([0.04, 0.42]))
    lai = np.concatenate([[0.0, 1e-6, 100.0], rng.gamma(1.5, 1.5, 197)])
    ground, one = rng.uniform(0, 1, (2, 200)), np.array([0.15, 0.6])
    worst = np.zeros(3)
    for sza, vza, raa, hotspot, shape in ((28.5, 0, 0, 0.0, "spherical"), (50, 45, 170, 0.1, "planophile")):
        given = {"sza": sza, "vza": vza, "raa": raa, "leaf_angles": shape, "hotspot": hotspot}
        canopy = sail(lai, leaf[0][:, None], leaf[1][:, None], **given)
        over = [with_background(canopy, each) for each in (one[:, None], ground)]
        expected = [(1 - sky[:, None]) * each.rso + sky[:, None] * each.rdo for each in over]
        tables = [canopy_reflectance(lai, *leaf, each, diffuse_fraction=sky, **given) for each in (one, ground)]
        exact = [
            canopy_reflectance(lai, *leaf, each, diffuse_fraction=sky, exact=True, **given) for each in (one, ground)
        ]
        towards = [np.full(200, float(angle)) for angle in (sza, vza, raa)]
        cells = directional_reflectance(lai, leaf, ground.T, sky, towards, shape, hotspot)
        worst = np.maximum(worst, [largest(tables, expected), largest(exact, expected), largest(cells, expected[1])])
    table, exact, cells = worst
    yield _deviation("table of canopies over leaf area", table, 1e-6, "1", "SAIL at every cell")
    yield _deviation("canopies cell by cell", np.maximum(exact, cells), 1e-12, "1", "SAIL, and a mixture of light")


def _orders():
    """Check multiple reflections between canopy and ground order by order, in both formulations."""
    canopy = sail(_LAI, 0.9 * _RHO, 0.9 - 0.9 * _RHO, sza=_SZA, vza=_VZA, raa=50, hotspot=0.05)
    through = (canopy.tss + canopy.tsd) * (canopy.too + canopy.tdo)
    hot = canopy.tsstoo - canopy.tss * canopy.too
    orders = sum(through * 0.5 * (0.5 * canopy.rdd) ** order for order in range(60))
    found = over_background(canopy.rso, hot, through, canopy.rdd, 0.5), with_background(canopy, 0.5).rso
    worst = largest(found, canopy.rso + hot * 0.5 + orders)
    yield _deviation("light between leaves and ground", worst, 1e-12, "1", "order by order")


CHECKS = (
    _limits,
    _reciprocity,
    _half_space,
    _spherical_leaves,
    _ellipsoidal_leaves,
    _hot_spot,
    _other_sail,
    _exact_transfer,
    _absorption,
    _chains,
    _orders,
    _tables,
)


_GREEN, _DEAD = ([0.07, 0.45], [0.04, 0.42]), ([0.28, 0.42], [0.12, 0.3])
_FOLIAGE_LAI = np.array([0, 0.01, 0.5, 2, 8, 20])[:, None]
_BROWN = np.linspace(0, 1, 5)
# Scenes of RAMI-3: leaf area index [m2 m-2], crown cover seen from above, leaf reflectance and transmittance, and
# background [1]. Leaves of HET04 are the mean of its spheres and cylinders, by leaf area.
CROWNS = {"HET01": (2.356, 0.4712, 0.4957, 0.4409, 0.159), "HET04": (1.4999, 0.2989, 0.4688, 0.3518, 0.15)}
_VIEW = {"sza": 35.0, "vza": 20.0, "raa": 30.0, "hotspot": 0.1}


def _other_layers():
    """Check two layers against another code, whose leaf angle classes come from an iteration that stops at 1e-8."""
    table = tables.table("two_layers.csv")
    worst = 0.0
    for row in table.itertuples():
        leaves = leaf_angle_classes(row.leaf_angles, classes=18)
        optics = row.rho_green, row.tau_green, row.rho_brown, row.tau_brown
        order = {"brown": row.brown, "dissociation": row.dissociation, "leaf_angles": leaves, "hotspot": row.hotspot}
        canopy = two_layers(row.lai, *optics, sza=row.sza, vza=row.vza, raa=row.raa, **order)
        found = with_background(canopy, row.soil)
        worst = np.maximum(worst, largest(list(found), [row.rso, row.rdo, row.rsd, row.rdd]))
    source = "Verhoef and Bach (2007), SAIL of prosail 2.0.5"
    yield _deviation(f"{len(table)} canopies of green and dead leaves", worst, 1e-6, "1", source)


def _foliage_limits():
    """Check limits of all fields of the layers, for every leaf area and dead share."""
    worst = np.zeros(3)
    for rho, tau, rho_dead, tau_dead in zip(*_GREEN, *_DEAD, strict=True):
        alike = two_layers(_FOLIAGE_LAI, rho, tau, rho, tau, brown=_BROWN, dissociation=0.6, **_VIEW)
        plain = sail(_FOLIAGE_LAI, rho, tau, **_VIEW)
        mean = [one + _BROWN * (other - one) for one, other in ((rho, rho_dead), (tau, tau_dead))]
        mixture = two_layers(_FOLIAGE_LAI, rho, tau, rho_dead, tau_dead, brown=_BROWN, dissociation=0.0, **_VIEW)
        covered = clumped(plain, crown_shares(1.0, 1.0, 35.0, 20.0, 30.0))
        pairs = (alike, plain), (mixture, sail(_FOLIAGE_LAI, *mean, **_VIEW)), (covered, plain)
        found = [max(largest(a, b) for a, b in zip(one, other, strict=True)) for one, other in pairs]
        worst = np.maximum(worst, found)
    names = "leaves alike in two layers", "leaves of two kinds, mixed", "crowns without gaps"
    for name, deviation in zip(names, worst, strict=True):
        yield _deviation(name, deviation, 1e-9, "1", "SAIL")


def _energy():
    """Check the energy budget at two wavelengths, through crowns with gaps."""
    lai, brown, cover = _FOLIAGE_LAI[..., None, None], _BROWN[:, None, None], np.array([0.3, 1.0])[:, None]
    optics = *_GREEN, *_DEAD, [0.15, 0.19]
    budget = light_budget(
        lai, *optics, brown=brown, dissociation=0.4, sza=35.0, diffuse_fraction=0.2, crown_cover=cover
    )
    yield _deviation("light absorbed and reflected", largest(sum(budget), 1), 1e-9, "1", "energy budget")


def _foliage_tables():
    """Check tables against single evaluations where dead share, crown cover and ground differ by cell."""
    rng, worst = np.random.default_rng(7), 0.0
    lai, brown, cover = rng.gamma(1.5, 1.5, 200), rng.uniform(0, 1, 200), rng.uniform(0.3, 1, 200)
    given = {"background": rng.uniform(0, 1, (2, 200)), "diffuse_fraction": [0.2, 0.1], "dead": _DEAD}
    given["dissociation"] = 0.5
    for shares in ({"brown": brown}, {"brown": 0.3, "crown_cover": cover}, {"brown": brown, "crown_cover": cover}):
        table, exact = (
            canopy_reflectance(lai, *_GREEN, exact=exact, **given, **shares, **_VIEW) for exact in (False, True)
        )
        worst = np.maximum(worst, largest(table, exact))
    yield _deviation("table over leaf area and dead share", worst, 1e-6, "1", "SAIL in two layers at every cell")


def _crowns():
    canopy, sky = sail(_FOLIAGE_LAI, *_GREEN, **_VIEW), 0.2
    shares = crown_shares(0.6, 1.0, 35.0, 20.0, 30.0)
    over = with_background(clumped(canopy, shares), 0.15)
    terms = crowns_over_background(
        crown_terms(canopy, sky), (0.6, shares.sun, shares.view, shares.apart, shares.lit), 0.15
    )
    worst = largest(terms, (1 - sky) * over.rso + sky * over.rdo)
    yield _deviation("crowns over ground, in both ways of writing it", worst, 1e-12, "1", "clumped SAIL")


def known_crowns(scene):
    """Reflectance of a RAMI-3 scene whose crowns are known leaf by leaf: columns vza, raa [degree] and brf [1]."""
    # HET01, spheres, is from Eradiate; HET04, spheres and cylinders, from the Monte Carlo code of make_crown_scenes.py.
    if scene == "HET01":
        return tables.table("spheres_of_leaves.csv")
    return tables.table("crown_scenes.csv").query("scene == @scene")


def crown_errors(scene, crown_cover=None):
    """View zenith, positive toward the sun [degree], and error of crowns by SAIL [%], shape (views,)."""
    lai, seen, *leaf, background = CROWNS[scene]
    cover = seen if crown_cover is None else crown_cover
    table = known_crowns(scene)
    angles = 20.0, table["vza"].to_numpy(), table["raa"].to_numpy()
    # Discs of 0.2 m in crowns of 20 m; of 0.1 m in crowns of 8 to 12 m.
    canopy = sail(lai / cover, *leaf, hotspot=0.01, **dict(zip(("sza", "vza", "raa"), angles, strict=True)))
    found = with_background(clumped(canopy, crown_shares(cover, SHAPE, *angles)), background).rso
    return np.where(angles[2] == 0, 1, -1) * angles[1], 100 * (found / table["brf"].to_numpy() - 1)


def _known_crowns():
    """Check crowns against scenes known leaf by leaf; the bounds state the error of the crown model."""
    for scene, what, bound, source in (
        ("HET01", "spheres full of leaves", 14.0, "Eradiate, RAMI-3 HET01"),
        ("HET04", "spheres and cylinders full of leaves", 26.0, "Monte Carlo, RAMI-3 HET04"),
    ):
        yield _deviation(what, largest(crown_errors(scene)[1], 0), bound, "%", source)


FOLIAGE_CHECKS = (_other_layers, _foliage_limits, _energy, _foliage_tables, _crowns, _known_crowns)
