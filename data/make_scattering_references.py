"""
Make independent results for the tests of scattering: cloud_drops, cloud_layers, mixed_layers and eddington.csv.

Needs PythonicDISORT (MIT licence); the tests do not. Run as ``python data/make_scattering_references.py``, a minute.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.polynomial.legendre import leggauss, legvander
from PythonicDISORT.pydisort import pydisort
from scipy.integrate import quad, solve_bvp

DATA = Path(__file__).parent
TESTS = DATA.parent / "tests" / "data"
POINTS, WEIGHTS = leggauss(1200)
STREAMS = 64

# Scattering angles of drops, between those of cloud_phase.csv. [degree]
ANGLE = np.array([10.3, 25.5, 61.0, 93.0, 118.8, 131.2, 139.7, 142.3, 151.3, 163.7, 171.2, 175.3, 177.7, 178.2])
DROPS = {0.48: 12_011, 1.65: 3001}  # number of radii by wavelength [um]: without absorption, resonances are narrow

# Optical thickness of a cloud, wavelength [um], sza, raa [degree], and reflectance of the ground.
CLOUDS = [
    (0.05, 0.66, 70.0, 180.0, 0.0),
    (0.05, 1.65, 20.0, 60.0, 0.0),
    (0.1, 0.84, 30.0, 0.0, 0.0),
    (0.4, 0.48, 33.0, 111.0, 0.0),
    (1.0, 1.65, 70.0, 0.0, 0.0),
    (2.0, 0.66, 10.0, 170.0, 0.0),
    (2.05, 1.65, 0.5, 79.0, 0.0),
    (3.3, 0.84, 47.0, 20.0, 0.0),
    (7.0, 0.66, 61.0, 140.0, 0.0),
    (20.0, 1.65, 8.0, 90.0, 0.0),
    (20.0, 0.48, 55.0, 170.0, 0.0),
    (60.0, 1.65, 28.0, 45.0, 0.0),
    (1.0, 0.84, 40.0, 70.0, 0.3),
    (10.0, 0.84, 40.0, 70.0, 0.8),
    (1.0, 0.66, 28.5, 180.0, 0.08),
    (1.0, 0.84, 28.5, 180.0, 0.25),
]
# Optical depth, single scattering albedo, asymmetry, phase function, and cosines of sun and view.
EDDINGTON = [(0.2, 0.9, 0.65, 0.3, 0.8, 0.9), (0.8, 0.85, 0.6, 0.2, 0.5, 1.0), (2.0, 0.5, 0.2, 1.4, 0.35, 0.4)]

HEADERS = {
    "clouds/cloud_drops.csv": """
# Phase function, mean over the sphere 1 [1], and co-albedo [1] of the drops of cloud_phase.csv, by wavelength [um] and
# scattering angle [degree]. Source: Mie theory after Bohren & Huffman (1983), by make_scattering_references.py.""",
    "clouds/cloud_layers.csv": """
# Reflectance of a cloud over Lambertian ground and transmittance of the layer [1], by optical thickness [1], wavelength
# [um], angles [degree], reflectance of the ground [1] and cosine of the view zenith angle [1].
# Source: PythonicDISORT, 64 streams, exact single scattering and Mie theory, by make_scattering_references.py.""",
    "mixed_layers.csv": """
# Reflectance and transmittance [1] of molecules (optical depth 0.2) mixed with aerosol (0.4, single scattering albedo
# 0.9, Henyey and Greenstein's phase function of an asymmetry [1]) whose scale height is a quarter of that of the
# molecules. Black ground, sun at 50 degrees, by raa [degree] and cosine of the view zenith angle [1].
# Source: PythonicDISORT with 32 streams and 60 layers, by make_scattering_references.py.""",
    "eddington.csv": """
# Reflectance of a layer: integral of the Eddington source function with exact single scattering. Plane albedo and
# transmittance by Eddington's equations for the layer scaled without its forward peak, asymmetry^2. All [1].
# Source: equations solved by scipy.integrate.solve_bvp to 1e-9, by make_scattering_references.py.""",
}


def write(name, rows, columns):
    """Write a table with its header."""
    text = pd.DataFrame(rows, columns=columns).to_csv(index=False, float_format="%.10g")
    (TESTS / name).write_text(HEADERS[name].lstrip() + "\n" + text, encoding="utf-8")


