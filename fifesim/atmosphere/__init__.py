"""Atmosphere: gases, scattering and their coupling with the surface."""
