"""Figures of the gallery agree with their axes and texts."""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from verification import atmosphere, benchmarks, canopy

from fifesim.accessor import DataArrayAccessor
from fifesim.base.geometry import relative_azimuth, scattering_angle_cosine

DOCS = Path(__file__).parents[1] / "docs"
SIGNED = "positive toward the sun"


@pytest.fixture
def drawn():
    """Function that runs all or the given cells of a gallery script; figures are closed at the end."""

    def run(name, cells=None):
        source = (DOCS / "gallery_src" / f"{name}.py").read_text(encoding="utf-8")
        parts, names = source.split("\n# %%\n"), {}
        for part in parts if cells is None else [parts[cell] for cell in cells]:
            exec(compile(part, name, "exec"), names)
        return names

    yield run
    plt.close("all")


def test_hot_spot_of_the_canopy_is_drawn_at_the_sun(drawn):
    names = drawn("ground/plot_5_canopy_reflectance", [0, 1, 2])
    for axis in names["axes"]:
        assert axis.get_xlabel().endswith(SIGNED)
        _, *with_hot_spot, sun = axis.get_lines()
        assert set(sun.get_xdata()) == {names["sun"].sza}
        peaks = [line.get_xdata()[np.argmax(line.get_ydata())] for line in with_hot_spot]
        assert peaks == [names["sun"].sza] * 2


def test_views_through_the_atmosphere_have_the_sign_of_the_axis(drawn, monkeypatch):
    """The NDVI of the test surface is minus the cosine of the scattering angle, i.e. largest toward the sun."""

    def mirrored(accessor, atmosphere, *, geometry, instrument):
        raa = relative_azimuth(geometry["saa"], geometry["vaa"])
        cosine = scattering_angle_cosine(geometry["sza"], geometry["vza"], raa)
        ground = accessor._raster
        scale = ground.copy(data=np.array([1.0, -1.0])[:, None, None] + 0 * ground.values)
        return (1 + scale * cosine).transpose("band", "y", "x").assign_attrs(ground.attrs)

    monkeypatch.setattr(DataArrayAccessor, "to_toa", mirrored)
    right = drawn("air/plot_1_atmosphere", [0])["right"]
    assert SIGNED in right.get_xlabel() and "sun at 45°" in right.get_xlabel()
    lines = [line for line in right.get_lines() if len(line.get_xdata()) > 10]
    assert len(lines) == 6
    for line in lines:
        assert abs(line.get_xdata()[np.argmax(line.get_ydata())] - 45) <= 5


def test_hot_spot_of_discs_is_drawn_at_the_sun(drawn):
    """Last figure of the script: SAIL and both references."""
    axes = drawn("answers/plot_5_benchmarks", [0, -1])["axes"]
    assert all(axis.get_xlabel().endswith(SIGNED) for axis in axes[1])
    for axis in axes[0]:
        _, *lines = axis.get_lines()
        assert {line.get_xdata()[np.argmax(line.get_ydata())] for line in lines} == {benchmarks.RAMI_SZA}


def test_table_of_the_hot_spot_agrees_with_its_figure():
    """Largest differences of HOM45 by view zenith, with the sign convention of the table header."""
    page = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    assert f"| view zenith, {SIGNED} |" in page
    table, found = benchmarks.hom45()
    percent, vza = 100 * (found / table["reflectance"].to_numpy() - 1), table["vza"].to_numpy()
    sun = benchmarks.RAMI_SZA
    beside = (vza != sun) & (abs(vza - sun) <= 3)
    rows = {
        "−75° to −35°": vza <= -35,
        "−30° to 60°": (vza >= -30) & (vza <= 60) & ~beside,
        "within 3° of the hot spot": beside,
        "in the hot spot": vza == sun,
        "65° to 75°": vza >= 65,
    }
    for name, there in rows.items():
        (printed,) = re.findall(rf"^\| {name} \| ([\d.]+) %", page, re.MULTILINE)
        assert f"{abs(percent[there]).max():.1f}" == printed


@pytest.mark.slow
def test_table_of_accuracy_agrees_with_the_checks():
    """Errors of SAIL, 5S in clear air, successive orders and gases, rounded as in the table."""
    page = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    cells = dict(re.findall(r"^\| (.+?) \| (.+?) \| .+ \|$", page, re.MULTILINE))
    checks = (canopy._exact_transfer, atmosphere._five_s, atmosphere._successive_orders)
    found = {each.what: each.deviation for check in checks for each in check()}

    red, nadir, slant = (
        found[name]
        for name in (
            "red reflectance at nadir and 45 degrees",
            "near infrared reflectance at nadir",
            "near infrared reflectance at 45 degrees",
        )
    )
    assert cells["canopy reflectance (SAIL), red"] == f"{red:.1f} %"
    expected = f"{nadir:.1f} % at nadir, {slant:.1f} % at a view zenith of 45°"
    assert cells["canopy reflectance (SAIL), near infrared"] == expected
    clear = [found[f"5S, clear and high sun, TM{band}, rms"] for band in (1, 2, 3, 4, 5, 7)]
    expected = f"{clear[0]:.1f} % rms in TM1, {clear[1]:.1f} % in TM2, at most 0.6 % in TM3 to 7"
    assert cells["the same in clear air (visibility from 23 km, sun to 45°, view to 20°)"] == expected
    assert max(clear[2:]) < 0.6
    assert max(found[f"5S, every aerosol and angle, TM{band}, rms"] for band in (1, 2, 3, 4, 5, 7)) < 3
    orders = max(found[f"successive orders, TM{band}, toa, rms"] for band in (1, 2, 3, 4))
    assert cells['the same 180 cases, `engine="successive-orders"`'] == f"0.09 to {orders:.2f} % rms in TM1 to 4"
    gases = max(value for what, value in found.items() if what.startswith("gases"))
    assert cells["two-way transmittance of gases in the TM bands"] == f"{gases:.3f}"


def test_unknown_terms_of_an_instrument_are_hatched(drawn):
    """Each cell has a number or hatching; the total has a number only if every term has one."""
    names = drawn("answers/plot_3_instruments", [0])
    instruments, columns = names["names"], names["columns"]
    assert [text.get_text() for text in names["figure"].legends[0].get_texts()] == [
        "Hatched cells are unknown, not zero."
    ]
    for axis in names["axes"]:
        printed = {tuple(round(at) for at in text.get_position()) for text in axis.texts}
        hatched = {tuple(round(at + 0.5) for at in patch.get_xy()) for patch in axis.patches if patch.get_hatch()}
        cells = {(column, row) for column in range(len(columns)) for row in range(len(instruments))}
        assert printed | hatched == cells and not printed & hatched
        for row, name in enumerate(instruments):
            known = names["sizes"].set_index("instrument").loc[name, ["blur", "place", "noise"]]
            terms = [(columns.index(stage), row) in printed for stage in ("point spread", "registration", "noise")]
            assert terms == list(known)
            assert ((columns.index("total"), row) in printed) == all(known)
