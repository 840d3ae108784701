"""The sensor: what an instrument makes of the light at the top of the atmosphere."""
