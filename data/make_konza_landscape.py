"""
Learn the landscape "konza" from an NDVI map and an elevation model of Kings Creek, Konza Prairie.

    python data/make_konza_landscape.py ndvi_2022-06-03.tif kings_creek_dem_10m_epsg26914.tif

The map is the NDVI of the surface reflectance of Sentinel-2 on 3 June 2022 at about 10 m, with 0 for no data (contains
modified Copernicus Sentinel data 2022). The elevation is USGS 3DEP, 1/3 arc-second, at 10 m. Neither file is
distributed; the description has numbers and tables only. NDVI becomes leaf area by the canopy model for green
tallgrass. Assumed: the time of the overpass, 17:15 UTC, which gives the position of the sun, and the noise of NDVI.
"""

import argparse

import numpy as np
import rioxarray
from odc.geo.geobox import GeoBox

import fifesim
from fifesim.base.files import path

GRID = ("EPSG:26914", 707610.0, 4331930.0, 4080.0, 4620.0, 10.0)
TIME = "2022-06-03T17:15Z"
SOURCE = (
    "Kings Creek, Konza Prairie: NDVI of Sentinel-2, 3 June 2022 (contains modified Copernicus Sentinel data 2022), "
    "and elevation of USGS 3DEP"
)
NOISE = 0.004
# Small deviations, because the leaf area was learned as if leaves were green and soil uniform, so that it already holds
# the variance of NDVI by dead leaves and soil.
NOTE = "Plausible, not measured; small, because the leaf area was learned as if leaves were green and soil was uniform."
PROPERTIES = {
    "soil": {"mean": 0.0, "sd": 0.015, "leaf_area": -0.3, "forms": {"slope_40": 0.3}, "spacings": [30.0], "note": NOTE},
    "brown": {"mean": 0.05, "sd": 0.02, "forms": {"above_400": 0.2}, "spacings": [30.0], "note": NOTE},
    "moisture": {"mean": 0.1, "sd": 0.05, "forms": {"above_400": -0.5}, "spacings": [120.0], "note": NOTE},
}


def learned(ndvi_file, dem_file):
    """Landscape of the map."""
    crs, west, north, width, height, cell = GRID
    grid: GeoBox = fifesim.grid_at(crs, west, north, width, height, cell)
    ndvi = rioxarray.open_rasterio(ndvi_file, masked=True).squeeze("band", drop=True)
    # Bilinear interpolation would blur the map once more.
    ndvi = ndvi.odc.reproject(grid, resampling="nearest", dst_nodata=np.nan).rename("ndvi")
    geometry = fifesim.sun_position(TIME, 39.09, -96.57)
    dem = rioxarray.open_rasterio(dem_file, masked=True).squeeze("band", drop=True)
    return fifesim.learn_landscape(
        ndvi, dem, instrument="MSI", geometry=geometry, noise=NOISE, source=SOURCE, properties=PROPERTIES
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ndvi")
    parser.add_argument("dem")
    given = parser.parse_args()
    land = learned(given.ndvi, given.dem)
    land.save(path("landscapes") / "konza.json")
    print(land)
