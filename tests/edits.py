"""Copies of a raster file as written by other programs."""

import numpy as np
import rasterio


class Copy:
    """Values and metadata of a file, to be edited and written again."""

    def __init__(self, path):
        with rasterio.open(path) as source:
            self.values = source.read()
            self.crs, self.transform, self.nodata = source.crs, source.transform, source.nodata
            self.tags = source.tags()
            self.descriptions, self.units = list(source.descriptions), list(source.units)
            self.scales, self.offsets = list(source.scales), list(source.offsets)
            self.imagery = [source.tags(number, ns="IMAGERY") for number in source.indexes]

    def select(self, bands):
        """Select and reorder bands, as ``gdal_translate -b`` does."""
        self.values = self.values[bands]
        for name in ("descriptions", "units", "scales", "offsets", "imagery"):
            setattr(self, name, [getattr(self, name)[band] for band in bands])

    def crop(self, rows, columns):
        """Crop to a window and drop units, as ``gdal_translate -srcwin`` does."""
        self.values = self.values[:, rows, columns]
        self.transform = self.transform @ rasterio.Affine.translation(columns.start, rows.start)
        self.units = [None] * len(self.units)

    def convert(self, dtype):
        """Convert the data type as ``gdal_translate -ot`` does: round, clip, and set NaN to 0."""
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
