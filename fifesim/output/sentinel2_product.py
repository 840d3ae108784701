"""Sentinel-2 Level-1C products of simulated scenes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyproj

from fifesim.base.arguments import FilePath
from fifesim.base.geometry import angle_between
from fifesim.grids import grid as grids
from fifesim.output import simulated_product
from fifesim.output.maps import rendered
from fifesim.output.simulated_product import Images, Truth, write_raster
from fifesim.sensor.products.sentinel2_labels import CIRRUS, SENTINEL2_INSTRUMENTS, SENTINEL2_LAUNCHES
from fifesim.sensor.response.calibration import between_nodes, direction_angles, direction_vectors

# No real product has this baseline, with offsets and with masks that are rasters, as since 04.00.
_BASELINE = "99.99"

# Distance between the nodes of the grids of angles. [m]
_STEP = 5000

# Pixels along an axis at which angles by pixel are read, and the largest error of the grids there. [1, degree]
_SAMPLES, _ANGLE = 60, 0.01

# Side of a large image. [step]
_LARGE = 4

# The detector that sees the whole tile, one of 12.
_DETECTOR = 7

# Reflectance of the largest number, 255, of the true-colour image. ESA, SentiWiki, Sentinel-2 products.
_BRIGHT = 0.3558

# Coarsest pixel, of which the sides of a tile are multiples. [m]
_COARSEST = 60

# Layers of MSK_QUALIT, of which the sixth is no data and the eighth saturation. ESA, S2-PDGS-TAS-DI-PSD, version 14.9.
_QUALITY_LAYERS, _NO_DATA, _SATURATED = 8, 5, 7


def to_sentinel2_l1c(image: Images, folder: FilePath, *, truth: Truth | None = None, overwrite: bool = False) -> Path:
    """
    Write a simulated scene as a Sentinel-2 Level-1C product of one tile, with its truth.

    Other programs read the ``.SAFE`` folder like a real one of Sentinel-2A or -2B. The product states that it is
    simulated: in its name, with baseline ``N9999`` and a tile such as ``T14SIM``, which no real tile has; in its
    metadata; and in ``SIMULATED.txt``.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x), or xarray.DataTree
        Image from `fifesim.sense` of MSI or MSI-B: digital numbers, radiance or reflectance at the top of the
        atmosphere, in WGS 84 / UTM, with a coordinate ``time``. The DataTree has the bands of 10, 20 and 60 m; a
        DataArray has all bands of one pixel size, and the other bands are absent from the product. The cirrus band may
        be left out. [1 or W m-2 sr-1 um-1]
    folder : str or path
        Folder in which the ``.SAFE`` folder is made.
    truth : xarray.Dataset, optional
        True rasters of the scene on any grid, such as surface reflectance, LAI, FPAR and optical thickness of aerosol.
        Each is written as ``truth/NAME.tif``. The variable ``cloud``, as a mask or as a fraction on the grid of the
        image (of the first in a DataTree), sets the mask of opaque clouds where it covers half of a pixel of 60 m.
    overwrite : bool, optional
        Replace the same product of an earlier call. Other folders are never replaced.

    Returns
    -------
    product : pathlib.Path
        ``.SAFE`` folder of the product. It appears when it is complete.

    Raises
    ------
    ValueError
        If the instrument is another; bands are missing; pixels have another size or CRS, or the sides are no multiples
        of 60 m; the image has no time or sun, or its date is outside of the mission; the sun differs by more than 1
        degree from the almanac; angles by pixel are not smooth over 5 km; or a reflectance is outside of the range of
        digital numbers. Digital numbers of saturated pixels are kept.
    FileExistsError
        If the product exists and ``overwrite`` is False, or its folder was not written by fifesim.
    OSError
        If a file cannot be written.

    Notes
    -----
    Digital numbers are reflectance x 10000 + 1000, as since baseline 04.00. One detector sees the tile, and all bands
    have the view of the image. The grids of angles have nodes every 5 km. There are no data strips, auxiliary data nor
    preview, which Sen2Cor needs.

    References
    ----------
    ESA, Sentinel-2 products specification document, S2-PDGS-TAS-DI-PSD

    See Also
    --------
    fifesim.open_sentinel2, fifesim.output.to_landsat_l1

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> grid = fifesim.grid_at("EPSG:32614", 704940, 4334220, 1200, 900, cell=10)
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> bands = ["MSI2", "MSI3", "MSI4", "MSI8"]
    >>> rho = lai.fifesim.surface_reflectance("MSI", bands=bands, time="2021-06-06T17:10Z")
    >>> image = rho.fifesim.to_toa().fifesim.sense("MSI", scaling="product")
    >>> product = image.fifesim.to_sentinel2_l1c(mkdtemp(), truth=lai.to_dataset(name="lai"))
    >>> product.name
    'S2A_MSIL1C_20210606T171000_N9999_R000_T14SIM_20210606T171000.SAFE'
    >>> again = fifesim.open_sentinel2(product)
    >>> bool(abs(again - image.fifesim.to_reflectance()).max() < 1e-6)
    True
    """
    images = simulated_product.images_of_scene(image)
    spacecraft_of = {name: spacecraft for spacecraft, name in SENTINEL2_INSTRUMENTS.items()}
    others = "sense the scene with one of them, or write the image with .fifesim.to_geotiff(...)"
    description = simulated_product.instrument_of(images, spacecraft_of, others)
    layers = simulated_product.layers_of_scene(images, description, omitted=(CIRRUS,))
    spacecraft = spacecraft_of[description.name]
    seen = simulated_product.acquisition_of(images, spacecraft, SENTINEL2_LAUNCHES[spacecraft], None)
    grid = grids.geobox(images[0])
    coarse = _coarse(grid)
    names = _names(spacecraft, seen, grid)
    angles = {kind: _nodes(seen.geometry, kind, grid) for kind in "sv"}
    with simulated_product.product_folder(folder, names["product"], truth, overwrite=overwrite) as new:
        cloud = _blocks(simulated_product.mask_of(truth, "cloud", grid), coarse.shape) >= 0.5
        masks = np.stack([cloud, np.zeros_like(cloud), np.zeros_like(cloud)]).astype(np.uint8)
        write_raster(new / names["masks"] / "MSK_CLASSI_B00.jp2", masks, coarse, "JP2OpenJPEG")
        bands = [_described(description, number, band, names) for number, band in enumerate(description.bands)]
        scale, largest, counts = description.product, 2**description.product.bits - 1, {}
        for band in bands:
            if layer := layers.get(band["name"]):
                values = simulated_product.digital_numbers(layer, scale.gain, scale.offset, largest)
                _write_band(new, layer, band, names, values, largest)
                counts[band["code"]] = values
            else:
                band["file"] = None
        if "B04" in counts:
            colours = _true_colours(np.stack([counts[code] for code in ("B04", "B03", "B02")]), scale)
            write_raster(new / f"{names['image']}_TCI.jp2", colours, layers["MSI4"].grid, "JP2OpenJPEG")
        values = names | _text_of_scene(seen, grid, description) | {"bands": bands, "largest": largest}
        values |= {
            "colours": "B04" in counts,
            "sun": angles["s"],
            "view": angles["v"],
            "cloud_cover": f"{100 * cloud.mean():.6f}",
        }
        granule = Path(names["masks"]).parent
        for path, name in (("MTD_MSIL1C.xml", "product"), (granule / "MTD_TL.xml", "tile")):
            template = Path(__file__).with_name(f"sentinel2_{name}.xml.j2")
            (new / path).write_text(rendered(template, **values) + "\n", encoding="utf-8")
        simulated_product.write_truth(new, images, truth)
    return Path(folder) / names["product"]


def _coarse(grid):
    """Grid of the coarsest pixels."""
    down, across = (size * cell for size, cell in zip(grid.shape, grids.cell_size(grid), strict=True))
    if max(down % _COARSEST, across % _COARSEST) > 1e-6:
        raise ValueError(
            f"the sides of a tile must be multiples of {_COARSEST} m, which is the coarsest pixel, got {down:g} x "
            f"{across:g} m: crop the image with .isel(y=slice(...), x=slice(...)), or simulate another size"
        )
    return grids.aligned_grid(grid, _COARSEST)


def _names(spacecraft, seen, grid):
    """Names of the product, its parts and its folders."""
    zone, north = simulated_product.utm_zone(grid)
    stamp = np.datetime_as_string(seen.time, "s").replace("-", "").replace(":", "")
    satellite, tile = f"S2{spacecraft[-1]}", f"T{zone:02d}SIM"
    granule = f"GRANULE/L1C_{tile}_A000000_{stamp}"
    return {
        "product": f"{satellite}_MSIL1C_{stamp}_N{_BASELINE.replace('.', '')}_R000_{tile}_{stamp}.SAFE",
        "tile": f"{satellite}_OPER_MSI_L1C_TL_SIM__{stamp}_A000000_{tile}_N{_BASELINE}",
        "datastrip": f"{satellite}_OPER_MSI_L1C_DS_SIM__{stamp}_S{stamp}_N{_BASELINE}",
        "masks": f"{granule}/QI_DATA",
        "image": f"{granule}/IMG_DATA/{tile}_{stamp}",
        "stamp": stamp,
        "spacecraft": spacecraft,
        "baseline": _BASELINE,
        "zone": f"{zone}{'N' if north else 'S'}",
        "epsg": grid.crs.to_epsg(),
    }


def _described(description, number, band, names):
    """Fields of a band in the metadata."""
    physical = band.name.replace("MSI", "B")
    code = f"B{physical[1:].rjust(2, '0')}"
    table = band.response
    ends = [int(np.floor(1000 * table.wavelength[0])), int(np.ceil(1000 * table.wavelength[-1]))]
    response = np.interp(np.arange(ends[0], ends[1] + 1) / 1000, table.wavelength, table.response, left=0, right=0)
    return {
        "name": band.name,
        "number": number,
        "physical": physical,
        "code": code,
        "file": f"{names['image']}_{code}",
        "size": round(description.pixel(band)),
        "wavelengths": ends,
        "centre": f"{1000 * band.wavelength:.1f}",
        "response": " ".join(f"{value:.8g}" for value in response),
        "solar_irradiance": f"{band.solar_irradiance:.6g}",
        "gain": f"{(2**description.bits - 1) / (band.full_scale_radiance - band.min_radiance):.8f}",
    }


def _write_band(new, layer, band, names, counts, largest):
    """Write the digital numbers of a band, its detector and its quality."""
    write_raster(new / f"{band['file']}.jp2", counts, layer.grid, "JP2OpenJPEG")
    quality = np.zeros((_QUALITY_LAYERS, *counts.shape), np.uint8)
    quality[_NO_DATA], quality[_SATURATED] = counts == 0, counts == largest
    masks = {"QUALIT": quality, "DETFOO": np.where(counts == 0, 0, _DETECTOR).astype(np.uint8)}
    for name, values in masks.items():
        write_raster(new / names["masks"] / f"MSK_{name}_{band['code']}.jp2", values, layer.grid, "JP2OpenJPEG")


def _true_colours(counts, product):
    """True-colour image of digital numbers, 0 for no data."""
    values = np.rint((counts * product.gain + product.offset) * (255 / _BRIGHT))
    return np.where(counts == 0, 0, np.clip(values, 1, 255)).astype(np.uint8)


def _text_of_scene(seen, grid, description):
    """Fields of time, place and directions in the metadata."""
    sensing = np.datetime_as_string(seen.time, "us")
    box = grid.boundingbox
    to_degrees = pyproj.Transformer.from_crs(grid.crs.proj, 4326)
    corners = [(box.left, box.top), (box.right, box.top), (box.right, box.bottom), (box.left, box.bottom)]
    places = [to_degrees.transform(*corner) for corner in (*corners, corners[0])]
    return {
        "statement": simulated_product.simulation_statement(),
        "start": f"{sensing[:23]}Z",
        "sensing": f"{sensing}Z",
        "quantification": round(1 / description.product.gain),
        "add_offset": round(description.product.offset / description.product.gain),
        "inverse_square": f"{seen.earth_sun_distance**-2:.14f}",
        "footprint": " ".join(f"{latitude:.12f} {longitude:.12f}" for latitude, longitude in places),
        "height": round(box.top - box.bottom),
        "width": round(box.right - box.left),
        "west": f"{box.left:.10g}",
        "north": f"{box.top:.10g}",
        "step": _STEP,
        "detector": _DETECTOR,
    } | {name: f"{getattr(seen, name):.12g}" for name in ("sza", "saa", "vza", "vaa")}


def _blocks(values, shape):
    """Mean of blocks of a mask, for an array of a coarser shape."""
    down, across = (size // coarse for size, coarse in zip(values.shape, shape, strict=True))
    return values.reshape(shape[0], down, shape[1], across).mean(axis=(1, 3))


def _nodes(geometry, kind, grid):
    """Rows of zenith and of azimuth at the nodes of the grid of sun (s) or view (v), as texts."""
    zenith, azimuth = (np.asarray(getattr(geometry, f"{kind}{angle}a"), float) for angle in "za")
    sides = np.array(grid.shape) * grids.cell_size(grid) / _STEP
    rows, columns = (np.arange(max(int(np.ceil(side - 1e-9)) + 1, 2)) for side in sides)
    if zenith.ndim == azimuth.ndim == 0:
        angles = [np.full((rows.size, columns.size), value) for value in (zenith, azimuth)]
    else:
        angles = _fitted(*np.broadcast_arrays(zenith, azimuth), rows, columns, grid)
    return [[" ".join(f"{value:.8g}" for value in row) for row in angle] for angle in angles]


def _fitted(zenith, azimuth, rows, columns, grid):
    """Zenith and azimuth at nodes, which lie outside of the image too, from angles by pixel. [degree]"""
    steps = [slice(None, None, -(-size // _SAMPLES)) for size in zenith.shape]
    zenith, azimuth = zenith[*steps], azimuth[*steps]
    at = [
        (np.arange(size)[step] + 0.5) * cell / _STEP
        for size, step, cell in zip(grid.shape, steps, grids.cell_size(grid), strict=True)
    ]
    # Relative to their vertical component, directions to one point are linear over level ground. Squares, which follow
    # the sun over a whole tile, would be arbitrary outside of a small image.
    squares = min(each[-1] for each in at) > _LARGE
    vectors = direction_vectors(zenith, azimuth)
    vectors = vectors / vectors[2]
    known = np.isfinite(vectors).all(axis=0)
    factors, *_ = np.linalg.lstsq(_terms(*at, squares)[known.ravel()], vectors[:, known].T, rcond=None)
    found = direction_angles((_terms(rows, columns, squares) @ factors).T.reshape(3, rows.size, columns.size))
    back = between_nodes(direction_vectors(*found), *at)
    if (error := np.nanmax(angle_between(zenith, azimuth, *back))) > _ANGLE:
        raise ValueError(
            f"angles by pixel must be smooth over {_STEP} m, the step of the product's grids of angles, got a rest "
            f"of {error:.3g} degrees: simulate the scene with one sun and view, geometry=fifesim.Geometry(...)"
        )
    return found


def _terms(rows, columns, squares):
    """Terms of a bilinear surface, with squares if needed, shape (place, term)."""
    row, column = (each.ravel() for each in np.meshgrid(rows, columns, indexing="ij"))
    terms = [np.ones(row.size), row, column, row * column]
    return np.stack([*terms, row**2, column**2] if squares else terms, axis=1)
