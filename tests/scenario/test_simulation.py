"""Simulated scenarios compared with explicit calls, and the physical meaning of the values of a section."""

import numpy as np
import pytest
import rasterio
from affine import Affine
from elevations import write
from lazy import no_compute

import fifesim
from fifesim.base.geometry import Geometry, earth_sun_distance
from fifesim.base.times import SITE_TIME
from fifesim.grids import grid as grids
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.sections import Ground, Sensor
from fifesim.sensor.description.instruments import instrument

GRID = {"west": 704970.0 + 600, "north": 4334220.0 - 300, "width": 600.0, "height": 450.0}


def scenario(**terrain):
    sections = {"grid": GRID, "ground": {"seed": 7, "arp": 0.15}, "terrain": {"horizon_reach": 900} | terrain}
    return parse_scenario(sections)


@pytest.fixture
def hill(tmp_path):
    """Writer of a file with a round hill, in metres or feet, that extends 300 m past the grid on every side."""

    def written(name="hill.tif", unit=None, per_metre=1.0, hole=False):
        y, x = np.mgrid[:35, :40]
        height = 400 + 60 * np.exp(-((x - 20) ** 2 + (y - 17) ** 2) / 72.0)
        if hole:
            height[17, 20] = np.nan
        place = rasterio.transform.from_origin(GRID["west"] - 300, GRID["north"] + 300, 30, 30)
        return str(write(tmp_path / name, height * per_metre, place, unit=unit))

    return written


def test_terrain_matches_explicit_calls_of_the_chain(hill):
    case = scenario(dem=hill())
    with no_compute():
        tree = fifesim.simulate(case, chunks={"y": 50, "x": 70})
    assert tree["scene"]["dem"].chunks is not None
    grid = case.geobox()
    dem = fifesim.fine_dem(case.terrain.dem, grid)
    around, reach = fifesim.terrain.source_dem(case.terrain.dem, grid, 900)
    lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
    level = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"])
    horizon = fifesim.horizon(around, reach=900)
    sloped = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=dem, horizon=horizon)
    np.testing.assert_array_equal(tree["image"]["dn"], fifesim.sense(fifesim.to_toa(sloped)))
    np.testing.assert_array_equal(tree["level"]["dn"], fifesim.sense(fifesim.to_toa(level)))
    np.testing.assert_array_equal(tree["terrain"]["dem"], fifesim.aggregate(dem, 30))
    kt = fifesim.kt(level, dem, horizon=horizon)
    np.testing.assert_array_equal(tree["terrain"]["kt"], fifesim.aggregate(kt, 30))
    assert grids.same_grid(grids.geobox(tree["terrain"]["slope"]), grids.geobox(tree["image"]["dn"]))
    assert tree["terrain"].attrs == {f"reach_{side}": distance for side, distance in reach.items()}
    assert reach == dict.fromkeys(("north", "east", "south", "west"), 300.0)


def test_elevation_in_feet_or_with_a_hole_is_rejected_unless_declared(hill):
    metres = fifesim.simulate(scenario(dem=hill()))["terrain"]["dem"]
    feet, holed = hill("feet.tif", unit="ft", per_metre=1 / 0.3048), hill("holed.tif", hole=True)
    with pytest.raises(ValueError, match="vertical_units"):
        fifesim.simulate(scenario(dem=feet))
    declared = fifesim.simulate(scenario(dem=feet, vertical_units="ft"))["terrain"]["dem"]
    np.testing.assert_allclose(declared, metres, rtol=1e-12)
    with pytest.raises(ValueError, match="fill"):
        fifesim.simulate(scenario(dem=holed))
    filled = fifesim.simulate(scenario(dem=holed, fill=60))["terrain"]["dem"]
    # The hole is one 30 m cell at the hilltop, filled with a minimum curvature surface.
    assert float(np.abs(filled - metres).max()) < 2.0


