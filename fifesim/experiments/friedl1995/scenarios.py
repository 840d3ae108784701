"""The nine scenes as scenarios that run by themselves, and their rasters as files."""

import numpy as np
import xarray as xr

from fifesim.base.kinds import is_path
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.pixels import block_means, ground_of, scene_image
from fifesim.output import stac
from fifesim.output.styles import write_style
from fifesim.rasters.files import to_geotiff
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.toml import write_scenario


def write_scenarios(case, folder, seed, scenes=False, each=iter):
    """
    Write the nine scenarios of a realisation, each into a folder such as ``burned-grazed-0.05``.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    folder : pathlib.Path
        Made where it does not exist.
    seed : int
        Of the realisation.
    scenes : bool, optional
        Beside ``scenario.toml`` write ``image.tif``, ``truth.tif`` (LAI and FPAR of the pixels) and ``scene.tif`` (LAI,
        FPAR and reflectance of the cells), as the experiment has them, with their styles, and a STAC item,
        ``item.json``; the folder gets a collection, ``collection.json``.
    each : callable, optional
        Wraps the sequence of scenes.

    Raises
    ------
    ValueError
        If a density has no name and no file, so that no scenario can name it.
    """
    check_named(case)
    land, items = case.land() if scenes else None, {}
    for treatment, arp in each(friedl1995.scenes()):
        own = folder / f"{treatment}-{arp:g}"
        own.mkdir(parents=True)
        (own / "scenario.toml").write_text(scenario_text(case, own, treatment, arp, seed), encoding="utf-8")
        if scenes:
            _write_rasters(case, own, land, treatment, arp, seed)
            found = read_scenario(own / "scenario.toml")
            items[f"{own.name}/item.json"] = stac.item(
                found, own, f"{treatment}, arp {arp:g}, seen by {case.instrument.name}"
            )
    if items:
        stac.write_collection(folder, "friedl1995", "The nine scenes of Friedl et al. (1995), repeated.", items)


def scenario_text(case, own, treatment, arp, seed):
    """
    Text of one of the nine scenarios, complete.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    own : pathlib.Path
        Folder that it is to lie in, beside the instrument of a reading with another response, which is written.
    treatment : str
    arp : float
        [1]
    seed : int

    Returns
    -------
    text : str
        TOML.
    """
    scenario = case.scenario(treatment, arp, seed)
    if not case.reading.other_response:
        return write_scenario(scenario.complete())
    name = f"{case.reading.name}.toml"
    (own / name).write_text(case.reading.instrument_file(case.instrument.altitude), encoding="utf-8")
    sensor = scenario.sensor.model_copy(update={"instrument": str(own / name)})
    complete = scenario.model_copy(update={"sensor": sensor}).complete()
    # Beside the scenario, wherever both are moved.
    beside = complete.sensor.model_copy(update={"instrument": name})
    return write_scenario(complete.model_copy(update={"sensor": beside}))


def check_named(case):
    """
    Refuse densities that a scenario cannot name.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Raises
    ------
    ValueError
        If one is no treatment and no file.
    """
    for treatment, source in case.densities.items():
        if not is_path(source):
            raise ValueError(
                f"densities: that of {treatment} is no file, and a scenario names one: write samples of it as a CSV "
                "file, or call fifesim.reproduce"
            )


def _write_rasters(case, own, land, treatment, arp, seed):
    ground = ground_of(case, treatment, arp, seed, land)
    truth = {name: block_means(case, ground, getattr(ground, name)) for name in ("lai", "fpar")}
    cells = {"lai": ground.lai, "fpar": ground.fpar}
    for band in ground.reflectance["band"].values:
        cells[str(band)] = ground.reflectance.sel(band=band).drop_vars(["band", "wavelength"], errors="ignore")
    rasters = {"image": scene_image(case, ground), "truth": xr.Dataset(truth), "scene": xr.Dataset(cells)}
    for name, raster in rasters.items():
        write_style(to_geotiff(raster if name == "image" else raster.astype(np.float32), own / f"{name}.tif"))
