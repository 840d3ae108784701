"""
Make aerosol_optics.csv, aerosol_phase.csv and aerosol_polarization.csv by Mie theory from aerosol_components.csv.

Needs miepython (MIT licence); fifesim itself does not. Run as ``python data/make_aerosol_tables.py``, a minute.
"""

import os
from pathlib import Path

os.environ.setdefault("MIEPYTHON_USE_JIT", "1")

import miepython
import numpy as np
import pandas as pd

DATA = Path(__file__).parent

RADIUS = np.geomspace(1e-3, 20.0, 1000)  # [um], the range of d'Almeida et al. (1991)

# Scattering angle [degree], fine where the largest dust particles diffract: their first minimum lies at 0.6 degrees.
ANGLE = np.concatenate(
    [np.arange(0, 2, 0.1), np.arange(2, 10, 0.25), np.arange(10, 30, 0.5), np.arange(30, 181, 1.0)]
).round(2)


def number_density(radius, sigma):
    """Log-normal number of particles per interval of ln r, shape (radius,). [1]"""
    return np.exp(-0.5 * (np.log(RADIUS / radius) / np.log(sigma)) ** 2) / (np.sqrt(2 * np.pi) * np.log(sigma))


def component_optics(rows):
    """
    Cross sections of the particles of one component, for a unit of their volume.

    Parameters
    ----------
    rows : pandas.DataFrame
        The rows of one component.

    Returns
    -------
    optics : array, shape (wavelength, 3 + 2 angle)
        Extinction, scattering, scattering times asymmetry [um-1]; scattering times the elements 11 and -12 of the
        phase matrix, whose first has the mean 1 over the sphere [um-1].
    """
    number = number_density(rows["radius"].iloc[0], rows["sigma"].iloc[0])
    log_radius, area = np.log(RADIUS), np.pi * RADIUS**2
    volume = np.trapezoid(4 / 3 * np.pi * RADIUS**3 * number, log_radius)
    optics = []
    for wavelength, n, k in rows[["wavelength", "n", "k"]].to_numpy():
        spheres = np.array([sphere_optics(complex(n, -k), size) for size in 2 * np.pi * RADIUS / wavelength])
        optics.append(np.trapezoid(spheres * (area * number)[:, None], log_radius, axis=0) / volume)
    return np.array(optics)


def sphere_optics(index, size):
    """Efficiencies of one sphere: extinction, scattering, that times asymmetry and times the phase matrix. [1]"""
    extinction, scattering, _, asymmetry = miepython.efficiencies_mx(index, size)
    # The package makes the phase function's integral over the sphere the scattering efficiency; here it is 4 pi of it.
    perpendicular, parallel = miepython.S1_S2(index, size, np.cos(np.radians(ANGLE)), norm="qsca")
    perpendicular, parallel = 2 * np.pi * np.abs(perpendicular) ** 2, 2 * np.pi * np.abs(parallel) ** 2
    moments = [extinction, scattering, scattering * asymmetry]
    return np.concatenate([moments, perpendicular + parallel, perpendicular - parallel])


def by_angle(component, wavelength, values):
    """Table of one component: an angle a row, a wavelength a column."""
    table = pd.DataFrame(values.T, columns=[f"{w:g}" for w in wavelength])
    table.insert(0, "angle", ANGLE)
    table.insert(0, "component", component)
    return table


def main():
    table = pd.read_csv(DATA / "aerosol_components.csv", comment="#")
    optics, phases, polarizations = [], [], []
    for component, rows in table.groupby("component", sort=False):
        wavelength, values = rows["wavelength"].to_numpy(), component_optics(rows)
        frame = pd.DataFrame(values[:, :3], columns=["extinction", "scattering", "directed"])
        frame.insert(0, "wavelength", wavelength)
        frame.insert(0, "component", component)
        optics.append(frame)
        first, second = np.split(values[:, 3:], 2, axis=1)
        phases.append(by_angle(component, wavelength, first / values[:, 1:2]))
        polarizations.append(by_angle(component, wavelength, (second / first).round(5) + 0.0))
    source = (
        f"# Aerosol components by Mie theory (miepython {miepython.__version__}) from aerosol_components.csv,\n"
        "# made by make_aerosol_tables.py. "
    )
    angles = "# by scattering angle [degree] (rows) and wavelength [um] (columns)\n"
    write(
        "aerosol_optics.csv",
        pd.concat(optics),
        source + "wavelength [um]; cross sections for a unit of the particles' volume [um-1]:\n"
        "# extinction, scattering, and directed, which is scattering times the asymmetry parameter\n",
    )
    write("aerosol_phase.csv", pd.concat(phases), source + "Phase function, mean over the sphere 1 [1],\n" + angles)
    write(
        "aerosol_polarization.csv",
        pd.concat(polarizations),
        source + "Degree of linear polarization of scattered\n# natural light, -P12 / P11, positive where light "
        "vibrates across the plane of scattering [1],\n" + angles,
    )


def write(name, table, header):
    """Write a table with its header comments."""
    with open(DATA / name, "w") as file:
        file.write(header)
        table.to_csv(file, index=False, float_format="%.6g", lineterminator="\n")


if __name__ == "__main__":
    main()
