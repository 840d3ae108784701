"""The explorer page: settings of its sliders, results equal to the public functions, data, and display in a browser."""

import asyncio
import base64
import json
import re
import tomllib
import zlib
from dataclasses import replace

import numpy as np
import pytest
from browser import CHROMIUM, opened
from typer.testing import CliRunner

import fifesim
from fifesim.cli import app
from fifesim.experiments import explorer
from fifesim.experiments.explorer import explorer_page, packed, page_data, stepped
from fifesim.experiments.explorer_settings import Setting, outcomes_of, sweep_of
from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.experiments.scatter.stages import STAGES, VARIABLES
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.toml import write_scenario

# 12 x 12 pixels of 30 m.
SMALL = {
    "grid": {"west": 707970.0, "north": 4331220.0, "width": 400.0, "height": 360.0, "cell": 10 / 3},
    "terrain": {"dem": "flat"},
    "ground": {"arp": 0.15, "seed": 3},
    "atmosphere": {"visibility": 45.0},
}
FLAT = {"terrain": {"dem": "flat"}}
SITE = {"west": 704970.0, "north": 4334220.0, "width": 3000.0, "height": 3000.0}


def ndvi_with_data(scenario):
    """Truth and NDVI of a run, for pixels that also have data without displacement, as in a budget."""
    run = fifesim.simulate(scenario)
    still = scenario.sensor.model_copy(update={"offset": [0.0, 0.0]})
    aligned = fifesim.simulate(scenario.model_copy(update={"sensor": still}))
    return run["truth"], run["image"]["ndvi"].where(aligned["image"]["ndvi"].notnull().values)


@pytest.fixture(scope="module")
def small():
    return parse_scenario(SMALL)


@pytest.fixture(scope="module")
def sweep(small):
    """Two values of each slider except haze, for the instruments TM and HRV."""
    found = sweep_of(small)
    return replace(
        found, arps=found.arps[:2], hazes=found.hazes[2:], szas=found.szas[:2], instruments=("HRV", "TM"),
        offsets=(found.offsets[0], found.offsets[2]),
    )  # fmt: skip


@pytest.fixture(scope="module")
def outcomes(sweep):
    return outcomes_of(sweep)


