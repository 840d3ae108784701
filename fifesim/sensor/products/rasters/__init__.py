"""Images as agencies deliver them, on labelled rasters."""
