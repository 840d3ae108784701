"""Spatial distribution of leaves: random fields of leaf area with a given density."""

from fifesim.base.arguments import Range

# Autoregressive parameters of any field and of fields computed in tiles.
ARP = Range("1", 0, 0.25, note="the process is not stationary from 0.25 up; the paper uses 0.05 to 0.24", ends="[)")
STREAMING_ARP = Range("1", 0, 0.2498)
