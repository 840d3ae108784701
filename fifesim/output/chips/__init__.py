"""Training sets: many chips of a study as sharded Zarr, with their documentation."""