def mie_coefficients(index, size):
    """Coefficients a and b of spheres of size parameter `size`, shape (order, size). [1]"""
    size = np.asarray(size, float)
    orders = int(size.max() + 4.05 * size.max() ** (1 / 3) + 2)
    inner = index * size
    derivative = np.zeros((orders + 16, size.size), complex)
    for n in range(orders + 15, 0, -1):
        derivative[n - 1] = n / inner - 1 / (derivative[n] + n / inner)
    a, b = np.zeros((2, orders, size.size), complex)
    psi_before, psi, chi_before, chi = np.cos(size), np.sin(size), -np.sin(size), np.cos(size)
    for n in range(1, orders + 1):
        psi_before, psi = psi, (2 * n - 1) / size * psi - psi_before
        chi_before, chi = chi, (2 * n - 1) / size * chi - chi_before
        # Beyond its last order, the wave of a small sphere grows by rounding.
        kept = n <= size + 4.05 * size ** (1 / 3) + 2
        psi, chi = np.where(kept, psi, 0.0), np.where(kept, chi, 1.0)
        for found, factor in ((a, derivative[n] / index), (b, derivative[n] * index)):
            left = factor + n / size
            xi, xi_before = psi - 1j * chi, psi_before - 1j * chi_before
            found[n - 1] = np.where(kept, (left * psi - psi_before) / (left * xi - xi_before), 0)
    return a, b


def mie_drops(index, wavelength, cosines, radii=4001):
    """
    Single scattering albedo, and phase function at some cosines, of drops with the sizes of `cloud_phase.csv`. [1]

    Gamma distribution by Hansen & Travis (1974), Eq. 2.56, with effective radius 10 um and variance 0.1, and Bohren &
    Huffman (1983), Eqs. 4.47, 4.61, 4.62, 4.74 and 4.88.
    """
    radii = np.linspace(0.4, 36.0, radii)
    number = (radii / 10) ** 7 * np.exp(-radii)
    size = 2 * np.pi * radii / wavelength
    a, b = mie_coefficients(index, size)
    n = np.arange(1, len(a) + 1)
    pi, tau = np.zeros((2, n.size + 1, np.size(cosines)))
    pi[1], tau[1] = 1, cosines
    for k in range(2, n.size + 1):
        pi[k] = (2 * k - 1) / (k - 1) * cosines * pi[k - 1] - k / (k - 1) * pi[k - 2]
        tau[k] = k * cosines * pi[k] - (k + 1) * pi[k - 1]
    factor = (2 * n + 1) / (n * (n + 1))
    first = (a.T * factor) @ pi[1:] + (b.T * factor) @ tau[1:]
    second = (a.T * factor) @ tau[1:] + (b.T * factor) @ pi[1:]
    scattered = number @ ((2 * n + 1) @ (np.abs(a) ** 2 + np.abs(b) ** 2))
    extinct = number @ ((2 * n + 1) @ (a + b).real)
    return scattered / extinct, number @ (np.abs(first) ** 2 + np.abs(second) ** 2) / scattered


@cache
def mie_moments(wavelength):
    """Single scattering albedo and Legendre moments of the phase function of drops, to the last. [1]"""
    albedo, phase = mie_drops(water_index(wavelength), wavelength, POINTS)
    return albedo, WEIGHTS * phase @ legvander(POINTS, 900) / 2


def water_index(wavelength):
    """Complex refractive index of water [1], by Hale & Querry (1973) and the absorption of PROSPECT-D."""
    real, water = (pd.read_csv(DATA / name, comment="#") for name in ("water_index.csv", "prospect_d.csv"))
    absorption = np.interp(wavelength, water["wavelength"], water["water"])
    imaginary = absorption * wavelength * 1e-4 / (4 * np.pi)
    return complex(np.interp(wavelength, real["wavelength"], real["refractive_index"]), imaginary)


def eddington_intensities(tau, albedo, asymmetry, mu_s):
    """Mean (J) and net upward (H) diffuse intensity as functions of depth, for solar flux pi and black surface. [1]"""

    def slopes(depth, state):
        mean, net = state
        beam = albedo / 4 * np.exp(-depth / mu_s)
        return np.stack([3 * (1 - albedo * asymmetry) * net + 3 * asymmetry * mu_s * beam, (1 - albedo) * mean - beam])

    def edges(top, bottom):
        return np.array([top[0] - 2 * top[1], bottom[0] + 2 * bottom[1]])

    depths = np.linspace(0, tau, 41)
    return solve_bvp(slopes, edges, depths, np.zeros((2, 41)), tol=1e-9).sol


def sobolev_reflectance(tau, albedo, asymmetry, phase, mu_s, mu_v):
    """Integral along the view of the Eddington source function, with exact single scattering. [1]"""
    field = eddington_intensities(tau, albedo, asymmetry, mu_s)

    def emitted(depth):
        mean, net = field(depth)
        once = albedo / 4 * phase * np.exp(-depth / mu_s)
        return (albedo * mean + 3 * albedo * asymmetry * mu_v * net + once) * np.exp(-depth / mu_v) / mu_v

    return quad(emitted, 0, tau, epsabs=1e-12, epsrel=1e-10)[0] / mu_s


