"""How fields go with the ground where that is lazy."""

import pytest
from lazy import in_chunks, no_compute

import fifesim
from fifesim.ground.landscape.covariance import Copula, copula
from fifesim.ground.landscape.field_labels import copulas

ARPS = {"soil": 0.05, "moisture": 0.1, "lai": 0.15, "brown": 0.2}
PAIRS = {("lai", "elevation"): 0.3, ("lai", "soil"): -0.3, ("soil", "moisture"): -0.5, ("brown", "lai"): 0.2}


@pytest.fixture(scope="module")
def hills():
    return {"elevation": fifesim.flint_hills(fifesim.fife_site(10, window=((0, 60), (0, 70))), seed=7)}


@pytest.mark.parametrize("coarser", [(), ("soil",), ("soil", "moisture")], ids=str)
def test_fields_before_the_first_that_follows_the_ground_do_not_wait_for_it(hills, coarser):
    """And are put together as with it."""
    whole = copula(ARPS, PAIRS, {"elevation": hills["elevation"].values.ravel()}, coarser)
    with no_compute():
        found = copulas(
            ARPS, PAIRS, {name: in_chunks(each, {"y": 40, "x": 33}) for name, each in hills.items()}, None, coarser
        )
    for name in ("soil", "moisture"):
        assert isinstance(found[name], Copula)
        assert found[name].noise[name] == whole.noise[name]
        assert found[name].coarse.get(name) == whole.coarse.get(name)
    for name in ("lai", "brown"):
        assert found[name].chunks == () and found[name].values.item().noise == whole.noise
