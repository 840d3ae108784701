"""Landscapes of several classes and properties, on labelled rasters."""
