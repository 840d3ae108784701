"""Where the scatter between NDVI and LAI or FPAR comes from."""
