"""
Small products in the formats of the agencies.

The images have few pixels. Names, groups and numbers of the metadata come from these products:
LT05_L1TP_058014_20110312_20200823_02_T1 and LC08_L2SP_047027_20201204_20210313_02_T1 (USGS),
S2A_MSIL1C_20210908T042701_N0301_R133_T46RER_20210908T070248 and
S2A_MSIL2A_20221005T115411_N0400_R023_T29UNU_20221005T164454 (ESA).
"""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import rasterio
import xarray as xr
from affine import Affine

from fifesim.grids import grid as grids

SHAPE = 12, 18

DATA = Path(__file__).parent / "data" / "products"
NUMBERS = tomllib.loads((DATA / "products.toml").read_text(encoding="utf-8"))
TM, OLI = (NUMBERS[name] | {"corner": tuple(NUMBERS[name]["corner"])} for name in ("TM", "OLI"))
MEAN_VIEWS = {number: tuple(angles) for number, angles in NUMBERS["MEAN_VIEWS"].items()}


def digital_numbers(kind, number, shape=SHAPE):
    """Digital numbers of a band: no data in the first pixel, saturation in the last pixel."""
    largest = np.iinfo(kind["dtype"]).max
    levels = (30, 90) if largest == 255 else (6000, 20000)
    dn = np.random.default_rng(int(number)).integers(*levels, shape).astype(kind["dtype"])
    dn[0, 0], dn[-1, -1] = 0, largest
    return dn