@pytest.fixture(scope="module")
def page(sweep, outcomes, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "explore.html"
    path.write_text(explorer_page(sweep, outcomes), encoding="utf-8")
    return path


def test_default_is_the_default_scenario():
    """A landscape with many stages has fewer settings."""
    sweep = sweep_of()
    assert sweep.arps == (None,) and sweep.scenario.learned == "konza" and sweep.scenario.terrain.dem == "flint-hills"
    box, whole = sweep.scenario.geobox(), fifesim.Scenario().geobox()
    assert box.shape == (270, 270)
    assert (box.affine.c - whole.affine.c) % 30 == pytest.approx(0, abs=1e-6)
    assert sweep.shape == (1, 2, 2, 2, 4) and sweep_of(fifesim.Scenario(base="paper")).shape == (3, 3, 3, 4, 4)
    assert sweep.hazes == (10.0, 45.0) and sweep.szas[1] == 60.0 and sweep.instruments == ("MSI", "TM")


def test_sliders_have_the_values_of_the_scenario():
    own = FLAT | {"grid": SITE, "ground": {"arp": 0.2}, "geometry": {"sza": 33.0, "saa": 90.0}}
    own |= {"atmosphere": {"visibility": 30.0}}
    sweep = sweep_of(parse_scenario(own | {"sensor": {"instrument": "OLI", "offset": [0.3, 0.4]}}))
    assert sweep.arps == (0.15, 0.2, 0.249) and sweep.hazes == (10.0, 30.0, 45.0) and sweep.szas == (20.0, 33.0, 60.0)
    assert "OLI" in sweep.instruments and (0.3, 0.4) in sweep.offsets and len(sweep.offsets) == 4
    words = explorer.slider_words(sweep)
    assert [each["start"] for each in words[:3]] == [1, 1, 1] and words[1]["marks"] == ["10 km", "30 km", "45 km"]
    assert set(explorer.STAGE_WORDS) == {CURVATURE, *STAGES}


def test_setting_changes_only_its_values_of_the_scenario(small):
    sensor = {"sensor": {"instrument": "L4TM", "noise": ["thermal"], "min_valid": 0.9}}
    sweep = sweep_of(parse_scenario(small.model_dump(exclude_unset=True) | sensor))
    own = sweep.at(Setting(0.249, 10.0, 60.0, "L4TM"), (0.0, 0.5))
    assert (own.ground.arp, own.atmosphere.visibility, own.sensor.offset) == (0.249, 10.0, [0.0, 0.5])
    assert own.sun_and_view().sza == 60.0 and own.sun_and_view().saa == sweep.scenario.sun_and_view().saa
    assert own.ground.seed == 3 and own.geobox() == sweep.scenario.geobox()
    assert sweep.at(Setting(0.24, 10.0, 60.0, "MSS")).sensor.noise == []
    other = sweep.at(Setting(0.24, 10.0, 60.0, "MSI"))
    assert other.sensor.bands == ["MSI4", "MSI8"] and other.sensor.noise == ["all"] and other.sensor.min_valid == 0.9


def test_instruments_fit_the_ground_and_its_cells(small):
    """MSS has 6 pixels in 360 m; a cell of 20 m is larger than a pixel of MSI."""
    assert sweep_of(small).instruments == ("MSI", "HRV", "TM")
    coarse = parse_scenario(FLAT | {"grid": SITE | {"cell": 25.0}, "sensor": {"instrument": "MODIS"}})
    found = sweep_of(coarse)
    assert found.instruments == ("TM", "MSS", "MODIS") and found.scenario.geobox().shape == (120, 120)


def test_maps_have_no_arp_slider_and_clear_air_no_haze_slider(tmp_path):
    grid, path = fifesim.grid_at("EPSG:26914", 707970.0, 4331220.0, 400.0, 400.0, 10.0), tmp_path / "lai.tif"
    fifesim.lai_scene(grid, "burned-grazed", arp=0.24, seed=1).fifesim.to_geotiff(path)
    ground = {"ground": {"lai_file": str(path)}, "grid": {"cell": 10.0}}
    own = parse_scenario(FLAT | ground | {"atmosphere": {"aerosol": "none"}})
    sweep = sweep_of(own)
    assert sweep.arps == (None,) and sweep.hazes == (None,)
    np.testing.assert_array_equal(sweep.at(sweep.settings[0]).ground.arp, own.ground.arp)


def test_ground_and_atmosphere_limit_the_sliders(small):
    """Optics by band exclude other instruments, and haze given as optical thickness stays optical thickness."""
    values = small.model_dump(exclude_unset=True)
    sweep = sweep_of(parse_scenario(values | {"atmosphere": {"aot": 0.15}}))
    assert sweep.haze == "aot" and sweep.hazes == (0.05, 0.15, 0.5)
    assert sweep.at(replace(sweep.settings[0], haze=0.5)).atmosphere.aot == 0.5
    values["ground"] |= {"leaf_reflectance": {"TM3": 0.1, "TM4": 0.5}, "leaf_transmittance": {"TM3": 0.05, "TM4": 0.4}}
    assert sweep_of(parse_scenario(values)).instruments == ("TM",)
    with pytest.raises(ValueError, match="fewer than 12 x 12 pixels of 30 m"):
        sweep_of(parse_scenario(FLAT | {"grid": SITE | {"width": 300.0}}))


def scenario_at(sweep, place):
    setting = sweep.settings[np.ravel_multi_index(place[:4], sweep.shape[:4])]
    return sweep.at(setting, sweep.offsets[place[4]])


def test_shares_and_curvature_add_up_to_the_unexplained_variance(outcomes):
    left = outcomes.shares.sum(axis=-1) + outcomes.curvature
    np.testing.assert_allclose(1 - outcomes.lines[..., 2], left, atol=1e-12)
    registration = outcomes.shares[..., list(STAGES).index("registration")]
    assert (registration[..., 0, :] == 0).all() and (registration[..., 1, :] > 0).all()


def test_reflectance_of_the_digital_numbers_equals_the_image(sweep, outcomes):
    """NDVI on the page equals `fifesim.ndvi` for every sun angle."""
    place = (1, 0, 1, 0, 0)
    run = fifesim.simulate(scenario_at(sweep, place))
    counts = outcomes.images[0][1, 0, 1, 0]
    red, nir = (outcomes.cameras[0].reflectance[k][counts[k]] for k in (0, 1))
    np.testing.assert_allclose((nir - red) / (nir + red), run["image"]["ndvi"].values, rtol=1e-12)
    expected = run["image"]["dn"].fifesim.to_reflectance().values[0] * np.cos(np.radians(sweep.szas[1]))
    np.testing.assert_allclose(red, expected, rtol=1e-12)


@pytest.mark.parametrize("place", [(0, 0, 0, 1, 0), (1, 0, 1, 0, 1)])
def test_outcomes_equal_the_public_functions(place, sweep, outcomes):
    arp, haze, sza, instrument, offset = place
    scenario = scenario_at(sweep, place)
    run = fifesim.simulate(scenario)
    np.testing.assert_array_equal(outcomes.scenes[arp], run["scene"]["lai"].values)
    rows, columns = outcomes.images[instrument].shape[-2:]
    np.testing.assert_array_equal(outcomes.images[instrument][arp, haze, sza, offset], run["image"]["dn"].values)
    truth, ndvi = ndvi_with_data(scenario)
    for k, name in enumerate(VARIABLES):
        found = outcomes.truths[instrument][arp, sza, k]
        np.testing.assert_array_equal(found, run["truth"][name].values[:rows, :columns])
        line = fifesim.regress(truth[name], ndvi, pair="index")
        np.testing.assert_allclose(outcomes.lines[place][k], [line.slope, line.intercept, line.r2, line.n], rtol=1e-9)
    budget = fifesim.budget(scenario, realisations=1, cells=400).isel(realisation=0)
    np.testing.assert_allclose(outcomes.shares[place], budget["share"].sel(variable=list(VARIABLES)), atol=1e-12)
    np.testing.assert_allclose(outcomes.curvature[place], budget["curvature"], atol=1e-12)


def test_constant_ndvi_gives_no_line(small):
    """MSS has 6 bits, and the scene is hazy with patches of 4 m."""
    values = small.model_dump(exclude_unset=True) | {"sensor": {"instrument": "MSS"}}
    values["grid"] |= {"width": 720.0, "height": 720.0}
    one = {"arps": (0.0,), "hazes": (5.0,), "szas": (60.0,), "instruments": ("MSS",), "offsets": ((0.0, 0.0),)}
    found = outcomes_of(replace(sweep_of(parse_scenario(values)), **one))
    flat = np.isnan(found.lines[..., 0])
    assert flat.any() and (found.lines[..., 2][flat] == 0).all()
    np.testing.assert_allclose(found.shares.sum(axis=-1) + found.curvature, 1 - found.lines[..., 2], atol=1e-12)


def test_page_is_self_contained_and_hides_local_paths(page, outcomes, tmp_path):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=\"(?!data:)", text) and "http:" not in text and "https:" not in text
    assert "fifesim " + fifesim.__version__ in text and "seed 3" in text
    assert str(tmp_path.parent) not in text
    r2, introduction = outcomes.lines[..., 0, 2], text.split("</header>")[0]
    for place in ((0, 0, 0, 1, 0), (0, 0, 0, 1, 1), (1, 0, 0, 1, 1)):
        assert f"{r2[place]:.2f}" in introduction


