"""The canopy on labelled rasters, where leaves and what lies below them differ from cell to cell."""
