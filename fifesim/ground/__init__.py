"""The ground scene: leaf area, its reflectance, and the light on slopes."""
