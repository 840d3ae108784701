"""Checks of canopies of two kinds of leaf and of crowns: limits, energy, and other codes."""

from functools import partial

import numpy as np

from fifesim.base import datasets
from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.ground.canopy.background import with_background
from fifesim.ground.canopy.crowns import SHAPE, clumped, crown_shares, crown_terms, crowns_over_background
from fifesim.ground.canopy.layers import two_layers
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.light_sharing import light_budget
from fifesim.ground.canopy.reflectance_table import canopy_reflectance
from fifesim.ground.canopy.sail_model import sail

_deviation = partial(Deviation, "canopy")

_GREEN, _DEAD = ([0.07, 0.45], [0.04, 0.42]), ([0.28, 0.42], [0.12, 0.3])
_LAI = np.array([0, 0.01, 0.5, 2, 8, 20])[:, None]
_BROWN = np.linspace(0, 1, 5)
# Scenes of RAMI-3: leaf area index [m2 m-2], crown cover seen from above, leaf reflectance and transmittance, and
# background [1]. Leaves of HET04 are the mean of its spheres and cylinders, by leaf area.
CROWNS = {
    "HET01": (2.356, 0.4712, 0.4957, 0.4409, 0.159),
    "HET04": (1.4999, 0.2989, 0.4688, 0.3518, 0.15),
}
_VIEW = {"sza": 35.0, "vza": 20.0, "raa": 30.0, "hotspot": 0.1}


def _other_layers():
    """Leaf angle classes of the other code come from an iteration that stops at 1e-8."""
    table = datasets.table("verification/two_layers.csv")
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


def _limits():
    """All fields of the layers, for every leaf area and dead share."""
    worst = np.zeros(3)
    for rho, tau, rho_dead, tau_dead in zip(*_GREEN, *_DEAD, strict=True):
        alike = two_layers(_LAI, rho, tau, rho, tau, brown=_BROWN, dissociation=0.6, **_VIEW)
        plain = sail(_LAI, rho, tau, **_VIEW)
        mean = [one + _BROWN * (other - one) for one, other in ((rho, rho_dead), (tau, tau_dead))]
        mixture = two_layers(_LAI, rho, tau, rho_dead, tau_dead, brown=_BROWN, dissociation=0.0, **_VIEW)
        covered = clumped(plain, crown_shares(1.0, 1.0, 35.0, 20.0, 30.0))
        pairs = (alike, plain), (mixture, sail(_LAI, *mean, **_VIEW)), (covered, plain)
        found = [max(largest(a, b) for a, b in zip(one, other, strict=True)) for one, other in pairs]
        worst = np.maximum(worst, found)
    names = "leaves alike in two layers", "leaves of two kinds, mixed", "crowns without gaps"
    for name, deviation in zip(names, worst, strict=True):
        yield _deviation(name, deviation, 1e-9, "1", "SAIL")


def _energy():
    """Of two wavelengths, through crowns with gaps."""
    budget = light_budget(
        _LAI[..., None, None],
        *_GREEN,
        *_DEAD,
        [0.15, 0.19],
        brown=_BROWN[:, None, None],
        dissociation=0.4,
        sza=35.0,
        diffuse_fraction=0.2,
        crown_cover=np.array([0.3, 1.0])[:, None],
    )
    yield _deviation("light absorbed and reflected", largest(sum(budget), 1), 1e-9, "1", "energy budget")


def _tables():
    """Dead share, crown cover and ground that differ from cell to cell, from tables and one by one."""
    rng, worst = np.random.default_rng(7), 0.0
    lai, brown, cover = rng.gamma(1.5, 1.5, 200), rng.uniform(0, 1, 200), rng.uniform(0.3, 1, 200)
    dead = dict(zip(("brown_reflectance", "brown_transmittance"), _DEAD, strict=True))
    given = {"background": rng.uniform(0, 1, (2, 200)), "diffuse_fraction": [0.2, 0.1], "dissociation": 0.5, **dead}
    for shares in ({"brown": brown}, {"brown": 0.3, "crown_cover": cover}, {"brown": brown, "crown_cover": cover}):
        table, exact = (
            canopy_reflectance(lai, *_GREEN, exact=exact, **given, **shares, **_VIEW) for exact in (False, True)
        )
        worst = np.maximum(worst, largest(table, exact))
    yield _deviation("table over leaf area and dead share", worst, 1e-6, "1", "SAIL in two layers at every cell")


def _crowns():
    canopy, sky = sail(_LAI, *_GREEN, **_VIEW), 0.2
    shares = crown_shares(0.6, 1.0, 35.0, 20.0, 30.0)
    over = with_background(clumped(canopy, shares), 0.15)
    terms = crowns_over_background(
        crown_terms(canopy, sky), (0.6, shares.sun, shares.view, shares.apart, shares.lit), 0.15
    )
    worst = largest(terms, (1 - sky) * over.rso + sky * over.rdo)
    yield _deviation("crowns over ground, in both ways of writing it", worst, 1e-12, "1", "clumped SAIL")


def known_crowns(scene):
    """
    Reflectance of a scene whose crowns are known leaf by leaf.

    Parameters
    ----------
    scene : {"HET01", "HET04"}
        Of RAMI-3: spheres, by Eradiate, or spheres and cylinders, by the Monte Carlo of ``make_crown_scenes.py``.

    Returns
    -------
    table : DataFrame
        Columns vza, raa [degree] and brf [1].
    """
    if scene == "HET01":
        return datasets.table("verification/spheres_of_leaves.csv")
    return datasets.table("verification/crown_scenes.csv").query("scene == @scene")


def crown_errors(scene, crown_cover=None):
    """
    Error of crowns by SAIL in a scene whose crowns are known leaf by leaf.

    Parameters
    ----------
    scene : {"HET01", "HET04"}
        As in `known_crowns`.
    crown_cover : float, optional
        By default the cover of the scene as seen from above; 1 is a canopy without gaps. [1]

    Returns
    -------
    vza : array, shape (views,)
        View zenith, positive toward the sun. [degree]
    error : array, shape (views,)
        Of the bidirectional reflectance factor. [%]
    """
    lai, seen, *leaf, background = CROWNS[scene]
    cover = seen if crown_cover is None else crown_cover
    table = known_crowns(scene)
    angles = 20.0, table["vza"].to_numpy(), table["raa"].to_numpy()
    # Discs of 0.2 m in crowns of 20 m; of 0.1 m in crowns of 8 to 12 m.
    canopy = sail(lai / cover, *leaf, hotspot=0.01, **dict(zip(("sza", "vza", "raa"), angles, strict=True)))
    found = with_background(clumped(canopy, crown_shares(cover, SHAPE, *angles)), background).rso
    return np.where(angles[2] == 0, 1, -1) * angles[1], 100 * (found / table["brf"].to_numpy() - 1)


def _known_crowns():
    """Cover and shape stand for the places of all crowns: the bounds state the error of this model."""
    for scene, what, bound, source in (
        ("HET01", "spheres full of leaves", 14.0, "Eradiate, RAMI-3 HET01"),
        ("HET04", "spheres and cylinders full of leaves", 26.0, "Monte Carlo, RAMI-3 HET04"),
    ):
        yield _deviation(what, largest(crown_errors(scene)[1], 0), bound, "%", source)


CHECKS = (_other_layers, _limits, _energy, _tables, _crowns, _known_crowns)
