"""Where a scan looks, and what its pixels see."""
