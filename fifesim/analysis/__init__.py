"""Analysis of images: indices, regressions, noise and scale."""
