"""What lazy rasters are made of, for a step that makes one with what follows on it, in one pass over the cells."""


class _Origin:
    """What an array is made of, which stays in this process."""

    def __init__(self, value):
        self.value = value

    def __reduce__(self):
        # A graph that travels to another process leaves it behind.
        return type(None), ()


def made_of(raster, origin):
    """
    A raster that knows what it is made of, as long as nothing is done to its values.

    Parameters
    ----------
    raster : xarray.DataArray
    origin
        What it is made of.

    Returns
    -------
    raster : xarray.DataArray
        The same; one in memory is what it is.
    """
    if raster.chunks is not None:
        raster.data.dask.layers[raster.data.name].fifesim_origin = _Origin(origin)
    return raster


def origin_of(raster):
    """
    What a raster is made of.

    Parameters
    ----------
    raster : xarray.DataArray

    Returns
    -------
    origin
        As `made_of` was told; None where that is not known, or the raster is in memory.
    """
    if raster.chunks is None:
        return None
    known = getattr(raster.data.dask.layers.get(raster.data.name), "fifesim_origin", None)
    return None if known is None else known.value
