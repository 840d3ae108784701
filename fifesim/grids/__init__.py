"""Labelled rasters: grids, CF metadata, files, and kernels on dask. No physics."""
