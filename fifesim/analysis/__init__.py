"""Analysis: vegetation indices and regression."""
