"""Retrieval of LAI and FPAR from images, with intervals and flags."""
