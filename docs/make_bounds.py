"""The table of all bounds of tests/verification, for the page of the benchmarks."""

import sys
from pathlib import Path

from threadpoolctl import threadpool_limits

DOCS = Path(__file__).parent
PAGE = DOCS / "bounds.md"

# Also for the gallery, which draws these comparisons.
sys.path.append(str(DOCS.parent / "tests"))


def write():
    """Write the table, with what this build finds."""
    from verification.areas import deviations
    from verification.deviations import AREA_STAGES

    # The matrices are small, so threads would mostly wait for each other.
    with threadpool_limits(1, user_api="blas"):
        found = list(deviations())
    lines, stage = [], None
    for each in found:
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
