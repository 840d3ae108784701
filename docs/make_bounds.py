"""The table of all bounds that `fifesim verify` keeps, for the page of the benchmarks."""

from pathlib import Path

from fifesim.experiments.verification.areas import deviations
from fifesim.experiments.verification.deviations import AREA_STAGES

PAGE = Path(__file__).parent / "bounds.md"


def write():
    """Write the table, with what this build finds."""
    lines, stage = [], None
    for each in deviations():
        if AREA_STAGES[each.area] != stage:
            stage = AREA_STAGES[each.area]
            lines += [
                f"\n### {stage}\n",
                "| compared | largest | bound | unit | with |",
                "|---|---|---|---|---|",
            ]
        lines.append(
            f"| {each.what} | {each.deviation:.3g} | {each.bound:.3g} | {each.unit} | {each.source} |"
        )
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")
