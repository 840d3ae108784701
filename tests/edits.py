"""Copies of a raster file as other programs write them."""

import numpy as np
import rasterio


class Copy:
    """Values and metadata of a file, which an edit changes before they are written again."""

    def __init__(self, path):
        with rasterio.open(path) as source:
            self.values = source.read()
            self.crs, self.transform, self.nodata = source.crs, source.transform, source.nodata
            self.tags = source.tags()
            self.descriptions, self.units = list(source.descriptions), list(source.units)
            self.scales, self.offsets = list(source.scales), list(source.offsets)
            self.imagery = [source.tags(number, ns="IMAGERY") for number in source.indexes]

    def select(self, bands):
        """Keep some bands, in another order, as ``gdal_translate -b`` does."""
        self.values = self.values[bands]
        for name in ("descriptions", "units", "scales", "offsets", "imagery"):
            setattr(self, name, [getattr(self, name)[band] for band in bands])

    def crop(self, rows, columns):
        """Keep a window, as ``gdal_translate -srcwin`` does, which drops units."""
        self.values = self.values[:, rows, columns]
        self.transform = self.transform @ rasterio.Affine.translation(columns.start, rows.start)
        self.units = [None] * len(self.units)

    def convert(self, dtype):
        """Change the type, as ``gdal_translate -ot`` does: rounded, clipped, and NaN as 0."""
        if np.dtype(dtype).kind == "f":
            self.values = self.values.astype(dtype)
            return
        limits = np.iinfo(dtype)
        rounded = np.rint(np.nan_to_num(self.values.astype(float)))
        self.values = np.clip(rounded, limits.min, limits.max).astype(dtype)
        if self.nodata is not None and not limits.min <= self.nodata <= limits.max:
            self.nodata = 0

    def write(self, path):
        count, height, width = self.values.shape
        profile = {"count": count, "height": height, "width": width, "dtype": self.values.dtype, "crs": self.crs}
        with rasterio.open(path, "w", driver="GTiff", **profile, transform=self.transform, nodata=self.nodata) as sink:
            sink.write(self.values)
            sink.update_tags(**self.tags)
            for number in sink.indexes:
                if self.descriptions[number - 1]:
                    sink.set_band_description(number, self.descriptions[number - 1])
                if self.units[number - 1]:
                    sink.set_band_unit(number, self.units[number - 1])
                sink.update_tags(number, ns="IMAGERY", **self.imagery[number - 1])
            sink.scales, sink.offsets = self.scales, self.offsets
        return path
