"""The explorer page: its text and data, and its display in a browser."""

import asyncio
import base64
import json
import re
import tomllib
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, opened
from typer.testing import CliRunner

import fifesim
from fifesim.cli import app
from fifesim.experiments import explorer
from fifesim.experiments.explorer import explorer_page, packed, page_data, stepped
from fifesim.experiments.explorer_settings import sweep_of
from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.experiments.scatter.stages import STAGES
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.toml import write_scenario

READY = "document.body?.classList.contains('ready')"
in_a_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")


def looked_at(page, folder, look):
    """Result of the coroutine `look` on the page; the page must have no errors and request no other address."""

    async def visit():
        async with opened(page, folder) as browser:
            await browser.until(READY)
            found = await look(browser)
            assert browser.errors == []
            assert browser.addresses == [page.absolute().as_uri()]
            return found

    return asyncio.run(visit())


async def press(browser, element, key):
    """Press a key on an element of the page."""
    await browser.evaluate(f"document.getElementById('{element}').focus()")
    await browser.press(key)


def test_page_is_self_contained_and_hides_local_paths(page, sweep, outcomes, tmp_path):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=\"(?!data:)", text) and "http:" not in text and "https:" not in text
    assert "fifesim " + fifesim.__version__ in text and "seed 3" in text
    assert str(tmp_path.parent) not in text
    assert len(text) < 1_000_000


def test_introduction_has_the_numbers_of_the_page(page, outcomes):
    r2 = outcomes.lines[..., 0, 2]
    text = page.read_text(encoding="utf-8").split("</header>")[0]
    for place in ((0, 0, 0, 1, 0), (0, 0, 0, 1, 1), (1, 0, 0, 1, 1)):
        assert f"{r2[place]:.2f}" in text


def test_data_have_valid_axis_ranges_and_file_names_without_folders(sweep, outcomes, tmp_path):
    dem = tmp_path / "hills.tif"
    fifesim.flint_hills(sweep.scenario.geobox(), seed=1).fifesim.to_geotiff(dem)
    values = sweep.scenario.model_dump(exclude_unset=True) | {"terrain": {"dem": str(dem)}}
    _, data = page_data(replace(sweep, scenario=parse_scenario(values)), outcomes)
    assert data["keys"]["tables"]["terrain"]["dem"] == "hills.tif"
    assert str(tmp_path) not in json.dumps(data)
    assert all(low < high for low, high in data["ranges"].values())
    assert data["ranges"]["lai"][0] >= 0 and data["ranges"]["fpar"][1] <= 1


@in_a_browser
def test_displayed_numbers_match_the_public_functions(page, sweep, tmp_path, with_data):
    """
    Sliders are moved by keyboard. R2, slope, intercept and shares are compared with a run of the displayed scenario.
    """

    async def look(browser):
        moves = {"arp": "ArrowRight", "registration": "End", "instrument": "Home", "sza": "ArrowRight"}
        for slider, key in moves.items():
            await press(browser, slider, key)
        shown = {name: await browser.text(name) for name in ("r2", "slope", "intercept", "n", "toml", "headline")}
        stages = await browser.evaluate(
            "[...document.querySelectorAll('.budget li:not(.scale)')].map((row) => row.innerText)"
        )
        own = "(() => { const { ndvi, truth } = window.explorer.pixels(); return [[...ndvi], [...truth]]; })()"
        return shown, stages, await browser.evaluate(own)

    shown, stages, (ndvi, truth) = looked_at(page, tmp_path, look)
    scenario = parse_scenario(tomllib.loads(shown["toml"]))
    assert (scenario.ground.arp, scenario.sensor.offset) == (sweep.arps[1], list(sweep.offsets[1]))
    assert scenario.geometry.sza == sweep.szas[1] and scenario.sensor.instrument == "HRV"
    run = fifesim.simulate(scenario)
    of_run, with_both = with_data(scenario)
    line = fifesim.regress(of_run["lai"], with_both, pair="index")
    expected = {"r2": f"{line.r2:.3f}", "slope": f"{line.slope:.3f}", "intercept": f"{line.intercept:.3f}"}
    assert {name: shown[name].replace("−", "-") for name in expected} == expected and shown["n"] == str(line.n)
    assert f"{100 * line.r2:.0f} %" in shown["headline"]
    budget = fifesim.budget(scenario, realisations=1, cells=400).isel(realisation=0).sel(variable="lai")
    said = {row.split("\n")[0]: row.split("\n")[-1].replace("−", "-") for row in stages}
    assert said["curvature"] == f"{100 * float(budget['curvature']):.1f}"
    for name in ("registration", "point spread", "non-linearity", "quantisation", "atmosphere"):
        assert float(said[name]) == pytest.approx(100 * float(budget["share"].sel(stage=name)), abs=0.05 + 1e-9)
    np.testing.assert_allclose(np.array(ndvi, float).ravel(), run["image"]["ndvi"].values.ravel(), rtol=1e-12)
    rows, columns = run["image"]["ndvi"].shape
    np.testing.assert_allclose(np.array(truth, float), run["truth"]["lai"].values[:rows, :columns].ravel(), atol=1e-4)


