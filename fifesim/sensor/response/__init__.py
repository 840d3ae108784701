"""Point spread, spectral response, noise and calibration."""
