"""The default experiment with few realisations, and small scenes."""

import paper_effects as effects
import pytest

import fifesim
from fifesim.experiments.friedl1995.case import case_of
from fifesim.experiments.friedl1995.reproduction import reproduce_case


@pytest.fixture(scope="session")
def found():
    """Three realisations of the nine scenes, in the native and the aligned reading."""
    return reproduce_case(case_of(), 3, 1995)


@pytest.fixture(scope="session")
def small():
    """One realisation of scenes of 10 x 10 pixels."""
    return fifesim.reproduce(cells=90, realisations=1)


@pytest.fixture(scope="session")
def effect_tables():
    """Effects of four readings, one size and an unchanged case, for one realisation of scenes of 10 x 10 pixels."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(effects, "SIZES", (90,))
        few = ("native", "aligned", "offset", "blur-48.6")
        patch.setattr(effects, "READINGS", {name: effects.READINGS[name] for name in few})
        patch.setattr(effects, "changes", lambda case: [effects.Change("itself", "1", "1", case)])
        case = effects.Case(cells=90)
        made = {"readings": effects.readings, "sizes": effects.sizes, "sensitivity": effects.effects_of_numbers}
        return {name: function(case, [1]) for name, function in made.items()}


@pytest.fixture(scope="session")
def folders(tmp_path_factory):
    """User inputs: bimodal samples of LAI, leaf optics and background."""
    folder = tmp_path_factory.mktemp("inputs")
    densities = folder / "densities"
    densities.mkdir()
    for number, name in enumerate(("burned-grazed", "burned-ungrazed", "unburned-ungrazed")):
        values = "\n".join(f"{(0.4 + 0.02 * k) + (0.9 if k % 2 else 0) + 0.1 * number:.3f}" for k in range(30))
        (densities / f"{name}.csv").write_text(f"# FIFE\nlai\n{values}\n")
    optics = folder / "optics.csv"
    optics.write_text("# mine\nband,leaf_reflectance,leaf_transmittance\nTM3,0.09,0.05\nTM4,0.42,0.40\nTM5,0.3,0.3\n")
    background = folder / "background.csv"
    background.write_text("band,background\nTM3,0.10\nTM4,0.16\n")
    return {"densities": densities, "optics": optics, "background": background}