@in_a_browser
def test_scenario_of_a_landscape_is_written_completely(sweep, outcomes, tmp_path):
    """Classes are separate tables; deviations and similar keys are inline tables."""
    window = sweep.scenario.grid.model_dump()
    values = fifesim.scenario.default_scenario().model_dump(exclude_unset=True) | {
        "grid": window,
        "terrain": {"dem": "flat"},
    }
    values["landscape"] = {"cover": "pastures", "deviations": {"soil": 0.02}}
    values["classes"] = {"one": {"share": 0.4, "brown": 0.1}, "other": {"share": 0.6}}
    own = replace(sweep, scenario=parse_scenario(values))
    page = tmp_path / "land.html"
    page.write_text(explorer_page(own, outcomes), encoding="utf-8")
    folder = tmp_path / "browser"
    folder.mkdir()
    text = looked_at(page, folder, lambda browser: browser.text("toml"))
    start = replace(own.settings[0], instrument="TM")
    assert parse_scenario(tomllib.loads(text)).complete() == own.at(start)


@in_a_browser
def test_page_states_the_unchanged_steps(page, tmp_path):
    """Registration moves pixels relative to the ground; the sun changes neither the ground nor its leaf area."""

    async def moves(browser):
        names = ("ground", "truth", "image", "line")
        found = []
        for slider in ("registration", "sza", "arp"):
            await press(browser, slider, "End")
            found.append({name: await browser.text(f"{name}-moved") for name in names})
            found[-1]["moved"] = await browser.text("moved-what")
        return found

    registration, sun, patches = looked_at(page, tmp_path, moves)
    assert registration["ground"] == registration["truth"] == "the same" and "→" in registration["line"]
    assert registration["moved"] == "Registration error: 0 → ½" and "other numbers" in registration["image"]
    assert sun["ground"] == sun["truth"] == "the same" and "other numbers" in sun["image"]
    assert patches["ground"] == "another" and patches["truth"] == "others"


@in_a_browser
def test_page_fits_its_width_and_follows_mouse_and_keyboard(page, tmp_path):
    async def at(browser, width, dark):
        await browser.size(width, 900, dark)
        await browser.evaluate("document.getElementById('reset').click()")
        await browser.evaluate("document.getElementById('registration').scrollIntoView({block: 'center'})")
        box = "const { left, top, width, height } = document.getElementById('registration').getBoundingClientRect()"
        left, top, wide, high = await browser.evaluate(f"(() => {{ {box}; return [left, top, width, height]; }})()")
        before = await browser.text("r2")
        await browser.click(left + wide - 6, top + high / 2)
        assert before != await browser.text("r2")
        said = await browser.evaluate("document.getElementById('registration').getAttribute('aria-valuetext')")
        assert said == "0.50 pixel, 15 m"
        await press(browser, "image", "ArrowDown")
        assert "row 8" in await browser.text("reading")
        pen = "const pen = new OffscreenCanvas(12, 12).getContext('2d'); pen.drawImage(it, 0, 0, 12, 12)"
        levels = f"(it) => {{ {pen}; return new Set(pen.getImageData(0, 0, 12, 12).data).size; }}"
        drawn = await browser.evaluate(f"[...document.querySelectorAll('canvas')].map({levels})")
        assert len(drawn) == 3 and min(drawn) > 15
        wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert await browser.evaluate(wide) <= 0
        paper = await browser.evaluate("getComputedStyle(document.body).backgroundColor")
        brightness = sum(map(int, re.findall(r"\d+", paper)[:3]))
        assert brightness < 150 if dark else brightness > 600

    async def look(browser):
        for width, dark in ((400, False), (400, True), (1600, False), (1600, True)):
            await at(browser, width, dark)
        return await browser.printed()

    assert looked_at(page, tmp_path, look).startswith(b"%PDF")


@in_a_browser
def test_axis_has_three_to_seven_ticks(page, tmp_path):
    """An axis with fewer ticks is hard to read."""
    drawing = Path(explorer.__file__).with_name("explore_drawing.js").read_text(encoding="utf-8")
    cases = [(0.41, 0.56, 3), (0.2, 0.47, 3), (0.0, 2.3, 5), (-0.01, 0.3, 5)]

    async def look(browser):
        calls = ", ".join(f"ticks{case}.found" for case in cases)
        return await browser.evaluate(f"(() => {{ {drawing}\nreturn [{calls}]; }})()")

    for (low, high, _), found in zip(cases, looked_at(page, tmp_path, look), strict=True):
        assert 3 <= len(found) <= 7 and low <= min(found) and max(found) < high + 1e-6


