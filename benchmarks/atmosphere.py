"""
What the atmosphere costs: the terms of a band by each engine, and applying them to a raster.

Times of one process on a machine that does other things too: read the ratios.

    python benchmarks/atmosphere.py
"""

import time

import numpy as np

import fifesim
from fifesim.atmosphere.schemes import engines, six_s
from fifesim.base.geometry import Geometry

CELLS = 3000


def seconds(call, repeat=5):
    """Best of some calls."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def terms_of_a_band(engine, band, repeat):
    """Seconds for the terms of one band of an atmosphere that nobody asked for before."""
    visibilities = iter(np.linspace(20, 40, 2 * repeat))

    def call():
        engines.band_terms(fifesim.Atmosphere(visibility=next(visibilities), engine=engine), (band,), 35.0, 10.0, 60.0)

    call()
    return seconds(call, repeat)


def main():
    band = fifesim.instrument("TM").select("TM1")[0].response
    print(f"{'terms of TM1, one geometry':<44}{'ms':>10}")
    for engine, repeat in (("5S", 9), ("successive-orders-scalar", 5), ("successive-orders", 5), ("6S", 3)):
        if engine == "6S" and six_s.Py6S is None:
            print("6S is not installed: pip install 'fifesim[sixs]'")
            continue
        print(f"  {engine:<42}{1e3 * terms_of_a_band(engine, band, repeat):>10.1f}")
    grid = fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS)))
    lai = fifesim.lai_scene(grid, arp=0.15, seed=7)
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    zenith = lai.copy(data=np.broadcast_to(np.linspace(0, 50, CELLS), lai.shape)).drop_attrs(deep=False)
    swath = Geometry(30.0, 120.0, zenith, 200.0)
    values = rho.values
    copy = seconds(lambda: values.copy())
    calls = {
        "a plain copy": lambda: values.copy(),
        "to_toa, one geometry": rho.fifesim.to_toa,
        "to_toa, view angles by cell (5S)": lambda: rho.fifesim.to_toa(geometry=swath),
        "to_toa with adjacency": lambda: rho.fifesim.to_toa(adjacency=True),
    }
    print(f"\n{f'{2 * CELLS**2 / 1e6:.0f} million values (two bands)':<44}{'million/s':>10}{'of a copy':>12}")
    for name, call in calls.items():
        call()
        time_taken = seconds(call, 3)
        print(f"  {name:<42}{2 * CELLS**2 / 1e6 / time_taken:>10.0f}{time_taken / copy:>12.1f}")


if __name__ == "__main__":
    main()
