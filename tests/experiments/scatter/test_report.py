"""What the page of a budget says of its mechanisms."""

import numpy as np
import pytest
import xarray as xr

from fifesim.experiments.scatter import report
from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.experiments.scatter.stages import STAGES, VARIABLES


@pytest.fixture
def budget():
    """Shares of 1 to 8 % for the stages in their order, and a curvature of 9 %, twice the same."""
    shares = np.broadcast_to(np.arange(1, len(STAGES) + 1) / 100, (2, len(VARIABLES), len(STAGES)))
    curvature = np.full((2, len(VARIABLES)), 0.09)
    return xr.Dataset(
        {
            "share": (("realisation", "variable", "stage"), shares),
            "curvature": (("realisation", "variable"), curvature),
            "total": (("realisation", "variable"), shares.sum(axis=-1) + curvature),
        },
        coords={"stage": list(STAGES), "variable": list(VARIABLES)},
    )


def test_mechanisms_share_out_the_stages_once(budget):
    rows = report.mechanisms(budget)
    parts = [part for row in rows for part in report.MECHANISMS[row["name"]]]
    assert len(parts) == len(set(parts)) and set(parts) <= {*STAGES, CURVATURE}
    for row in rows:
        expected = sum(
            0.09 if part == CURVATURE else (list(STAGES).index(part) + 1) / 100
            for part in report.MECHANISMS[row["name"]]
        )
        assert row["lai"]["share"] == pytest.approx(expected, rel=1e-12)
        assert row["lai"]["of_total"] == pytest.approx(expected / float(budget["total"][0, 0]), rel=1e-12)
        assert row["lai"]["error"] == pytest.approx(0, abs=1e-12)


def test_registration_is_no_mechanism_of_the_paper():
    """The paper's third is regularization; of pixels beside their blocks it says nothing."""
    (name,) = (name for name, parts in report.MECHANISMS.items() if "registration" in parts)
    assert "not discussed" in name and report.MECHANISMS[name] == ("registration",)
    assert report.MECHANISMS["iii. Regularization by the sensor"] == ("point spread",)
