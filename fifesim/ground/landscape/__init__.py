"""Where leaves are: random fields of leaf area with a given density."""
