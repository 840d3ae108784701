"""Why a run of the paper's own ground has another R2 than the paper's Table 2."""

from fifesim.analysis.rasters.pairs import matched
from fifesim.analysis.rasters.regression import regress
from fifesim.base import datasets
from fifesim.rasters import grid as grids
from fifesim.scenario.ensemble import realise
from fifesim.scenario.scenario import grid_keys

# Cells along the edge of the part that is paired as the paper's scenes are: as many as `fifesim reproduce` takes.
_CELLS, _EDGE = 333, 1110.0
# With fewer pixels along an edge a line through them says little.
_FEWEST_PIXELS = 10
_PAPERS_INSTRUMENT = "TM"


def pairing_rows(scenario, fits):
    """
    What Table 2 of Friedl et al. (1995) has for the ground of a run, and why it is less.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    fits : mapping of str to fifesim.analysis.regression.Regression
        Of the true means on NDVI.

    Returns
    -------
    rows : list of (str, str)
        Two, or none where the run is none of the table's or its pixels do not lie on the blocks of the truth.
    """
    paper, own = _paper_r2(scenario), scenario.sensor
    if paper is None or "lai" not in fits or own.interval != "product" or own.description.name != _PAPERS_INSTRUMENT:
        return []
    interval = own.description.ground_intervals(own.description.select(own.bands)[0])[0]
    why = (
        f"{paper:.2f}, and {fits['lai'].r2:.2f} here, where pixels lie on the blocks of ground that they are compared "
        f"with. There, as fifesim reads Table 1, they lie {interval:.3f} m apart, and drift from blocks of "
        f"{own.size:g} m"
    )
    typed = f'type interval = "native" in [sensor] and width = height = {_EDGE:g} in [grid], or fifesim reproduce'
    found = _papers_pairing(scenario)
    if found is not None:
        cells, r2 = found
        typed = f"R² {r2:.2f} over {cells} x {cells} cells of this ground, level: {typed}"
    return [("R² in Table 2 of Friedl et al. (1995), LAI", why), ("With pixels paired so", typed)]


def _paper_r2(scenario):
    """R2 of LAI that the paper has for the ground of a scenario; None where it has none."""
    ground = scenario.ground
    if ground.lai_file or not scenario.landscape.is_one():
        return None
    table = datasets.table("friedl1995_table2.csv").set_index(["variable", "distribution", "arp"])["r2"]
    return table.get(("lai", ground.distribution, ground.arp))


def _papers_pairing(scenario):
    """Cells along the edge of a part of the ground, and R2 of LAI with pixels at the instrument's own interval."""
    box = scenario.geobox()
    cells = min(_CELLS, *box.shape)
    if cells * max(grids.cell_size(box)) < _FEWEST_PIXELS * scenario.sensor.size:
        return None
    sensor = scenario.sensor.model_copy(update={"interval": "native", "offset": [0.0, 0.0]})
    terrain = scenario.terrain.model_copy(update={"dem": "flat", "fill": None, "vertical_units": None})
    part = {"grid": grid_keys(box[:cells, :cells]), "terrain": terrain, "sensor": sensor}
    run = realise(scenario.model_copy(update=part))
    truth, image = matched(run["truth"]["lai"], run["image"]["ndvi"], "index")
    return cells, regress(truth, image, pair="index").r2
