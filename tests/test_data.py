"""Data tables of the package, and independent results for the tests, state their sources and units."""

import re

import pandas as pd
import pytest
from verification import tables

from fifesim.base import files

DATA = files.path("lai_distributions.csv").parent
EACH = pytest.mark.parametrize("folder", [DATA, tables.FOLDER], ids=["package", "tests"])
SCRIPTS = {path.name for folder in (DATA, tables.FOLDER) for path in folder.glob("make_*.py")}


def tables_of(folder):
    return sorted(path for path in folder.rglob("*") if path.suffix in (".csv", ".toml"))


def header(path):
    """Comment lines at the start of a table."""
    lines = path.read_text(encoding="utf-8").splitlines()
    first = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return "\n".join(lines[:first])


def is_named(name, readme):
    """Whether the README lists a table by its path, or by its name in the table of its folder."""
    folder, _, file = name.rpartition("/")
    _, _, table = readme.partition(f"| file in `{folder}/` |")
    return name in readme or f"`{file}`" in table.partition("\n\n")[0]


@EACH
def test_tables_are_listed_and_have_sources_and_units(folder):
    """A source is a publication, the script that generates the table, or the calibration data."""
    readme, breaches = (folder / "README.md").read_text(encoding="utf-8"), []
    for path in tables_of(folder):
        name, text = path.relative_to(folder).as_posix(), header(path)
        breaches += [] if is_named(name, readme) else [f"{name} is not in README.md"]
        breaches += [] if re.search(r"Source|\[sources\]|by make_\w+\.py|Calibrated", text) else [f"{name}: no source"]
        breaches += [f"{each} is missing" for each in re.findall(r"\bmake_\w+\.py", text) if each not in SCRIPTS]
        if path.suffix == ".csv":
            table = pd.read_csv(path, comment="#")
            breaches += [] if re.search(r"\[[^\]]+\]", text) else [f"{name}: no units"]
            breaches += [f"{name} has gaps"] if table.empty or table.isna().any(axis=None) else []
    assert len(tables_of(folder)) >= 9 and breaches == []


@EACH
def test_folder_has_only_tables_and_their_scripts(folder):
    extra = {path.name for path in folder.rglob("*") if path.is_file() and path not in tables_of(folder)}
    assert [name for name in extra if name != "README.md" and not re.fullmatch(r"make_\w+\.py|konza\.json", name)] == []
