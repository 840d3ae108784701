"""Ground scene: leaf area, canopy reflectance and absorption."""
