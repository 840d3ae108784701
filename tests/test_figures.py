"""Figures and tables of the pages agree with runs, and their numbers support the text."""

import json
import re
from pathlib import Path

import make_benchmark_pictures
import make_paper
import make_why_scatter as why
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from verification import atmosphere, benchmarks, canopy

import fifesim
from fifesim.accessor import DataArrayAccessor
from fifesim.base.geometry import relative_azimuth, scattering_angle_cosine
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ALIGNED, NATIVE, READINGS

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


@pytest.fixture
def case():
    """Small part of the scene, without hills, which take most of the time."""
    sections = why.scenario(cells=90).model_dump(exclude_unset=True)
    sections["terrain"] = {"dem": "flat"}
    return fifesim.Scenario(**sections)


def test_panels_agree_with_the_budget_of_their_scene(case):
    found = why.panels(case)
    budget = fifesim.budget(case, realisations=1, cells=90).isel(realisation=0).sel(variable="lai")
    assert found[0].r2 == pytest.approx(1 - float(budget["curvature"]), abs=1e-9)
    assert found[-1].r2 == pytest.approx(1 - float(budget["total"]), abs=1e-9)
    assert len({panel.r2 for panel in found}) >= 5
    figure = why.draw_panels(found)
    for panel, axis in zip(found, figure.axes, strict=True):
        assert panel.r2 == pytest.approx(np.corrcoef(panel.lai, panel.ndvi)[0, 1] ** 2, abs=1e-9)
        assert axis.texts[0].get_text() == f"R² = {panel.r2:.2f}"
        points, line = axis.get_lines()
        np.testing.assert_array_equal(points.get_xydata().T, [panel.ndvi, panel.lai])
        slope = np.diff(line.get_ydata()) / np.diff(line.get_xdata())
        assert slope[0] == pytest.approx(np.polyfit(panel.ndvi, panel.lai, 1)[0])


def test_mixed_pixel_has_the_ndvi_of_its_mean_reflectance():
    area, ndvi, (low, high, mean), (at_low, at_high, even), mixed = why.mixed_pixel()
    assert mean == (low + high) / 2 and np.all(np.diff(ndvi) > 0)
    assert np.interp([low, high, mean], area, ndvi) == pytest.approx([at_low, at_high, even], abs=1e-3)
    assert at_low < mixed < even - 0.1


def test_table_sums_to_the_total_of_the_budget():
    found, table = why.shares(), pd.read_csv(why.TABLE)
    total = table.query("variable == 'lai' and stage == 'total'").set_index("instrument")["share"]
    for name, column in found.items():
        assert column.loc[list(why.ROWS)].sum() == pytest.approx(column["total"], abs=0.1)
        assert column["total"] == pytest.approx(100 * total[name])
    lines = why.share_table().splitlines()
    assert len(lines) == 2 + len(why.ROWS) + 2
    assert lines[2].startswith(f"| geolocation error | {found.loc['geolocation error', 'TM']:.1f} % |")
    assert "−" in why.share_table() and "-0.0" not in why.share_table() and "−0.0" not in why.share_table()


def test_statements_of_the_page_on_the_table():
    found = why.shares()
    causes = found.loc[list(why.ROWS)]
    moved, curved, within = (
        "geolocation error",
        "curved relation between LAI and NDVI",
        "variation of LAI within pixels",
    )
    assert causes["TM"].idxmax() == causes["MODIS"].idxmax() == moved and causes["MSI"].idxmax() == curved
    assert set(causes["TM"].nlargest(2).index) == {moved, curved}
    assert abs(causes.loc[curved, "TM"] - causes.loc[moved, "TM"]) < 1
    assert causes.loc[within, ["TM", "MSI"]].abs().max() < 1.5 and causes["MODIS"].nlargest(2).index[1] == within
    assert causes.loc[["terrain", "atmosphere"]].abs().max().max() < 2
    assert found.loc["total"].idxmax() == "MODIS"
    assert found.loc["sub-pixel variation", "MODIS"] == pytest.approx(6, abs=0.5)


@pytest.mark.slow
def test_statements_of_the_page_on_the_panels():
    """Full scene of the figure."""
    page = (DOCS / "why_scatter.md").read_text("utf-8")
    assert "most in panel 5" in page
    found = why.panels(why.scenario())
    falls = -np.diff([panel.r2 for panel in found])
    assert np.argmax(falls) == 3 and falls[3] > 0.05
    assert np.abs(falls[[0, 4]]).max() < 0.03


SIGNED = "positive toward the sun"


def drawn(name, cells):
    """Names after the given cells of a gallery script."""
    parts, names = (DOCS / "gallery_src" / f"{name}.py").read_text(encoding="utf-8").split("\n# %%\n"), {}
    for cell in cells:
        exec(compile(parts[cell], name, "exec"), names)
    return names


