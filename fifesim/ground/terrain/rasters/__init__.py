"""Terrain on labelled rasters."""
