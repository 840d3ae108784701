"""What an atmosphere is, in a few lines to read."""

import numpy as np

from fifesim.atmosphere.air import aerosols, gases
from fifesim.atmosphere.schemes import scattering

# Band limits of the Thematic Mapper, as its designers state them. [um]
_BANDS = ((0.45, 0.52), (0.52, 0.60), (0.63, 0.69), (0.76, 0.90), (1.55, 1.75), (2.08, 2.35))


def atmosphere_in_words(atmosphere):
    """
    Columns, optical depths and band transmittances of an atmosphere.

    Parameters
    ----------
    atmosphere : models.Atmosphere

    Returns
    -------
    text : str
        Means over the nominal bands of the Thematic Mapper that the aerosol's tables hold, along the vertical.

    References
    ----------
    [Tanre1990]_
    """
    amount = "" if atmosphere.visibility is None else f", visibility {atmosphere.visibility:g} km"
    bands = [band for band in _BANDS if atmosphere.aot == 0 or aerosols.covers(atmosphere.aerosol, *band)]
    lines = [
        f"{atmosphere.profile}, {atmosphere.aerosol} aerosol{amount}, ground at {atmosphere.altitude:g} km, "
        f"engine {atmosphere.engine}",
        f"pressure {atmosphere.pressure:.1f} hPa, water vapour {atmosphere.water_vapour:.3f} g cm-2, "
        f"ozone {atmosphere.ozone:.4f} cm-atm, aerosol {atmosphere.aot:.4f} at 0.55 um",
        "",
        "band                         um" + "".join(f"  {low:.2f}-{high:.2f}" for low, high in bands),
    ]
    columns = [_of_band(atmosphere, low, high) for low, high in bands]
    rows = [f"{name:<31}" + "".join(f"{column[name]:>11.4f}" for column in columns) for name in (columns or [{}])[0]]
    return "\n".join(lines + rows)


def _of_band(atmosphere, low, high):
    wavelength = gases.table_wavelengths()
    wavelength = wavelength[(wavelength >= low) & (wavelength <= high)]
    molecules, aerosol = atmosphere.rayleigh_optical_depth(wavelength), atmosphere.aerosol_optical_depth(wavelength)
    through_aerosol = np.ones_like(aerosol)
    if atmosphere.aot > 0:
        _, albedo, asymmetry = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
        _, through_aerosol = scattering.delta_eddington(aerosol, albedo, asymmetry, 1.0)
    total = scattering.conservative_transmittance(molecules, 1.0) * through_aerosol
    rows = {"optical depth, molecules": molecules, "optical depth, aerosol": aerosol}
    rows |= {"transmittance, direct": np.exp(-molecules - aerosol), "transmittance, with skylight": total}
    rows |= {
        f"transmittance, {name}": gases.gas_transmittance(wavelength, atmosphere, 1.0, gases=names)
        for name, names in (("water vapour", ("h2o",)), ("ozone", ("o3",)), ("all gases", gases.GASES))
    }
    return {name: float(np.mean(values)) for name, values in rows.items()}
