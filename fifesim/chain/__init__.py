"""The steps of Figure 1 that need several stages."""
