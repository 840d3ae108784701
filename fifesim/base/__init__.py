"""Common basis of all stages: directions, bands, footprints and tables, in numpy only."""
