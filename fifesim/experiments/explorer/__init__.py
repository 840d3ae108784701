"""A page with sliders over simulations of one scenario."""
