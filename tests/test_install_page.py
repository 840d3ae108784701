"""The installation page lists the supported Python versions of the package."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_tested_python_versions_agree_with_classifiers():
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["classifiers"]
    stated = {each.rpartition(" ")[2] for each in classifiers if re.fullmatch(r".*Python :: 3\.\d+", each)}
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    tested = re.search(r"\*\*Tested on Linux with Python (.+?)\*\*", page)[1]
    assert set(re.findall(r"3\.\d+", tested)) == stated == {"3.11", "3.12", "3.13"}
