"""What all stages speak in: directions, bands, footprints, tables. numpy only."""
