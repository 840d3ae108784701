"""Scenes a second of ensembles: of one setup by size, and chips of which each has sun, air, canopy and sensor anew."""

import time

import numpy as np
from chain import floor

from fifesim.ground.landscape.field import keep_tiles
from fifesim.scenario.ensemble import realise
from fifesim.scenario.scenario import Scenario

CELL = 30 / 9
SIZES = (111, 333, 999)
CHIP = 333
PAIRS = 50  # of seed and arp, whose tiles chips share
TREATMENTS = ("burned-grazed", "burned-ungrazed", "unburned-ungrazed")
_WEST, _NORTH = 704970.0, 4334220.0


def place(number, side):
    """Corner and size of a window; nine chips lie in a tile of the random field."""
    step = max(side, CHIP) + 3
    west, north = _WEST + CELL * step * (number % 3 + 3), _NORTH - CELL * step * (number // 3 % 3 + 3)
    return {"west": west, "north": north, "width": side * CELL + 1e-6, "height": side * CELL + 1e-6}


def same(number, side=CHIP):
    """Another seed, under the same air and sun."""
    return Scenario(grid=place(number, side), ground={"seed": number % PAIRS}, terrain={"dem": "flat"})


def anew(number, dem="flat"):
    """A chip of which all is drawn but the field."""
    draw, pair = np.random.default_rng(number).uniform, number % PAIRS
    leaves = {"TM3": draw(0.05, 0.1), "TM4": draw(0.4, 0.5)}
    ground = {"seed": pair, "arp": round(0.05 + 0.0036 * pair, 4), "distribution": TREATMENTS[number % 3]}
    ground |= {"leaf_reflectance": leaves, "leaf_transmittance": {"TM3": 0.04, "TM4": 0.4}}
    geometry = {"sza": draw(20, 60), "saa": draw(90, 180), "vza": draw(0, 30), "vaa": draw(0, 360)}
    sensor = {"min_valid": 0.9, "offset": [draw(-0.3, 0.3), draw(-0.3, 0.3)]}
    air = {"visibility": draw(10, 60)}
    return Scenario(
        grid=place(number, CHIP), ground=ground, geometry=geometry, atmosphere=air, sensor=sensor, terrain={"dem": dem}
    )


def seconds(scenario_of, numbers, times=3):
    """Processor time of a scene, best of several rounds, tables and tiles made before."""
    for number in numbers:
        realise(scenario_of(number))
    spent = []
    for round_ in range(times):
        scenarios = [scenario_of(number + round_ * 1000 * PAIRS) for number in numbers]
        start = time.process_time()
        for scenario in scenarios:
            realise(scenario)
        spent.append((time.process_time() - start) / len(scenarios))
    return min(spent)


def main():
    """Print a table; a floor is drawing and filtering as many normals."""
    keep_tiles(PAIRS + 10)
    print("| scenes | a second of one processor | floors |\n|---|---|---|")
    cases = {
        f"{side} x {side} cells, one setup": (lambda n, s=side: same(n % 20, s), range(20), side) for side in SIZES
    }
    cases |= {"chips of 333 x 333, one air and sun": (same, range(PAIRS), CHIP)}
    cases |= {"chips of 333 x 333, all anew": (anew, range(PAIRS), CHIP)}
    cases |= {"chips of 333 x 333, all anew, on hills": (lambda n: anew(n, "flint-hills"), range(10), CHIP)}
    for name, (scenario_of, numbers, side) in cases.items():
        spent = seconds(scenario_of, numbers)
        start = time.process_time()
        floor(side, 1)
        print(f"| {name} | {1 / spent:.0f} | {spent / (time.process_time() - start):.2g} |", flush=True)


if __name__ == "__main__":
    main()