def test_sun_below_every_slope_is_rejected(tmp_path):
    """A plane slopes 30 degrees to the north, with the sun 21 degrees above the southern horizon."""
    place = rasterio.transform.from_origin(GRID["west"] - 600, GRID["north"] + 600, 30, 30)
    write(tmp_path / "ramp.tif", np.mgrid[:60, :60][0] * 30 * np.tan(np.radians(30.0)), place)
    shaded = {"grid": GRID, "geometry": {"sza": 69.0, "saa": 180.0}, "terrain": {"dem": str(tmp_path / "ramp.tif")}}
    with pytest.raises(ValueError, match="sun"):
        fifesim.simulate(parse_scenario(shaded))


# The cells of the fixture "site", on level ground.
LEVEL = {
    "grid": {"west": 704970.0 + 600, "north": 4334220.0 - 300, "width": 180.0, "height": 150.0},
    "ground": {"seed": 7, "arp": 0.15},
    "terrain": {"dem": "flat"},
}


def test_every_key_of_a_scenario_reaches_its_stage():
    """Each key differs from its default, so an ignored key changes the bits."""
    bands, place = ["TM3", "TM4"], LEVEL["grid"] | {"width": 360.0, "height": 300.0}
    leaf, back = {"TM3": (0.1, 0.08), "TM4": (0.5, 0.4)}, {"TM3": 0.1, "TM4": 0.2}
    stand = {"distribution": "burned-ungrazed", "arp": 0.2, "leaf_angles": "planophile", "hotspot": 0.2}
    stand |= {"leaf_reflectance": {"TM3": 0.1, "TM4": 0.5}, "leaf_transmittance": {"TM3": 0.08, "TM4": 0.4}}
    case = fifesim.Scenario(
        grid=place,
        terrain=LEVEL["terrain"],
        ground=stand | {"seed": 11, "method": "periodic", "fpar_inf": 0.9, "background": back},
        geometry={"sza": 40.0, "saa": 100.0, "vza": 5.0, "vaa": 10.0},
        atmosphere={"visibility": 23, "altitude": 1.0},
        sensor={"instrument": "L4TM", "bands": bands, "pixel": 50.0, "interval": 31.0, "offset": [0.25, -0.5]}
        | {"min_valid": 1.0, "noise": ["thermal"], "seed": 3},
    )
    with no_compute():
        tree = fifesim.simulate(case)
    sun = Geometry(40.0, 100.0, 5.0, 10.0, earth_sun_distance(SITE_TIME))
    grid = grids.grid_at("EPSG:26914", *place.values(), 30 / 9)
    lai = fifesim.lai_scene(grid, "burned-ungrazed", arp=0.2, seed=11, method="periodic")
    canopy = fifesim.Canopy(leaf_optics=leaf, background=back, leaf_angles="planophile", hotspot=0.2)
    air = fifesim.Atmosphere(visibility=23, altitude=1.0)
    rho = fifesim.surface_reflectance(lai, "L4TM", bands=bands, atmosphere=air, geometry=sun, canopy=canopy)
    pixels = {"interval": 31.0, "offset": (0.25, -0.5), "min_valid": 1.0}
    image = fifesim.sense(fifesim.to_toa(rho), "L4TM", noise="thermal", seed=3, **pixels)
    fpar = fifesim.fpar(lai, geometry=sun, canopy=fifesim.Canopy(leaf_angles="planophile"), fpar_inf=0.9)
    np.testing.assert_array_equal(tree["image"]["dn"], image)
    np.testing.assert_array_equal(tree["truth"]["lai"], fifesim.aggregate(lai, 50.0, min_valid=1.0))
    np.testing.assert_array_equal(tree["truth"]["fpar"], fifesim.aggregate(fpar, 50.0, min_valid=1.0))