def write(path, values, crs, corner, pixel, driver="GTiff", **options):
    """Write a raster of one or more bands."""
    path.parent.mkdir(parents=True, exist_ok=True)
    bands = values.reshape(-1, *values.shape[-2:])
    profile = {"driver": driver, "count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "crs": crs}
    profile |= {"dtype": values.dtype, "transform": Affine(pixel, 0, corner[0], 0, -pixel, corner[1])}
    with rasterio.open(path, "w", **profile, **options) as sink:
        sink.write(bands)
    return values


def landsat_groups(kind, level=1):
    """Metadata by group, as text."""
    product = kind["product"].replace("L1TP", "L2SP") if level == 2 else kind["product"]
    numbers = [number for number in kind["bands"] if level == 1 or number not in "89"]
    prefix = "SR_B" if level == 2 else "B"
    contents = {
        "ORIGIN": "Image courtesy of the U.S. Geological Survey",
        "DIGITAL_OBJECT_IDENTIFIER": "https://doi.org/10.5066/P975CC9B",
        "LANDSAT_PRODUCT_ID": product,
        "PROCESSING_LEVEL": "L2SP" if level == 2 else "L1TP",
        "COLLECTION_NUMBER": "02",
        "COLLECTION_CATEGORY": "T1",
        "OUTPUT_FORMAT": "GEOTIFF",
    }
    contents |= {f"FILE_NAME_BAND_{number}": f"{product}_{prefix}{number}.TIF" for number in numbers}
    if level == 1:
        contents |= {f"FILE_NAME_BAND_{number}": f"{product}_B{number}.TIF" for number in kind["thermal"]}
    else:
        contents |= {f"FILE_NAME_BAND_ST_B{number}": f"{product}_ST_B{number}.TIF" for number in kind["thermal"][:1]}
    contents |= {
        "FILE_NAME_QUALITY_L1_PIXEL": f"{product}_QA_PIXEL.TIF",
        "FILE_NAME_QUALITY_L1_RADIOMETRIC_SATURATION": f"{product}_QA_RADSAT.TIF",
    }
    angles = {
        f"FILE_NAME_ANGLE_{body}_{angle}_BAND_4": f"{kind['product']}_{short}.TIF"
        for body, angle, short in (
            ("SENSOR", "AZIMUTH", "VAA"),
            ("SENSOR", "ZENITH", "VZA"),
            ("SOLAR", "AZIMUTH", "SAA"),
            ("SOLAR", "ZENITH", "SZA"),
        )
    }
    groups = {"PRODUCT_CONTENTS": contents | (angles if level == 1 else {}), "IMAGE_ATTRIBUTES": dict(kind["image"])}
    if level == 2:
        groups["LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"] = {
            f"{key}_BAND_{number}": value
            for number in numbers
            for key, value in {
                "REFLECTANCE_MAXIMUM": "1.602213",
                "REFLECTANCE_MINIMUM": "-0.199972",
                "QUANTIZE_CAL_MAX": "65535",
                "QUANTIZE_CAL_MIN": "1",
                "REFLECTANCE_MULT": "2.75e-05",
                "REFLECTANCE_ADD": "-0.2",
            }.items()
        }
    groups["LEVEL1_PROCESSING_RECORD"] = {
        "LANDSAT_PRODUCT_ID": kind["product"],
        "PROCESSING_LEVEL": "L1TP",
        "FILE_NAME_QUALITY_L1_PIXEL": f"{kind['product']}_QA_PIXEL.TIF",
        "FILE_NAME_QUALITY_L1_RADIOMETRIC_SATURATION": f"{kind['product']}_QA_RADSAT.TIF",
    } | angles
    return groups | _level1_scales(kind)


def _level1_scales(kind):
    largest = np.iinfo(kind["dtype"]).max
    names = {
        "LEVEL1_MIN_MAX_RADIANCE": ("RADIANCE_MAXIMUM", "RADIANCE_MINIMUM"),
        "LEVEL1_MIN_MAX_REFLECTANCE": ("REFLECTANCE_MAXIMUM", "REFLECTANCE_MINIMUM"),
        "LEVEL1_RADIOMETRIC_RESCALING": ("REFLECTANCE_MULT", "REFLECTANCE_ADD"),
    }
    groups = {}
    for place, (group, keys) in enumerate(names.items()):
        digits = ".6g" if group.endswith("RESCALING") else ".6f"
        groups[group] = {
            f"{key}_BAND_{number}": f"{values[2 * place + k]:{digits}}"
            for number, values in kind["bands"].items()
            for k, key in enumerate(keys)
        }
    groups["LEVEL1_MIN_MAX_PIXEL_VALUE"] = {
        f"QUANTIZE_CAL_{end}_BAND_{number}": str(value)
        for number in (*kind["bands"], *kind["thermal"])
        for end, value in (("MAX", largest), ("MIN", 1))
    }
    return groups


def surface_by_hand(toa, terms):
    """Surface reflectance from top-of-atmosphere reflectance, shape (band, y, x)."""
    names = ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo", "gas_transmittance")
    path, down, up, albedo, gas = (np.asarray(getattr(terms, name))[:, None, None] for name in names)
    below = (toa / gas - path) / (down * up)
    return below / (1 + albedo * below)


def mtl(groups, form="txt", root="LANDSAT_METADATA_FILE"):
    """Metadata text in one of the three USGS formats."""
    if form == "json":
        return json.dumps({root: groups}, indent=2)
    if form == "xml":
        inner = ""
        for group, values in groups.items():
            lines = "".join(f"    <{key}>{value}</{key}>\n" for key, value in values.items())
            inner += f"  <{group}>\n{lines}  </{group}>\n"
        return f'<?xml version="1.0" encoding="UTF-8"?>\n<{root}>\n{inner}</{root}>\n'
    lines = [f"GROUP = {root}"]
    for group, values in groups.items():
        lines += [f"  GROUP = {group}"]
        shown = {key: value if _is_plain(key, value) else json.dumps(value) for key, value in values.items()}
        lines += [f"    {key} = {value}" for key, value in shown.items()]
        lines += [f"  END_GROUP = {group}"]
    return "\n".join([*lines, f"END_GROUP = {root}", "END", ""])


def _is_plain(key, value):
    """Whether a value is a number or date, which have no quotes."""
    return key in ("DATE_ACQUIRED", "COLLECTION_NUMBER") or re.fullmatch(r"-?[\d.]+(e-?\d+)?", value)


def landsat(folder, kind, level=1, form="txt", groups=None):
    """Write a Landsat product and return the values of its files: bands, quality, saturation and angles."""
    groups = groups or landsat_groups(kind, level)
    contents = groups["PRODUCT_CONTENTS"]
    product = contents["LANDSAT_PRODUCT_ID"]
    place = {"crs": kind["crs"], "corner": kind["corner"], "pixel": 30.0}
    stored = dict(kind, dtype="uint16") if level == 2 else kind
    files = {}
    for number in kind["bands"]:
        name = contents.get(f"FILE_NAME_BAND_{number}")
        fine = number == "8"
        if name is not None:
            dn = digital_numbers(stored, number, (23, 35) if fine else SHAPE)
            west, north = kind["corner"]
            own = {"crs": kind["crs"], "corner": (west + 7.5, north - 7.5), "pixel": 15.0} if fine else place
            files[number] = write(folder / name, dn, **own)
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
    (folder / f"{product}_MTL.{form}").write_text(mtl(groups, form))
    return files


_BANDS = tuple(NUMBERS["SENTINEL2"])
_SIZES, _SOLAR = zip(*NUMBERS["SENTINEL2"].values(), strict=True)

# By level: product, granule and image.
SENTINEL2 = {
    1: (
        "S2A_MSIL1C_20210908T042701_N{}_R133_T46RER_20210908T070248",
        "L1C_T46RER_A032448_20210908T043714",
        "T46RER_20210908T042701",
    ),
    2: (
        "S2A_MSIL2A_20221005T115411_N{}_R023_T29UNU_20221005T164454",
        "L2A_T29UNU_A038058_20221005T115407",
        "T29UNU_20221005T115411",
    ),
}
CORNER, UTM = (499980.0, 5900040.0), "EPSG:32629"
U = "0.983841990384341"


def _file_name(band):
    return f"B{band[1:]:>02}"


def safe_files(level):
    """Paths without suffix, by band and pixel size."""
    _, granule, image = SENTINEL2[level]
    own = dict(zip(_BANDS, _SIZES, strict=True))
    if level == 1:
        return {(band, own[band]): f"GRANULE/{granule}/IMG_DATA/{image}_{_file_name(band)}" for band in own}
    found = {}
    for size in (10, 20, 60):
        aside = {"B10"} if size == 10 else {"B10", "B8"}
        here = [band for band in own if (own[band] <= size or (band, size) == ("B1", 20)) and band not in aside]
        for band in (*here, *(["SCL"] if size > 10 else [])):
            name = band if band == "SCL" else _file_name(band)
            found[band, size] = f"GRANULE/{granule}/IMG_DATA/R{size}m/{image}_{name}_{size}m"
    return found


def product_xml(level, baseline, spacecraft="Sentinel-2A", offset=-1000, granules=1):
    """Text of MTD_MSIL1C.xml or MTD_MSIL2A.xml."""
    name = SENTINEL2[level][0].format(baseline.replace(".", ""))
    kind = "Level-1C" if level == 1 else "Level-2A"
    images = "".join(f"<IMAGE_FILE>{file}</IMAGE_FILE>\n" for file in safe_files(level).values())
    listed = "".join(
        f'<Granule_List><Granule granuleIdentifier="S2A_OPER_TL_{k}" imageFormat="JPEG2000">\n{images}</Granule>'
        "</Granule_List>\n"
        for k in range(granules)
    )
    quantification = '<QUANTIFICATION_VALUE unit="none">10000</QUANTIFICATION_VALUE>'
    if level == 2:
        quantification = (
            '<QUANTIFICATION_VALUES_LIST>\n<BOA_QUANTIFICATION_VALUE unit="none">10000</BOA_QUANTIFICATION_VALUE>\n'
            '<AOT_QUANTIFICATION_VALUE unit="none">1000.0</AOT_QUANTIFICATION_VALUE>\n'
            "</QUANTIFICATION_VALUES_LIST>"
        )
    names = {1: ("Radiometric_Offset_List", "RADIO_ADD_OFFSET"), 2: ("BOA_ADD_OFFSET_VALUES_LIST", "BOA_ADD_OFFSET")}
    outer, inner = names[level]
    offsets = "".join(f'<{inner} band_id="{number}">{offset}</{inner}>\n' for number in range(13))
    offsets = f"<{outer}>\n{offsets}</{outer}>" if offset is not None and baseline >= "04.00" else ""
    solar = "".join(
        f'<SOLAR_IRRADIANCE bandId="{k}" unit="W/m²/µm">{value}</SOLAR_IRRADIANCE>\n' for k, value in enumerate(_SOLAR)
    )
    spectral = "".join(
        f'<Spectral_Information bandId="{k}" physicalBand="{band}">\n<RESOLUTION>{size}</RESOLUTION>\n'
        "</Spectral_Information>\n"
        for k, (band, size) in enumerate(zip(_BANDS, _SIZES, strict=True))
    )
    return (DATA / "MTD.xml").read_text(encoding="utf-8").format(
        kind=kind, name=name, baseline=baseline, spacecraft=spacecraft, listed=listed, quantification=quantification,
        offsets=offsets, u=U, solar=solar, spectral=spectral,
    )  # fmt: skip


def sun_grid():
    """Solar zenith and azimuth at the nodes of the 5 km grid. [degree]"""
    rows, columns = np.indices((23, 23))
    return 58.38 - 0.0448 * rows - 0.006 * columns, 171.9 + 0.0865 * columns


def view_grids():
    """View grids of two detectors (left and right of the tile) for bands 3 and 7; the last columns are missing."""
    rows, columns = np.indices((23, 23))
    zenith = 5.5 + 0.3 * columns + 0.1 * rows
    left, right = np.where(columns <= 10, zenith, np.nan), np.where((columns >= 10) & (columns < 20), zenith, np.nan)
    return {("3", "9"): (left, np.where(columns <= 10, 281.4, np.nan)), ("3", "10"): (right, right * 0 + 110.0),
            ("7", "9"): (left, left * 0 + 281.4), ("7", "10"): (right, right * 0 + 110.0)}  # fmt: skip


def _values(grid):
    texts = [" ".join(f"{value:g}" if np.isfinite(value) else "NaN" for value in row) for row in grid]
    rows = "".join(f"<VALUES>{text}</VALUES>\n" for text in texts)
    steps = '<COL_STEP unit="m">5000</COL_STEP>\n<ROW_STEP unit="m">5000</ROW_STEP>\n'
    return f"{steps}<Values_List>\n{rows}</Values_List>\n"


def tile_xml(level):
    """Text of MTD_TL.xml."""
    zenith, azimuth = sun_grid()
    sun = f"<Zenith>{_values(zenith)}</Zenith>\n<Azimuth>{_values(azimuth)}</Azimuth>"
    views = "".join(
        f'<Viewing_Incidence_Angles_Grids bandId="{band}" detectorId="{detector}">\n<Zenith>{_values(z)}</Zenith>\n'
        f"<Azimuth>{_values(a)}</Azimuth>\n</Viewing_Incidence_Angles_Grids>\n"
        for (band, detector), (z, a) in view_grids().items()
    )
    means = "".join(
        f'<Mean_Viewing_Incidence_Angle bandId="{k}">\n<ZENITH_ANGLE unit="deg">{z}</ZENITH_ANGLE>\n'
        f'<AZIMUTH_ANGLE unit="deg">{a}</AZIMUTH_ANGLE>\n</Mean_Viewing_Incidence_Angle>\n'
        for k, (z, a) in MEAN_VIEWS.items()
    )
    kind = "Level-1C" if level == 1 else "Level-2A"
    return (DATA / "MTD_TL.xml").read_text(encoding="utf-8").format(kind=kind, sun=sun, views=views, means=means)


def sentinel2(folder, level=1, baseline="04.00", width=120, **options):
    """Write a .SAFE folder of JPEG 2000 files; return its path, and digital numbers by band and pixel size."""
    path = folder / f"{SENTINEL2[level][0].format(baseline.replace('.', ''))}.SAFE"
    files, lossless = {}, {"QUALITY": "100", "REVERSIBLE": "YES"}
    for (band, size), file in safe_files(level).items():
        shape = (width // size, width // size)
        random = np.random.default_rng([size, len(band), ord(band[-1])])
        if band == "SCL":
            dn = random.integers(0, 12, shape).astype(np.uint8)
        else:
            dn = random.integers(1200, 5000, shape).astype(np.uint16)
            dn[0, 0], dn[-1, -1] = 0, 65535
        files[band, size] = write(path / f"{file}.jp2", dn, UTM, CORNER, float(size), driver="JP2OpenJPEG", **lossless)
    if level == 1 and baseline >= "04.00":
        masks = np.random.default_rng(9).integers(0, 2, (3, width // 60, width // 60)).astype(np.uint8)
        file = path / "GRANULE" / SENTINEL2[1][1] / "QI_DATA" / "MSK_CLASSI_B00.jp2"
        files["masks"] = write(file, masks, UTM, CORNER, 60.0, driver="JP2OpenJPEG", **lossless)
    metadata = path / ("MTD_MSIL1C.xml" if level == 1 else "MTD_MSIL2A.xml")
    metadata.write_text(product_xml(level, baseline, **options), encoding="utf-8")
    (path / "GRANULE" / SENTINEL2[level][1] / "MTD_TL.xml").write_text(tile_xml(level), encoding="utf-8")
    return path, files


def labelled(values, grid, bands, geometry):
    """Top-of-atmosphere reflectance on a grid."""
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": bands, **geometry}, name="toa_reflectance")
    return grids.place(array, grid)
