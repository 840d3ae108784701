"""Checks of two kinds of leaf and of crowns see the kernels that make images."""

import re
from pathlib import Path

import numpy as np
import pytest
from broken import exceeded, notices

from fifesim.base import files
from fifesim.experiments.verification import canopy
from fifesim.ground.canopy import interpolation, layers


@pytest.mark.parametrize("check", [each for each in canopy.FOLIAGE_CHECKS if each is not canopy._foliage_tables])
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (interpolation, "_foliage", canopy._foliage_tables),
        (interpolation, "_crowned", canopy._foliage_tables),
        (layers, "bidirectional_gap", canopy._other_layers),
        (canopy, "crowns_over_background", canopy._crowns),
        (canopy, "light_budget", canopy._energy),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)


def test_errors_of_crowns_are_those_of_the_page():
    page = (Path(__file__).parents[3] / "docs" / "physics.md").read_text(encoding="utf-8")
    row = r"^\| (HET0\d).* \| ([\d.]+)(?:, .+)? \| (.+) % \| (.+) % \| (.+) % \|$"
    rows = re.findall(row, page, re.MULTILINE)
    assert [(scene, cover) for scene, cover, *_ in rows] == [
        ("HET01", "0.4712"),
        ("HET04", "0.2989"),
        ("HET04", "0.2592"),
        ("HET01", "1"),
        ("HET04", "1"),
    ]
    for scene, cover, *printed in rows:
        _, error = canopy.crown_errors(scene, float(cover))
        found = error.mean(), error.min(), error.max()
        assert [f"{each:+.0f}".replace("-", "−") for each in found] == printed
    low, high = map(int, re.search(r"crowns are not round to be (\d+) to (\d+) % too dark", page).groups())
    slant = [
        error[abs(vza) >= 45] for vza, error in (canopy.crown_errors("HET04", cover) for cover in (0.2989, 0.2592))
    ]
    np.testing.assert_allclose([-np.max(slant), -np.min(slant)], [low, high], atol=2)


def test_monte_carlo_of_crowns_agrees_with_eradiate():
    """Discs lie at other places of the same spheres."""
    page = (Path(__file__).parents[3] / "docs" / "physics.md").read_text(encoding="utf-8")
    bound = float(re.search(r"agrees with Eradiate within ([\d.]+) % in HET01", page)[1])
    table = files.table("verification/crown_scenes.csv").query("scene == 'HET01'").reset_index()
    theirs = canopy.known_crowns("HET01")
    assert (table[["vza", "raa"]] == theirs[["vza", "raa"]]).all(axis=None)
    percent = 100 * (table["brf"] / theirs["brf"] - 1)
    assert f"{percent.abs().max():.1f}" == f"{bound:.1f}"


def test_cover_and_leaf_area_of_a_scene_are_those_of_its_crowns():
    """Shares of points that lie below a crown, its leaves 5 of its ground, and crowns at random places."""
    lai, cover, *leaf, _ = canopy.CROWNS["HET04"]
    crowns = files.table("verification/crown_places.csv").query("scene == 'HET04'")
    width, radius = 270.0, crowns["shape"].map({"sphere": 4.0, "cylinder": 3.0}).to_numpy()
    places, points = crowns[["x", "y"]].to_numpy(), np.random.default_rng(1).uniform(0, width, (20_000, 1, 2))
    apart = points - places - width * np.round((points - places) / width)
    below = (np.hypot(*np.moveaxis(apart, -1, 0)) <= radius).any(axis=1).mean()
    assert below == pytest.approx(cover, abs=3 * np.sqrt(cover * (1 - cover) / len(points)))
    areas = np.pi * radius**2 / width**2
    assert 5 * areas.sum() == pytest.approx(lai, abs=1e-4)
    assert 1 - np.exp(-areas.sum()) == pytest.approx(0.2592, abs=1e-4)
    spheres = areas[radius == 4].sum() / areas.sum()
    mean = spheres * np.array([0.49, 0.41]) + (1 - spheres) * np.array([0.45, 0.30])
    np.testing.assert_allclose(leaf, mean, atol=5e-5)
