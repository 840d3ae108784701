"""Time of public functions on small rasters in memory, as multiples of the same work on plain arrays."""

import xarray as xr
from timing import in_turn

import fifesim
from fifesim.chain.driver import Driver

BANDS = ("TM3", "TM4")


def cases():
    """Calls of public functions and of their kernels on arrays, by name."""
    lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 333), (0, 333))), seed=7)
    setup = fifesim.Setup("TM", bands=BANDS, geometry=fifesim.fife_geometry(), atmosphere=fifesim.Atmosphere())
    driver = Driver(setup)
    rho = lai.fifesim.surface_reflectance("TM", bands=BANDS)
    toa = rho.fifesim.to_toa()
    wide = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 450), (0, 450))), seed=7)
    image = wide.fifesim.surface_reflectance("TM", bands=BANDS).fifesim.to_toa().fifesim.sense("TM")
    red, nir = (image.isel(band=number).astype(float) for number in (0, 1))
    yield (
        "surface_reflectance, 333 x 333 cells, compared with its kernel",
        lambda: lai.fifesim.surface_reflectance("TM", bands=BANDS),
        lambda: driver.reflectance(lai.values),
    )
    yield "to_toa, 333 x 333 cells", lambda: rho.fifesim.to_toa(), lambda: driver.toa(rho.values)
    yield "sense, 333 x 333 cells", lambda: toa.fifesim.sense("TM"), lambda: driver.image(toa.values, lai.odc.geobox)
    yield (
        "ndvi, 50 x 50 pixels, compared with xarray.apply_ufunc",
        lambda: image.fifesim.ndvi(),
        lambda: xr.apply_ufunc(lambda r, n: (n - r) / (n + r), red, nir),
    )


def main():
    """Print a table of times and ratios."""
    print("| | ms | plain, ms | times |\n|---|---|---|---|")
    for name, ours, plain in cases():
        spent = in_turn({"ours": ours, "plain": plain}, rounds=30)
        ratio = spent["ours"] / spent["plain"]
        print(f"| {name} | {1e3 * spent['ours']:.2f} | {1e3 * spent['plain']:.2f} | {ratio:.1f} |", flush=True)


if __name__ == "__main__":
    main()
