"""What an image tells: indices, regressions, noise and scale."""
