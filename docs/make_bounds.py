"""Table of all bounds of tests/verification, for the page of the benchmarks."""

import sys
from pathlib import Path

import pandas as pd
from threadpoolctl import threadpool_limits

DOCS = Path(__file__).parent
PAGE = DOCS / "bounds.md"
TABLE = DOCS / "tables" / "bounds.csv"

# Also for the gallery, which draws these comparisons.
sys.path.append(str(DOCS.parent / "tests"))


def write():
    """Write the deviations that this build finds as CSV, and their summary by area for the page."""
    from verification.areas import deviations

    # The matrices are small, so threads would mostly wait for each other.
    with threadpool_limits(1, user_api="blas"):
        found = list(deviations())
    columns = ["area", "what", "deviation", "bound", "unit", "source"]
    table = pd.DataFrame(
        [[getattr(each, name) for name in columns] for each in found], columns=columns
    )
    TABLE.parent.mkdir(exist_ok=True)
    table.to_csv(TABLE, index=False, float_format="%.3g")
    PAGE.write_text(summary(table), encoding="utf-8")


def summary(table):
    """Number of comparisons by area, and the one that is nearest to its bound."""
    lines = ["| area | comparisons | nearest to its bound | deviation | bound |"]
    lines.append("|---|---|---|---|---|")
    used = (table["deviation"] / table["bound"]).fillna(0.0)
    for area, rows in table.groupby("area", sort=False):
        worst = rows.loc[used[rows.index].idxmax()]
        numbers = " | ".join(
            f"{worst[name]:.3g} {worst['unit']}" for name in ("deviation", "bound")
        )
        lines.append(f"| {area} | {len(rows)} | {worst['what']} | {numbers} |")
    return "\n".join(lines) + "\n"
