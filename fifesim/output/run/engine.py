"""The engine of the atmosphere, run before all else: 6S takes half a second for each band, and is shown."""

from fifesim.atmosphere.schemes import engines
from fifesim.output.progress import steps
from fifesim.sensor.description.instruments import instrument


def run_engine(scenario):
    """
    Have the engine make what the simulation of a scenario asks of it; it is kept.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Raises
    ------
    ImportError
        If the engine is not installed.
    ValueError
        If sun or sensor stand too low for it.
    """
    bands = [band.response for band in instrument(scenario.sensor.instrument).select(scenario.sensor.bands)]
    atmosphere, light = scenario.model_atmosphere(), scenario.sun_and_view()
    # The skylight on the canopy does not depend on the view.
    for vza, raa in ((0.0, 0.0), (light.vza, light.raa)):
        engines.band_terms(atmosphere, bands, light.sza, vza, raa, each=lambda runs: steps(runs, "6S, band by band"))