ARRAYS = {
    "a": np.arange(5, dtype=np.uint8),
    "b": np.array([[1, 256], [65535, 0]], np.uint16),
    "c": np.array([0.1, np.nan], np.float32),
    "d": np.array([[np.pi]]),
}


def test_packed_arrays_are_recovered():
    text, places = packed(ARRAYS)
    whole = zlib.decompress(base64.b64decode(text))
    for name, array in ARRAYS.items():
        place = places[name]
        assert place["start"] % 8 == 0 and tuple(place["shape"]) == array.shape
        part = np.frombuffer(whole[place["start"] :][: array.nbytes], np.uint8)
        if place["kind"] == "u2":
            found = part[: array.size] + 256 * part[array.size :].astype(np.uint16)
        else:
            found = np.frombuffer(part.tobytes(), f"<{place['kind']}")
        np.testing.assert_array_equal(found.reshape(array.shape), array)


@pytest.mark.parametrize(("kind", "levels"), [("u1", 254), ("u2", 65534)])
def test_stepped_values_are_within_half_a_step(kind, levels):
    values = np.random.default_rng(5).normal(size=500)
    values[3] = np.nan
    codes, low, step = stepped(values, kind)
    assert codes.dtype == kind and codes[3] == 0 and codes.max() == levels + 1
    found = np.where(codes, low + (codes - 1.0) * step, np.nan)
    np.testing.assert_allclose(found, values, atol=step / 2 * (1 + 1e-9))
    assert step == pytest.approx(np.ptp(values[np.isfinite(values)]) / levels)
    codes, low, _ = stepped(np.full(3, 2.5), kind)
    assert codes.tolist() == [1, 1, 1] and low == 2.5
    with pytest.raises(ValueError, match="x is of type int64: packed takes uint8"):
        packed({"x": np.arange(3)})


def test_sliders_start_at_the_scenario_and_show_its_values(sweep):
    arp, haze, sza, instrument, registration = explorer.slider_words(sweep)
    assert arp["start"] == 0 and "leaf area is correlated up to 8 m, arp 0.15" in arp["texts"][0]
    assert haze["marks"] == ["45 km"] and haze["start"] == 0
    assert sza["texts"][0] == "28.5° from overhead"
    assert instrument["marks"] == ["HRV", "TM"]
    assert instrument["texts"] == [
        "SPOT-1 HRV 1, multispectral mode, 20 m; blur: assumed ± 0.08",
        "Landsat-5 Thematic Mapper, 30 m; blur: in-flight ± 0.12",
    ]
    assert registration["marks"] == ["0", "½"] and registration["texts"] == ["none", "0.50 pixel"]


def test_slider_texts_follow_the_varied_quantity(sweep, small):
    assert set(explorer.STAGE_WORDS) == {CURVATURE, *STAGES}
    arp, haze, *_ = explorer.slider_words(replace(sweep, arps=(None,), hazes=(None,)))
    assert arp["texts"] == ["as in the map"] and haze["texts"] == ["without haze"]
    values = small.model_dump(exclude_unset=True) | {"atmosphere": {"aot": 0.15}}
    haze = explorer.slider_words(sweep_of(parse_scenario(values)))[1]
    assert haze["name"] == "Haze" and haze["texts"][haze["start"]] == "aerosol optical thickness 0.15"


def test_command_writes_one_page_and_overwrites_only_on_request(sweep, small, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few = replace(sweep, arps=sweep.arps[:1], szas=sweep.szas[:1], instruments=("TM",))
    monkeypatch.setattr(explorer, "sweep_of", lambda scenario: few)
    (tmp_path / "mine.toml").write_text(write_scenario(small.complete()))
    command = ["explore", "mine.toml", "-o", "pages/mine.html"]
    made = CliRunner().invoke(app, command)
    assert made.exit_code == 0, made.output
    assert re.search(r"^pages/mine.html\ndone in .*: open pages/mine.html in a browser\n$", made.output, re.MULTILINE)
    assert [path.name for path in (tmp_path / "pages").iterdir()] == ["mine.html"]
    again = CliRunner().invoke(app, command)
    assert again.exit_code == 2 and "--overwrite" in again.output
    first = (tmp_path / "pages" / "mine.html").read_bytes()
    assert CliRunner().invoke(app, [*command, "--overwrite"]).exit_code == 0
    assert (tmp_path / "pages" / "mine.html").read_bytes() == first
    with pytest.raises(ValueError, match="is a folder, and explore writes one page"):
        fifesim.experiments.explore(path=tmp_path)
