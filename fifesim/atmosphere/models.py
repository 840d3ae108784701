"""State of the atmosphere: profile, aerosol and their amounts, with a text summary."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal, Self, get_args, get_type_hints

import numpy as np

from fifesim.atmosphere import aerosols, gases, mixtures, two_stream
from fifesim.atmosphere.aerosols import Aerosol, known_aerosol
from fifesim.atmosphere.gases import BOLTZMANN, MOLAR_MASS_OZONE, MOLAR_VOLUME, Levels, Profile, column, profile_above
from fifesim.base.arguments import PLAIN, AerosolMixture, Numbers, Range, check_fields, kind_of
from fifesim.base.messages import html_table, value_in_words

# Band limits of the Thematic Mapper, as its designers state them. [um]
_BANDS = ((0.45, 0.52), (0.52, 0.60), (0.63, 0.69), (0.76, 0.90), (1.55, 1.75), (2.08, 2.35))


def atmosphere_in_words(atmosphere):
    """Text on columns, optical depths and transmittances [Tanre1990]_ in the bands of the Thematic Mapper."""
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
        _, through_aerosol = two_stream.delta_eddington(aerosol, albedo, asymmetry, 1.0)
    total = two_stream.conservative_transmittance(molecules, 1.0) * through_aerosol
    rows = {"optical depth, molecules": molecules, "optical depth, aerosol": aerosol}
    rows |= {"transmittance, direct": np.exp(-molecules - aerosol), "transmittance, with skylight": total}
    rows |= {
        f"transmittance, {name}": gases.gas_transmittance(wavelength, atmosphere, 1.0, gases=names)
        for name, names in (("water vapour", ("h2o",)), ("ozone", ("o3",)), ("all gases", gases.GASES))
    }
    return {name: float(np.mean(values)) for name, values in rows.items()}


_NUMBER = r"([-+.\deE]+)"
_TEXT = re.compile(
    rf"profile=(\S+) aerosol=(\S+) (?:visibility={_NUMBER} km|aot={_NUMBER}) altitude={_NUMBER} km"
    rf"(?: h2o={_NUMBER} g cm-2)?(?: o3={_NUMBER} cm-atm)?(?: engine=(\S+))?"
)


@dataclass(frozen=True)
class Atmosphere:
    """
    A plane-parallel atmosphere and its radiative transfer engine.

    Parameters
    ----------
    profile : str, optional
        Pressure, temperature, water vapour and ozone by altitude: "tropical", "midlatitude-summer",
        "midlatitude-winter", "subarctic-summer", "subarctic-winter" or "us-1962".
    aerosol : str, mapping or Aerosol, optional
        Optical properties of the aerosol: "continental", "maritime", "urban", "none", or a mixture by volume of dust,
        water_soluble, oceanic and soot, such as ``{"dust": 0.5, "water_soluble": 0.5}``; or a user-defined aerosol from
        `fifesim.atmosphere.read_aerosol`, which needs ``aot``.
    visibility : float, optional
        Meteorological range at the ground, 5 to 100; by default 45, unless ``aot`` is given. [km]
    altitude : float, optional
        Ground elevation above sea level, 0 to 4. [km]
    aot : float, optional
        Aerosol optical thickness at 0.55 um, 0 to 2, instead of ``visibility``. [1]
    h2o : float, optional
        Column of water vapour, 0 to 10; by default from the profile. [g cm-2]
    o3 : float, optional
        Column of ozone, 0 to 1; by default from the profile. [cm-atm]
    engine : {"5S", "successive-orders"}, optional
        "5S" (closed-form equations) or "successive-orders" (multiple scattering with polarization).

    Raises
    ------
    ValueError
        If a name is unknown, or a number is out of range.

    Notes
    -----
    A higher ground removes the lower part of the profile; the aerosol column starts at the ground and keeps its amount.
    A user-defined aerosol needs ``aot``, because visibility refers to the standard haze at the ground. Given
    columns scale the profile at all levels. The attribute `aot` is always set; `visibility` is None if `aot` was given.

    References
    ----------
    [McClatchey1972]_, profiles; [Tanre1990]_

    Examples
    --------
    The text stored with the data describes the atmosphere completely:

    >>> from fifesim import Atmosphere
    >>> Atmosphere.parse(Atmosphere(visibility=23).text) == Atmosphere(visibility=23)
    True
    """

    profile: Annotated[Profile, "profile of pressure, temperature, water vapour and ozone"] = "midlatitude-summer"
    aerosol: Annotated[AerosolMixture | Aerosol, PLAIN, "optical properties of the aerosol"] = "continental"
    visibility: Annotated[
        float | None,
        Range("km", 5, 100, others={"m": 1e-3}, note="an optical thickness is aot="),
        "meteorological range; give either this or aot",
    ] = None
    altitude: Annotated[
        float,
        Range("km", 0, 4, others={"m": 1e-3, "feet": 3.048e-4}),
        "ground elevation above sea level; default only on the FIFE site",
    ] = 0.4
    aot: Annotated[
        float | None,
        Range("1", 0, 2, others={"percent": 0.01}, note="a visibility in km is visibility="),
        "aerosol optical thickness at 0.55 um, instead of visibility",
    ] = None
    # From Antarctica to the wettest tropics, and from an ozone hole to the thickest layer.
    h2o: Annotated[
        float | None,
        Range("g cm-2", 0, 10, (0.03, 7.5), {"mm or kg m-2": 0.1, "m": 100.0}),
        "column water vapour; by default from the profile",
    ] = None
    o3: Annotated[
        float | None,
        Range("cm-atm", 0, 1, (0.08, 0.6), {"Dobson units": 1e-3}),
        "column ozone; by default from the profile",
    ] = None
    engine: Annotated[Literal["5S", "successive-orders"], "radiative transfer model: 5S, successive-orders"] = "5S"

    def __post_init__(self):
        check_fields(self)
        if isinstance(self.aerosol, Aerosol):
            self._check_own_aerosol()
        elif self.aerosol != "none":
            self._set(aerosol=mixtures.canonical(self.aerosol))
        numbers = {name: getattr(self, name) for name in ("altitude", "h2o", "o3", "visibility", "aot")}
        self._set(**{name: float(value) for name, value in numbers.items() if value is not None})
        self._set_amount()

    def _check_own_aerosol(self):
        name = self.aerosol.name
        if self.visibility is not None or self.aot is None:
            given = "nothing" if self.visibility is None else f"visibility={self.visibility:g}"
            raise ValueError(
                f"the amount of the user-defined aerosol {name} must be given as aot, from 0 to 2, got {given}: "
                "give for example aot=0.2, because visibility refers to the standard haze"
            )

    def _set_amount(self):
        visibility, aot = self.visibility, self.aot
        if visibility is not None or aot is None:
            visibility = 45.0 if visibility is None else visibility
            follows = 0.0 if self.aerosol == "none" else aerosols.aerosol_optical_thickness(visibility)
            if aot not in (None, follows):
                raise ValueError(
                    f"give visibility or aot, not both: {visibility:g} km is an aot of {follows:.4g}, got {aot:g}; "
                    "type None for the other"
                )
            aot = follows
        if self.aerosol == "none" and aot:
            raise ValueError(f"aot must be 0 without aerosol, got {aot:g}: name an aerosol, or leave aot out")
        self._set(visibility=visibility, aot=aot)

    def _set(self, **values):
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __str__(self):
        return atmosphere_in_words(self)

    def _repr_html_(self):
        rows = []
        for name, hint in get_type_hints(type(self), include_extras=True).items():
            value, known = getattr(self, name), kind_of(hint).known
            unit = f" {known.unit}" if known and known.unit != "1" and value is not None else ""
            rows.append((name, f"{value_in_words(value)}{unit}", get_args(hint)[-1]))
        return html_table("Atmosphere", rows)

    @cached_property
    def text(self) -> str:
        """Complete description in one line, for `parse`."""
        by_aot = self.visibility is None
        amount = f"aot={_shortest(self.aot)}" if by_aot else f"visibility={_shortest(self.visibility)} km"
        text = f"profile={self.profile} aerosol={self.aerosol} {amount} altitude={_shortest(self.altitude)} km"
        text += "" if self.h2o is None else f" h2o={_shortest(self.h2o)} g cm-2"
        text += "" if self.o3 is None else f" o3={_shortest(self.o3)} cm-atm"
        return text if self.engine == "5S" else f"{text} engine={self.engine}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """
        Atmosphere described by a text.

        Parameters
        ----------
        text : str
            Text in the format of `text`.

        Returns
        -------
        atmosphere : Atmosphere

        Raises
        ------
        ValueError
            If the text has another format, describes an invalid atmosphere, or names a user-defined aerosol that was
            not read in this session.
        """
        match = _TEXT.fullmatch(text.strip())
        if match is None:
            raise ValueError(f"atmosphere must read like {cls().text!r}, got {text!r}")
        profile, aerosol, *numbers, engine = match.groups()
        aerosol = known_aerosol(aerosol) if "#" in aerosol else aerosol
        visibility, aot, altitude, h2o, o3 = (None if number is None else float(number) for number in numbers)
        return cls(profile, aerosol, visibility, altitude, aot, h2o, o3, engine or "5S")

    @property
    def levels(self) -> Levels:
        """Profile above the ground with the user's columns, as `gases.Levels`."""
        levels = profile_above(self.profile, self.altitude)
        own = {name: getattr(levels, name) * column / measure(levels) for name, column, measure in self._own_columns()}
        return levels._replace(**own)

    def above(self, altitude: float) -> Self:
        """
        The same atmosphere above ground at another altitude.

        Parameters
        ----------
        altitude : float
            [km]

        Returns
        -------
        atmosphere : Atmosphere
            User-defined columns refer to the original altitude, and scale the profile at the new one.
        """
        here, there = (profile_above(self.profile, z) for z in (self.altitude, altitude))
        own = {name: measure(there) / measure(here) * column for name, column, measure in self._own_columns()}
        return replace(self, altitude=altitude, **own)

    def _own_columns(self):
        """User-supplied columns: name, amount, and the function that measures it in a profile."""
        columns = ("h2o", self.h2o, water_vapour_column), ("o3", self.o3, ozone_column)
        return [each for each in columns if each[1] is not None]

    @property
    def pressure(self) -> float:
        """Pressure at the ground [hPa]."""
        return float(self.levels.pressure[0])

    @property
    def water_vapour(self) -> float:
        """Column of water vapour above the ground [g cm-2]."""
        return water_vapour_column(self.levels)

    @property
    def ozone(self) -> float:
        """Column of ozone above the ground [cm-atm]."""
        return ozone_column(self.levels)

    def rayleigh_optical_depth(self, wavelength: Numbers) -> np.ndarray:
        """
        Optical depth of the molecules.

        Parameters
        ----------
        wavelength : array
            [um]

        Returns
        -------
        tau : array
            [1]
        """
        number = self.levels.pressure * 100 / (BOLTZMANN * self.levels.temperature)
        return gases.rayleigh_cross_section(wavelength) * np.trapezoid(number, self.levels.altitude * 1000)

    def aerosol_optical_depth(self, wavelength: Numbers) -> np.ndarray:
        """
        Extinction optical depth of the aerosol.

        Parameters
        ----------
        wavelength : array
            0.35 to 3.75. [um]

        Returns
        -------
        tau : array
            [1]
        """
        if self.aot == 0:
            return np.zeros(np.shape(wavelength))
        extinction, _, _ = aerosols.aerosol_optics(self.aerosol, wavelength)
        return self.aot * extinction


def water_vapour_column(levels):
    """Column of water vapour. [g cm-2]"""
    return float(column(levels, levels.h2o).sum() / 10)


def ozone_column(levels):
    """Column of ozone. [cm-atm]"""
    return float(100 * column(levels, levels.o3).sum() / MOLAR_MASS_OZONE * MOLAR_VOLUME)


def _shortest(value):
    return np.format_float_positional(value, trim="-")
