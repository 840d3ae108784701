"""Processing steps of Figure 1 that combine several stages."""