def test_data_have_valid_axis_ranges_and_file_names_without_folders(sweep, outcomes, tmp_path):
    dem = tmp_path / "hills.tif"
    fifesim.flint_hills(sweep.scenario.geobox(), seed=1).fifesim.to_geotiff(dem)
    values = sweep.scenario.model_dump(exclude_unset=True) | {"terrain": {"dem": str(dem)}}
    _, data = page_data(replace(sweep, scenario=parse_scenario(values)), outcomes)
    assert data["keys"]["tables"]["terrain"]["dem"] == "hills.tif"
    assert str(tmp_path) not in json.dumps(data)
    assert all(low < high for low, high in data["ranges"].values())
    assert data["ranges"]["lai"][0] >= 0 and data["ranges"]["fpar"][1] <= 1


def test_packed_arrays_are_recovered():
    arrays = {
        "a": np.arange(5, dtype=np.uint8),
        "b": np.array([[1, 256], [65535, 0]], np.uint16),
        "c": np.array([0.1, np.nan], np.float32),
        "d": np.array([[np.pi]]),
    }
    text, places = packed(arrays)
    whole = zlib.decompress(base64.b64decode(text))
    for name, array in arrays.items():
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


def test_command_writes_one_page_and_overwrites_only_on_request(sweep, small, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few = replace(sweep, arps=sweep.arps[:1], szas=sweep.szas[:1], instruments=("TM",))
    monkeypatch.setattr(explorer, "sweep_of", lambda scenario: few)
    (tmp_path / "mine.toml").write_text(write_scenario(small.complete()))
    command = ["explore", "mine.toml", "-o", "pages/mine.html"]
    made = CliRunner().invoke(app, command)
    assert made.exit_code == 0, made.output
    assert [path.name for path in (tmp_path / "pages").iterdir()] == ["mine.html"]
    again = CliRunner().invoke(app, command)
    assert again.exit_code == 2 and "--overwrite" in again.output
    assert CliRunner().invoke(app, [*command, "--overwrite"]).exit_code == 0


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_displayed_numbers_match_the_public_functions(page, sweep, tmp_path):
    """
    Sliders are moved by keyboard. R2, slope, intercept and shares are compared with a run of the displayed scenario.
    """

    async def look():
        moves = {"arp": "ArrowRight", "registration": "End", "instrument": "Home", "sza": "ArrowRight"}
        async with opened(page, tmp_path) as browser:
            await browser.until("document.body?.classList.contains('ready')")
            for slider, key in moves.items():
                await browser.evaluate(f"document.getElementById('{slider}').focus()")
                await browser.press(key)
            shown = {name: await browser.text(name) for name in ("r2", "slope", "intercept", "n", "toml", "headline")}
            stages = await browser.evaluate(
                "[...document.querySelectorAll('.budget li:not(.scale)')].map((row) => row.innerText)"
            )
            own = "(() => { const { ndvi, truth } = window.explorer.pixels(); return [[...ndvi], [...truth]]; })()"
            pixels = await browser.evaluate(own)
            assert browser.errors == [] and browser.addresses == [page.absolute().as_uri()]
            return shown, stages, pixels

    shown, stages, (ndvi, truth) = asyncio.run(look())
    scenario = parse_scenario(tomllib.loads(shown["toml"]))
    assert (scenario.ground.arp, scenario.sensor.offset) == (sweep.arps[1], list(sweep.offsets[1]))
    assert scenario.geometry.sza == sweep.szas[1] and scenario.sensor.instrument == "HRV"
    run = fifesim.simulate(scenario)
    of_run, with_both = ndvi_with_data(scenario)
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
