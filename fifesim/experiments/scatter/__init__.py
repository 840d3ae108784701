"""Budget of the scatter between NDVI and LAI or FPAR."""
