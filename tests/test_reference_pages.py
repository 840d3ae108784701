"""Tables that the documentation generates from the code are complete."""

import tomllib
from pathlib import Path

import make_tables as tables
import pytest
import typer
import yaml

import fifesim
from fifesim.cli import app
from fifesim.scenario.keys import FIELD_LIMITS, StandKeys
from fifesim.scenario.scenario import Scenario
from fifesim.sensor.response.noise import KINDS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BOUNDS = ("ge", "gt", "le", "lt")


def sections(text):
    """Text of each second-level section, by heading."""
    parts = text.split("\n## ")
    parts[0] = parts[0].removeprefix("## ")
    return {part.partition("\n")[0].strip("`"): part for part in parts}


def rows(text):
    """Cells of table rows in a text, by the first cell."""
    lines = [line.strip("|").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {cells[0].strip(" `"): [cell.strip() for cell in cells] for cells in lines}


def test_scenario_keys_have_unit_range_default_and_meaning():
    found = sections(tables.scenario_keys())
    assert list(found) == [f"[{'classes.NAME' if name == 'classes' else name}]" for name in Scenario.model_fields]
    for name, text in zip(Scenario.model_fields, found.values(), strict=True):
        is_class = name == "classes"
        section = Scenario.section((name, "grass") if is_class else (name,))
        by_key = rows(text)
        for key, known in section.model_fields.items():
            if is_class and key in StandKeys.model_fields:
                assert f"`{key}`" in text
                continue
            _, kind, unit, limits, default, meaning = by_key[key]
            assert kind and meaning.replace("µ", "u") == tables.docstrings.raised(known.description)
            assert unit == tables.docstrings.raised(f"[{section.unit(key)}]")[1:-1]
            bounds = [getattr(each, name) for each in known.metadata for name in BOUNDS if hasattr(each, name)]
            assert all(tables._number(bound) in limits for bound in bounds)
            if known.default is None:
                assert default == "–"
            elif known.default == {}:
                assert default == "empty"
            else:
                assert tomllib.loads(f"key = {default.strip('`')}")["key"] == approx(known.default)


def approx(value):
    return pytest.approx(value) if isinstance(value, float) else value


def test_scenario_accepts_exactly_the_listed_names():
    for (section, key), names in tables.NAMES.items():
        annotation = Scenario.section((section,)).model_fields[key].annotation
        for name in names:
            others = {"instrument": "L4TM"} if key == "noise" else {}
            if name in (*KINDS, "all") and key == "noise":
                others["noise_model"] = {"thermal": 0.1, "shot": 0.1, "detectors": 2, "gain_spread": 0.1}
            value = [name] if annotation == list[str] else name
            found = getattr(fifesim.Scenario(**{section: {key: value} | others}), section)
            assert getattr(found, key) == value
        wrong = ["nonsense"] if annotation == list[str] else "nonsense"
        with pytest.raises(ValueError, match="nonsense"):
            fifesim.Scenario(**{section: {key: wrong}})


def test_landscape_limits_agree_with_the_table():
    for key, (low, high) in FIELD_LIMITS.items():
        assert rows(sections(tables.scenario_keys())["[landscape]"])[key][3] == f"[{low:g}, {high:g}]"
        with pytest.raises(ValueError, match="must be in"):
            fifesim.Scenario(landscape={"cover": "none", "deviations": {"soil": 0.1}} | {key: {"soil": high + 0.01}})


def test_page_has_every_command_option_and_help_text():
    group = typer.main.get_command(app)
    if any(parameter.help is None for command in group.commands.values() for parameter in command.params):
        pytest.skip(f"typer {typer.__version__} has no help of arguments, which the page then lacks")
    found = sections(tables.command_line())
    assert list(found) == list(group.commands)
    for name, command in group.commands.items():
        assert command.help in found[name]
        for parameter in command.params:
            assert " ".join(parameter.help.split()) in " ".join(found[name].split())
            names = parameter.opts if parameter.param_type_name == "option" else [parameter.name]
            assert all(option in found[name] for option in names)
    threads = "`--threads <int>` | Number of threads; by default one per core. (at least 1)"
    assert "(default: fife)" in found["simulate"] and threads in found["simulate"]
    assert "default: 0" not in found["simulate"] and "\nfifesim simulate mine.toml -o run" in found["simulate"]
    assert "fifesim rerun [OPTIONS] {file}" in found["rerun"]


def test_page_has_a_source_for_every_instrument_value():
    page = tables.instruments()
    found = {name.partition("\n")[0]: text for name, text in sections(page).items()}
    for name in fifesim.sensor.instrument_names():
        item, text = fifesim.instrument(name), found[name]
        by_quantity = rows(text)
        for number in tables.given_numbers(item):
            cells = by_quantity[tables.QUANTITIES.get(number, [number.replace("_", " ")])[0]]
            keys = {band.sources.get(number) or item.sources.get(number) for band in item.bands}
            assert all(key in cells[2] for key in keys if key)
        assert all(f"**{key}**: {publication}" in text for key, publication in item.references.items())
        assert all(gap in text for gap in item.not_found.values())
        assert all(band.name in text for band in item.bands if len(item.bands) < 22)
        assert f"(#{tables._anchor(item)})" in page and f"({tables._anchor(item)})=" in page


def test_values_of_an_instrument():
    found = sections(tables.instruments())
    tm, msi = rows(found["TM"]), rows(found["MSI"])
    assert tm["altitude"][1:3] == ["705 km", "Friedl1995"]
    assert tm["geolocation error (rms along each axis)"][1:3] == ["8.5 m", "USGS2020"]
    assert "20 m (MSI5–MSI7, MSI8A, MSI11, MSI12)" in msi["pixel of the gridded product"][1]
    assert msi["MSI10"][-1] == "SNR 50 at 6" and tm["TM3"][3:5] == ["-1.2 to 204.3", "1536"]
    overview = rows(tables.instruments().partition("## ")[0])
    assert overview["[MSS](#instrument-mss)"][2:] == ["60", "6", "4", "unknown", "unknown", "unknown"]
    assert overview["[L4TM](#instrument-l4tm)"][-3] != "unknown" and overview["[L4TM](#instrument-l4tm)"][-1] == "8.5 m"


def test_citation_page_has_the_software_and_the_paper():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    (paper,) = cited["references"]
    text = tables.citation()
    flat = " ".join(text.split())
    assert cited["title"] in text and fifesim.__version__ in text
    assert f"title = {{{{{paper['title']}}}}}" in flat and f"https://doi.org/{paper['doi']}" in text
    assert f"volume = {{{paper['volume']}}}" in text and f"{paper['start']}--{paper['end']}" in text
    assert all(each["family-names"] in text for each in paper["authors"])
    assert max(map(len, text.partition("```bibtex")[2].splitlines())) <= 96


def test_visibility_table_agrees_with_optical_thickness():
    page = (DOCS / "howto" / "aerosol.md").read_text("utf-8")
    found = [cells for name, cells in rows(page).items() if name.endswith(" km")]
    assert len(found) == 5
    for visibility, aot, _ in found:
        air = fifesim.Atmosphere(visibility=float(visibility.removesuffix(" km")))
        assert f"{air.aot:.2f}" == aot
    assert "45 km of visibility" in page and fifesim.Scenario().atmosphere.visibility == 45
