"""Scans over labelled rasters."""
