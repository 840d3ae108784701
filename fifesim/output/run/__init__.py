"""Simulation of a scenario into a folder, block by block."""
