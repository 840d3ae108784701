"""Layers of the user's files and arrays: the band that holds a quantity of the ground."""

from dataclasses import replace

from rasterio.enums import ColorInterp

from fifesim.base.messages import warn
from fifesim.grids import cf
from fifesim.grids.inputs import with_band_names
from fifesim.grids.opening import raster_file, sound_raster


def file_of(quantity, path, allow_remote=False):
    """Checked raster file, with the number of the band that holds a quantity."""
    file = raster_file(path, allow_remote)
    with sound_raster(file) as (source, _):
        numbers = [each for each in source.indexes if source.colorinterp[each - 1] != ColorInterp.alpha]
        index = _band_of(file.name, [words_of(source, each) for each in numbers], quantity)
        if quantity != "cover" and source.colorinterp[numbers[index] - 1] == ColorInterp.palette:
            raise ValueError(
                f"{file.name} has a colour table, so that its numbers are classes, where "
                f"{cf.QUANTITIES[quantity].long_name} is needed: take a map of that quantity, or remove the table with "
                "gdal_translate -colorinterp gray"
            )
    return replace(file, band=numbers[index])


def words_of(source, band):
    """Texts that describe a band of an open file."""
    tags = source.tags(band)
    return source.descriptions[band - 1], *(tags.get(key) for key in ("NETCDF_VARNAME", "long_name", "standard_name"))


def one_layer(raster, quantity):
    """Layer of an array that holds a quantity, with the dimensions y and x only."""
    name = str(raster.name or "the raster")
    if "band" in raster.dims:
        names = with_band_names(raster)["band"].values
        raster = raster.isel(band=_band_of(name, names[:, None], quantity), drop=True)
    if raster.ndim != 2:
        raise ValueError(
            f"{name} has dimensions {raster.dims}, where {cf.QUANTITIES[quantity].long_name} has y and x: select one "
            "layer, such as .isel(time=0)"
        )
    return raster


def _band_of(raster, bands, name):
    """Index of the band whose texts name a quantity; a single band needs none."""
    texts = [[text for text in texts if isinstance(text, str)] for texts in bands]
    exactly = [index for index, each in enumerate(texts) if name in map(str.lower, each)]
    in_words = [index for index, each in enumerate(texts) if set().union(*map(cf.named, each)) == {name}]
    for found in (range(len(texts)), exactly, in_words):
        if len(found) == 1:
            return found[0]
    raise ValueError(
        f"{raster} has {len(texts)} bands, and not exactly one is described as {cf.QUANTITIES[name].long_name}: select "
        "the band, for instance with rioxarray.open_rasterio(path).sel(band=2), or gdal_translate -b 2 of a file"
    )


def warn_of_integers(name):
    """Warn that integers without a scale are used as leaf area index."""
    warn(
        f"{name} holds integers without a scale, which are used as leaf area index: if they are scaled, set their "
        "scale (.assign_attrs(scale_factor=0.1), or gdal_edit.py -a_scale 0.1 for a file), else convert them with "
        ".astype(float)"
    )
