"""Radiative transfer in leaves and canopies, and the background below them."""
