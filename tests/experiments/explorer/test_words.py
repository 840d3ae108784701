"""What a page calls its sliders."""

from dataclasses import replace

from fifesim.experiments.explorer import page
from fifesim.experiments.explorer.settings import sweep_of
from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.experiments.scatter.stages import STAGES
from fifesim.scenario.scenario import parse_scenario


def test_every_stage_has_its_words():
    assert set(page.STAGE_WORDS) == {CURVATURE, *STAGES}


def test_sliders_begin_at_the_scenario_and_say_its_values(sweep):
    arp, haze, sza, instrument, registration = page.slider_words(sweep)
    assert arp["start"] == 0 and "leaf area is correlated up to 8 m, arp 0.15" in arp["texts"][0]
    assert haze["marks"] == ["45 km"] and haze["start"] == 0
    assert sza["texts"][0] == "28.5° from overhead"
    assert instrument["marks"] == ["HRV", "TM"]
    assert instrument["texts"] == [
        "SPOT-1 HRV 1, multispectral mode, 20 m; blur: assumed ± 0.08",
        "Landsat-5 Thematic Mapper, 30 m; blur: in-flight ± 0.12",
    ]
    assert registration["marks"] == ["0", "½"] and registration["texts"] == ["none", "0.50 pixel"]


def test_what_cannot_vary_says_so(sweep):
    arp, haze, *_ = page.slider_words(replace(sweep, arps=(None,), hazes=(None,)))
    assert arp["texts"] == ["as in the map"] and haze["texts"] == ["without haze"]


def test_haze_is_said_as_it_is_given(small):
    values = small.model_dump(exclude_unset=True) | {"atmosphere": {"aot": 0.15}}
    haze = page.slider_words(sweep_of(parse_scenario(values)))[1]
    assert haze["name"] == "Haze" and haze["texts"][haze["start"]] == "aerosol optical thickness 0.15"
