"""The shape of the land, and the light that falls on it."""
