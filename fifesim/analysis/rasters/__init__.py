"""Analysis on labelled rasters."""
