"""Scenes per second: one setup by size, and chips with all drawn; budgets and designs without simulation."""

import time

import numpy as np
from chain import floor

import fifesim
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
    return Scenario(
        base="paper", grid=place(number, side), ground={"seed": number // SHARED[side]}, terrain={"dem": "flat"}
    )


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


def without_simulation():
    """Print processor times of a budget by both methods, and of a thousand designs, after a first call of each."""
    ground = {"soil": 0.0, "brown": 0.05, "moisture": 0.1}
    scenario = Scenario(ground=ground, terrain={"dem": "flat"}, sensor={"noise": ["all"], "offset": [0.2, 0.0]})
    designs = {"pixel": [10, 20, 30, 60], "mtf": [0.1, 0.2, 0.3, 0.4, 0.5]}
    designs |= {"registration": [0, 3, 6, 9, 12], "snr": np.geomspace(20, 500, 10)}
    cases = {
        "budget, 20 realisations": lambda: fifesim.budget(scenario),
        "budget, analytic": lambda: fifesim.budget(scenario, method="analytic"),
        "trade, 1,000 designs": lambda: fifesim.trade("OLI", designs, scenario),
    }
    print("\n| without simulation | processor time [s] | in budgets of 20 realisations |\n|---|---|---|")
    whole = None
    for name, case in cases.items():
        case()
        start = time.process_time()
        case()
        spent = time.process_time() - start
        whole = whole or spent
        print(f"| {name} | {spent:.2g} | {spent / whole:.2g} |", flush=True)


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
    without_simulation()


if __name__ == "__main__":
    main()
