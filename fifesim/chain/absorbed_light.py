"""Photosynthetically active radiation that leaves and ground absorb: by Beer's law, or from SAIL's energy balance."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from fifesim.atmosphere.engines import LARGEST_ZENITH, check_zenith, flux_at_ground
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import FparLimit, Time
from fifesim.base.bands import Band
from fifesim.base.caches import cached
from fifesim.base.geometry import Geometry
from fifesim.chain.landscapes import Land, canopies_of, check_used, land_of, stands_of, warn_of_tallgrass
from fifesim.chain.steps import air_of
from fifesim.grids import cf, chunks, directions
from fifesim.grids import grid as grids
from fifesim.grids.classes import by_class
from fifesim.grids.dates import by_date
from fifesim.grids.directions import Directions
from fifesim.grids.grid import north_up
from fifesim.grids.inputs import RasterOrDataset
from fifesim.grids.sites import is_fife
from fifesim.ground.canopy import labels as ground
from fifesim.ground.canopy import layers
from fifesim.ground.canopy.description import TALLGRASS, Canopy
from fifesim.ground.canopy.labels import Light
from fifesim.ground.canopy.spectra import is_mixture

_EDGES = tuple(round(0.4 + 0.02 * k, 2) for k in range(16))
PAR_BANDS = tuple(Band(f"{low:.2f}-{high:.2f} um", (low, high), (1.0, 1.0)) for low, high in pairwise(_EDGES))
"""Bands of 0.02 um over photosynthetically active radiation; FPAR is within 4e-4 of the result of 120 bands."""

# Variables of the light budget, and their quantities.
LIGHT_PARTS = {"green": "green_fpar", "dead": "dead_fpar", "ground": "ground_fpar", "reflected": "reflected_par"}


@by_date
def fpar(
    lai: RasterOrDataset,
    *,
    method: Literal["beer", "energy"] = "beer",
    canopy: Canopy | None = None,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    fpar_inf: FparLimit = layers.FPAR_INF,
    leaves: Literal["all", "green"] = "all",
) -> xr.DataArray:
    """
    Fraction of photosynthetically active radiation absorbed by a canopy, or by its green leaves.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape with a variable ``lai``. [m2 m-2]
    method : {"beer", "energy"}, optional
        Beer's law (Eq. 6), or the energy balance of SAIL, as `light` computes it.
    canopy : Canopy, optional
        Leaf angles, crown cover and dead leaves; for "energy" also leaf optics and background. Leave out properties
        that are variables of the landscape.
    atmosphere : Atmosphere, optional
        Determines the spectrum and the diffuse fraction of the light for "energy"; has no effect with "beer".
    geometry : fifesim.base.geometry.Geometry, optional
        Direction of the sun; by default from the coordinates of the array, else from its time and place.
    time : str or datetime, optional
        Time for the position of the sun, instead of ``geometry``.
    fpar_inf : float, optional
        FPAR of an infinitely thick canopy, for "beer" only. [1]
    leaves : {"all", "green"}, optional
        Include dead leaves ("all") or only photosynthetic ones ("green").

    Returns
    -------
    fpar : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If LAI is negative, a fraction is outside 0 to 1, or the optics for "energy" are not spectra.

    Warns
    -----
    UserWarning
        If LAI is part of a landscape, whose other variables are left out; for "energy", if the atmosphere, leaves or
        background are not given for a scene outside the FIFE site.

    Notes
    -----
    With "beer", green and dead leaves absorb equally, as in Eq. 6. With "energy", each kind of leaf absorbs by its
    optics, and skylight and the reflection of the ground contribute.

    References
    ----------
    [Friedl1995]_, Eq. 6; [VerhoefBach2007]_

    See Also
    --------
    fifesim.light, fifesim.surface_reflectance, fifesim.gpp

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> round(float(lai.fifesim.fpar().mean()), 2)
    0.3
    >>> round(float(lai.fifesim.fpar(method="energy").mean()), 2)
    0.33
    """
    if method == "energy":
        if fpar_inf != layers.FPAR_INF:
            raise ValueError(
                f"fpar_inf = {fpar_inf:g} has no effect with method='energy', where SAIL gives the light absorbed by a "
                "thick canopy: leave it out, or use method='beer'"
            )
        absorbed, history, source = _absorbed(lai, leaves, canopy, atmosphere, geometry, time)
        quantity = "green_fpar" if leaves == "green" else "fpar"
        return cf.label(absorbed.isel(band=0), quantity, source=source, history=f"fpar: {history}")
    land, canopy = land_of(lai), canopy or TALLGRASS
    check_used(land, canopy)

    def absorbed_by(stand):
        return ground.canopy_fpar(land.lai, stand, geometry=geometry, time=time, fpar_inf=fpar_inf, leaves=leaves)

    stands = stands_of(land.classes, canopy, land.cells)
    if land.cover is None:
        return absorbed_by(stands[None])
    # Classes with equal absorption are computed once.
    kernels: dict = {}
    known: list = []
    for code, stand in stands.items():
        alike = [kernel for other, kernel in known if ground.same_properties(stand, other, ground.ABSORBING)]
        kernels[code] = alike[0] if alike else (np.positive, [absorbed_by(stand)])
        known.append((stand, kernels[code]))
    distinct = list({id(kernel): kernel for kernel in kernels.values()}.values())
    out = grids.place(by_class(kernels, land.cover), grids.geobox(land.lai))
    history = distinct[0][1][0].attrs["history"].splitlines()[-1] if len(distinct) == 1 else "fpar: by class"
    return cf.label(out, "green_fpar" if leaves == "green" else "fpar", source=land.lai, history=history)


@by_date
def light(
    lai: RasterOrDataset,
    *,
    canopy: Canopy | None = None,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
) -> xr.Dataset:
    """
    Light budget of a canopy: photosynthetically active radiation absorbed by leaves and ground, and reflected.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape with a variable ``lai``. [m2 m-2]
    canopy : Canopy, optional
        Leaves, their arrangement and the background; by default green tallgrass of the FIFE site.
    atmosphere : Atmosphere, optional
        Determines the spectrum and the diffuse fraction of the light, with the default of `surface_reflectance`.
    geometry : fifesim.base.geometry.Geometry, optional
        Direction of the sun; by default from the coordinates of the array, else from its time and place.
    time : str or datetime, optional
        Time for the position of the sun, instead of ``geometry``.

    Returns
    -------
    light : xarray.Dataset, dims (y, x)
        ``green`` and ``dead``, absorbed by green and dead leaves, ``ground``, absorbed by the ground, and
        ``reflected``. They sum to 1. [1]

    Raises
    ------
    ValueError
        If a value is out of range, or leaf optics or background are given by band and not as spectra.

    Warns
    -----
    UserWarning
        As `surface_reflectance`.

    Notes
    -----
    Means over 0.4 to 0.7 um, weighted by the solar photons that reach the ground, direct and diffuse, in bands of 0.02
    um. Light that the ground reflects and the atmosphere sends back has the spectrum of the other light.

    References
    ----------
    [VerhoefBach2007]_

    See Also
    --------
    fifesim.fpar, fifesim.models.albedo, fifesim.gpp

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> parts = lai.fifesim.light(canopy=fifesim.Canopy(brown=0.3))
    >>> {name: round(float(part.mean()), 2) for name, part in parts.items()}
    {'green': 0.24, 'dead': 0.08, 'ground': 0.6, 'reflected': 0.08}
    """
    parts, history, source = _absorbed(lai, "light", canopy, atmosphere, geometry, time)
    found = {
        name: cf.label(parts.isel(band=number), quantity, source=source, history=f"light: {history}")
        for number, (name, quantity) in enumerate(LIGHT_PARTS.items())
    }
    return xr.Dataset(found)


def _absorbed(lai, part, canopy, atmosphere, geometry, time):
    """Layers of absorbed light, dims (band, y, x) [1], the text of their history, and the leaf area."""
    land = land_of(lai)
    scene, area = lai if isinstance(lai, xr.Dataset) else land.lai, ground.checked_scene(north_up(land.lai))
    geometry = directions.given_geometry(geometry, area, time)
    if "sza" in directions.varying(geometry):
        directions.uniform_geometry(geometry, "light")
    sza = float(geometry.sza)
    check_zenith("sza", sza)
    made = absorption_of(scene, part, canopy, atmosphere, (sza,))
    shares = "by class" if made.land.cover is not None else made.words
    words = ["energy balance of SAIL, 0.4 to 0.7 um", *filter(None, [shares]), f"sza {sza:.2f}"]
    return made.layers(len(LIGHT_PARTS) if part == "light" else 1), ", ".join(words), area


class Absorption(NamedTuple):
    """Kernels of absorbed light by class code, with their rasters, for a scene and its leaf area."""

    land: Land
    area: xr.DataArray
    kernels: dict
    words: str

    def layers(self, count):
        """Absorbed light, dims (band, y, x). [1]"""
        if self.land.cover is None:
            kernel, rasters = self.kernels[None]
            out = chunks.pointwise(kernel, self.area, *rasters, bands=count)
        else:
            out = by_class(self.kernels, self.land.cover, self.area, bands=count)
        return grids.place(out, grids.geobox(self.area))

    @property
    def of_leaf_area(self):
        """Function of an array of leaf area, or None if cells differ in anything else."""
        if self.land.cover is not None or any({"y", "x"} & set(each.dims) for each in self.kernels[None][1]):
            return None
        kernel, rasters = self.kernels[None]
        return lambda cells: kernel(cells, *(each.values for each in rasters))


def absorption_of(lai, part, canopy, atmosphere, suns):
    """Absorption of light in a scene for each zenith angle of the sun."""
    land, canopy = land_of(lai), canopy or TALLGRASS
    area = ground.checked_scene(north_up(land.lai))
    atmosphere = air_of(atmosphere, area)
    if not is_fife(area):
        warn_of_tallgrass(area.name or "the raster", land.classes, canopy, land.cells)
    check_spectra(stands_of(land.classes, canopy, land.cells))
    stands = canopies_of(land._replace(lai=area), PAR_BANDS, canopy)
    kernels = {code: sunlit_kernel(area, stand, atmosphere, suns, part) for code, stand in stands.items()}
    words = "" if land.cover is not None else f"{ground.shares_in_words(stands[None].canopy)}".rstrip(", ")
    return Absorption(land, area, kernels, words)


def sunlit_kernel(lai, stand, atmosphere, suns, part):
    """Kernel of light absorbed by a stand with optics in `PAR_BANDS` for each sun, and its rasters."""
    kernels, rasters, names = [], [], [band.name for band in PAR_BANDS]
    for sza in suns:
        flux, diffuse = par_at_ground(atmosphere, sza)
        # Absorption does not depend on the view.
        sun = Light(Geometry(sza=sza, saa=0.0), diffuse)
        kernel, rasters = ground.light_kernel(lai, names, stand, sun, tuple((flux / flux.sum()).tolist()), part)
        kernels.append(kernel)
    return (kernels[0] if len(suns) == 1 else partial(_by_sun, tuple(kernels))), rasters


def _by_sun(kernels, lai, *blocks):
    """Layers of all kernels."""
    return np.concatenate([kernel(lai, *blocks) for kernel in kernels])


@cached(64, "photosynthetically active light at the ground")
def par_at_ground(atmosphere, sza):
    """Relative photon flux in `PAR_BANDS` on level ground per cosine of the zenith angle, and diffuse fraction."""
    # A lower sun has the air of the lowest sun of all engines.
    return flux_at_ground(atmosphere, PAR_BANDS, min(sza, LARGEST_ZENITH))


def check_spectra(stands):
    """Raise ValueError for optics by band, which have no spectrum."""
    for stand in stands.values():
        for name in ("leaf_optics", "brown_leaf", "background"):
            given = getattr(stand, name)
            by_name = isinstance(given, Mapping) and not is_mixture(given)
            if by_name or (isinstance(given, xr.DataArray) and "band" in given.dims):
                raise ValueError(
                    f"{name} is given by band, a mean over wavelengths needs its spectrum: give a number or pair "
                    "for all wavelengths, a file or Dataset of the spectrum, fifesim.Leaf or fifesim.Background"
                )
