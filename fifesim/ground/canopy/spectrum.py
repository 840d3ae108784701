"""Spectra of a background or of a leaf, and the CSV files that hold them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from fifesim.base.foreign import read_csv


@dataclass(frozen=True)
class Spectrum:
    """
    A reflectance spectrum.

    Parameters
    ----------
    wavelength : sequence of float, shape (n,)
        Increasing. [um]
    reflectance : sequence of float, shape (n,)
        [1]

    Raises
    ------
    ValueError
        If the wavelengths do not increase or are not in micrometres, or a reflectance is outside 0 to 1.
    """

    wavelength: tuple = field(repr=False)
    reflectance: tuple = field(repr=False)

    def __post_init__(self):
        wavelength, shapes = np.asarray(self.wavelength, float), {np.shape(each) for each in self.values()}
        if wavelength.ndim != 1 or wavelength.size < 2 or shapes != {wavelength.shape}:
            raise ValueError("a spectrum needs two wavelengths or more, and one value for each")
        if not np.all(np.diff(wavelength) > 0):
            raise ValueError("the wavelengths of a spectrum must increase, and none be missing: sort them")
        if wavelength[-1] > 100:
            raise ValueError(f"wavelengths are in um, got {wavelength[-1]:g}: divide nanometres by 1000")
        if wavelength[-1] < 0.1:
            raise ValueError(f"wavelengths are in um, the largest is {wavelength[-1]:g}: convert them to micrometres")
        object.__setattr__(self, "wavelength", tuple(wavelength.tolist()))
        for name, values in zip(self.names(), self.values(), strict=True):
            values = np.asarray(values, float)
            wrong = ~((values >= 0) & (values <= 1))
            if wrong.any():
                raise ValueError(
                    f"the {name} of a spectrum must be in [0, 1], got {values[wrong][0]:g} at "
                    f"{wavelength[wrong][0]:g} um: give a fraction, not percent"
                )
            object.__setattr__(self, name, tuple(values.tolist()))

    @classmethod
    def names(cls):
        """Names of the quantities along the wavelengths."""
        return tuple(each.name for each in fields(cls) if each.name != "wavelength")

    def values(self):
        """Values of these quantities, each of shape (n,). [1]"""
        return tuple(getattr(self, name) for name in self.names())


@dataclass(frozen=True)
class LeafSpectrum(Spectrum):
    """
    Reflectance and transmittance spectra of a leaf.

    Parameters
    ----------
    wavelength, reflectance
        As in `Spectrum`.
    transmittance : sequence of float, shape (n,)
        [1]

    Raises
    ------
    ValueError
        As in `Spectrum`, or if reflectance and transmittance add up to more than 1.
    """

    transmittance: tuple = field(repr=False)

    def __post_init__(self):
        super().__post_init__()
        total = np.add(self.reflectance, self.transmittance)
        if np.max(total) > 1 + 1e-12:
            raise ValueError(
                f"leaf reflectance and transmittance add up to {np.max(total):g} at "
                f"{self.wavelength[np.argmax(total)]:g} um: the sum must not exceed 1, the rest is absorbed"
            )


def read_spectrum(path, kind=Spectrum):
    """
    Spectrum of a CSV file.

    Parameters
    ----------
    path : str or path
        Its columns ``wavelength`` [um], ``reflectance`` and, for a leaf, ``transmittance`` [1] may be in capitals.
    kind : type, optional
        `Spectrum` or `LeafSpectrum`.

    Returns
    -------
    spectrum : Spectrum

    Raises
    ------
    ValueError
        If the file cannot be read, or holds no such spectrum.
    """
    table = read_csv(path, "the spectrum")
    columns = [str(column).strip().lower() for column in table.columns]
    wanted = ("wavelength", *kind.names())
    missing = [name for name in wanted if columns.count(name) != 1]
    if missing:
        raise ValueError(
            f"{path} has no column {' nor '.join(missing)}, or several: its first line must name wavelength [um] and "
            f"{' and '.join(kind.names())} [1], it has {', '.join(map(str, table.columns))}"
        )
    try:
        return kind(*(table.iloc[:, columns.index(name)] for name in wanted))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
