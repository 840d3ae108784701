"""
Make cloud_phase.csv and cloud_moments.csv by Mie theory for the drops of water clouds.

Needs miepython (MIT licence); fifesim itself does not. Run as ``python data/make_cloud_phase.py``, three minutes.
"""

import os
from pathlib import Path

os.environ.setdefault("MIEPYTHON_USE_JIT", "1")

import miepython
import numpy as np
import pandas as pd

DATA = Path(__file__).parent

EFFECTIVE_RADIUS, EFFECTIVE_VARIANCE = 10.0, 0.1  # [um], [1]; as assumed by ISCCP (Rossow & Schiffer 1999)
# [um]. Larger and smaller drops have 2e-6 of the cross section. Resonances of drops are so narrow that with an eighth
# of the radii, the phase function has an error of 1 %.
RADIUS = np.linspace(0.5, 35.0, 12000)

WAVELENGTH = np.geomspace(0.4, 2.5, 48).round(4)  # [um]

# Scattering angle [degree]: no reflectance with zenith angles up to 85 degrees needs less than 10 degrees.
ANGLE = np.concatenate(
    [np.arange(6, 30, 1.0), np.arange(30, 120, 2.0), np.arange(120, 177, 0.5), np.arange(177, 180.05, 0.1)]
).round(1)
DEGREES = 33  # moments, to the first one that 16 directions per hemisphere do not resolve


def number_density():
    """Gamma distribution of Hansen & Travis (1974), Eq. 2.56, not normalised. [1]"""
    scaled = RADIUS / EFFECTIVE_RADIUS
    return scaled ** (1 / EFFECTIVE_VARIANCE - 3) * np.exp(-scaled / EFFECTIVE_VARIANCE)


def refractive_index(wavelength):
    """Complex refractive index of water, by water_index.csv and the absorption coefficient of prospect_d.csv. [1]"""
    real, water = (pd.read_csv(DATA / name, comment="#") for name in ("water_index.csv", "prospect_d.csv"))
    n = np.interp(wavelength, real["wavelength"], real["refractive_index"])
    absorption = np.interp(wavelength, water["wavelength"], water["water"]) * 1e-4  # [um-1]
    return complex(n, -absorption * wavelength / (4 * np.pi))


def drop_optics(wavelength, cosines):
    """Co-albedo [1], and the phase function at some cosines of the scattering angle, mean over the sphere 1. [1]"""
    index, share = refractive_index(wavelength), number_density()
    extinction = scattering = phase = 0.0
    for some in np.array_split(np.arange(RADIUS.size), 24):
        sizes = 2 * np.pi * RADIUS[some] / wavelength
        a, b = np.zeros((2, some.size, int(1.1 * sizes[-1]) + 30), complex)
        for each, size in enumerate(sizes):
            for kept, found in zip((a, b), miepython.coefficients(index, size), strict=True):
                kept[each, : found.size] = found
        # Bohren & Huffman (1983), Eqs. 4.61, 4.62 and 4.74.
        order = np.arange(1, a.shape[1] + 1)
        pi, tau = angular_functions(order.size, cosines)
        factor = (2 * order + 1) / (order * (order + 1))
        waves = (a * factor) @ pi + (b * factor) @ tau, (a * factor) @ tau + (b * factor) @ pi
        phase = phase + share[some] @ sum(np.abs(each) ** 2 for each in waves)
        scattering += share[some] @ (np.abs(a) ** 2 + np.abs(b) ** 2) @ (2 * order + 1)
        extinction += share[some] @ (a + b).real @ (2 * order + 1)
    return 1 - scattering / extinction, phase / scattering


def angular_functions(orders, cosines):
    """Functions pi and tau of Bohren & Huffman (1983), Eq. 4.47, shape (order, angle). [1]"""
    pi, tau = np.zeros((2, orders + 1, cosines.size))
    pi[1], tau[1] = 1, cosines
    for order in range(2, orders + 1):
        pi[order] = ((2 * order - 1) * cosines * pi[order - 1] - order * pi[order - 2]) / (order - 1)
        tau[order] = order * cosines * pi[order] - (order + 1) * pi[order - 1]
    return pi[1:], tau[1:]


def main():
    # The largest drops have functions of degree 600, whose squares 700 points integrate exactly.
    points, weights = np.polynomial.legendre.leggauss(700)
    legendre = np.polynomial.legendre.legvander(points, DEGREES - 1)
    phases, moments = [], []
    for wavelength in WAVELENGTH:
        co_albedo, phase = drop_optics(wavelength, np.concatenate([np.cos(np.radians(ANGLE)), points]))
        phases.append(phase[: ANGLE.size])
        moments.append([co_albedo, *(weights * phase[ANGLE.size :] @ legendre / 2)])
    table = pd.DataFrame(np.transpose(phases), columns=[f"{each:g}" for each in WAVELENGTH])
    table.insert(0, "angle", ANGLE)
    what = (
        "Phase function, mean over the sphere 1 [1],\n"
        "# by scattering angle [degree] (rows) and wavelength [um] (columns)"
    )
    write("cloud_phase.csv", table, what, "%.5g")
    table = pd.DataFrame(moments, columns=["co_albedo", *(f"moment_{degree}" for degree in range(DEGREES))])
    table.insert(0, "wavelength", WAVELENGTH)
    what = (
        "Columns: wavelength [um];\n"
        "# co_albedo, one less the single scattering albedo [1]; Legendre moments of the phase function [1]"
    )
    write("cloud_moments.csv", table, what, "%.6g")


def write(name, table, what, digits):
    """Write a table with its header comments."""
    sizes = f"effective radius {EFFECTIVE_RADIUS:g} um and effective variance {EFFECTIVE_VARIANCE:g}"
    with open(DATA / name, "w") as file:
        file.write(
            f"# Drops of water clouds by Mie theory (miepython {miepython.__version__}), made by make_cloud_phase.py.\n"
            f"# Gamma distribution of {sizes} (Hansen & Travis 1974).\n"
            f"# Refractive index: water_index.csv, absorption: prospect_d.csv. {what}.\n"
        )
        table.to_csv(file, index=False, float_format=digits, lineterminator="\n")


if __name__ == "__main__":
    main()
