"""Every table that the program reads says where it comes from."""

import re

import pandas as pd
import pytest

from fifesim.base import files

DATA = files.path("lai_distributions.csv").parent
TABLES = sorted(path for path in DATA.rglob("*") if path.suffix in (".csv", ".toml"))
NAMES = [path.relative_to(DATA).as_posix() for path in TABLES]


def header(path):
    """The comment lines that a table begins with."""
    lines = path.read_text(encoding="utf-8").splitlines()
    first = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return "\n".join(lines[:first])


def test_there_are_tables():
    assert len(TABLES) >= 9


@pytest.mark.parametrize("name", NAMES)
def test_readme_names_the_table(name):
    """By its path, or in the table of a folder by its name."""
    readme = (DATA / "README.md").read_text(encoding="utf-8")
    folder, _, file = name.rpartition("/")
    _, _, table = readme.partition(f"| file in `{folder}/` |")
    assert name in readme or f"`{file}`" in table.partition("\n\n")[0]


@pytest.mark.parametrize("path", TABLES, ids=NAMES)
def test_header_says_the_source(path):
    """A publication, the script in this folder that made the table, or what the numbers were calibrated with."""
    text = header(path)
    assert re.search(r"Source|\[sources\]|by make_\w+\.py|Calibrated", text)
    scripts = re.findall(r"\bmake_\w+\.py", text)
    assert all((DATA / script).is_file() for script in scripts)


@pytest.mark.parametrize("path", [path for path in TABLES if path.suffix == ".csv"], ids=lambda path: path.name)
def test_header_says_the_units_and_the_table_is_whole(path):
    assert re.search(r"\[[^\]]+\]", header(path))
    table = pd.read_csv(path, comment="#")
    assert len(table) > 0
    assert not table.isna().any(axis=None)


def test_everything_in_the_folder_is_a_table_or_makes_one():
    extra = {path.name for path in DATA.rglob("*") if path.is_file() and path not in TABLES}
    assert all(name == "README.md" or re.fullmatch(r"make_\w+\.py", name) for name in extra), extra
