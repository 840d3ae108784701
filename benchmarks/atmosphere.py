"""
Time of the atmosphere: the terms of a band by each engine, their application to a raster, and clouds.

Times of one process on a machine that does other things too: read the ratios.

    python benchmarks/atmosphere.py
"""

import numpy as np
import xarray as xr
from timing import both_times, seconds

import fifesim
from fifesim.atmosphere import engines

CELLS = 3000


def terms_of_a_band(engine, band, repeat):
    """Seconds for the terms of one band of an atmosphere that nobody asked for before."""
    visibilities = iter(np.linspace(20, 40, 2 * repeat))

    def call():
        engines.band_terms(fifesim.Atmosphere(visibility=next(visibilities), engine=engine), (band,), 35.0, 10.0, 60.0)

    return both_times(call, repeat)[1]


def modis_year(count=24):
    """Seconds for a year of 365 dates of MODIS over the site with clouds, from some of its dates."""
    grid = fifesim.fife_site(30)
    lai = fifesim.lai_scene(grid, seed=7)
    dates = fifesim.sensor.overpasses("MODIS", "2001-01-01T00:00Z", "2002-01-01T00:00Z", (39.06, -96.54))
    dates = dates.isel(time=np.linspace(0, dates.sizes["time"] - 1, count).astype(int))

    def call():
        for number in range(count):
            date = dates.isel(time=number)
            geometry = fifesim.Geometry(**{name: float(date[name]) for name in ("sza", "saa", "vza", "vaa")})
            slopes = np.tan(np.radians(geometry.sza)) + np.tan(np.radians(geometry.vza))
            sky = fifesim.cloud_field(grid, 0.4, seed=3, time=date.time.values, margin=1500 * slopes)
            rho = lai.fifesim.surface_reflectance("MODIS", bands=["MODIS1", "MODIS2"], geometry=geometry)
            cells = rho.fifesim.cast_clouds(sky)
            rho.fifesim.to_toa(clouds=cells).fifesim.sense()

    return 365 / count * seconds(call, 2)


def main():
    band = fifesim.instrument("TM").select("TM1")[0].response
    print("| terms of TM1, one geometry | ms |\n|---|---|")
    for engine, repeat in (("5S", 9), ("successive-orders", 5)):
        print(f"| {engine} | {1e3 * terms_of_a_band(engine, band, repeat):.1f} |")
    grid = fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS)))
    lai = fifesim.lai_scene(grid, arp=0.15, seed=7)
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    zenith = lai.copy(data=np.broadcast_to(np.linspace(0, 50, CELLS), lai.shape)).drop_attrs(deep=False)
    swath = xr.Dataset({"sza": 30.0, "saa": 120.0, "vza": zenith, "vaa": 200.0})
    sky = fifesim.cloud_field(grid, 0.4, seed=3, margin=3000)
    values, anywhere = rho.values, rho.drop_vars(["sza", "saa", "vza", "vaa"])
    copy = seconds(lambda: values.copy())
    calls = {
        "a plain copy": lambda: values.copy(),
        "to_toa, one geometry": rho.fifesim.to_toa,
        "to_toa, view angles by cell (5S)": lambda: anywhere.fifesim.to_toa(geometry=swath),
        "to_toa with adjacency": lambda: rho.fifesim.to_toa(adjacency=True),
        "to_toa, one geometry, 40 % clouds": lambda: rho.fifesim.to_toa(clouds=sky),
    }
    print(f"\n| {2 * CELLS**2 / 1e6:.0f} million values (two bands) | times a copy |\n|---|---|")
    for name, call in calls.items():
        print(f"| {name} | {seconds(call) / copy:.1f} |")
    print(f"\n365 dates of MODIS with clouds, cells of 30 m: {modis_year():.0f} s of processor time")


if __name__ == "__main__":
    main()
