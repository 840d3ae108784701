"""
Make aerosol_optics.csv and aerosol_phase.csv by Mie theory from aerosol_components.csv.

Needs miepython (MIT licence); fifesim itself does not. Run as ``python data/make_aerosol_tables.py``, half a minute.
"""

import os
from pathlib import Path

os.environ.setdefault("MIEPYTHON_USE_JIT", "1")

import miepython
import numpy as np
import pandas as pd

DATA = Path(__file__).parent

# Volume fractions of the components. World Climate Programme WCP-55 (1983); Tanre et al. (1990).
MODELS = {"continental": {"dust": 0.70, "water_soluble": 0.29, "soot": 0.01}}

RADIUS = np.geomspace(1e-3, 20.0, 1000)  # [um], the range of d'Almeida et al. (1991)
ANGLE = np.concatenate([np.arange(0, 10, 0.5), np.arange(10, 181, 1.0)])  # scattering angle [degree]
REFERENCE_WAVELENGTH = 0.55  # [um]


def number_density(radius, sigma):
    """Log-normal number of particles per interval of ln r, shape (radius,). [1]"""
    return np.exp(-0.5 * (np.log(RADIUS / radius) / np.log(sigma)) ** 2) / (np.sqrt(2 * np.pi) * np.log(sigma))


def component_optics(rows):
    """
    Mean cross sections of one particle, by wavelength.

    Parameters
    ----------
    rows : pandas.DataFrame
        The rows of one component.

    Returns
    -------
    volume : float
        [um3]
    optics : array, shape (wavelength, 3 + angle)
        Extinction, scattering, scattering times asymmetry, scattering times phase function. [um2]
    """
    number = number_density(rows["radius"].iloc[0], rows["sigma"].iloc[0])
    log_radius, area = np.log(RADIUS), np.pi * RADIUS**2
    volume = np.trapezoid(4 / 3 * np.pi * RADIUS**3 * number, log_radius)
    optics = []
    for wavelength, n, k in rows[["wavelength", "n", "k"]].to_numpy():
        spheres = np.array([sphere_optics(complex(n, -k), size) for size in 2 * np.pi * RADIUS / wavelength])
        optics.append(np.trapezoid(spheres * (area * number)[:, None], log_radius, axis=0))
    return volume, np.array(optics)


def sphere_optics(index, size):
    """Efficiencies of one sphere: extinction, scattering, that times asymmetry and times phase function. [1]"""
    extinction, scattering, _, asymmetry = miepython.efficiencies_mx(index, size)
    # The package integrates the phase function over the sphere to the scattering efficiency; here to 4 pi of it.
    phase = 4 * np.pi * miepython.i_unpolarized(index, size, np.cos(np.radians(ANGLE)), norm="qsca")
    return np.concatenate([[extinction, scattering, scattering * asymmetry], phase])


def mixture(fractions, components):
    """
    Optics of an external mixture, per particle.

    Parameters
    ----------
    fractions : dict
        Volume fraction of each component. [1]
    components : dict
        Volume and optics of each component, from `component_optics`.

    Returns
    -------
    optics : array, shape (wavelength, 3 + angle)
        As in `component_optics`.
    """
    number = {name: share / components[name][0] for name, share in fractions.items()}
    return sum(number[name] / sum(number.values()) * components[name][1] for name in fractions)


def main():
    table = pd.read_csv(DATA / "aerosol_components.csv", comment="#")
    wavelength = table["wavelength"].unique()
    components = {name: component_optics(rows) for name, rows in table.groupby("component")}
    optics, phases = [], []
    for model, fractions in MODELS.items():
        extinction, scattering, directed, *phase = mixture(fractions, components).T
        frame = pd.DataFrame({"model": model, "wavelength": wavelength})
        reference = np.interp(REFERENCE_WAVELENGTH, wavelength, extinction)
        frame["extinction"] = (extinction / reference).round(6)
        frame["single_scattering_albedo"] = (scattering / extinction).round(6)
        frame["asymmetry"] = (directed / scattering).round(6)
        optics.append(frame)
        phase = pd.DataFrame(np.array(phase) / scattering, columns=[f"{w:g}" for w in wavelength])
        phase.insert(0, "angle", ANGLE)
        phase.insert(0, "model", model)
        phases.append(phase)
    source = (
        f"# Aerosol models by Mie theory (miepython {miepython.__version__}) from aerosol_components.csv,\n"
        "# made by make_aerosol_tables.py. "
    )
    write(
        "aerosol_optics.csv",
        pd.concat(optics),
        source + "wavelength [um], extinction relative to 0.55 um [1],\n"
        "# single scattering albedo [1], asymmetry parameter [1]\n",
    )
    write(
        "aerosol_phase.csv",
        pd.concat(phases),
        source + "Phase function, whose mean over the sphere is 1 [1],\n"
        "# by scattering angle [degree] (rows) and wavelength [um] (columns)\n",
    )


def write(name, table, header):
    """Write a table with its header comments."""
    with open(DATA / name, "w") as file:
        file.write(header)
        table.to_csv(file, index=False, float_format="%.6g", lineterminator="\n")


if __name__ == "__main__":
    main()
