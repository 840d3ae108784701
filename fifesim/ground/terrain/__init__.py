"""Elevation, slopes and horizons, and the light on slopes."""
