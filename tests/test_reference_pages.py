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


def test_table_has_a_source_for_every_instrument_value():
    known, bands = tables.instrument_sources(), tables.instrument_bands()
    for name in fifesim.sensor.instrument_names():
        item = fifesim.instrument(name)
        by_quantity = known[known["instrument"] == name].set_index("quantity")
        for number in tables.given_numbers(item):
            row = by_quantity.loc[tables.QUANTITIES.get(number, [number.replace("_", " ")])[0]]
            keys = {band.sources.get(number) or item.sources.get(number) for band in item.bands} - {None}
            assert keys and all(key in row["source"] for key in keys)
            assert all(item.references[key] in row["publication"] for key in keys)
        assert all(by_quantity.loc[gap, "publication"] == text for gap, text in item.not_found.items())
        assert list(bands.loc[bands["instrument"] == name, "band"]) == [band.name for band in item.bands]


def test_values_of_an_instrument():
    known = tables.instrument_sources().set_index(["instrument", "quantity"])
    assert list(known.loc[("TM", "altitude"), ["value", "source"]]) == ["705 km", "Friedl1995"]
    geolocation = known.loc[("TM", "geolocation error (rms along each axis)")]
    assert list(geolocation[["value", "source", "origin"]]) == ["8.5 m", "USGS2020", "in-flight; uncertainty 4"]
    assert "20 m (MSI5–MSI7, MSI8A, MSI11, MSI12)" in known.loc[("MSI", "pixel of the gridded product"), "value"]
    bands = tables.instrument_bands().set_index(["instrument", "band"])
    tm = bands.loc[("TM", "TM3"), ["min_radiance", "full_scale_radiance", "solar_irradiance"]]
    assert list(tm) == [-1.2, 204.3, 1536] and abs(bands.loc[("TM", "TM3"), "center_um"] - 0.661) < 1e-3
    assert list(bands.loc[("MSI", "MSI10"), ["snr", "snr_radiance"]].round(6)) == [50, 6]
    overview, errors, names = map(rows, tables.instruments().split("\n## "))
    assert overview["MSS"][-2:] == ["60", "6"] and errors["MSS"][-3:] == ["unknown"] * 3
    assert errors["L4TM"][-3:] == ["in-flight", "in-flight", "8.5 m"]
    assert names["TM"][1].startswith("TM1 0.486, TM2 0.571")
    assert names["EMIT"][1].startswith("285 bands, EMIT1 0.381 to")


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
