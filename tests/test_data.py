"""Every table that the program reads says where it comes from."""

import re

import pandas as pd

from fifesim.base import files

DATA = files.path("lai_distributions.csv").parent
TABLES = sorted(path for path in DATA.rglob("*") if path.suffix in (".csv", ".toml"))
SCRIPTS = {path.name for path in DATA.glob("make_*.py")}


def header(path):
    """The comment lines that a table begins with."""
    lines = path.read_text(encoding="utf-8").splitlines()
    first = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return "\n".join(lines[:first])


def is_named(name, readme):
    """Whether the README names a table by its path, or in the table of a folder by its name."""
    folder, _, file = name.rpartition("/")
    _, _, table = readme.partition(f"| file in `{folder}/` |")
    return name in readme or f"`{file}`" in table.partition("\n\n")[0]


def test_tables_are_named_and_have_sources_and_units():
    """A source is a publication, the script that made the table, or what the numbers were calibrated with."""
    readme, breaches = (DATA / "README.md").read_text(encoding="utf-8"), []
    for path in TABLES:
        name, text = path.relative_to(DATA).as_posix(), header(path)
        breaches += [] if is_named(name, readme) else [f"{name} is not in README.md"]
        breaches += [] if re.search(r"Source|\[sources\]|by make_\w+\.py|Calibrated", text) else [f"{name}: no source"]
        breaches += [
            f"{each} is missing" for each in re.findall(r"\bmake_\w+\.py", text) if not (DATA / each).is_file()
        ]
        if path.suffix == ".csv":
            table = pd.read_csv(path, comment="#")
            breaches += [] if re.search(r"\[[^\]]+\]", text) else [f"{name}: no units"]
            breaches += [f"{name} has gaps"] if table.empty or table.isna().any(axis=None) else []
    assert len(TABLES) >= 9 and breaches == []


def test_everything_in_the_folder_is_a_table_or_makes_one():
    extra = {path.name for path in DATA.rglob("*") if path.is_file() and path not in TABLES}
    assert [name for name in extra if name != "README.md" and not re.fullmatch(r"make_\w+\.py", name)] == []
