"""Aerosols from Datasets and files, and the aerosols of the package as Datasets."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import xarray as xr

from fifesim.atmosphere import aerosols, mixtures
from fifesim.atmosphere.aerosols import Aerosol, phase_of_moments
from fifesim.base.arguments import AerosolMixture, FilePath
from fifesim.base.files import read_csv, reading

# Other spellings of each name, by Eradiate, libRadtran and AERONET.
_NAMES = {
    "wavelength": ("w", "wavelen", "lambda"),
    "component": ("mode",),
    "angle": ("scattering_angle", "theta"),
    "mu": ("cosine", "scattering_cosine"),
    "order": ("l", "nmom"),
    "extinction": ("sigma_t", "ext", "aod_extinction-total"),
    "single_scattering_albedo": ("albedo", "ssa"),
    "asymmetry": ("g", "gg", "asymmetry_factor-total"),
    "phase": ("phase_function", "p11", "f11"),
    "polarization": (),
    "f12": ("p12",),
    "moments": ("pmom",),
}
_CANONICAL = {name: canonical for canonical, names in _NAMES.items() for name in (canonical, *names)}
_AXES = ("component", "order", "angle", "wavelength")

_MICROMETRES = {"um": 1, "µm": 1, "μm": 1, "micrometer": 1, "micrometre": 1, "nm": 1e-3, "nanometer": 1e-3, "m": 1e6}
_PER_STERADIAN = ("sr-1", "sr^-1", "1/sr", "1 / sr", "sr**-1", "1 / steradian", "steradian^-1", "steradian ** -1")
_AERONET = re.compile(r"(.+)\[(\d+) ?nm\]")


def read_aerosol(
    source: FilePath | xr.Dataset, *, scale_height: float | None = None, layer: tuple[float, float] | None = None
) -> Aerosol:
    """
    Read a user-defined aerosol for `Atmosphere`.

    Parameters
    ----------
    source : path of a NetCDF or CSV file, or xarray.Dataset
        ``wavelength`` [um], ``extinction`` [any one unit] and ``single_scattering_albedo`` [1] by wavelength; ``phase``
        [1, or sr-1 if stated in its units] by ``angle`` [degree] or its cosine ``mu``, and by wavelength, or
        ``moments`` by ``order``; optionally ``asymmetry`` [1] by wavelength, and ``polarization`` [1] or ``f12`` with
        the dimensions of ``phase``. All may have a dimension ``component``, whose extinctions are added. A CSV file has
        one row for each wavelength and angle, or one row with AERONET's columns, such as
        ``Single_Scattering_Albedo[440nm]``.
    scale_height : float, optional
        Scale height of the aerosol above the ground; by default from the attribute ``scale_height``, else 2. [km]
    layer : pair of float, optional
        Bottom and top of a uniform layer above the ground, instead of `scale_height`; by default from the attributes
        ``bottom`` and ``top``. [km]

    Returns
    -------
    aerosol : Aerosol

    Raises
    ------
    ValueError
        If the file cannot be read, a variable is missing, or a value is out of range.

    Notes
    -----
    Names from other codes are also accepted, in upper or lower case: ``w``, ``sigma_t``, ``albedo``, ``mu`` and the
    matrix ``phase`` by ``i`` and ``j`` of Eradiate; ``ext``, ``ssa``, ``gg``, ``theta`` and ``pmom`` of libRadtran;
    ``AOD_Extinction-Total[440nm]``, ``Asymmetry_Factor-Total[440nm]`` and ``0.000000[440nm]`` of AERONET's inversions.
    Moments are defined as in `aerosols.phase_moments`, without a factor of 2 l + 1. Wavelengths in nm need ``units``.

    See Also
    --------
    fifesim.atmosphere.aerosol_tables

    Examples
    --------
    The amount of the aerosol is given as optical thickness:

    >>> import fifesim
    >>> tables = fifesim.atmosphere.aerosol_tables("continental")
    >>> haze = fifesim.atmosphere.read_aerosol(tables)
    >>> fifesim.Atmosphere(aerosol=haze, aot=0.2).aot
    0.2
    """
    dataset, name = (source, source.attrs.get("title", "own")) if isinstance(source, xr.Dataset) else _opened(source)
    found = _named(dataset, name)
    wavelength = found["wavelength"] * _factor(found["wavelength"].attrs.get("units", "um"), name)
    angle, phase, polarization = _scattering(found, name)
    if layer is None and scale_height is None and "top" in dataset.attrs:
        layer = float(dataset.attrs.get("bottom", 0)), float(dataset.attrs["top"])
    if layer is None and scale_height is None and "scale_height" in dataset.attrs:
        scale_height = float(dataset.attrs["scale_height"])
    return Aerosol(
        wavelength=wavelength.values,
        extinction=_by(found, "extinction", ("wavelength",), name),
        single_scattering_albedo=_by(found, "single_scattering_albedo", ("wavelength",), name),
        angle=angle,
        phase=phase,
        polarization=polarization,
        asymmetry=_by(found, "asymmetry", ("wavelength",), name) if "asymmetry" in found else None,
        scale_height=scale_height,
        layer=layer,
        name=name,
    )


def aerosol_tables(aerosol: AerosolMixture) -> xr.Dataset:
    """
    Tables of a built-in aerosol, in the form of `read_aerosol`.

    Parameters
    ----------
    aerosol : str or mapping
        As in `Atmosphere`.

    Returns
    -------
    tables : xarray.Dataset, dims (component, angle, wavelength)

    Raises
    ------
    ValueError, TypeError
        If the aerosol is unknown.

    Examples
    --------
    >>> import fifesim
    >>> tables = fifesim.atmosphere.aerosol_tables("continental")
    >>> tables.sizes["component"], sorted(tables.data_vars)
    (3, ['asymmetry', 'extinction', 'phase', 'polarization', 'single_scattering_albedo'])
    """
    parts = aerosols.parts(aerosol)
    tables = [mixtures.tabulated(component) for component in parts]
    by_wavelength = [
        (share * np.exp(each.log_extinction), np.exp(each.log_scattering - each.log_extinction), each.asymmetry)
        for each, share in zip(tables, parts.values(), strict=True)
    ]
    extinction, albedo, asymmetry = np.moveaxis(np.array(by_wavelength), 1, 0)
    short, long = ("component", "wavelength"), ("component", "angle", "wavelength")
    values = {
        "extinction": (short, extinction, {"long_name": "extinction for a volume of particles", "units": "um-1"}),
        "single_scattering_albedo": (short, albedo, {"units": "1"}),
        "asymmetry": (short, asymmetry, {"long_name": "mean cosine of the scattering angle", "units": "1"}),
        "phase": (long, np.exp([each.log_phase for each in tables]), {"long_name": "phase function", "units": "1"}),
        "polarization": (long, np.array([each.polarization for each in tables]), {"units": "1"}),
    }
    coords = {
        "component": [str(component) for component in parts],
        "angle": ("angle", tables[0].angle, {"long_name": "scattering angle", "units": "degree"}),
        "wavelength": ("wavelength", np.exp(tables[0].log_wavelength).round(12), {"units": "um"}),
    }
    found = xr.Dataset(values, coords, {"title": str(aerosol)})
    for each in ("wavelength", "angle", *values):
        # A file keeps checksums, with which netCDF's library finds damaged numbers.
        found[each].encoding["fletcher32"] = True
    return found


def _opened(path):
    """Dataset of a file, and the name of the file."""
    path = Path(path)
    readers = {".nc": _read_netcdf, ".csv": _read_csv}
    if path.suffix.lower() not in readers:
        raise ValueError(f"aerosol must be a Dataset or a file .nc or .csv, got {str(path)!r}: give one of these")
    return readers[path.suffix.lower()](path), path.stem


# Size of the largest tables in memory. [byte]
_LARGEST = 10**8


def _read_netcdf(path):
    with reading("the aerosol", path), xr.open_dataset(path) as file:
        if file.nbytes > _LARGEST:
            raise ValueError(f"it declares {file.nbytes} bytes of numbers, at most {_LARGEST} are read")
        return file.load()


def _read_csv(path):
    table = read_csv(path, "the aerosol")
    if any(_AERONET.fullmatch(column) for column in table):
        return _of_aeronet(table, path.stem)
    table = table.rename(columns=lambda column: _CANONICAL.get(column.strip().lower(), column.strip()))
    index = [axis for axis in ("component", "wavelength", "angle", "mu", "order") if axis in table]
    if "wavelength" not in index or table.duplicated(index).any():
        raise ValueError(
            f"aerosol {path.stem}: a CSV file must have a column wavelength, and one row for each wavelength and "
            f"angle, got columns {', '.join(table)}: add it, or drop rows that are there twice"
        )
    dataset = table.set_index(index).to_xarray()
    for name in {"extinction", "single_scattering_albedo", "asymmetry"} & set(dataset):
        others = [axis for axis in dataset[name].dims if axis not in ("component", "wavelength")]
        if (dataset[name].max(others) > dataset[name].min(others)).any():
            raise ValueError(f"aerosol {path.stem}: {name} must be one at each wavelength, got several: check the rows")
        dataset[name] = dataset[name].max(others)
    vertical = {key: float(dataset[key].max()) for key in ("scale_height", "bottom", "top") if key in dataset}
    return dataset.assign_attrs(vertical)


def _of_aeronet(table, name):
    """Dataset from one row of AERONET columns."""
    if len(table) != 1:
        raise ValueError(
            f"aerosol {name}: AERONET's columns must have one row, got {len(table)}: keep one, or their mean"
        )
    cells = [(match, float(table[match[0]].iloc[0])) for match in map(_AERONET.fullmatch, table) if match]
    wavelengths = sorted({int(match[2]) for match, _ in cells})
    values, phase = {}, {}
    for match, value in cells:
        if re.fullmatch(r"[\d.]+", match[1]):
            phase[float(match[1]), int(match[2])] = value
        elif match[1].lower() in _CANONICAL:
            values.setdefault(_CANONICAL[match[1].lower()], {})[int(match[2])] = value
    dataset = xr.Dataset(coords={"wavelength": [each / 1000 for each in wavelengths]})
    for quantity, by_wavelength in values.items():
        dataset[quantity] = "wavelength", [by_wavelength.get(each, np.nan) for each in wavelengths]
    angles = sorted({angle for angle, _ in phase})
    if angles:
        rows = [[phase.get((angle, each), np.nan) for each in wavelengths] for angle in angles]
        dataset = dataset.assign_coords(angle=angles).assign(phase=(("angle", "wavelength"), rows))
    return dataset


def _named(dataset, name):
    """Dataset with the canonical names of variables."""
    known = {each: _CANONICAL.get(str(each).lower(), each) for each in {*dataset.variables, *dataset.dims}}
    dataset = dataset.rename({old: new for old, new in known.items() if new != old and new not in dataset.variables})
    missing = [each for each in ("wavelength", "extinction", "single_scattering_albedo") if each not in dataset]
    if missing or ("phase" in dataset) == ("moments" in dataset):
        wanted = "wavelength, extinction, single_scattering_albedo, and one of phase and moments"
        raise ValueError(
            f"aerosol {name}: there must be {wanted}, got {', '.join(map(str, dataset.variables))}: "
            "rename what is there, or add what is missing"
        )
    return dataset


def _factor(units, name):
    """Factor from a unit of wavelength to micrometres."""
    found = units if units in _MICROMETRES else str(units).rstrip("s")
    if found not in _MICROMETRES:
        raise ValueError(f"aerosol {name}: units of wavelength must be um, nm or m, got {units!r}: convert it")
    return _MICROMETRES[found]


def _scattering(found, name):
    """Angles, phase function and polarization, with axes (component, angle, wavelength)."""
    if "moments" in found:
        moments = np.moveaxis(_by(found, "moments", ("order", "wavelength"), name), -2, -1)
        if np.any(np.abs(moments[..., 0] - 1) > 1e-3):
            first = moments[..., 0].flat[np.argmax(np.abs(moments[..., 0] - 1))]
            raise ValueError(
                f"aerosol {name}: the first of the moments must be 1, got {first:g}: divide them by it, and leave "
                "out a factor of 2 l + 1"
            )
        angle, phase = phase_of_moments(moments)
        return angle, np.moveaxis(phase, -1, -2), None
    matrix = {axis: found.sizes[axis] for axis in ("i", "j") if axis in found["phase"].dims}
    if matrix:
        if min(matrix.values()) > 1:
            found = found.assign(f12=found["phase"].isel(i=0, j=1))
        found = found.assign(phase=found["phase"].isel(dict.fromkeys(matrix, 0)))
    if "mu" in found:
        found = found.assign_coords(angle=np.degrees(np.arccos(found["mu"].clip(-1, 1)))).swap_dims(mu="angle")
        found = found.sortby("angle")
    if "angle" not in found:
        raise ValueError(f"aerosol {name}: phase must have angles, got dims {found['phase'].dims}: add angle or mu")
    phase = _by(found, "phase", ("angle", "wavelength"), name)
    polarization = None
    if "f12" in found:
        polarization = -_by(found, "f12", ("angle", "wavelength"), name) / phase
    elif "polarization" in found:
        polarization = _by(found, "polarization", ("angle", "wavelength"), name)
    per_steradian = str(found["phase"].attrs.get("units", "1")).strip() in _PER_STERADIAN
    return found["angle"].values, phase * (4 * np.pi if per_steradian else 1), polarization


def _by(found, quantity, axes, name):
    """Values with the given axes after any component axis, constant in a missing wavelength."""
    values = found[quantity]
    wrong = [axis for axis in values.dims if axis not in ("component", *axes)]
    if wrong or not set(axes) - {"wavelength"} <= set(values.dims):
        raise ValueError(
            f"aerosol {name}: {quantity} must have the dims {', '.join(axes)}, and perhaps component, got "
            f"{', '.join(map(str, values.dims)) or 'none'}: rename or drop the others"
        )
    whole = [axis for axis in _AXES if axis in axes or (axis == "component" and axis in found.dims)]
    missing = {axis: found.sizes[axis] for axis in whole if axis not in values.dims}
    return values.expand_dims(missing).transpose(*whole).values