def test_hot_spot_of_the_canopy_is_drawn_at_the_sun():
    names = drawn("ground/plot_5_canopy_reflectance", [0, 1, 2])
    for axis in names["axes"]:
        assert axis.get_xlabel().endswith(SIGNED)
        _, *with_hot_spot, sun = axis.get_lines()
        assert set(sun.get_xdata()) == {names["sun"].sza}
        peaks = [line.get_xdata()[np.argmax(line.get_ydata())] for line in with_hot_spot]
        assert peaks == [names["sun"].sza] * 2


def test_views_through_the_atmosphere_have_the_sign_of_the_axis(monkeypatch):
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


def test_hot_spot_of_discs_is_drawn_at_the_sun():
    """SAIL and both references."""
    axes = np.reshape(make_benchmark_pictures.discs().axes, (2, 2))
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


def test_bars_of_instruments_are_the_shares_of_their_budgets(monkeypatch):
    """Two instruments; the parts of a bar sum to its total, and all stages of the budget are in a part."""
    text = (DOCS / "gallery_src" / "answers" / "plot_3_instruments.py").read_text(encoding="utf-8").split("\n# %%\n")[0]
    names = {}
    exec(compile(re.sub(r"names = \(.*\)", 'names = ("TM", "OLI")', text), "instruments", "exec"), names)
    axis = names["axis"]
    assert [text.get_text() for text in axis.get_yticklabels()] == ["TM, 30 m", "OLI, 30 m"]
    for row, found in enumerate(names["budgets"].values()):
        bars = [patch for patch in axis.patches if round(patch.get_y() + patch.get_height() / 2) == row]
        assert sum(patch.get_width() for patch in bars) == pytest.approx(100 * float(found.total), rel=1e-9)
        assert axis.texts[row].get_text() == f"{100 * float(found.total):.0f} %"
        registration = 100 * float(found.share.sel(stage="registration"))
        assert bars[0].get_width() == pytest.approx(registration) and registration > 30


NUMBERS = json.loads((DOCS / "paper.json").read_text(encoding="utf-8"))


# Numbers that the paper states, and round numbers in definitions.
STATED = {"0.05", "0.15", "0.24", "3.33", "4.778", "0.1", "1.0"}


TABLE, TEXT = "fitted to Table 2", "fitted to the text"
ASSUMED = {"shape of the densities", "elevation", "hour and view"}


def reading(name, dem="flat"):
    (found,) = (one for one in NUMBERS["readings"] if (one["name"], one["dem"]) == (name, dem))
    return found


def nine(row, name):
    """Values for LAI by treatment and arp, shape (3, 3)."""
    return np.array([row[f"{name} {treatment} {arp:g}"] for treatment, arp in friedl1995.scenes()]).reshape(3, 3)


def test_page_is_generated_from_the_numbers():
    """To update the page, run ``python docs/make_paper.py --text``."""
    assert (DOCS / "paper.md").read_text(encoding="utf-8") == make_paper.text(NUMBERS)


