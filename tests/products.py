"""
Small products in the formats of the agencies.

The images have few pixels. Metadata are shortened from these products:
LT05_L1TP_058014_20110312_20200823_02_T1 and LC08_L1TP_047027_20201204_20210313_02_T1 (USGS),
S2A_MSIL1C_20210908T042701_N0301_R133_T46RER_20210908T070248 and
S2A_MSIL2A_20221005T115411_N0400_R023_T29UNU_20221005T164454 (ESA).
"""

import re
from pathlib import Path

import numpy as np
import rasterio
import xarray as xr
from affine import Affine

from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.grids import grid as grids

SHAPE = 12, 18

DATA = Path(__file__).parent / "data" / "products"
TM = {
    "product": "LT05_L1TP_058014_20110312_20200823_02_T1",
    "place": {"crs": "EPSG:32609", "corner": (339300.0, 7392900.0), "pixel": 30.0},
    "dtype": "uint8",
}
OLI = {
    "product": "LC08_L1TP_047027_20201204_20210313_02_T1",
    "place": {"crs": "EPSG:32610", "corner": (353700.0, 5374200.0), "pixel": 30.0},
    "dtype": "uint16",
}


def digital_numbers(dtype, number, shape=SHAPE):
    """Digital numbers of a band: no data in the first pixel, saturation in the last pixel."""
    largest = np.iinfo(dtype).max
    levels = (30, 90) if largest == 255 else (6000, 20000)
    dn = np.random.default_rng(int(number)).integers(*levels, shape).astype(dtype)
    dn[0, 0], dn[-1, -1] = 0, largest
    return dn


