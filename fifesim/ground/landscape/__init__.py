"""Spatial distribution of leaves: random fields of leaf area with a given density."""
