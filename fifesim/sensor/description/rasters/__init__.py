"""The response of an instrument on labelled rasters."""
