"""Gross primary production, evapotranspiration and albedo of vegetation: formulas on arrays, and maps by `labels`."""
