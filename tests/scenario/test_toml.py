"""Reading and writing scenarios as TOML."""

import os
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifesim.scenario.scenario import Scenario, parse_scenario, read_scenario
from fifesim.scenario.toml import check_spelling, load_values, write_scenario, write_tables


def write_toml(tmp_path, text):
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    return tmp_path / "s.toml"


def test_file_paths_are_relative_to_the_scenario(tmp_path):
    """Only values that name files become paths; other names stay as they are."""
    path = write_toml(
        tmp_path,
        "[ground]\nlai_file = 'lai.tif'\ndistribution = 'burned-grazed'\n[terrain]\ndem = '/vsizip//a.zip/dem.tif'\n"
        "[sensor]\ninstrument = 'mine.toml'\n",
    )
    values = load_values(path)
    assert values["ground"] == {"lai_file": str(tmp_path.resolve() / "lai.tif"), "distribution": "burned-grazed"}
    assert values["terrain"]["dem"] == "/vsizip//a.zip/dem.tif"
    assert values["sensor"]["instrument"] == str(tmp_path.resolve() / "mine.toml")


def test_spelling_check_reports_each_mistake_on_one_line(tmp_path):
    path = write_toml(tmp_path, "[sensor]\nbandz = ['TM3']\npixel = -1\n[ground]\narp = 0.3\n")
    with pytest.raises(ValueError) as caught:
        check_spelling(path)
    assert [line.partition(" =")[0] for line in str(caught.value).splitlines()] == [
        "ground.arp",
        "sensor.pixel",
        "unknown key sensor.bandz",
    ]

    # Names of instruments and models are left to physics.
    check_spelling(write_toml(tmp_path, "[sensor]\ninstrument = 'TN'\n[ground]\nleaf_angles = 'sphere'\n"))


FILE_NAMES = ("a\nb.tif", "a\tb", "\x1b[31mred.tif", "a\x7fb.tif", "röd 😀.tif", "a\u202eb", "\"'.tif", "a\\b")
BAND_NAMES = ("B 3", "röd", 'b"3', "b.3", "b\\3", "", "=", "3")


@pytest.mark.parametrize(("name", "band"), [*zip(FILE_NAMES, BAND_NAMES, strict=True)])
def test_any_name_of_a_file_or_band_is_read_back(tmp_path, name, band):
    ground = {"lai_file": str(tmp_path / name), "background": {band: 0.1, "TM3": 0.2}}
    scenario = parse_scenario({"ground": ground})
    assert read_scenario(write_toml(tmp_path, write_scenario(scenario))) == scenario


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=30), st.floats())
def test_text_and_numbers_are_written_as_toml(text, number):
    """tomllib reads the same values back."""
    values = {text: {"text": text, "list": [text, number], "flag": True}, "none": None}
    found = tomllib.loads(write_tables("", {("draw",): values, ("empty",): {}}))
    assert list(found) == ["draw"] and list(found["draw"]) == [text]
    found = found["draw"][text]
    assert (found["text"], found["list"][0], found["flag"]) == (text, text, True)
    assert found["list"][1] == number or number != number


def test_unset_keys_are_comments_that_can_be_filled_in(tmp_path):
    """The comment stands in its section, above the tables inside the section."""
    text = write_scenario(Scenario(base="paper")).replace("# lai_file = ", "lai_file = 'lai.tif'")
    assert load_values(write_toml(tmp_path, text))["ground"]["lai_file"] == str(tmp_path.resolve() / "lai.tif")


@pytest.mark.parametrize("key", ["ground.lai_file", "terrain.dem", "ground.distribution", "sensor.instrument", ""])
def test_unreadable_files_are_rejected_without_waiting(tmp_path, key):
    """A pipe would block for ever. The error names the key of a file before anything is loaded."""
    suffix = {"ground.distribution": ".csv", "sensor.instrument": ".toml"}.get(key, ".tif")
    os.mkfifo(tmp_path / f"pipe{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    (tmp_path / f"loop{suffix}").symlink_to(f"loop{suffix}")
    (tmp_path / f"zero{suffix}").symlink_to("/dev/zero")
    for name in ("pipe", "folder", "loop", "zero", "a" * 5000, "a\\u0000b" if key else "none"):
        path = write_toml(tmp_path, f'{key} = "{name}{suffix}"') if key else tmp_path / f"{name}{suffix}"
        assert spelling_error(path).startswith(f"{key} = " if key else "")


def spelling_error(path):
    """Error message of the spelling check, which must be short and printable."""
    with pytest.raises(ValueError) as caught:
        check_spelling(path)
    said = str(caught.value)
    assert len(said) <= 500 and all(line.isprintable() for line in said.splitlines())
    return said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = " + "[" * 5000, "nests its tables too deeply"),
        ("[" + "a." * 5000 + "a]", "nests its tables too deeply"),
        ("[ground]\n" + "k" * 5000 + " = 1", "allowed are distribution, arp"),
        ("[grid]\n'\\x' = '\\'\n\"\\u001b[31m\" = 1", "grid.\\x1b[31m = 1"),
        ("[ground]\nleaf_angles = 3\ndistribution = 4\n" + "".join(f"k{i} = 1\n" for i in range(999)), "and 99"),
        ("grid.north = 0x" + "f" * 9000, "grid.north"),
        ("grid.north = '1" + " " * 900_000 + "x'", "north is in m"),
        ("[atmosphere]\nvisibility = '1.2.3'", "visibility is in km"),
        ("#" * 2_000_000, "has 2000000 bytes"),
    ],
    ids=["brackets", "tables", "long key", "escape", "many", "digits", "spaces", "dots", "size"],
)
def test_message_is_short_and_printable(tmp_path, text, said):
    assert said in spelling_error(write_toml(tmp_path, text))


def test_symbolic_link_keeps_its_name(tmp_path):
    """The target of the link has no suffix that distinguishes a file from a name."""
    (tmp_path / "version1").write_text("lai\n1\n2\n3\n")
    (tmp_path / "samples.csv").symlink_to("version1")
    scenario = read_scenario(write_toml(tmp_path, "ground.distribution = 'samples.csv'"))
    assert scenario.ground.distribution.endswith(".csv")


def test_each_class_is_written_as_a_table(tmp_path):
    """Its files are relative to the scenario, only its explicit keys are written, and they are read back unchanged."""
    (tmp_path / "mine.csv").write_text("lai\n1\n2\n3\n4\n5\n")
    path = write_toml(
        tmp_path,
        "[landscape]\ncover = 'voronoi'\n[classes.grass]\nshare = 0.7\n[classes.wood]\nshare = 0.3\n"
        "distribution = 'mine.csv'\nbackground = { TM3 = 0.1, TM4 = 0.2 }\n",
    )
    scenario = read_scenario(path)
    assert scenario.classes["wood"].distribution == str(tmp_path.resolve() / "mine.csv")
    assert scenario.files == {("classes", "wood", "distribution"): str(tmp_path.resolve() / "mine.csv")}
    text = write_scenario(scenario)
    assert text.count("distribution =") == 2 and "[classes.wood.background]" in text
    again = parse_scenario(tomllib.loads(text))
    assert again == scenario and write_scenario(again) == text
