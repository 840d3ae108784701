"""
User code for a type checker.

The correct functions have no type errors and run in the tests. Each wrong line has an ``ignore`` with its error code,
and mypy reports unneeded ones.
"""

from datetime import datetime
from pathlib import Path

import numpy as np
import xarray as xr
from scipy import stats

import fifesim


def scene() -> xr.DataArray:
    grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 108)))
    fifesim.grid_at(grid.crs, 705000, 4334000, width=300, height=300, cell=(5, 5))
    fifesim.lai_scene(grid, stats.gamma(4, scale=0.4), seed=1, chunks={"y": 45, "x": 54})
    arp = fifesim.ground.arp_for_length(20, cell=30 / 9)
    print(f"{fifesim.ground.correlation_length(arp):.1f}", ", ".join(fifesim.ground.treatments()))
    print(fifesim.ground.lai_distribution("burned-grazed").mean())
    return fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7, method="streaming")


def ground(lai: xr.DataArray) -> xr.DataArray:
    grid = lai.odc.geobox
    dem = fifesim.flint_hills(grid, seed=7)
    soil = fifesim.landscape(grid, soil=fifesim.ground.Field(sd=0.03, arp=0.24))["soil"]
    light = fifesim.horizon(dem, directions=16, reach=300)
    print(
        fifesim.terrain.slope(dem).max() + fifesim.terrain.sky_view(dem, light).min(),
        fifesim.terrain.wetness(dem).mean(),
    )
    return fifesim.surface_reflectance(
        lai,
        "TM",
        bands=["TM3", "TM4"],
        dem=dem,
        canopy=fifesim.Canopy(
            leaf_optics=fifesim.Leaf(chlorophyll=xr.where(lai > 1, 45.0, 25.0)),
            background={"soil_dry": 0.4, "shade": 0.6},
            soil=soil,
            leaf_angles="campbell(57)",
        ),
    )


def patches(lai: xr.DataArray) -> xr.Dataset:
    classes = {
        "wood": fifesim.CoverClass(
            lai=4.0, canopy=fifesim.Canopy(leaf_optics=fifesim.Leaf(chlorophyll=45), background={"dead_grass": 1.0})
        ),
        "pond": fifesim.CoverClass(lai=0.0, canopy=fifesim.Canopy(background=0.03)),
    }
    cover = fifesim.ground.Patches("voronoi", size=150, shares={"wood": 0.7, "pond": 0.3})
    land = fifesim.landscape(
        lai.odc.geobox, cover=cover, classes=classes, moisture=fifesim.ground.Field(0.25, 0.08), seed=7
    )
    seen = fifesim.surface_reflectance(land, "TM", geometry=fifesim.fife_geometry())
    print(seen.sizes, fifesim.fpar(land, leaves="green").mean())
    return fifesim.aggregate(land, 30)


def air(rho: xr.DataArray) -> xr.DataArray:
    hazy = fifesim.Atmosphere(aerosol={"dust": 0.6, "water_soluble": 0.4}, visibility=10)
    sun = fifesim.sun_position(datetime(1987, 6, 6, 16, 35), latitude=39.1, longitude=-96.5)
    low = fifesim.Setup(bands=["TM3", "TM4"], atmosphere=hazy, geometry=fifesim.Geometry(65, sun.saa))
    by_engine = fifesim.atmosphere.compare_engines(low, reflectance=[0.05, 0.3], engines=["5S"])
    print(by_engine, fifesim.atmosphere.spectrum(hazy, fifesim.fife_geometry()).sizes, f"{sun.sza:.1f}")
    toa = fifesim.to_toa(rho, surroundings=0.2, adjacency=True)
    print(fifesim.index(fifesim.to_surface(toa, adjacency=True), "EVI2").mean())
    return toa


def image(toa: xr.DataArray) -> xr.DataArray:
    tm = fifesim.instrument("TM", response="system")
    red, _ = tm.red_and_near_infrared()
    print(red.name, tm.line_spread.half_width, tm.line_spreads(red).across.mtf([0.01]), tm.source("altitude"))
    print(
        fifesim.sensor.snr("OLI", "OLI4", [50.0, 100.0]).max(),
        fifesim.sensor.psf(tm).sum(),
        fifesim.sensor.mtf(tm, ["TM3"]),
    )
    fifesim.sense(toa, offset=(0.2, 0.0), interval="native", noise=["shot"], noise_models=fifesim.NoiseModel(0.1, 0.01))
    swath = fifesim.sense_swath(toa, "TM", heading=193.6, min_valid=0.5, view_tolerance=180)
    print(fifesim.to_reflectance(fifesim.sense(toa)).mean(), swath.sizes)
    view = fifesim.sensor.scan_geometry("TM", toa.odc.geobox, fifesim.sensor.Track(39.1, -96.6, 190.0))
    print(view["vza"].max(), fifesim.sensor.spectral_adjustment("MSI", "OLI")["slope"].values)
    return fifesim.sense(toa, tm)


