"""
Speed of the regularization of a whole site, relative to a plain mean of blocks in the same process.

The mean of 9 x 9 cells is what numpy takes for it: a reshape and a mean over two axes. Read the ratios.

    python benchmarks/sensor.py --cells 4500
"""

import argparse

import numpy as np
from timing import seconds

from fifesim.base.footprints import Boxcar, axis_operator, regularize
from fifesim.sensor.response.spatial import CosineSpread, GaussianSpread

CELL = 30 / 9
BANDS = 2


def block_mean(scene):
    bands, rows, columns = scene.shape
    return scene.reshape(bands, rows // 9, 9, columns // 9, 9).mean(axis=(2, 4))


def operator(spread, cells, pixel, origin=0.0):
    return axis_operator(
        spread,
        cell_origin=0.0,
        cell_size=CELL,
        n_cells=cells,
        pixel_origin=origin,
        pixel_size=pixel,
        n_pixels=int((cells * CELL - origin) / pixel),
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--cells", type=int, default=4500, help="cells along each side, a multiple of 9")
    cells = parser.parse_args().cells
    scene = np.random.Generator(np.random.Philox(7)).random((BANDS, cells, cells))
    cases = {
        "TM, cosine, 30 m": operator(CosineSpread(30.32), cells, 30.0),
        "TM, cosine, 30.315 m": operator(CosineSpread(30.32), cells, 30.315),
        "boxcar 30 m, offset 7.1 m": operator(Boxcar(30.0), cells, 30.0, 7.1),
        "Gaussian 30 m, 30 m": operator(GaussianSpread(30.0), cells, 30.0),
        "Gaussian 1.1 km, 0.8 km": operator(GaussianSpread(1100.0), cells, 800.0),
    }
    regularize(scene[:, :90, :90], *[operator(Boxcar(30.0), 90, 30.0)] * 2)
    base = seconds(lambda: block_mean(scene))
    print(f"{cells**2 / 1e6:.1f} million cells, {BANDS} bands; a block mean of 9 x 9 cells takes {base:.3f} s")
    print("\n| | times the block mean |\n|---|---|")
    for name, axis in cases.items():
        taken = seconds(lambda axis=axis: regularize(scene, axis, axis))
        print(f"| {name} | {taken / base:.2f} |")


if __name__ == "__main__":
    main()
