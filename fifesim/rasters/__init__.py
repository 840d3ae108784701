"""Labelled rasters: grids, CF metadata, files, and how a kernel meets dask. No physics."""
