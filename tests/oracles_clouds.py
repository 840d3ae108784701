"""Mie scattering by cloud drops and discrete ordinates of their layer, independent of fifesim."""

from functools import cache

import numpy as np
import pytest

from fifesim.base import files

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(1200)


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
    return albedo, WEIGHTS * phase @ np.polynomial.legendre.legvander(POINTS, 900) / 2


def water_index(wavelength):
    """Complex refractive index of water [1], by Hale & Querry (1973) and the absorption of PROSPECT-D."""
    real, water = files.table("water_index.csv"), files.table("prospect_d.csv")
    absorption = np.interp(wavelength, water["wavelength"], water["water"])
    imaginary = absorption * wavelength * 1e-4 / (4 * np.pi)
    return complex(np.interp(wavelength, real["wavelength"], real["refractive_index"]), imaginary)


def disort(thickness, wavelength, sza, raa, ground=0.0, streams=64):
    """Cosines and reflectance of discrete ordinates upward, with exact single scattering, and transmittance."""
    pydisort = pytest.importorskip("PythonicDISORT.pydisort").pydisort
    albedo, moments = mie_moments(wavelength)
    mu_s, depth, half = np.cos(np.radians(sza)), np.array([thickness]), streams // 2
    options = {"NT_cor": True, "BDRF_Fourier_modes": [ground] if ground else []}
    mu, _, down, _, radiance = pydisort(
        depth, np.array([min(albedo, 1 - 1e-9)]), streams, moments[None] / moments[0], mu_s, np.pi, np.pi, NLeg=streams,
        NFourier=streams, f_arr=moments[streams : streams + 1], **options,
    )  # fmt: skip
    return mu[:half], radiance(0.0, np.radians(raa))[:half] / mu_s, np.squeeze(sum(down(depth)) / (np.pi * mu_s))