def eddington_flux(tau, albedo, asymmetry, mu_s):
    """Plane albedo and total transmittance from the Eddington fluxes. [1]"""
    field = eddington_intensities(tau, albedo, asymmetry, mu_s)
    return 4 * field(0)[1] / mu_s, np.exp(-tau / mu_s) - 4 * field(tau)[1] / mu_s


def cloud_rows():
    """Reflectance at each upward direction, and transmittance, of the cases of `CLOUDS`."""
    for thickness, wavelength, sza, raa, ground in CLOUDS:
        albedo, moments = mie_moments(wavelength)
        mu_s, depth, half = np.cos(np.radians(sza)), np.array([thickness]), STREAMS // 2
        options = {"NT_cor": True, "BDRF_Fourier_modes": [ground] if ground else []}
        mu, _, down, _, radiance = pydisort(
            depth, np.array([min(albedo, 1 - 1e-9)]), STREAMS, moments[None] / moments[0], mu_s, np.pi, np.pi,
            NLeg=STREAMS, NFourier=STREAMS, f_arr=moments[STREAMS : STREAMS + 1], **options,
        )  # fmt: skip
        transmittance = np.squeeze(sum(down(depth)) / (np.pi * mu_s))
        for cosine, each in zip(mu[:half], radiance(0.0, np.radians(raa))[:half] / mu_s, strict=True):
            yield thickness, wavelength, sza, raa, ground, cosine, each, transmittance


def mixed_rows(molecules=0.2, aerosol=0.4, albedo=0.9, sza=50.0, depolarization=0.0279):
    """Reflectance and transmittance of a mixture whose aerosol lies below the molecules."""
    edges, mu_s = np.linspace(0, 1, 61), np.cos(np.radians(sza))
    raa = np.array([0.0, 60.0, 120.0, 180.0])
    air, particles = molecules * np.diff(edges), aerosol * np.diff(edges**4)
    scattered, depths = air + albedo * particles, np.cumsum(air + particles)
    rayleigh = np.zeros(64)
    rayleigh[[0, 2]] = 1, (1 - depolarization) / (2 + depolarization) / 5
    for asymmetry in (0.3, 0.6):
        mixed = air[:, None] * rayleigh + albedo * particles[:, None] * asymmetry ** np.arange(64)
        mixed /= scattered[:, None]
        ratio = scattered / (air + particles)
        mu, _, down, _, radiance = pydisort(depths, ratio, 32, mixed, mu_s, np.pi, 0.0, NLeg=32, NFourier=32)
        transmittance = sum(down(depths[-1])) / (np.pi * mu_s)
        found = radiance(0.0, np.radians(180 - raa))[:16] / mu_s
        for (row, column), each in np.ndenumerate(found):
            yield asymmetry, raa[column], mu[row], each, transmittance


def drop_rows():
    """Phase function and co-albedo of drops."""
    for wavelength, radii in DROPS.items():
        albedo, phase = mie_drops(water_index(wavelength), wavelength, np.cos(np.radians(ANGLE)), radii)
        for angle, each in zip(ANGLE, phase, strict=True):
            yield wavelength, angle, each, 1 - albedo


def eddington_rows():
    """Reflectance, and plane albedo and transmittance of the scaled layer."""
    for tau, albedo, asymmetry, phase, mu_s, mu_v in EDDINGTON:
        peak = asymmetry**2
        scaled = (1 - albedo * peak) * tau, (1 - peak) * albedo / (1 - albedo * peak), asymmetry / (1 + asymmetry)
        case = tau, albedo, asymmetry, phase, mu_s, mu_v
        yield *case, sobolev_reflectance(*case), *eddington_flux(*scaled, mu_s)


if __name__ == "__main__":
    cloud = ["thickness", "wavelength", "sza", "raa", "ground", "mu_v", "reflectance", "transmittance"]
    write("clouds/cloud_drops.csv", drop_rows(), ["wavelength", "angle", "phase", "co_albedo"])
    write("clouds/cloud_layers.csv", cloud_rows(), cloud)
    write("mixed_layers.csv", mixed_rows(), ["asymmetry", "raa", "mu_v", "reflectance", "transmittance"])
    layer = ["tau", "albedo", "asymmetry", "phase", "mu_s", "mu_v"]
    write("eddington.csv", eddington_rows(), [*layer, "reflectance", "plane_albedo", "transmittance"])