def analysis(lai: xr.DataArray, rho: xr.DataArray, dn: xr.DataArray) -> float:
    ndvi, truth = fifesim.ndvi(dn), fifesim.aggregate(lai, 30.0)
    fit = fifesim.regress(truth, ndvi, pair="coordinates")
    low, high = fit.prediction_interval([0.5, 0.6])
    estimate = truth.copy(data=fit.predict(ndvi.values))
    print(low[0], high[-1], fit.predict(0.5), fifesim.score(estimate, truth)["rmse"])
    print(fifesim.scaling.relative_equivalent_noise(truth, ndvi, min_count=2), fifesim.scaling.share_kept(truth, lai))
    print(fifesim.scaling.scale_bias(fifesim.ndvi, rho)["bias"].mean(), fifesim.scaling.ndvi_bias(rho).mean())
    print(fifesim.scaling.regularized_variance(lai, 30, fifesim.instrument("TM", response="paper").line_spread))
    return fit.slope / fit.slope_error + float(fifesim.scaling.variogram(lai, 60)["practical_range"][0])


def files(dn: xr.DataArray, folder: Path) -> xr.DataArray:
    written = fifesim.to_geotiff(dn, folder / "tm.tif", tags={"title": "Konza"}, overwrite=True)
    fifesim.output.write_style(str(written))
    print(fifesim.rgb(dn, ("TM4", "TM3", "TM3"), stretch=(2, 98)).sizes)
    fifesim.plot(dn, band="TM4", cmap="viridis", limits=(0, 255)).set_title(written.stem)
    return fifesim.open_image(written, chunks="auto").compute()


def runs() -> xr.Dataset:
    scenario = fifesim.Scenario(grid={"width": 150, "height": 150}, terrain={"dem": "flat"})
    lai = fifesim.simulate(scenario, chunks=50)["scene"].to_dataset()["lai"]
    table = fifesim.sensor.comparison_table(fifesim.compare(lai, ["TM", "OLI"], bands={"TM": ["TM3", "TM4"]}))
    print(table.columns, scenario.geobox().shape, scenario.sun_and_view().mu_s, scenario.ground.arp)
    return fifesim.scenario.sweep(scenario, {"arp": [0.05, 0.15], "visibility": np.array([10.0, 45.0])})


def wrong(lai: xr.DataArray, dn: xr.DataArray, fit: fifesim.Regression) -> None:
    grid = fifesim.fife_site("3.3")  # type: ignore[arg-type]
    fifesim.lai_scene(grid, 1.5)  # type: ignore[arg-type]
    fifesim.lai_scene(grid, sead=7)  # type: ignore[call-arg]
    fifesim.terrain.slope("dem.tif")  # type: ignore[arg-type]
    fifesim.surface_reflectance(lai, 5)  # type: ignore[arg-type]
    fifesim.to_toa(lai.values)  # type: ignore[arg-type]
    fifesim.atmosphere.spectrum("tropical")  # type: ignore[arg-type]
    fifesim.sense(dn, offset=0.2)  # type: ignore[arg-type]
    fifesim.sense(dn, onto=dn)  # type: ignore[arg-type]
    fifesim.regress(lai, dn, pair="place")  # type: ignore[arg-type]
    fifesim.index(dn, "ndvi")  # type: ignore[arg-type]
    fifesim.Geometry("30", 120)  # type: ignore[arg-type]
    fifesim.Atmosphere(visibility="10 km")  # type: ignore[arg-type]
    fifesim.landscape(grid, classes=["wood"])  # type: ignore[list-item]
    fifesim.no_such_function(lai)  # type: ignore[attr-defined]
    print(fit.slope.mean(), fifesim.scaling.ndvi_linearity(dn).mean())  # type: ignore[attr-defined]
    text: str = fifesim.regress(lai, dn).r2  # type: ignore[assignment]
    print(text)
