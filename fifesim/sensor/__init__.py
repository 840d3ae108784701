"""Sensor: spatial response, calibration and the instruments."""