def write(path, values, crs, corner, pixel, driver="GTiff", **options):
    """Write a raster of one or more bands."""
    path.parent.mkdir(parents=True, exist_ok=True)
    bands = values.reshape(-1, *values.shape[-2:])
    profile = {"driver": driver, "count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "crs": crs}
    profile |= {"dtype": values.dtype, "transform": Affine(pixel, 0, corner[0], 0, -pixel, corner[1])}
    options |= {"QUALITY": "100", "REVERSIBLE": "YES"} if driver == "JP2OpenJPEG" else {}
    with rasterio.open(path, "w", **profile, **options) as sink:
        sink.write(bands)
    return values


def landsat_groups(kind, changes=None):
    """Metadata by group, as text, with changed values by group; None removes a key or a group."""
    groups = {}
    for line in (DATA / f"{kind['product']}_MTL.txt").read_text().splitlines()[1:-2]:
        key, value = line.strip().split(" = ")
        if key == "GROUP":
            group = groups[value] = {}
        elif key != "END_GROUP":
            group[key] = value.strip('"')
    for name, values in (changes or {}).items():
        merged = groups.pop(name, {}) | (values or {})
        if values:
            groups[name] = {key: value for key, value in merged.items() if value is not None}
    return groups


def mtl(groups):
    """Text of metadata."""
    lines = ["GROUP = LANDSAT_METADATA_FILE"]
    for group, values in groups.items():
        lines += [f"GROUP = {group}", *(f'{key} = "{value}"' for key, value in values.items()), f"END_GROUP = {group}"]
    return "\n".join([*lines, "END_GROUP = LANDSAT_METADATA_FILE", "END\n"])


def landsat(folder, kind, changes=None):
    """Write a Landsat product and return the values of its files: bands, quality, saturation and angles."""
    groups, place, dtype = landsat_groups(kind, changes), kind["place"], kind["dtype"]
    contents, files = groups["PRODUCT_CONTENTS"], {}
    (west, north), numbers = place["corner"], re.findall(r"FILE_NAME_BAND_(\d)\b", " ".join(contents))
    fine = {"crs": place["crs"], "corner": (west + 7.5, north - 7.5), "pixel": 15.0}
    for number in numbers:
        dn = digital_numbers(dtype, number, (23, 35) if number == "8" else SHAPE)
        files[number] = write(folder / contents[f"FILE_NAME_BAND_{number}"], dn, **(fine if number == "8" else place))
    quality = np.full(SHAPE, 21824, np.uint16)
    quality[0, 0], quality[3, 4] = 1, 22280
    saturated = np.zeros(SHAPE, np.uint16)
    # Bands 3, 4 and 5.
    saturated[5, 6:9] = 1 << 2, 1 << 3, 1 << 4
    files["quality"] = write(folder / contents["FILE_NAME_QUALITY_L1_PIXEL"], quality, **place)
    files["saturated"] = write(folder / contents["FILE_NAME_QUALITY_L1_RADIOMETRIC_SATURATION"], saturated, **place)
    rows, columns = np.indices(SHAPE)
    angles = {
        "SZA": 6950 + 3 * rows + columns,
        "SAA": 16560 + columns,
        "VZA": 100 + 10 * columns,
        "VAA": np.where(columns < 9, 10500, -7500) + rows,
    }
    for short, values in angles.items():
        values = np.where(quality == 1, 0, values).astype(np.int16)
        files[short] = write(folder / f"{kind['product']}_{short}.TIF", values, **place)
    (folder / f"{contents['LANDSAT_PRODUCT_ID']}_MTL.txt").write_text(mtl(groups))
    return files


# By level: name of the product, and text of its metadata.
SENTINEL2 = {
    1: "S2A_MSIL1C_20210908T042701_N0400_R133_T46RER_20210908T070248.SAFE",
    2: "S2A_MSIL2A_20221005T115411_N0400_R023_T29UNU_20221005T164454.SAFE",
}
PRODUCTS = {
    1: (DATA / "MTD_MSIL1C.xml").read_text(encoding="utf-8"),
    2: (DATA / "MTD_MSIL2A.xml").read_text(encoding="utf-8"),
}
# Sun: 58.38 - 0.0448 row - 0.006 column, and 171.9 + 0.0865 column, in steps of 5 km. View of bands 3 and 7: zenith
# 5.5 + 0.3 column + 0.1 row; azimuth 281.4 of the detector on the left, and 110 on the right. [degree]
TILE = (DATA / "MTD_TL.xml").read_text(encoding="utf-8")
CORNER, UTM = (499980.0, 5900040.0), "EPSG:32629"


def safe_files(text):
    """Paths without suffix, by band and pixel size, from the text of a product's metadata."""
    own = dict(re.findall(r'physicalBand="(\w+)">\s*<RESOLUTION>(\d+)', text))
    files = {}
    for path in re.findall(r"<IMAGE_FILE>\s*(\S+)\s*</IMAGE_FILE>", text):
        code, size = re.search(r"_(\w{3})(?:_(\d\d)m)?$", path).groups()
        band = code if code.isalpha() else f"B{code[1:].lstrip('0')}"
        files[band, int(size or own.get(band, 10))] = path
    return files


def sentinel2(folder, level=1, width=120):
    """Write a .SAFE folder of JPEG 2000 files; return its path, and digital numbers by band and pixel size."""
    path, place = folder / SENTINEL2[level], {"crs": UTM, "corner": CORNER, "driver": "JP2OpenJPEG"}
    files = {}
    for (band, size), file in safe_files(PRODUCTS[level]).items():
        shape = (width // size, width // size)
        random = np.random.default_rng([size, len(band), ord(band[-1])])
        if band == "SCL":
            dn = random.integers(0, 12, shape).astype(np.uint8)
        else:
            dn = random.integers(1200, 5000, shape).astype(np.uint16)
            dn[0, 0], dn[-1, -1] = 0, 65535
        files[band, size] = write(path / f"{file}.jp2", dn, pixel=float(size), **place)
    granule = path / Path(file).parents[-3]
    if level == 1:
        masks = np.random.default_rng(9).integers(0, 2, (3, width // 60, width // 60)).astype(np.uint8)
        files["masks"] = write(granule / "QI_DATA" / "MSK_CLASSI_B00.jp2", masks, pixel=60.0, **place)
    (path / f"MTD_MSIL{level}{'CA'[level - 1]}.xml").write_text(PRODUCTS[level])
    (granule / "MTD_TL.xml").write_text(TILE)
    return path, files


def labelled(values, grid, bands, geometry):
    """Top-of-atmosphere reflectance on a grid."""
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": bands, **geometry}, name="toa_reflectance")
    return grids.place(array, grid)


def radiance(values, grid, bands):
    """Radiance at the top of the atmosphere on a grid, with a sun. [W m-2 sr-1 um-1]"""
    array = labelled(values, grid, bands, {}).rename("toa_radiance").assign_attrs(units="W m-2 sr-1 um-1")
    return directions.with_geometry(array, Geometry(40.0, 120.0))
