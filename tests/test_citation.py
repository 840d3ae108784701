"""Project metadata for citation, hosting and indexing are consistent."""

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_citation_agrees_with_pyproject():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0" and citation["message"] and citation["type"] == "software"
    assert citation["title"].startswith(PROJECT["name"]) and citation["license"] == PROJECT["license"]
    assert citation["authors"] == PROJECT["authors"] and citation["version"] == PROJECT["version"]
    doi = citation["references"][0]["doi"]
    assert doi in (ROOT / "docs" / "references.rst").read_text(encoding="utf-8")


def test_readme_links_to_the_citation_page():
    assert "docs/cite.md" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_bibliography_of_the_paper_is_complete():
    text, bibliography = ((ROOT / "docs" / "paper" / f"paper.{kind}").read_text("utf-8") for kind in ("md", "bib"))
    cited = set(re.findall(r"@([A-Za-z]+\d{4}|Eradiate|prosail)\b", text))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", bibliography, re.MULTILINE))


def test_workflow_runs_the_test_command_of_the_readme():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))
    commands = [step.get("run", "") for step in workflow["jobs"]["tests"]["steps"]]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (options,) = re.findall(r"bin/pytest (.*)", readme)
    assert f"python -m pytest {options}" in commands
