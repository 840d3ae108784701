"""Scenes per second: one setup by size, and chips that each have another sun, atmosphere, canopy and sensor."""

import time

import numpy as np
from chain import floor

from fifesim.ground.landscape.autoregression import FIELD_TILE
from fifesim.scenario.ensemble import realise
from fifesim.scenario.scenario import Scenario

CELL = 30 / 9
SIZES = (111, 333, 999)
CHIP = 333
PAIRS = 50  # of seed and arp
SHARED = {
    side: (FIELD_TILE // (side + 3)) ** 2 for side in SIZES
}  # scenes that follow each other in a tile of one field
TREATMENTS = ("burned-grazed", "burned-ungrazed", "unburned-ungrazed")
# Where a tile of the random field begins on the site of FIFE. [m]
_WEST, _NORTH = 210 * FIELD_TILE * CELL, 1289 * FIELD_TILE * CELL


def place(number, side):
    """Corner and size of a window within a tile of the random field."""
    step, fitting = side + 3, FIELD_TILE // (side + 3)
    west, north = _WEST + CELL * step * (number % fitting), _NORTH - CELL * step * (number // fitting % fitting)
    return {"west": west, "north": north, "width": side * CELL + 1e-6, "height": side * CELL + 1e-6}


def same(number, side=CHIP):
    """Another seed, under the same air and sun."""
    return Scenario(grid=place(number, side), ground={"seed": number // SHARED[side]}, terrain={"dem": "flat"})


def anew(number, dem="flat"):
    """A chip of which all is drawn but the field."""
    draw, pair = np.random.default_rng(number).uniform, number // SHARED[CHIP]
    leaves = {"TM3": draw(0.05, 0.1), "TM4": draw(0.4, 0.5)}
    ground = {"seed": pair, "arp": round(0.05 + 0.0036 * (pair % PAIRS), 4), "distribution": TREATMENTS[number % 3]}
    ground |= {"leaf_reflectance": leaves, "leaf_transmittance": {"TM3": 0.04, "TM4": 0.4}}
    geometry = {"sza": draw(20, 60), "saa": draw(90, 180), "vza": draw(0, 30), "vaa": draw(0, 360)}
    sensor = {"min_valid": 0.9, "offset": [draw(-0.3, 0.3), draw(-0.3, 0.3)]}
    air = {"visibility": draw(10, 60)}
    return Scenario(
        grid=place(number, CHIP), ground=ground, geometry=geometry, atmosphere=air, sensor=sensor, terrain={"dem": dem}
    )


def seconds(scenario_of, numbers, times=3):
    """Processor time of a scene, best of several rounds; tables are made before, tiles as scenes come to them."""
    for number in numbers:
        realise(scenario_of(number))
    spent = []
    for round_ in range(times):
        scenarios = [scenario_of(number + (round_ + 1) * PAIRS * SHARED[111] * SHARED[CHIP]) for number in numbers]
        start = time.process_time()
        for scenario in scenarios:
            realise(scenario)
        spent.append((time.process_time() - start) / len(scenarios))
    return min(spent)


def main():
    """Print a table; a floor is drawing and filtering as many normals."""
    print("| scenes | a second of one processor | floors |\n|---|---|---|")
    cases = {
        f"{side} x {side} cells, one setup": (lambda n, s=side: same(n, s), range(max(SHARED[side], 18)), side)
        for side in SIZES
    }
    cases |= {"chips of 333 x 333, one air and sun": (same, range(5 * SHARED[CHIP]), CHIP)}
    cases |= {"chips of 333 x 333, all anew": (anew, range(2 * SHARED[CHIP]), CHIP)}
    cases |= {"chips of 333 x 333, all anew, on hills": (lambda n: anew(n, "flint-hills"), range(SHARED[CHIP]), CHIP)}
    for name, (scenario_of, numbers, side) in cases.items():
        spent = seconds(scenario_of, numbers)
        start = time.process_time()
        floor(side)
        print(f"| {name} | {1 / spent:.0f} | {spent / (time.process_time() - start):.2g} |", flush=True)


if __name__ == "__main__":
    main()
