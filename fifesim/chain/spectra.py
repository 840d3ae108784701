"""Reflectance of many uniform canopies in the bands of an instrument, and its derivatives, without a raster."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from fifesim.atmosphere.labels import diffuse_fraction
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import Names, Range, check_number
from fifesim.base.geometry import Geometry, warn_of_radians
from fifesim.base.messages import nearest
from fifesim.ground.canopy import optics
from fifesim.ground.canopy.crowns import check_crowns
from fifesim.ground.canopy.description import TALLGRASS, Canopy, is_raster
from fifesim.ground.canopy.leaf_area import check_lai
from fifesim.ground.canopy.optics import check_background
from fifesim.ground.canopy.properties import NUMERIC_PROPERTIES
from fifesim.ground.canopy.prospect import LEAF_RANGES, Leaf, leaf_band_means
from fifesim.ground.canopy.reflectance_table import Scene, model_reflectance
from fifesim.ground.canopy.soil import brightened, moistened, soil_line, water_films
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument

_LEAF = {f"leaf_{name}": name for name in LEAF_RANGES}
_ZENITH = Range("degree", 0, 90, ends="[)")
_ANGLES = {"sza": _ZENITH, "vza": _ZENITH, "raa": Range("degree", -360, 360)}
_RANGES = {**_ANGLES, "diffuse_fraction": Range("1", 0, 1)}
_NAMES = ("lai", *NUMERIC_PROPERTIES, *_ANGLES, "diffuse_fraction", "background", *_LEAF)
"""Names of the quantities that may differ from canopy to canopy."""

_BLOCK = 2**12  # canopies per batch, so that intermediate results fit into the processor cache
_STEP = 1e-30  # imaginary step for derivatives; too small to change the real part
_SPACING = 2.0**-10  # node spacing of finite differences over the soil properties


def canopy_spectra(
    canopies: Mapping | xr.Dataset,
    instrument: InstrumentLike = "TM",
    *,
    bands: Names | None = None,
    canopy: Canopy | None = None,
    geometry: Geometry | None = None,
    atmosphere: Atmosphere | None = None,
    derivatives: Sequence[str] = (),
) -> xr.Dataset:
    """
    Reflectance factor of uniform canopies in the bands of an instrument, for tables, training and retrieval.

    Parameters
    ----------
    canopies : mapping of str to float or array, shape (n,), or xarray.Dataset of one dimension
        Quantities that differ between canopies: ``lai`` [m2 m-2]; the contents of green leaves, ``leaf_structure``
        to ``leaf_dry_matter``, in the units of `Leaf`; the numbers of `Canopy`, such as ``brown`` or ``soil`` [1];
        ``background``, of shape (n,) or (n, band) [1]; ``sza``, ``vza`` and ``raa`` [degree]; ``diffuse_fraction``, of
        shape (n,) or (n, band) [1]. NaN gives NaN.
    instrument : str or Instrument, optional
        Instrument whose bands are simulated.
    bands : sequence of str, optional
        Names of its bands; all by default.
    canopy : Canopy, optional
        Properties that are equal in all canopies, without rasters; by default green tallgrass of the FIFE site.
    geometry : Geometry, optional
        Directions of sun and sensor, unless ``canopies`` has ``sza``; without ``vza`` the view is nadir.
    atmosphere : Atmosphere, optional
        Determines the diffuse fraction if all canopies have the same sun. By default there is only direct light, or the
        ``diffuse_fraction`` of ``canopies``.
    derivatives : sequence of str, optional
        Names of quantities with respect to which the reflectance is differentiated, including those equal in all
        canopies.

    Returns
    -------
    spectra : xarray.Dataset, dims (canopy, band), or those of ``canopies``
        ``reflectance`` [1] and, if requested, ``derivative``, dims (quantity, canopy, band): change of the reflectance
        per unit of each quantity. ``background`` and ``diffuse_fraction`` are varied in the same band.

    Raises
    ------
    ValueError
        If a name is unknown, a value is out of its range, or the position of the sun is unknown.

    Notes
    -----
    SAIL and PROSPECT-D are evaluated for every canopy. Derivatives use the complex-step method and are exact to
    rounding. The reflectance has weak kinks as a function of zenith angle, at which the derivative is one-sided.

    References
    ----------
    [Verhoef2007]_; [VerhoefBach2007]_; [Feret2017]_

    See Also
    --------
    fifesim.surface_reflectance

    Examples
    --------
    >>> import fifesim
    >>> found = fifesim.ground.canopy_spectra(
    ...     {"lai": [0.5, 2.0]}, "TM", bands=["TM3", "TM4"], geometry=fifesim.fife_geometry(), derivatives=["lai"]
    ... )
    >>> found.reflectance.round(3).values.tolist()
    [[0.1, 0.216], [0.039, 0.284]]
    >>> found.derivative.sel(quantity="lai").round(3).values.tolist()
    [[-0.078, 0.051], [-0.017, 0.038]]
    """
    description = find_instrument(instrument)
    selected = description.select(bands)
    responses = tuple(band.response for band in selected)
    dim, values, coords = _values(canopies, len(responses))
    for name in (*values, *derivatives):
        if name not in _NAMES:
            raise ValueError(
                f"{name!r} is no quantity of canopies and their derivatives: {nearest(name, _NAMES)}There are "
                f"{', '.join(_NAMES)}"
            )
    model = _Model(responses, canopy or TALLGRASS, bool(_LEAF.keys() & {*values, *derivatives}))
    values = model.defaults(geometry, atmosphere, values) | values
    count = max(np.shape(each)[0] for each in values.values())
    values = {name: np.broadcast_to(each, (count, *np.shape(each)[1:])) for name, each in values.items()}
    _check(values)
    out = np.empty((1 + len(derivatives), count, len(responses)))
    for start in range(0, count, _BLOCK):
        part = {name: each[start : start + _BLOCK] for name, each in values.items()}
        # numpy warns of complex NaN as an invalid value, unlike real NaN.
        with np.errstate(invalid="ignore"):
            out[0, start : start + _BLOCK] = model.reflectance(part).T
            for number, name in enumerate(derivatives, start=1):
                out[number, start : start + _BLOCK] = model.derivative(part, name).T
    out[:, np.any([np.isnan(each).reshape(count, -1).any(axis=1) for each in values.values()], axis=0)] = np.nan
    coords = coords | {"band": [band.name for band in selected]}
    found = xr.Dataset(coords=coords, attrs={"instrument": description.name})
    about = {"units": "1", "long_name": "reflectance factor of the canopy"}
    found["reflectance"] = (dim, "band"), out[0], about
    if derivatives:
        about = {"long_name": "derivative of the reflectance factor by each quantity"}
        found["derivative"] = ("quantity", dim, "band"), out[1:], about
        found = found.assign_coords(quantity=list(derivatives))
    return found


class _Model:
    """Reflectance of canopies with common properties in some bands."""

    def __init__(self, bands, canopy, by_contents):
        if any(map(is_raster, vars(canopy).values())):
            raise ValueError("canopy must not have rasters: give what varies in canopies=, such as {'brown': [0, 0.3]}")
        self.bands, self.canopy = bands, canopy
        if canopy.model != "sail":
            raise ValueError(f"canopy_spectra computes SAIL, got model={canopy.model!r}: leave the model out")
        self.leaf_angles = canopy.leaf_angle_distribution
        self.leaf = canopy.leaf_optics or Leaf()
        if by_contents and not isinstance(self.leaf, Leaf):
            raise ValueError("leaf contents need leaf_optics of the canopy to be a fifesim.Leaf, or not given")
        self.green = None if by_contents else optics.band_leaf_optics(bands, canopy.leaf_optics)
        dead = optics.DEAD_LEAF if canopy.brown_leaf is None else canopy.brown_leaf
        self.dead = optics.band_leaf_optics(bands, dead)
        self.weights = optics.leaf_weights(bands) if by_contents else None

    def defaults(self, geometry, atmosphere, given):
        """Values of all quantities, equal in all canopies, each of shape (1,) or (1, band)."""
        if geometry is None and "sza" not in given:
            raise ValueError("the position of the sun is unknown: give geometry=, or 'sza' in canopies")
        at = geometry or Geometry(0.0, 0.0)
        values = {"lai": None, "sza": at.sza, "vza": at.vza, "raa": at.raa, "diffuse_fraction": 0.0}
        values |= {name: getattr(self.canopy, name) for name in NUMERIC_PROPERTIES}
        if "lai" not in given:
            raise ValueError(f"canopies have no leaf area index: add 'lai' to {', '.join(given) or 'them'}")
        if atmosphere is not None:
            if np.size(given.get("sza", at.sza)) > 1 or "diffuse_fraction" in given:
                raise ValueError(
                    "an atmosphere gives the diffuse fraction for one sun: leave out atmosphere=, and give the "
                    "diffuse_fraction of each canopy"
                )
            sun = float(np.reshape(given.get("sza", at.sza), ()))
            one = Geometry(sun, at.saa, at.vza, at.vaa)
            values["diffuse_fraction"] = diffuse_fraction(atmosphere, self.bands, one)[None]
        values["background"] = optics.band_background(self.bands, self.canopy.background)[None]
        if self.weights is not None:
            values |= {name: getattr(self.leaf, content) for name, content in _LEAF.items()}
        return {name: np.atleast_1d(np.asarray(each, float)) for name, each in values.items() if name not in given}

    def reflectance(self, values):
        """Reflectance factor, shape (band, n), and its derivative as imaginary part where a value has one. [1]"""
        return self._over(values, self._ground(values))

    def derivative(self, values, name):
        """Derivative of the reflectance factor by one quantity, shape (band, n)."""
        if name in ("soil", "moisture"):
            ground, known = self._ground(values), NUMERIC_PROPERTIES[name]
            # Five points around each soil state, shifted into the valid range.
            middle = np.clip(values[name], known.lowest + 2 * _SPACING, known.highest - 2 * _SPACING)
            at = (values[name] - middle) / _SPACING
            slope = sum(
                weight * self._ground(values | {name: middle + node * _SPACING})
                for node, weight in zip(range(-2, 3), _weights_of_slope(at), strict=True)
            )
            return self._over(values, ground + 1j * _STEP * (slope / _SPACING)).imag / _STEP
        return self.reflectance(values | {name: values[name] + 1j * _STEP}).imag / _STEP

    def _ground(self, values):
        """Reflectance of the background of each canopy, shape (band, n)."""
        ground = values["background"]
        ground = ground[:, None] if ground.ndim == 1 else ground
        ground = np.broadcast_to(ground, (len(ground), len(self.bands)))
        if not np.iscomplexobj(ground):
            if np.any(values["soil"] != 0):
                ground = brightened(ground, values["soil"], soil_line(self.bands))
            if np.any(values["moisture"] != 0):
                ground = moistened(ground, values["moisture"], water_films(self.bands))
            return ground.T
        # Propagate the imaginary part of the dry background to the wet one.
        real, step = ground.real, _SPACING
        middle = np.clip(real, 2 * step, 1 - 2 * step)
        at = (real - middle) / step
        slope = sum(
            weight.T * self._ground(values | {"background": middle + node * step})
            for node, weight in zip(range(-2, 3), _weights_of_slope(at), strict=True)
        )
        return self._ground(values | {"background": real}) + 1j * ground.imag.T * slope / step

    def _over(self, values, ground):
        """Reflectance factor over a background, shape (band, n)."""
        if self.green is None:
            leaf = leaf_band_means([values[name] for name in _LEAF], self.weights)
        else:
            leaf = np.reshape(self.green, (2, -1, 1))
        sky = values["diffuse_fraction"]
        dead = np.reshape(self.dead, (2, -1, 1))
        scene = Scene(
            *leaf,
            sky.T if sky.ndim > 1 else sky[None],
            *(values[name] for name in _ANGLES),
            self.leaf_angles,
            values["hotspot"],
            *dead,
            **{name: values[name] for name in ("brown", "dissociation", "crown_cover", "crown_shape")},
        )
        none = [name for name in ("brown", "dissociation") if not np.any(values[name])]
        if np.all(values["crown_cover"] == 1):
            none.append("crown_cover")
        return model_reflectance(
            values["lai"], ground, scene._replace(**{name: Scene._field_defaults[name] for name in none})
        )


def _values(canopies, n_bands):
    """Name of the dimension of canopies, the given values as arrays of shape (n,) or (n, band), and coordinates."""
    dim, coords = "canopy", {}
    if isinstance(canopies, xr.Dataset):
        dims = [each for each in canopies.dims if each != "band"]
        if len(dims) != 1:
            raise ValueError(f"canopies must have one dimension, optionally with band, got {tuple(canopies.dims)}")
        dim, coords = dims[0], {name: each for name, each in canopies.coords.items() if each.dims == (dims[0],)}
        canopies = {name: each.transpose(dim, ...).values for name, each in canopies.data_vars.items()}
    values = {}
    for name, each in canopies.items():
        array = np.atleast_1d(np.asarray(each, float))
        last = (1, n_bands) if name in ("background", "diffuse_fraction") else (1,)
        if array.ndim > 2 or (array.ndim == 2 and array.shape[1] not in last):
            raise ValueError(f"{name} must be of shape (n,){' or (n, band)' * (len(last) > 1)}, got {array.shape}")
        values[name] = array
    sizes = {name: len(each) for name, each in values.items() if len(each) != 1}
    if len(set(sizes.values())) > 1:
        got = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise ValueError(f"canopies must have equal numbers of values, or a single value, got {got}")
    return dim, values, coords


def _check(values):
    """Raise ValueError if a value is out of its range; NaN passes."""
    check_lai(values["lai"])
    warn_of_radians(*(float(np.nan_to_num(np.abs(values[name])).max()) for name in ("sza", "raa")), "sza", "raa")
    for name, known in (_RANGES | NUMERIC_PROPERTIES).items():
        check_number(name, values[name], known)
    check_background(values["background"])
    check_crowns(values["lai"], values["crown_cover"])
    Leaf(**{content: values[name] for name, content in _LEAF.items() if name in values})


def _weights_of_slope(at):
    """Weights of values at -2 to 2 in the slope of their interpolating polynomial at a position."""
    return (
        (2 * at**3 - 3 * at**2 - at + 1) / 12,
        -(4 * at**3 - 3 * at**2 - 8 * at + 4) / 6,
        (2 * at**3 - 5 * at) / 2,
        -(4 * at**3 + 3 * at**2 - 8 * at - 4) / 6,
        (2 * at**3 + 3 * at**2 - at - 1) / 12,
    )
