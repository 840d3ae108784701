"""
Write the figures of tables.md into the pages that state speeds.

    python benchmarks/summary.py
"""

import re
import textwrap
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]
TABLES = ROOT / "benchmarks" / "tables.md"
FIRST, LAST = "<!-- figures of benchmarks/tables.md -->", "<!-- end of the figures -->"

# Rows of the tables that the pages state.
LEVEL, HILLS = "flat chain, field to DN", "terrain chain, field to DN"
DEFAULT = "default landscape on hills, field to DN"
RUNS = {
    "fifesim simulate (15 km, landscape on hills)": "15 km, landscape on hills",
    "fifesim simulate, 60 km, hills": "60 km, hills",
    "fifesim simulate, 185 km, flat": "185 km, level ground (a Landsat scene)",
}
LANDSAT = list(RUNS)[-1]
EACH = "SAIL in each cell: radiative-transfer-models"
INTERPOLATED = "SAIL interpolated in LAI: radiative-transfer-models and numpy.interp"
ENGINES = ("5S", "successive-orders")


def sections(text):
    """Sections of a page of tables by title, each with the line that says when and where it was measured."""
    head, *parts = re.split(r"^## ", text, flags=re.MULTILINE)
    found = {}
    for part in parts:
        title, body = part.split("\n", 1)
        if not body.lstrip().startswith("Measured on"):
            body = re.search(r"^Measured on .*$", head, re.MULTILINE)[0] + "\n\n" + body.strip()
        found[title] = body.strip()
    return found


def rows(text):
    """Cells of the tables of a page by name of the row and head of the column, and the line of the measurement."""
    found = {}
    for body in sections(text).values():
        heads = []
        for line in body.splitlines():
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if not line.startswith("|"):
                heads = []
            elif not heads:
                heads = cells
            elif set(line) != {"|", "-"}:
                found[cells[0]] = dict(zip(heads, cells, strict=True)) | {"measured": body.splitlines()[0]}
    return found


def machine(row):
    """Where and when a row was measured."""
    day, kind, cores = re.match(r"Measured on ([\d-]+): (\w+), (\d+) cores", row["measured"]).groups()
    day = date.fromisoformat(day)
    return f"{kind} machine with {cores} cores, {day.day} {day:%B %Y}"


def speeds(row):
    """Size of the largest scene [million cells] and its speed [million cells/s]."""
    head = [head for head in row if head.endswith(" M: million cells/s")][-1]
    return head.split()[0], row[head]


def cells(name):
    """Million cells of 3.33 m of a square scene whose name states its side in kilometres."""
    side = 1000 * float(re.search(r"(\d+) km", name)[1])
    return f"{(side / (30 / 9)) ** 2 / 1e6:,.0f}"


def readme(found):
    """Speed in three points."""
    (size, level), (_, hills), (_, default) = (speeds(found[name]) for name in (LEVEL, HILLS, DEFAULT))
    scene = found[LANDSAT]
    clock, memory = float(scene["on the clock [s]"]), float(scene["peak memory [GB]"])
    elsewhere = "" if machine(scene) == machine(found[LEVEL]) else f" (measured on an {machine(scene)})"
    lines = [
        f"""On one core ({machine(found[LEVEL])}), fifesim simulates {level} million ground cells per second of a
        stand on level ground, {hills} million of a stand on hills and {default} million of the default landscape, from
        random field to digital numbers in two bands ({size} million cells of 3.33 m).""",
        f"""A Landsat scene of 185 km ({cells(LANDSAT)} million cells) takes {clock:.0f} s and {memory:.1f} GB on two
        cores{elsewhere}.""",
    ]
    if EACH in found and INTERPOLATED in found:
        ours, other = "fifesim: million cells/s", "other: million cells/s"
        lines.append(
            f"""SAIL in each cell reaches {found[EACH][ours]} million cells per second (radiative-transfer-models:
            {found[EACH][other]}). Interpolated in LAI, with an error below 1e-6, it reaches
            {found[INTERPOLATED][ours]} million."""
        )
    return "\n".join(filled(f"- {line}", subsequent_indent="  ") for line in lines)


def filled(text, **options):
    """Text in lines of equal length."""
    return textwrap.fill(" ".join(text.split()), 118, **options)


def large_scenes(found):
    """Time and memory of whole runs."""
    lines = [
        f"Runs with two threads ({machine(found[LANDSAT])}); imports, files and report included:",
        "",
        "| scene | million cells | on the clock [s] | processor time [s] | peak memory [GB] |",
        "|---|---|---|---|---|",
    ]
    heads = "on the clock [s]", "processor time [s]", "peak memory [GB]"
    for name, scene in RUNS.items():
        lines.append(f"| {scene} | {cells(name)} | {' | '.join(found[name][head] for head in heads)} |")
    return "\n".join(lines)


def haze(found):
    """Time that each engine takes."""
    times = [f"{float(format(float(found[engine]['ms']), '.2g')):g} ms with `{engine}`" for engine in ENGINES]
    return filled(f"One band and geometry takes {', '.join(times[:-1])} and {times[-1]}.")


PAGES = {"README.md": readme, "docs/large_scenes.md": large_scenes, "docs/howto/haze.md": haze}


def written(page, figures):
    """Text of a page with other figures between the markers."""
    before, after = page.split(FIRST)
    return f"{before}{FIRST}\n{figures}\n{LAST}{after.split(LAST)[1]}"


def main():
    """Write the pages."""
    found = rows(TABLES.read_text(encoding="utf-8"))
    for name, figures in PAGES.items():
        page = ROOT / name
        page.write_text(written(page.read_text(encoding="utf-8"), figures(found)), encoding="utf-8")


if __name__ == "__main__":
    main()
