"""The experiment of Friedl et al. (1995)."""