@pytest.mark.parametrize(
    ("crs", "west", "north"), [("EPSG:3031", 0.0, 1.8e6), ("EPSG:3413", 0.0, -2.0e6), ("EPSG:5042", 2.1e6, 2.2e6)]
)
def test_polar_scene_is_simulated(crs, west, north):
    grid = {"crs": crs, "west": west, "north": north, "width": 120.0, "height": 90.0, "cell": 10.0}
    given = {"geometry": {"sza": 60.0, "saa": 0.0}, "atmosphere": {"altitude": 0.4}}
    case = parse_scenario(given | {"grid": grid, "terrain": {"dem": "flint-hills", "horizon_reach": 300}})
    image = fifesim.simulate(case)["image"]["dn"].compute()
    assert image.rio.crs == crs and image.shape == (2, 3, 4) and (image[:, 1, 1:3] > 0).all()


CLASSES = {"thin": {"distribution": "burned-grazed"}, "thick": {"distribution": "unburned-ungrazed", "hotspot": 0.1}}


def test_cells_of_a_class_equal_a_scenario_of_that_class_alone():
    """Leaf area and reflectance are identical to the bit, whatever the neighbouring classes."""
    small = {"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}}
    both = parse_scenario(small | {"landscape": {"cover": "voronoi", "size": 80}, "classes": CLASSES})
    scene = fifesim.simulate(both)["scene"]
    assert set(np.unique(scene["cover"])) == {1, 2}
    for code, (name, keys) in enumerate(CLASSES.items(), 1):
        alone = fifesim.simulate(parse_scenario(small | {"ground": keys}))["scene"]
        cells = (scene["cover"] == code).compute()
        for variable in ("lai", "surface_reflectance"):
            found, meant = (each[variable].where(cells).compute() for each in (scene, alone))
            np.testing.assert_array_equal(found, meant, err_msg=f"{name} {variable}")


def test_cover_map_is_read_and_shares_are_drawn(tmp_path):
    small = {"grid": {"width": 600, "height": 600}, "terrain": {"dem": "flat"}}
    write(tmp_path / "cover.tif", [[5.0, 9.0], [5.0, 5.0]], parse_scenario(small).geobox().affine * Affine.scale(90))
    classes = {"grass": {"code": 5}, "wood": {"code": 9, "distribution": "unburned-ungrazed"}}
    mapped = {"landscape": {"cover": str(tmp_path / "cover.tif")}, "classes": classes}
    wood = (fifesim.simulate(parse_scenario(small | mapped))["scene"]["cover"] == 9).compute()
    assert float(wood.mean()) == 0.25 and bool(wood[:90, 90:].all())
    drawn = {"landscape": {"cover": "levels", "size": 20}, "classes": {"grass": {"share": 0.8}, "wood": {"share": 0.2}}}
    cover = fifesim.simulate(parse_scenario(small | drawn))["scene"]["cover"]
    # There are about 600 patches, so the standard error of the share is about 0.02.
    assert 0.1 < float((cover == 2).mean()) < 0.3


SKY = {"cloud_cover": 0.5, "length": "800 m", "base": 900.0, "top": 900.0, "seed": 4}


def test_cloud_keys_give_the_cloud_field_and_truth_is_cloud_fraction():
    scenario = fifesim.Scenario(grid={"width": 1800, "height": 1800, "cell": 10}, terrain={"dem": "flat"})
    clouded = fifesim.Scenario(grid=scenario.grid, terrain=scenario.terrain, clouds=SKY)
    clear, clouded = fifesim.simulate(scenario), fifesim.simulate(clouded)
    time = scenario.complete().geometry.time
    field = fifesim.cloud_field(scenario.geobox(), 0.5, length=800, height=900, seed=4, margin=600, time=time)
    cells = clear["scene"]["surface_reflectance"].fifesim.cast_clouds(field)
    for name in ("cloud", "shadow"):
        np.testing.assert_array_equal(clouded["truth"][name].values, cells[name].fifesim.aggregate(30).values)
    hidden = cells.optical_thickness + cells.shadow_thickness + cells.overhead_thickness
    # The footprint of TM extends two pixels.
    far = (hidden.fifesim.aggregate(30).rolling(y=7, x=7, center=True).max() == 0).values
    assert far.any()
    np.testing.assert_array_equal(clouded["image"]["dn"].values[:, far], clear["image"]["dn"].values[:, far])
    bright = cells.optical_thickness.fifesim.aggregate(30).values > 20
    assert (clouded["image"]["dn"].values[0][bright] > 1.2 * clear["image"]["dn"].values[0].max()).mean() > 0.5


def test_complete_image_over_relief_with_clouds_has_no_missing_edge():
    """Clouds are also cast onto the elevation around the scene."""
    run = fifesim.simulate(fifesim.Scenario(grid={"width": 900, "height": 900, "cell": 15}, clouds=SKY), complete=True)
    assert run["scene"]["dem"].shape == (60, 60)
    dn = run["image"]["dn"]
    assert (dn > 0).all()
    # TM saturates over thick clouds.
    np.testing.assert_array_equal(run["image"]["ndvi"].isnull(), (dn == 255).any("band"))


def test_optics_by_band_need_both_and_complete_optics_are_passed_to_the_chain():
    assert Ground().leaf_optics() is None and Ground().below_canopy() is None
    both = Ground(leaf_reflectance={"TM3": 0.1}, leaf_transmittance={"TM3": 0.05})
    assert both.leaf_optics() == {"TM3": (0.1, 0.05)}
    with pytest.raises(ValueError, match="must name the same bands"):
        Ground(leaf_reflectance={"TM3": 0.1}).leaf_optics()
    bands = [band.response for band in instrument("TM").select(["TM3", "TM4"])]
    keys = Ground().complete_optics(bands)
    rho = fifesim.ground.canopy.optics.band_leaf_optics(bands)[0]
    np.testing.assert_array_equal(list(keys["leaf_reflectance"].values()), rho)
    assert Ground(**keys).complete_optics(bands) == keys


def test_aerosol_file_is_found_next_to_the_scenario(tmp_path, monkeypatch):
    """An aerosol file needs an optical thickness, and a completed scenario holds its full path."""
    fifesim.atmosphere.aerosol_tables("urban").to_netcdf(tmp_path / "mine.nc")
    (tmp_path / "mine.toml").write_text('[atmosphere]\naerosol = "mine.nc"\naot = 0.3\n')
    read = fifesim.scenario.read_scenario(tmp_path / "mine.toml")
    air = read.model_atmosphere()
    assert (air.aerosol.name, air.aot, air.visibility) == ("mine", 0.3, None)
    assert read.files["atmosphere", "aerosol"] == str(tmp_path / "mine.nc")
    monkeypatch.chdir(tmp_path)
    inside = fifesim.Scenario(atmosphere={"aerosol": "mine.nc", "aot": 0.3})
    assert inside.complete().atmosphere.aerosol == str(tmp_path / "mine.nc")
    with pytest.raises(ValueError, match="must be given as aot, from 0 to 2, got visibility=23"):
        fifesim.Scenario(atmosphere={"aerosol": "mine.nc", "visibility": 23})


def test_default_pixel_size_is_taken_from_the_bands():
    """`sense` without `onto` uses the same size."""
    assert (Sensor(instrument="MSI").bands, Sensor(instrument="MSI").size) == (["MSI4", "MSI8"], 10)
    assert Sensor().size == 30 and Sensor(instrument="MODIS").size == 250 and Sensor(pixel=50.0).size == 50.0
    assert Sensor(instrument="MSI", bands=["MSI11"]).size == 20
    assert Sensor(instrument="MSI", bands=["MSI4", "MSI11"], pixel=20).size == 20


def test_response_and_noise_keys_equal_the_python_arguments():
    sharp = Sensor(response="detector").description
    assert sharp == fifesim.instrument("TM", response="detector") != Sensor().description
    assert Sensor(response="system").description == Sensor().description
    assert Sensor(response="paper").description == fifesim.instrument("TM", response="paper")
    given = {"thermal": 0.4, "shot": 0.005, "detectors": 16, "gain_spread": 0.005}
    assert Sensor(noise=["shot"], noise_model=given).given_noise() == fifesim.NoiseModel(**given)
    assert Sensor(instrument="OLI", noise=["thermal"], noise_model={"thermal": 1}).given_noise().along == "columns"
    assert Sensor().given_noise() is None