def test_no_number_of_the_page_is_typed_by_hand():
    text = re.sub(r"\{\{.*?\}\}|\{%.*?%\}", "", (DOCS / "paper.md.j2").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert set(re.findall(r"(?<![\w.])\d+\.\d+", text)) <= STATED


def test_numbers_support_the_statements_of_the_page():
    """A change of the model updates the numbers, but not the text of the template."""
    drift, shift, aligned, narrow = map(reading, ("native", "offset", "aligned", "narrow"))
    hills, both = reading("aligned", "flint-hills"), reading("native", "flint-hills")
    blurred = [reading("blur-40.8"), reading("blur-48.6")]
    others = [reading(name) for name in READINGS.keys() - {"native", "offset"}]
    excess, on_hills = (nine(one, "r2") - nine(one, "paper_r2") for one in (aligned, hills))
    growth, deviation = drift["paper_growth"], NUMBERS["growth_deviation"]
    sensitivity, origins = NUMBERS["sensitivity"], {row["name"]: row["origin"] for row in NUMBERS["origins"]}
    lengths = [one["there"] for one in NUMBERS["deviations"]["lengths"]]
    noise = make_paper.noise(NUMBERS)
    statements = {
        "R2 rises with the length scale": all((np.diff(nine(one, "r2"), axis=1) > 0).all() for one in (drift, aligned)),
        "aligned pixels lack the scatter of the paper": (excess > 0.1).all() and (on_hills[0] > 0.1).all(),
        "the drift has the paper's R2, and a shift too": drift["lai_r2_rms"] < shift["lai_r2_rms"] < 0.06,
        "a shift misses the slopes": drift["lai_slope_largest"] < 0.15 < shift["lai_slope_largest"] < 0.2,
        "other readings miss R2": min(one["lai_r2_rms"] for one in others) > 0.08,
        "other readings miss the slopes": min(one["lai_slope_largest"] for one in others) > 0.2,
        "a narrow spread makes some scatter": 0.1 < narrow["lai_r2_rms"] < aligned["lai_r2_rms"] / 2,
        "a narrow spread misses long scales": narrow["lai_r2_largest_long"] > 0.15,
        "slopes grow with arp as in the paper": abs(drift["growth"] - growth) < deviation,
        "blurred slopes are too large": all((nine(one, "slope") > nine(one, "paper_slope")).all() for one in blurred),
        "blurred slopes grow too little": max(one["growth"] for one in blurred) < growth - 2 * deviation,
        "soil does not help": NUMBERS["deviations"]["blur"]["growth"] < blurred[1]["growth"],
        "fitted values hardly move R2": max(abs(one["lai_r2"]) for one in sensitivity) < 0.02,
        "fitted values move slopes": max(abs(one["lai_slope"]) for one in sensitivity) > 0.03,
        "hills and drift are not both in the paper": (nine(both, "r2") - nine(both, "paper_r2"))[1, 0] < -0.1,
        "hills alone give one row of the paper": abs(on_hills[1, 0]) <= 0.03 and (np.delete(on_hills, 3) > 0.15).all(),
        "choices in view of the table": origins["reading of Table 1"] == origins["size of the scenes"] == TABLE,
        "choices in view of the text": origins["form of the random field"] == origins["bounds of LAI"] == TEXT,
        "assumptions": {name for name, origin in origins.items() if origin == "assumed"} == ASSUMED,
        "no threshold gives the paper's lengths": max(lengths) > 10 * min(lengths),
        "NDVI of the mean is lower": all(one["bias"] < 0 for one in NUMBERS["scaling"]),
        "the criterion of scaling is not met": all(abs(one["correlation"]) > 0.3 for one in NUMBERS["scaling"]),
        "limits are met": all(one["met"] for one in NUMBERS["limits"]),
        "noise follows from R2": all(0.8 < each["native"]["estimate"] / each["native"]["value"] < 1 for each in noise),
        "aligned noise is half the paper's": all(2 * each["aligned"]["value"] < each["paper"] for each in noise),
        "its estimate is lower": all(each["aligned"]["estimate"] < each["aligned"]["value"] for each in noise),
        "another spread misses it": all(
            each["native"]["by_other"] < 0.75 * each["paper"] for each in noise if each["variable"] == "lai"
        ),
    }
    assert [words for words, holds in statements.items() if not holds] == []


def text_values(quantity, name):
    """Values of a reading and of the paper, by variable and arp."""
    rows = (row for row in NUMBERS["text"][name] if row["quantity"] == quantity and row["paper"] is not None)
    return {(row["variable"], row["arp"]): row for row in rows}


def test_noise_estimate_agrees_with_normal_pairs():
    """Eq. 7 from drawn pairs: residual standard deviation divided by slope and mean."""
    rng = np.random.default_rng(0)
    lai = 0.74 + 0.11 * rng.standard_normal(20_000)
    ndvi = 0.3 * lai + 0.03 * rng.standard_normal(lai.size)
    intercept, slope, r2 = friedl1995_table.line(lai, ndvi)
    expected = np.std(ndvi - intercept - slope * lai) / slope / lai.mean()
    assert make_paper.expected_noise(r2, lai.std() / lai.mean()) == pytest.approx(expected, rel=1e-9)


def test_noise_and_spread_agree_with_the_program():
    """Three realisations, four standard errors. To update, run ``python docs/make_paper.py --only scenes``."""
    seeds = range(make_paper.SEED + 100, make_paper.SEED + 103)
    case, options = friedl1995.Case(), {"readings": [NATIVE, ALIGNED], "distributions": ["burned-grazed"]}
    found = friedl1995_table.realise_scenes(case, seeds, **options)["ren"].mean("realisation").squeeze("distribution")
    for name in ("native", "aligned"):
        for (variable, arp), row in text_values("ren", name).items():
            value = float(found.sel(reading=name, variable=variable, arp=arp))
            assert value == pytest.approx(row["value"], abs=4 * row["deviation"] * np.sqrt(1 / 3 + 1 / 20))
    for variable, by_arp in make_paper.spread(case, seeds).items():
        assert by_arp == pytest.approx(NUMBERS["spread"][variable], rel=0.05)


@pytest.mark.slow
def test_numbers_agree_with_the_program():
    """
    Values without realisations, and Table 2 within the scatter of two realisations.

    To update, run ``python docs/make_paper.py``.
    """
    for name, found in make_paper._plain(make_paper.words(friedl1995.Case())).items():
        assert found == NUMBERS[name]
    sizes = make_paper.paper_deviations
    for name, found in (("lengths", sizes.lengths()), ("sun", sizes.sun())):
        for one, kept in zip(found, NUMBERS["deviations"][name], strict=True):
            for key in one.keys() - {"time"}:
                assert one[key] == pytest.approx(kept[key], rel=1e-4)
    lines = sizes.fits(friedl1995.Case(), range(make_paper.SEED, make_paper.SEED + 2)).mean(axis=0)
    kept = [row for row in NUMBERS["table2"]["native"] if row["variable"] == "lai"]
    np.testing.assert_allclose(lines[:, 2], [row["r2"] for row in kept], atol=0.06)
    np.testing.assert_allclose(lines[:, 1], [row["slope"] for row in kept], rtol=0.1)
