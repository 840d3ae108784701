"""A scenario into a folder, block by block."""
