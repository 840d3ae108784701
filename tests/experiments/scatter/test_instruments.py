"""The same ground simulated for every instrument."""

import importlib
from pathlib import Path

import pandas as pd
import pytest

import fifesim
from fifesim.sensor.description.spatial_response import knows_blur

DOCS = Path(__file__).parents[3] / "docs"


@pytest.fixture
def make_instruments(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("make_instruments")


def test_terms_without_a_source_are_unknown_and_so_is_the_total(make_instruments):
    """The geolocation of EMIT is unknown; so are blur, noise and geolocation of MSS."""
    found = make_instruments.compare_instruments(["EMIT", "MSS"], arps=(0.15,), realisations=2)
    unknown = found[found["share"].isna() & found["alone"].isna()]
    by_name = unknown[unknown["variable"] == "lai"].groupby("instrument")["stage"].agg(set)
    total = {"total", "sub-pixel variation"}
    assert by_name.to_dict() == {
        "EMIT": {"registration"} | total,
        "MSS": {"point spread", "registration", "noise"} | total,
    }
    numbers = unknown.select_dtypes("number").columns.difference(["arp", "pixel"])
    assert unknown[numbers].isna().all(axis=None) and len(numbers) == 6
    known = found[~found.index.isin(unknown.index)]
    assert known["share"].notna().all() and (known.query("stage == 'quantisation'")["share"] != 0).all()


def test_gallery_table_has_no_numbers_for_unknown_terms(make_instruments):
    table = pd.read_csv(DOCS / "instruments.csv")
    complete = table[list(make_instruments.KNOWN.values())].all(axis=1)
    hidden = table["stage"].isin(["total", "sub-pixel variation"]) & ~complete
    for stage, name in make_instruments.KNOWN.items():
        hidden |= (table["stage"] == stage) & ~table[name]
    # The variation of the ground itself has no additive share.
    hidden |= table["stage"] == "sub-pixel variation"
    assert (table["share"].isna() == hidden).all() and (table["share_error"].isna() == hidden).all()
    columns = table.drop_duplicates("instrument").set_index("instrument")[list(make_instruments.KNOWN.values())]
    for name, known in columns.iterrows():
        own = fifesim.instrument(name)
        bands = own.red_and_near_infrared()
        stated = all(knows_blur(own, band) for band in bands), own.geolocation is not None, all(b.noise for b in bands)
        assert tuple(known) == stated, name
